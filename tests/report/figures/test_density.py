"""The smooth density of samples: bounds that samples show, and no peaks that chance made."""

from __future__ import annotations

import math

import chaospy
import numpy as np
import pytest
import scipy.stats
import xarray as xr

import uqmbd
from uqmbd import extend, report, results
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.report.figures.kernel_density import DensityCurve, densities, density, ends_of, known_densities


def peaks(f: np.ndarray) -> int:
    """Count maxima above a tenth of the largest, at the ends, too."""
    padded = np.concatenate([[0.0], f, [0.0]])
    inner = padded[1:-1]
    return int(np.sum((inner > padded[:-2]) & (inner >= padded[2:]) & (inner > 0.1 * f.max())))


LAWS = {
    "uniform": (scipy.stats.uniform(), (0.0, 1.0)),
    "exponential": (scipy.stats.expon(), (0.0, math.inf)),
    "half normal, shifted": (scipy.stats.halfnorm(-50, 2), (-50.0, math.inf)),
    "rayleigh": (scipy.stats.rayleigh(), (0.0, math.inf)),
    "normal": (scipy.stats.norm(3, 10), (-math.inf, math.inf)),
    "triangular about zero": (scipy.stats.triang(0.5, -1, 2), (-math.inf, math.inf)),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("count", [200, 4000])
def test_a_density_ends_where_its_quantity_does(name: str, count: int) -> None:
    """Bounds are those of the distribution, in 18 of 20 sets; the area within is 1, and there is one peak, as it has."""
    law, bounds = LAWS[name]
    found = [ends_of(law.rvs(count, random_state=seed)) for seed in range(20)]
    for side, bound in enumerate(bounds):
        near = [ends[side] == bound or abs(ends[side] - bound) < 12 / count * law.std() for ends in found]
        assert sum(near) >= 18
    for seed in range(5):
        values = law.rvs(count, random_state=seed)
        ends = found[seed]
        x, f = density(values, 400, ends)
        assert x[0] >= ends[0] and x[-1] <= ends[1]
        assert np.trapezoid(f, x) == pytest.approx(1, abs=0.01)
        assert peaks(f) <= 3 if name == "uniform" and count == 200 else peaks(f) <= 2
        if name != "uniform":
            assert peaks(f) == 1


def test_peaks_stay_that_are_no_chance() -> None:
    """Two normal distributions, four standard deviations apart, have two peaks: of many samples, and of few."""
    for count in (200, 4000):
        rng = np.random.default_rng(count)
        values = np.where(rng.uniform(size=count) < 0.5, -2.0, 2.0) + rng.normal(size=count)
        assert peaks(density(values)[1]) == 2


def test_reflection_is_unbiased_at_a_bound() -> None:
    """At its bound the density of an exponential distribution is 1; kernels alone give half of it."""
    values = scipy.stats.expon().rvs(20000, random_state=1)
    _, f = density(values, ends=(0.0, math.inf))
    assert f[0] == pytest.approx(1, abs=0.1)


def test_a_curve_that_is_known_to_be_wrong_flattens_no_other() -> None:
    """The axes are as high as bars and trusted curves are; alone a wrong curve is shown whole."""
    values = np.random.default_rng(1).normal(size=400)
    wrong = DensityCurve(0.01 * values, 1, scales=False)
    assert densities(values, [DensityCurve(values), wrong]).top == densities(values, [DensityCurve(values)]).top
    assert densities(None, [wrong]).top > 30


def nodes(error: float) -> xr.DataTree:
    """A method with samples, and one that states an error and has samples of a hundredth of the spread."""
    axes = extend.labels([("x", "m")], [("k", "1")], [0.0, 1.0])
    made = []
    for label, scale in (("mine", 1.0), ("wrong", 0.01)):
        inputs = np.random.default_rng(1).normal(size=(200, 1))
        samples = extend.sample_dataset(scale * inputs[:, :, None] * np.ones(2), inputs, axes)
        about = extend.statistics_of_samples(samples)
        if label == "wrong":
            about["verification_error"] = (("output", "time"), np.full((1, 2), error))
        made.append(
            results.propagator_node(
                label, about, propagator="p", realisations=200, wall_time=1.0, children={"samples": samples}
            )
        )
    return results.study_tree(made, study="s", mechanism="m")


def test_stated_errors_tell_which_curve_is_wrong() -> None:
    right, wrong = (report.histograms(nodes(error), "x").axes[0].get_ylim()[1] for error in (0.01, 0.5))
    assert right > 20 > 1 > wrong


def test_panels_of_densities_are_high_enough(study: xr.DataTree) -> None:
    """Each is more than an inch high, however many there are: 120 pixels in a figure of 480."""
    for figure in (report.histograms(study, "slider_x"), report.inputs(study["monte-carlo"])):
        _, height = figure.get_size_inches()
        assert len(figure.axes) > 1
        assert all(axes.get_position().height * height > 1.4 for axes in figure.axes)


def test_inputs_have_their_density(study: xr.DataTree) -> None:
    """Bars and the curve enclose 1; units are those of one over the input."""
    axes = report.inputs(study["monte-carlo"]).axes[0]
    bars, curve, *_ = axes.lines
    assert np.trapezoid(np.nan_to_num(bars.get_ydata()), bars.get_xdata()) == pytest.approx(1)
    assert np.trapezoid(np.nan_to_num(curve.get_ydata()), curve.get_xdata()) == pytest.approx(1, abs=0.01)
    assert axes.get_ylabel().startswith("density [")


KNOWN = {
    "uniform": (chaospy.Uniform(0.9, 1.1), scipy.stats.uniform(0.9, 0.2)),
    "normal": (chaospy.Normal(58570, 1952), scipy.stats.norm(58570, 1952)),
    "lognormal": (chaospy.LogNormal(0.1, 0.5), scipy.stats.lognorm(0.5, scale=math.exp(0.1))),
    "beta": (chaospy.Beta(2, 3, -1, 4), scipy.stats.beta(2, 3, -1, 5)),
    "exponential": (chaospy.Exponential(2.0), scipy.stats.expon(0, 2)),
    "truncated": (chaospy.Trunc(chaospy.Normal(0, 1), -1, 2), scipy.stats.truncnorm(-1, 2)),
    "weibull": (chaospy.Weibull(1.8, 2.0), scipy.stats.weibull_min(1.8, 0, 2)),
}


@pytest.mark.parametrize("name", KNOWN)
def test_inputs_of_a_surrogate_have_the_density_of_their_distribution(name: str) -> None:
    """That of SciPy, to half a per cent of its maximum; it ends where the distribution does."""
    given, law = KNOWN[name]
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", given)]))
    x, f = known_densities(GermSpace.from_dataset(space.to_dataset()))["k"]
    inside = x[1:-1]  # the ends of the support are jumps
    np.testing.assert_allclose(f[1:-1], law.pdf(inside), atol=0.005 * law.pdf(inside).max())
    for end, bound in zip((x[0], x[-1]), law.support(), strict=True):
        if math.isfinite(bound):
            assert end == pytest.approx(bound, abs=1e-3 * law.std()) or law.cdf(end) * law.sf(end) < 2e-4
    assert np.trapezoid(f, x) == pytest.approx(1, abs=1e-3)


def test_inputs_that_depend_on_each_other_have_the_densities_of_each() -> None:
    covariance = [[4.0, 1.5], [1.5, 1.0]]
    both = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([1.0, -2.0], covariance), ["m", "m"])
    found = known_densities(GermSpace.of(JointInput.of(list(both)), "nataf"))
    for name, mean, variance in (("a", 1.0, 4.0), ("b", -2.0, 1.0)):
        x, f = found[name]
        law = scipy.stats.norm(mean, math.sqrt(variance))
        np.testing.assert_allclose(f, law.pdf(x), atol=0.005 * law.pdf(mean))


def test_known_densities_are_drawn(study: xr.DataTree) -> None:
    """Over the histogram, the line of a distribution that is known, and not an estimate, which has wiggles."""
    names = [str(name) for name in study["monte-carlo/samples"]["input"].values]
    given = JointInput.of([uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in names])
    figure = report.inputs(study["monte-carlo"], GermSpace.of(given))
    for axes in figure.axes[: len(names)]:
        drawn = axes.lines[1].get_ydata()
        assert set(np.round(drawn[np.isfinite(drawn)], 9)) == {0.0, 0.5}
