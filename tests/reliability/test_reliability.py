"""Reliability of mechanisms against closed forms."""

from __future__ import annotations

import re
import warnings
from collections import Counter

import chaospy
import numpy as np
import pytest
import sympy
from scipy.stats import norm

import uqmbd
import uqmbd_reliability.propagator as module
from uqmbd.results import load, save, validate
from uqmbd.testing import check_propagator
from uqmbd_collocation import Collocation
from uqmbd_reliability import Reliability
from uqmbd_reliability.space import StandardSpace
from uqmbd_springs import SpringDamper


def spring(requirements, variables, expression):
    """A mass on a spring whose stiffness is an expression of random variables; requirements on it are statics."""
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational())
    mass = mechanism.body("mass", mass=2, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=expression(*variables)))
    for name, relation in requirements.items():
        mechanism.require(name, relation)
    return mechanism


def answer(mechanism, times=None, **options):
    study = uqmbd.Study("limits", mechanism, times, [Reliability(**{"seed": 1, **options})])
    return study.run()["reliability"]


def normals(count=3):
    return [uqmbd.RandomVariable(f"x{k}", chaospy.Normal(10, 1)) for k in range(count)]


def test_a_plane_of_normal_inputs_in_closed_form(tmp_path):
    x = normals()
    mechanism = spring({"stiff": x[0] + 2 * x[1] - 2 * x[2] >= -2}, x, lambda *v: sum(v))
    # the margin is normal with the mean 12 and the deviation 3
    node = answer(mechanism)
    validate(node)
    data = node["requirements"].to_dataset()
    probability = norm.sf(4)
    low, high = data["interval"].values[0]
    assert low < probability < high < 1.3 * low
    assert data["violation_probability"].values == pytest.approx([probability], rel=0.15)
    assert data["beta"].values == pytest.approx(np.array([[4.0]]), abs=0.01)
    assert data["importance"].values == pytest.approx(np.array([[1, 4, 4]]) / 9, abs=0.01)
    # the point of the plane that is nearest in deviations
    expected = 10 - 4 / 3 * np.array([1, 2, -2])
    assert data["design_points"].values == pytest.approx(expected[None, None], abs=0.05)
    # P = Phi(-(mean) / deviation) of the margin
    slope = norm.pdf(4) / 3
    mean = -slope * np.array([1, 2, -2])
    deviation = slope * 12 / 9 * np.array([1, 4, 4])
    gradient, error = data["probability_gradient"].values[0], data["probability_gradient_error"].values[0]
    assert np.all(np.abs(gradient - [mean, deviation]) < 4 * error + 1e-9)
    assert np.all(error < 0.35 * np.abs([mean, deviation]).max(axis=1, keepdims=True))
    assert node.attrs["realisations"] <= 3000
    again = load(save(uqmbd.Study("limits", mechanism, None, [Reliability(seed=1)]).run(), tmp_path / "r.nc"))
    assert again["reliability/requirements"].to_dataset()["violation_probability"].equals(data["violation_probability"])


@pytest.mark.parametrize(
    ("distribution", "limit", "probability"),
    [
        (chaospy.LogNormal(0, 0.5), np.exp(0.5 * 4.5), norm.sf(4.5)),
        (chaospy.Uniform(2, 4), 4 - 2e-5, 1e-5),
        (chaospy.Exponential(1), 12.0, np.exp(-12.0)),
        (chaospy.Trunc(chaospy.Normal(5, 1), upper=9), 8.5, (norm.sf(3.5) - norm.sf(4)) / norm.cdf(4)),
    ],
)
def test_tails_of_distributions(distribution, limit, probability):
    x = uqmbd.RandomVariable("x", distribution)
    data = answer(spring({"low": x <= limit}, [x], lambda v: 5 + v))["requirements"].to_dataset()
    assert data["violation_probability"].item() == pytest.approx(probability, rel=0.2)
    assert data["importance"].values == pytest.approx(np.ones((1, 1)))


def test_a_discrete_input():
    count, x = uqmbd.RandomVariable("n", chaospy.Binomial(3, 0.1)), uqmbd.RandomVariable("x", chaospy.Normal(0, 1))
    data = answer(spring({"low": x + count <= 4}, [count, x], lambda n, v: 20 + n + v))["requirements"].to_dataset()
    exact = sum(p * norm.sf(4 - k) for k, p in enumerate([0.729, 0.243, 0.027, 0.001]))
    assert data["violation_probability"].item() == pytest.approx(exact, rel=0.2)


