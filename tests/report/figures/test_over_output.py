"""An output over another one: means and bands at each value of the other, for samples and chaoses alike."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import labels, sample_dataset, statistics_of_samples
from uqmbd.report import over_output, write_report
from uqmbd.results import load, propagator_node
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo


def node_of(x, y):
    """Make the node of a method whose samples are the rows of x and y."""
    axes = labels([("x", "m"), ("y", "rad")], ["k"], np.arange(x.shape[1], dtype=float))
    samples = sample_dataset(np.stack([x, y], axis=1), np.ones((len(x), 1)), axes)
    statistics = statistics_of_samples(samples)
    return propagator_node("mine", statistics, samples=samples, propagator="p", realisations=len(x), wall_time=0.0)


def band(collection):
    """Lower and upper edge of a filled band, at its places."""
    points = collection.get_paths()[0].vertices
    places = np.unique(points[:, 0])
    edges = np.array([[f(points[points[:, 0] == x, 1]) for f in (np.min, np.max)] for x in places])
    return places, edges


@pytest.mark.parametrize("sign", [1, -1])
def test_bands_are_those_of_curves_at_each_value(sign):
    """Curves ``y = k x`` that are run through at different paces, forth or back: at x the quantiles of k times x."""
    rng = np.random.default_rng(1)
    k, pace = rng.uniform(1, 2, 400), rng.uniform(0.9, 1.4, 400)
    x = sign * pace[:, None] * np.linspace(0, 1, 60) ** 1.5
    figure = over_output(node_of(x, k[:, None] * x), "y", over="x")
    axes = figure.axes[0]
    places, mean = axes.lines[0].get_data()
    assert (places.min(), places.max()) == pytest.approx(sorted((0, sign * pace.min())))
    np.testing.assert_allclose(mean, k.mean() * places, atol=1e-12)
    for collection, share in zip(axes.collections, (0.95, 0.5), strict=True):
        at, edges = band(collection)
        expected = np.sort(np.outer(at, np.quantile(k, [0.5 - share / 2, 0.5 + share / 2])), axis=1)
        np.testing.assert_allclose(edges, expected, atol=1e-12)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [rad]")


def test_curves_that_turn_back_are_lines():
    """A loop is no function: single realisations, and the means of both at each time."""
    phase = np.linspace(0, 2 * np.pi, 50)
    size = np.array([[1.0], [2.0]])
    axes = over_output(node_of(size * np.sin(phase), size * np.cos(phase)), "y", over="x").axes[0]
    assert not axes.collections
    assert len(axes.lines) == 3
    np.testing.assert_allclose(axes.lines[-1].get_data(), 1.5 * np.array([np.sin(phase), np.cos(phase)]), atol=1e-12)


def test_what_cannot_be_drawn_is_reported():
    node = node_of(np.zeros((2, 3)), np.ones((2, 3)))
    with pytest.raises(uqmbd.StudyError, match="cannot be drawn over itself"):
        over_output(node, "x", over="x")
    with pytest.raises(uqmbd.StudyError, match="The results have no output 'z'"):
        over_output(node, "x", over="z")


def thrown():
    """A stone that is thrown at a random angle: its height over its way is a parabola in closed form."""
    slope = uqmbd.RandomVariable("slope", chaospy.Uniform(0.8, 1.2))
    mechanism = uqmbd.Mechanism("thrown", uqmbd.Translational(gravity=(0, -10)))
    stone = mechanism.body("stone", mass=1, velocity=(4, 4 * slope))
    mechanism.output("way", stone.position[0], units="m")
    mechanism.output("height", stone.position[1], units="m", over="way")
    return mechanism


@pytest.mark.thorough
def test_every_method_and_the_report(tmp_path):
    """``y = slope x - g x^2 / (2 v^2)``: the same mean and band of samples and chaoses; stored, and in the report."""
    methods = [MonteCarlo(samples=512, seed=1, sampling="sobol"), Collocation(order=2), Galerkin(order=2)]
    study = uqmbd.Study("thrown", thrown(), np.linspace(0, 1, 41), propagators=methods)
    tree = study.run()
    assert tree.attrs["over"] == '{"height": "way"}'
    for label in ("monte-carlo", "collocation", "galerkin"):
        axes = over_output(tree[label], "height", over="way").axes[0]
        places, mean = axes.lines[0].get_data()
        np.testing.assert_allclose(mean, places - 10 * places**2 / 32, atol=0.03)
        at, edges = band(axes.collections[0])
        expected = np.outer(at, [0.81, 1.19]) - 10 * at[:, None] ** 2 / 32
        np.testing.assert_allclose(edges, expected, atol=0.05)
    tree.to_netcdf(tmp_path / "results.nc", engine="h5netcdf")

    write_report(load(tmp_path / "results.nc"), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Curve over way: the mean, and the bands" in page
    assert page.count("height over way") >= 1


def test_over_what_is_reported_at_once():
    mechanism = thrown()
    stone = mechanism.bodies["stone"]
    with pytest.raises(uqmbd.StudyError, match=r"over is the text 'wy'; did you mean 'way'\? Expected the name of an"):
        mechanism.output("a", stone.velocity[0], over="wy")
    with pytest.raises(uqmbd.StudyError, match="over is 3; expected the name of an existing output"):
        mechanism.output("a", stone.velocity[0], over=3)
    mechanism.output("f", uqmbd.eigenfrequency(1), units="Hz")
    with pytest.raises(uqmbd.StudyError, match="over='f' is a scalar output"):
        mechanism.output("a", stone.velocity[0], over="f")
    with pytest.raises(uqmbd.StudyError, match="a scalar output is not a curve over another output"):
        mechanism.output("g", uqmbd.eigenfrequency(1), over="way")
    assert "a" not in mechanism.outputs
