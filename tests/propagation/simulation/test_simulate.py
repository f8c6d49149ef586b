"""One motion: at the means, or at given values."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd

TIMES = np.linspace(0, 0.5, 6)


def test_means_are_the_default(swing):
    mechanism = swing.mechanism
    found = uqmbd.simulate(mechanism, TIMES)
    same = uqmbd.simulate(mechanism, TIMES, values={"length": 1.0, "push": 0.15})
    assert list(found) == ["x", "pull"] and found["x"].attrs["units"] == "m"
    assert found["time"].attrs["units"] == "s" and np.array_equal(found["time"], TIMES)
    assert found["x"].values == pytest.approx(same["x"].values, abs=1e-12)


def test_values_are_used(swing):
    """A small swing: x = push / omega sin(omega t), omega^2 = g / length, within the square of the amplitude."""
    found = uqmbd.simulate(swing.mechanism, TIMES, values={"length": 2.0, "push": 0.02}, rtol=1e-9)
    omega = np.sqrt(9.81 / 2.0)
    assert found["x"].values == pytest.approx(0.02 / omega * np.sin(omega * TIMES), abs=1e-6)


def test_one_realisation_of_a_study_is_a_simulation(swing, results):
    samples = results["monte-carlo"]["samples"]
    inputs = dict(zip(samples["input"].values, samples["inputs"].values[7], strict=True))
    found = uqmbd.simulate(swing.mechanism, TIMES, values=inputs, rtol=1e-9)
    assert found["x"].values == pytest.approx(samples["response"].sel(output="x").values[7], abs=1e-4)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"mass": 1.0}, "values contains 'mass'; expected names of random variables: length, push"),
        ({"length": "long"}, "the value of 'length' is 'long'; expected a finite number"),
        ({"length": np.inf}, "the value of 'length' is inf"),
        ({"length": None}, "the value of 'length' is None"),
        ([1.0, 2.0], "expected numbers by name"),
    ],
)
def test_values_that_cannot_be_used(swing, values, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        uqmbd.simulate(swing.mechanism, TIMES, values=values)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"times": [0, 0]}, "simulate 'swing': times do not increase"),
        ({"rtol": 0}, "simulate 'swing': rtol is 0"),
        ({"integrator": "x"}, "simulate 'swing': integrator is 'x'; expected one of"),
        ({"mechanism": "swing"}, "simulate: the mechanism is 'swing'; expected a uqmbd.Mechanism"),
    ],
)
def test_arguments_that_cannot_be_used(swing, arguments, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        uqmbd.simulate(**({"mechanism": swing.mechanism, "times": TIMES} | arguments))


def test_mechanism_that_cannot_be_assembled_names_the_joint():
    from ..conftest import fragile

    mechanism = fragile(highest=1.5)
    with pytest.raises(uqmbd.AssemblyError, match="left|right"):
        uqmbd.simulate(mechanism, TIMES, values={"length": 0.3})


def test_mechanism_without_bodies():
    mechanism = uqmbd.Mechanism("empty", uqmbd.Planar())
    mechanism.output("time_squared", uqmbd.t**2)
    with pytest.raises(uqmbd.StudyError, match="mechanism 'empty' has no bodies"):
        uqmbd.simulate(mechanism, TIMES)