def test_dependent_inputs():
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([1, 2], [[4, 3], [3, 9]]))
    data = answer(spring({"sum": a + b <= 3 + 4 * np.sqrt(19)}, [a, b], lambda v, w: 50 + v + w))["requirements"]
    data = data.to_dataset()
    assert data["violation_probability"].item() == pytest.approx(norm.sf(4), rel=0.2)
    # mean and deviation of each input at the same correlation: of 3 + mean, and sqrt(s^2 + t^2 + s t)
    slope = norm.pdf(4) / np.sqrt(19)
    gradient = data["probability_gradient"].values[0]
    assert gradient[0] == pytest.approx([slope, slope], rel=0.25)
    assert gradient[1] == pytest.approx(4 / np.sqrt(19) * slope * np.array([3.5, 4]), rel=0.3)
    assert data["importance"].values.sum() == pytest.approx(1)


def test_scores_of_a_copula_are_those_of_its_density():
    a, b, c = uqmbd.random_vector(
        ["a", "b", "c"], chaospy.MvNormal([0, 0, 0], [[1, 0.5, 0.3], [0.5, 1, 0], [0.3, 0, 1]])
    )
    mechanism = spring({}, [a, b, c], lambda *v: 50 + sum(v))
    space = StandardSpace(uqmbd.extend.GermSpace.of(mechanism.inputs))
    u = np.random.default_rng(0).normal(size=(1, 3))
    z, correlation = space.to_inputs(u)[0], np.array([[1, 0.5, 0.3], [0.5, 1, 0], [0.3, 0, 1]])

    def log_density(mean, scale):
        w = (z - mean) / scale
        return -0.5 * w @ np.linalg.solve(correlation, w) - np.log(scale).sum()

    for k in range(3):
        e = 1e-6 * np.eye(3)[k]
        assert space.scores(u)[0, 0, k] == pytest.approx(
            (log_density(e, 1 + 0 * e) - log_density(-e, 1 + 0 * e)) / 2e-6
        )
        assert space.scores(u)[0, 1, k] == pytest.approx((log_density(0 * e, 1 + e) - log_density(0 * e, 1 - e)) / 2e-6)


@pytest.mark.thorough
def test_over_time_and_several_requirements():
    """x = cos(w t): the speed w sin(w t) passes a limit where w does, once w t has come so far."""
    w = uqmbd.RandomVariable("w", chaospy.Normal(1, 0.05))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=w**2))
    mechanism.require("slow", mass.velocity[0] >= -1.2)
    mechanism.require("stiff", w >= 0.85)
    mechanism.output("x", mass.position[0])
    node = answer(mechanism, np.linspace(0, 3, 301))
    data = node["requirements"].to_dataset()
    exact = [norm.sf(4), norm.sf(3), norm.sf(4) + norm.sf(3)]
    assert data["requirement"].values.tolist() == ["slow", "stiff", "any"]
    assert data["violation_probability"].values == pytest.approx(exact, rel=0.2)
    by = data["violated_by"].values
    assert np.all(np.diff(by, axis=1) >= 0)
    assert np.all(by[0, data["time"].values < 0.7] < 1e-12)  # w sin(w t) > 1.2
    assert np.allclose(by[:, -1], data["violation_probability"].values)
    one = answer(mechanism, np.linspace(0, 3, 301), requirement="slow")["requirements"].to_dataset()
    assert one["requirement"].values.tolist() == ["slow"]
    assert one["violation_probability"].item() == pytest.approx(norm.sf(4), rel=0.2)
    assert node["statistics"]["mean"].shape == (1, 301)


@pytest.mark.thorough
def test_the_seed_decides_and_neither_workers_nor_resuming():
    check_propagator(Reliability(seed=1), workers=2)
    x = normals()
    study = uqmbd.Study("s", spring({"low": sum(x) <= 37}, x, lambda *v: sum(v)), None, [Reliability(seed=4)])
    one, two = (study.run(workers)["reliability/requirements"].to_dataset() for workers in (1, 2))
    one.attrs.clear(), two.attrs.clear()
    assert one.identical(two)


def test_what_cannot_be_done_is_reported(monkeypatch):
    monkeypatch.setattr(module, "available", lambda: True)
    x = normals()
    mechanism = spring({"low": x[0] <= 14, "high": x[0] >= 5}, x, lambda *v: sum(v))
    study = uqmbd.Study("s", mechanism, None, [Reliability(requirement="nothing")])
    assert "expected one of low, high, or None" in Reliability(requirement="nothing").obstacle(study)
    assert "supports one requirement only" in Reliability(method="subset").obstacle(study)
    assert Reliability().obstacle(study) is None
    assert Reliability(surrogate=Collocation(order=2)).estimate(study).realisations == 3000
    costly = Reliability(surrogate=Collocation(order=9), max_realisations=600)
    assert "and the analysis needs 500 more" in costly.obstacle(study)
    with pytest.raises(uqmbd.StudyError, match="Omit method, or omit surrogate"):
        Reliability(surrogate=Collocation(order=2), method="form")
    heavy = uqmbd.RandomVariable("h", chaospy.StudentT(2))
    with pytest.raises(uqmbd.StudyError, match="'h'.*tail so heavy"):
        answer(spring({"low": heavy <= 14}, [heavy], lambda v: 500 + v))
    monkeypatch.setattr(module, "available", lambda: False)
    with pytest.raises(uqmbd.StudyError, match=r"uqmbd\[reliability\].*method='auto'"):
        Reliability(method="subset")
    Reliability(method="form")


