"""Intervals of the probability of a violation until each time, against a motion with a closed form."""

import chaospy
import numpy as np
import pytest
from scipy.stats import norm

import uqmbd
from uqmbd.extend import Violations
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability

TIMES = np.array([0.0, 0.3, 0.35, 0.4, 0.5, 0.6, 0.8, 0.95])
EXACT = np.clip((3 - 1 / np.maximum(TIMES, 1e-9)) / 2, 0, 1)
"""Probability that a body with a speed between 1 and 3 m/s has passed 1 m."""


def passing(speed=None, times=TIMES):
    mechanism = uqmbd.Mechanism("passing", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", speed or chaospy.Uniform(1, 3), units="m/s")
    x = mechanism.body("body", mass=1, velocity=speed).position[0]
    mechanism.require("inside", x <= 1)
    return uqmbd.Study("passing", mechanism, times), x


def intervals(data):
    """Return probabilities (T,) and ends (T,) of their intervals, of the first requirement."""
    ends = data["violated_by_interval"].isel(requirement=0)
    low, high = (ends.sel(bound=end).values for end in ("lower", "upper"))
    values = data["violated_by"].isel(requirement=0).values
    assert np.all((0 <= low) & (low <= values) & (values <= high) & (high <= 1))
    np.testing.assert_array_equal([low[-1], high[-1]], data["interval"].isel(requirement=0).values)
    return values, low, high


def test_counts_contain_the_exact_probability_in_95_per_cent_of_the_samples():
    study, _ = passing()
    problem, count = study.problem(MonteCarlo()), 200
    found = problem.margins(np.random.default_rng(5).uniform(1, 3, (count * 30, 1)))
    hits = 0.0
    for k in range(count):
        own = slice(30 * k, 30 * (k + 1))
        counts = Violations.of(found.running[own], found.failed[own])
        _, low, high = intervals(Violations.dataset(problem.requirements, [counts], TIMES))
        hits += (low <= EXACT) & (EXACT <= high)
    assert np.all(hits / count > 0.95 - 3 * np.sqrt(0.05 * 0.95 / count))


@pytest.mark.thorough
def test_replicates_of_a_design_contain_the_exact_probability():
    study, _ = passing()
    hits = 0.0
    for seed in range(15):
        node = study.propagate(MonteCarlo(samples=256, sampling="sobol", seed=seed))
        _, low, high = intervals(node["requirements"].to_dataset())
        hits += (low <= EXACT) & (EXACT <= high)
    assert np.all(hits >= 12)  # 15 intervals of 95 % contain it fewer than 12 times with a probability of 0.5 %


@pytest.mark.parametrize("times", [TIMES, np.linspace(0, 0.95, 96)], ids=["few", "more than intervals are computed at"])
def test_intervals_of_a_surrogate_contain_the_exact_probability(times):
    study, _ = passing(times=times)
    _, low, high = intervals(study.propagate(Collocation(order=2))["requirements"].to_dataset())
    exact = np.clip((3 - 1 / np.maximum(times, 1e-9)) / 2, 0, 1)
    # the samples of the surrogate are a finite number
    assert np.all((low - 1e-3 <= exact) & (exact <= high + 1e-3))
    assert np.all(high - low < 0.1 if len(times) < 10 else high - low < 0.3)


def test_requirements_at_the_end_are_not_violated_before():
    study, x = passing()
    study.mechanism.require("near", uqmbd.final(x) <= 2)
    for method in (MonteCarlo(samples=50, seed=1), Collocation(order=2)):
        data = study.propagate(method)["requirements"].to_dataset()
        near = data["violated_by_interval"].sel(requirement="near")
        assert np.all(
            near.isel(time=slice(0, -1)) == 0 if method.name == "collocation" else near.sel(bound="lower")[:-1] == 0
        )
        assert near.sel(bound="upper").values[-1] > 0


def test_intervals_without_a_verification_are_from_zero_to_one():
    study, _ = passing()
    _, low, high = intervals(study.propagate(Collocation(order=2, verify=0))["requirements"].to_dataset())
    assert low.tolist() == [0] * len(TIMES) and high.tolist() == [1] * len(TIMES)


@pytest.mark.thorough
def test_rare_violations_have_intervals_before_the_end():
    times = np.array([0.0, 0.3, 0.34, 0.36, 0.38, 0.4])
    study, _ = passing(chaospy.Normal(2, 0.2), times)
    exact = norm.sf((1 / np.maximum(times, 1e-9) - 2) / 0.2)
    hits = 0.0
    for seed in range(10):
        _, low, high = intervals(study.propagate(Reliability(seed=seed))["requirements"].to_dataset())
        hits += (low <= exact) & (exact <= high)
    assert np.all(hits >= 8)


def test_an_interval_without_its_probability_is_refused():
    given = {"violation_probability": [0.1], "lower": [0.0], "upper": [0.2], "times": [0, 1]}
    with pytest.raises(uqmbd.StudyError, match="violated_by_interval is given without violated_by"):
        uqmbd.extend.requirements_dataset(["r"], **given, violated_by_interval=([[0, 0]], [[0, 0.2]]))
    text = (
        "requirement 'r': the probability until t = 0 s is 0.05, and its interval is 0.06 to 0.1; expected an interval"
    )
    with pytest.raises(uqmbd.StudyError, match=text):
        ends = [[0.06, 0]], [[0.1, 0.2]]
        uqmbd.extend.requirements_dataset(["r"], **given, violated_by=[[0.05, 0.1]], violated_by_interval=ends)
