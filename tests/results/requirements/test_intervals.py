"""Intervals of probabilities: their ends solve binomial equations, and they hold the truth as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from uqmbd.errors import StudyError
from uqmbd.extend import Violations, requirements_dataset
from uqmbd.results import clopper_pearson, requirement_names
from uqmbd.results.requirements.intervals import of_replicates


@pytest.mark.parametrize(("happened", "of"), [(1, 10), (3, 500), (499, 500), (250, 500)])
def test_ends_are_those_of_the_exact_binomial_test(happened, of):
    found = clopper_pearson(happened, of)
    expected = stats.binomtest(happened, of).proportion_ci(0.95, method="exact")
    assert [float(end) for end in found] == pytest.approx([expected.low, expected.high], rel=1e-9)


def test_what_never_happened_has_one_end_with_all_of_the_confidence():
    lower, upper = clopper_pearson([0, 500], 500)
    assert lower[0] == 0 and upper[1] == 1
    assert (1 - upper[0]) ** 500 == pytest.approx(0.05) and lower[1] ** 500 == pytest.approx(0.05)
    assert upper[0] < 0.006  # "at most 0.6 %"


@pytest.mark.parametrize("probability", [0.002, 0.02, 0.3])
def test_coverage_of_counts(probability):
    counts = np.arange(501)
    lower, upper = clopper_pearson(counts, 500)
    held = (lower <= probability) & (probability <= upper)
    assert stats.binom.pmf(counts[held], 500, probability).sum() >= 0.94


def test_replicates_know_more_than_counts_and_fall_back_where_they_are_too_few():
    rng = np.random.default_rng(3)
    # stratified points: the share of each replicate hardly varies
    shares = np.stack([0.25 + 0.002 * rng.normal(size=16), np.eye(1, 16)[0] / 50], axis=1)
    error, lower, upper = of_replicates(shares, 16 * 50, np.zeros(2), np.ones(2))
    assert upper[0] - lower[0] < 0.01 and lower[0] < 0.25 < upper[0] and error[0] < 0.001
    assert (lower[1], upper[1]) == (0, 1)  # it happened in one replicate only


def test_failed_realisations_are_neither_safe_nor_unsafe():
    running = np.ones((100, 1, 2))
    running[:5] = -1.0
    running[90:] = np.nan
    counted = Violations.of(running, np.isnan(running[:, 0, -1]))
    data = Violations.dataset(["limit"], [counted], [0.0, 1.0])
    assert data["violation_probability"].item() == pytest.approx(5 / 90)
    low, high = data["interval"].values[0]
    assert low == pytest.approx(stats.binomtest(5, 100).proportion_ci(method="exact").low)
    assert high == pytest.approx(stats.binomtest(15, 100).proportion_ci(method="exact").high)


def test_any_is_the_union():
    running = np.array([[[1.0], [1.0]], [[-1.0], [1.0]], [[1.0], [-1.0]], [[-1.0], [-1.0]]])
    data = Violations.dataset(["a", "b"], [Violations.of(running, np.zeros(4, dtype=bool))], [0.0])
    assert data["requirement"].values.tolist() == ["a", "b", "any"] == list(requirement_names(["a", "b"]))
    assert data["violation_probability"].values.tolist() == [0.5, 0.5, 0.75]


def test_an_interval_without_its_probability_is_refused():
    with pytest.raises(StudyError, match="requirement 'a': the probability is 0.5, and its interval is 0 to 0.1"):
        requirements_dataset(["a"], violation_probability=[0.5], lower=[0.0], upper=[0.1])
