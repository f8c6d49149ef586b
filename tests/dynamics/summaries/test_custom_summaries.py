"""Summaries by functions of plugins and studies: percentiles and norms over time, in every method."""

from __future__ import annotations

import pickle

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper


@uqmbd.extend.summary
def percentile(values, weights, percent):
    """Return the value that an expression exceeds for the rest of the time."""
    order = np.argsort(values)
    share = (np.cumsum(weights[order]) - weights[order] / 2) / weights.sum()
    return np.interp(percent / 100, share, values[order])


@uqmbd.extend.summary
def p_norm(values, weights, p):
    """Return the mean of a power, and its root."""
    return (weights @ np.abs(values) ** p / weights.sum()) ** (1 / p)


@uqmbd.extend.summary
def duration(values, weights):
    return weights.sum()


def oscillator(amplitude, turns=1.0):
    """A mass whose position is an amplitude times the cosine, with so many periods in a second."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=amplitude)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=(2 * np.pi * turns) ** 2))
    return mechanism, mass.position[0]


@pytest.mark.parametrize("turns", [1, 3, 40])
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_percentiles_and_norms_have_closed_forms(turns, integrator):
    """Of a cosine over whole periods; steps of 40 periods are short."""
    mechanism, x = oscillator(2.0, turns)
    for percent in (10, 50, 90):
        mechanism.output(f"p{percent}", percentile(x, percent), units="m")
    mechanism.output("p4", p_norm(x, 4), units="m")
    mechanism.output("half", p_norm(x / 2, 6))
    mechanism.output("whole", duration(x))
    found = uqmbd.simulate(mechanism, [0, 1], rtol=1e-8, integrator=integrator)
    for percent in (10, 50, 90):
        assert abs(float(found[f"p{percent}"]) + 2 * np.cos(np.pi * percent / 100)) < 4e-3
    np.testing.assert_allclose(found["p4"], 2 * (3 / 8) ** 0.25, rtol=1e-6)
    np.testing.assert_allclose(found["half"], (5 / 16) ** (1 / 6), rtol=1e-6)
    np.testing.assert_allclose(found["whole"], 1.0, rtol=1e-12)


@pytest.mark.thorough
def test_every_method_propagates_them_and_requirements_contain_them():
    """The percentile is the amplitude times the cosine of 18 degrees; it exceeds 1.5 for 42.28 % of the amplitudes."""
    amplitude = uqmbd.RandomVariable("a", chaospy.Uniform(1, 2), units="m")
    mechanism, x = oscillator(amplitude)
    mechanism.output("p90", percentile(x, 90), units="m")
    mechanism.require("low", percentile(x, 90) <= 1.5)
    methods = [MonteCarlo(samples=64, sampling="sobol", seed=1), Collocation(order=2)]
    tree = uqmbd.Study("oscillator", mechanism, [0, 1], methods).run()
    factor = np.cos(np.pi / 10)
    for label in ("monte-carlo", "collocation"):
        data = tree[label]["scalars/statistics"].dataset
        np.testing.assert_allclose(data["mean"], [1.5 * factor], rtol=1e-3)
        np.testing.assert_allclose(data["std"], [factor / np.sqrt(12)], rtol=2e-2)
        lower, upper = tree[label]["requirements"].dataset["interval"].values[0]
        assert lower <= 2 - 1.5 / factor <= upper
    assert tree["monte-carlo"]["scalars/statistics"].dataset["integration_error"].values[0] > 0


@pytest.mark.thorough
def test_other_processes_call_the_function_and_runs_are_the_same():
    """A mechanism with contact is computed in processes, which import the function."""
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.1, 0.2), units="m")
    mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-9.81))
    ball = mechanism.body("ball", mass=1, position=height)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, 1, restitution=0.5))
    mechanism.output("norm", p_norm(ball.velocity[0], 4), units="m/s")
    study = uqmbd.Study("ball", mechanism, [0, 0.3], [MonteCarlo(samples=16, seed=1)])
    one, two = (study.run(workers=count)["monte-carlo/scalars/samples"]["response"].values for count in (1, 2))
    np.testing.assert_array_equal(one, two)
    assert np.isfinite(one).all() and np.ptp(one) > 0


def test_functions_that_are_equal_are_one_summary():
    """Its code decides, not its address: an interrupted run knows its stored values again."""
    x = oscillator(1.0)[1]
    again = pickle.loads(pickle.dumps(percentile))
    assert again is percentile and percentile(x, 90) == percentile(x, 90.0) != percentile(x, 80)
    assert str(percentile(x, 90)) == "percentile(mass.x, 90)"

    def made(power):
        namespace = {}
        exec(f"def norm(values, weights):\n    return weights @ values**{power}", namespace)
        return uqmbd.extend.summary(namespace["norm"])

    assert made(2)(x) == made(2)(x) != made(4)(x)
    assert percentile.__doc__.startswith("Return the value")


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda x: percentile(3.0, 90), "which is equal in every pose"),
        (lambda x: percentile(x, np.nan), "finite numbers"),
        (lambda x: percentile(x, "90"), "finite numbers"),
        (lambda x: percentile(x, x), "finite numbers"),
        (lambda x: percentile(uqmbd.maximum(x), 90), "already contains a scalar output"),
        (lambda x: uqmbd.extend.summary(3), "function"),
        (lambda x: uqmbd.extend.summary(np.max), "function"),
    ],
)
def test_other_arguments_are_refused(call, text):
    with pytest.raises(uqmbd.StudyError, match=text) as caught:
        call(oscillator(1.0)[1])
    assert "uqmbd.percentile" not in str(caught.value)


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (lambda values, weights: values, "expected one real number"),
        (lambda values, weights: 1j, "expected one real number"),
        (lambda values, weights: 1 / 0, "ZeroDivisionError"),
        (lambda values: 1.0, "TypeError"),
    ],
)
def test_functions_that_return_no_number_are_named(function, text):
    mechanism, x = oscillator(1.0)
    mechanism.output("wrong", uqmbd.extend.summary(function)(x))
    with pytest.raises(uqmbd.StudyError, match=text) as caught:
        uqmbd.simulate(mechanism, [0, 1])
    assert "test_custom_summaries" in str(caught.value)


def test_a_realisation_without_a_finite_number_has_failed():
    """Its status and message state this; the others are used."""
    amplitude = uqmbd.RandomVariable("a", chaospy.Uniform(1, 2), units="m")
    mechanism, x = oscillator(amplitude)
    often = uqmbd.extend.summary(lambda values, weights: np.nan if values.max() > 1.9 else 1.0)
    mechanism.output("sometimes", often(x))
    with pytest.warns(UserWarning, match="returned no finite number"):
        node = uqmbd.Study("oscillator", mechanism, [0, 1]).propagate(MonteCarlo(samples=64, seed=1))
    samples = node["scalars/samples"].dataset
    bad = samples["inputs"].values[:, 0] > 1.9
    assert 0 < bad.sum() < 20
    np.testing.assert_array_equal(samples["status"].values != 0, bad)