def test_a_target_that_is_not_reached_is_reported():
    x = normals()
    mechanism = spring({"low": sum(x) <= 37}, x, lambda *v: sum(v))
    with pytest.warns(UserWarning, match="did not reach target_cov=0.02 for low") as caught:
        node = answer(mechanism, target_cov=0.02, max_realisations=700)
    assert node.attrs["realisations"] <= 700
    # the advised number suffices: with it, there is no warning
    advised = re.search(r"of at most 700 .* max_realisations to about ([\d,]+)", str(caught[0].message))
    enough = int(advised.group(1).replace(",", ""))
    assert 700 < enough < 10_000
    assert answer(mechanism, target_cov=0.02, max_realisations=enough).attrs["realisations"] <= enough


@pytest.mark.thorough
@pytest.mark.parametrize("order", [1, 4])
def test_a_surrogate_saves_realisations_and_a_poor_one_deceives_nobody(order):
    """The margin is 1 - 0.1 exp((x0 + x1) / 2): the limit is a plane for the germs, and order one misses its place."""
    x = [uqmbd.RandomVariable(f"x{k}", chaospy.Normal(0, 1)) for k in range(2)]
    limit = {"low": 0.1 * sympy.exp((x[0] + x[1]) / 2) <= 1}
    surrogate = Collocation(order=order)
    node = answer(spring(limit, x, lambda a, b: 50 + a + b), surrogate=surrogate)
    data = node["requirements"].to_dataset()
    exact = norm.sf(np.log(10) * np.sqrt(2))
    low, high = data["interval"].values[0]
    assert low < exact < high < 1.3 * low
    assert data["violation_probability"].item() == pytest.approx(exact, rel=0.15)
    assert np.allclose(data["violated_by"].values, data["violation_probability"].values[:, None])
    assert node.attrs["realisations"] < (1000 if order == 1 else 500)
    assert node.attrs["surrogate_realisations"] > 0


def test_what_a_surrogate_takes_counts_even_where_it_is_of_no_use(monkeypatch):
    """It is given up after 40 real realisations; the samples that count lie behind those."""

    def useless(runs, predicted, dimension, **_):
        runs(np.random.default_rng(1).normal(size=(40, dimension)))

    monkeypatch.setattr(module, "learn", useless)
    w = uqmbd.RandomVariable("w", chaospy.Normal(1, 0.05))
    mechanism = spring({"stiff": w <= 1.15}, [w], lambda v: 50 * v)
    with pytest.warns(UserWarning, match="did not reach target_cov"):
        node = answer(mechanism, surrogate=Collocation(order=2), max_realisations=600, target_cov=0.01)
    data = node["requirements"].to_dataset()
    assert node.attrs["surrogate_realisations"] > 3
    assert node.attrs["realisations"] == 600
    assert np.allclose(data["violated_by"].values[:, -1], data["violation_probability"].values)
    assert data["violation_probability"].item() == pytest.approx(norm.sf(3), rel=0.3)


class Counted:
    """How many realisations each piece of work takes."""

    def __init__(self):
        self.counts = Counter()

    def start(self, label, total):
        pass

    def advance(self, label, count=1):
        self.counts[label] += count

    def finish(self, label):
        pass


@pytest.mark.thorough
@pytest.mark.parametrize("outputs", [True, False])
@pytest.mark.parametrize("options", [{}, {"method": "form"}, {"surrogate": Collocation(order=2)}], ids=str)
def test_what_is_counted_is_what_is_computed(options, outputs):
    """Margins of the first points are computed beside the outputs there, and not again."""
    w = uqmbd.RandomVariable("w", chaospy.Normal(1, 0.05))
    mechanism = spring({"stiff": w <= 1.15}, [w], lambda v: 50 * v)
    if outputs:
        mechanism.output("x", next(iter(mechanism.bodies.values())).position[0])
    computed = Counted()
    method = Reliability(seed=1, max_realisations=900, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        node = uqmbd.Study("s", mechanism, [0, 0.1] if outputs else None, [method]).run(progress=computed)
    realisations = node["reliability"].attrs["realisations"]
    assert computed.counts.total() == realisations <= 900
