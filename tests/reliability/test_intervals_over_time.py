"""Intervals of the probability of a violation until each time, from weighted samples with known probabilities."""

import numpy as np
import pytest

from uqmbd_reliability.describing import intervals_over_time
from uqmbd_reliability.estimating import estimate

EARLY, WHOLE = 1e-4, 1e-3
"""Probabilities of a violation by the first time and by the end."""


@pytest.mark.parametrize("ratio", [0.2, 1.0, 5.0, 15.0])
def test_early_violations_with_other_weights_have_valid_intervals(ratio):
    """Weights of early violations are `ratio` times those of late ones, as with a mode of failure sampled rarely."""
    generator, hits, repetitions, size = np.random.default_rng(3), 0, 300, 1000
    late = 0.005
    for _ in range(repetitions):
        drawn = generator.random(size)
        first = drawn < EARLY / (ratio * late)
        then = (drawn > 0.5) & (drawn < 0.5 + (WHOLE - EARLY) / late)
        by_time = np.stack([first * ratio * late, first * ratio * late + then * late], axis=1)[:, None, :]
        one = estimate(by_time[:, 0, -1], np.zeros(size), 100)
        by = by_time.mean(axis=0)
        low, high = intervals_over_time(by, by_time, np.array([one.lower]), np.array([one.upper]), dependent=False)
        assert (low[0, -1], high[0, -1]) == (one.lower, one.upper)
        assert np.all((low <= by) & (by <= high)) and high[0, 0] <= high[0, 1]
        hits += low[0, 0] <= EARLY <= high[0, 0]
    assert hits / repetitions > 0.95 - 3 * np.sqrt(0.05 * 0.95 / repetitions)


def test_failed_realisations_may_violate_at_every_time():
    weights, failures = np.zeros(1000), np.zeros(1000)
    weights[:300], failures[300:350] = 0.003, 1.0
    one = estimate(weights, failures, 0)
    by_time = np.stack([np.where(np.arange(1000) < 3, weights, 0.0), weights], axis=1)[:, None, :]
    by = by_time.mean(axis=0) / 0.95
    low, high = intervals_over_time(by, by_time, np.array([one.lower]), np.array([one.upper]), dependent=False)
    assert one.upper > 0.05 and high[0, 0] > 0.05 and low[0, 0] < by[0, 0]


def test_dependent_samples_and_times_without_a_violation_have_the_upper_end_of_the_motion():
    by_time = np.zeros((10, 1, 3))
    by_time[:4, 0, 1:] = 0.1
    by = by_time.mean(axis=0)
    for dependent in (False, True):
        low, high = intervals_over_time(by, by_time, np.array([0.01]), np.array([0.1]), dependent=dependent)
        assert (low[0, 0], high[0, 0]) == (0.0, 0.1)
    assert (low[0, 1], high[0, 1]) == (0.0, 0.1)
