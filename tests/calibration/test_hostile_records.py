"""Records and options that cannot be used are refused, and outliers are named and not reported as knowledge."""

from __future__ import annotations

import functools
import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_calibration import Bias, Record, Series, calibrate
from uqmbd_collocation import Collocation

TIMES = np.linspace(0, 1, 21)


@functools.cache
def study():
    """A stone of unknown speed, 2 m/s, whose way is a straight line."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(2.1, 0.3), units="m/s")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    mechanism.output("x", mechanism.body("stone", mass=1, velocity=speed).position[0], units="m")
    return uqmbd.Study("stone", mechanism, TIMES)


def record(values, noise=0.01, times=TIMES):
    return Record("run 3", [Series("x", times, values, "m", noise=noise)])


def values(seed=0):
    return 2 * TIMES + 0.01 * np.random.default_rng(seed).standard_normal(21)


def found(given, **options):
    """Return a calibration and what it warned of."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        made = calibrate(study(), given, surrogate=Collocation(order=1), draws=400, chains=2, progress=False, **options)
    assert all(issubclass(one.category, uqmbd.StudyWarning) for one in told), [str(one) for one in told]
    return made, " ".join(str(one.message) for one in told)


@pytest.mark.parametrize("individual", [None, 1, "speed", {"speed": 1}, b"speed", 1.5, True], ids=repr)
def test_individual_is_a_list_of_names(individual):
    with pytest.raises(uqmbd.StudyError, match="calibrate: individual is .*; expected a list of input names"):
        found(record(values()), individual=individual)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (lambda: record(1e307 * values()), "the value at .* s is .*too large"),
        (lambda: record(-1e101 * values()), "the value at .* s is -.*too large"),
        (lambda: record(values(), 1e101), "its noise is 1e\\+101, too large for computations"),
        (lambda: record(values(), 1e-15), "the noise is 1e-15, below the rounding errors"),
        (lambda: record(values(), 5e-324), "the noise .* below the rounding errors"),
        (lambda: record(0 * values(), 1e-200), "the noise .* below the rounding errors"),
    ],
)
def test_numbers_that_cannot_be_computed_with(given, words):
    with pytest.raises(uqmbd.StudyError, match=f"record 'run 3', output 'x': {words}"):
        found(given())


@pytest.mark.parametrize("sd", [1e101, 1e300, 10**300])
def test_a_bias_that_cannot_be_computed_with(sd):
    with pytest.raises(uqmbd.StudyError, match="calibrate: bias of 'x': sd is .*too large"):
        found(record(values()), bias={"x": Bias(sd)})


def _with_outlier(size, at, seed=0):
    wrong = values(seed)
    wrong[at] += size
    return wrong


def test_a_value_that_no_input_gives_is_refused_by_name():
    with pytest.raises(uqmbd.StudyError, match="record 'run 3', output 'x': the value at 0.35 s is 1e\\+06, .*student"):
        found(record(_with_outlier(1e6, 7)))


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [0.01, None], ids=["known", "unknown"])
@pytest.mark.parametrize("size", [0.3, -3.0, 30.0, -1e3, 9e3, -1e5, 1e7, 1e12, -1e50])
def test_an_outlier_is_named_and_is_no_knowledge(size, noise):
    at = int(abs(size)) % 19 + 1
    time = f"at {TIMES[at]:g} s"
    try:
        made, told = found(record(_with_outlier(size, at), noise))
    except uqmbd.StudyError as error:
        assert time in str(error) and "record 'run 3', output 'x'" in str(error) and abs(size) >= 1e3
        return
    assert time in told and "record 'run 3', output 'x'" in told
    assert time in str(made) and "%" not in str(made).split("\n", 1)[1] and "unreliable" in str(made)
    assert made.summary()["unreliable"].sel(input="speed")
    (one,) = made.checks["model"]
    (outlier,) = one["outlier_values"]
    assert outlier["time"] == TIMES[at] and outlier["value"] == _with_outlier(size, at)[at]


@pytest.mark.thorough
@pytest.mark.parametrize("size", [0.3, -30.0, 1e4, -1e7, 1e12])
def test_noise_of_student_holds_an_outlier(size):
    made, told = found(record(_with_outlier(size, 12)), noise="student")
    (speed,) = made.variables()
    # of 20 values with noise of 0.01 m: sqrt(sum of squares of times) is 2.6 s
    assert speed.mean == pytest.approx(2.0, abs=4 * 0.01 / 2.6) and not made.summary()["unreliable"].any()
    assert ("at 0.6 s" in told) == bool(told)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.01, None], ids=["known", "unknown"])
def test_records_without_outliers_are_not_rejected_more_often_than_stated(noise):
    for seed in range(12):
        made, _ = found(record(values(seed), noise))
        assert not made.summary()["unreliable"].any() and " %" in str(made).split("\n")[1]
        assert not made.checks["model"][0]["outlier_values"]
