"""Moments gathered chunk by chunk against those of all samples, and against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from uqmbd.errors import StudyError
from uqmbd.extend import Moments
from uqmbd.results import sample_statistics


def merged(x: np.ndarray, *edges: int) -> Moments:
    total = Moments.of(x[:0])
    for part in np.split(x, edges):
        total = total.merge(Moments.of(part))
    return total


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_merged_moments_are_those_of_all_samples(offset: float) -> None:
    x = offset + np.random.default_rng(1).gamma(2.0, size=(500, 3, 4))
    found = merged(x, 1, 64, 64, 200, 499).statistics()
    np.testing.assert_allclose(found["mean"], x.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(found["std"], x.std(axis=0, ddof=1), rtol=1e-9)
    np.testing.assert_allclose(found["skewness"], scipy.stats.skew(x, axis=0), rtol=1e-7)
    np.testing.assert_allclose(found["kurtosis"], scipy.stats.kurtosis(x, axis=0, fisher=False), rtol=1e-7)


def test_they_agree_with_the_statistics_of_stored_samples() -> None:
    x = np.random.default_rng(2).normal(size=(300, 2, 5))
    stored = sample_statistics(x)
    for name, value in merged(x, 100, 101).statistics().items():
        np.testing.assert_allclose(value, stored[name], rtol=1e-9, err_msg=name)


def test_what_does_not_vary_has_no_shape() -> None:
    found = Moments.of(np.full((10, 1, 1), 3.7)).statistics()
    assert (found["std"].item(), found["skewness"].item(), found["kurtosis"].item()) == (0.0, 0.0, 3.0)


def test_one_sample_has_no_spread() -> None:
    with pytest.raises(StudyError, match="at least two"):
        Moments.of(np.ones((1, 1))).statistics()
