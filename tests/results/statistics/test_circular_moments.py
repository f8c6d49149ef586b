"""Directions that are gathered chunk by chunk are those of all samples."""

from __future__ import annotations

from functools import reduce

import numpy as np
import pytest

from uqmbd.extend import CircularMoments
from uqmbd.results.statistics.circular import circular_of_samples

TURNS = np.array([360.0, 0.0, 2 * np.pi])


def merged(x: np.ndarray, edges: list[int]) -> dict[str, np.ndarray]:
    parts = (CircularMoments.of(part, TURNS) for part in np.split(x, edges))
    return reduce(CircularMoments.merge, parts).statistics()


@pytest.mark.parametrize("spread", [1e-9, 1e-3, 0.3, 3.0, 100.0])
@pytest.mark.parametrize("centre", [0.0, 3.14159, -40.0])
def test_they_are_those_of_all_samples(spread: float, centre: float) -> None:
    x = centre + spread * np.random.default_rng(1).normal(size=(500, 3, 4))
    x[:, 0] *= 180 / np.pi
    expected, found = circular_of_samples(x, TURNS), merged(x, [0, 1, 200, 200, 460])
    assert np.isnan(found["circular_mean"][1]).all() and np.isnan(found["circular_std"][1]).all()
    scale = np.array([180 / np.pi, 1.0, 1.0])[:, None]
    apart = (found["circular_mean"] - expected["circular_mean"]) / scale
    # the mean of what is spread over many turns is known as well as directions do not cancel
    slack = (
        1e-13 * (1 + abs(centre) + spread) / np.exp(-(np.minimum(np.nanmax(expected["circular_std"][2]), 6.0) ** 2) / 2)
    )
    assert np.nanmax(np.abs((apart + np.pi) % (2 * np.pi) - np.pi)) < slack
    np.testing.assert_allclose(found["circular_std"], expected["circular_std"], rtol=max(1e-6 * 1e-9 / spread, slack))


def test_directions_that_cancel_have_no_mean() -> None:
    x = np.zeros((2, 3, 1))
    x[1, 0], x[1, 2] = 180.0, np.pi
    found = merged(x, [1])
    assert np.isnan(found["circular_mean"]).all()
    assert np.isinf(found["circular_std"][[0, 2]]).all()


def test_no_output_is_an_angle() -> None:
    assert CircularMoments.of(np.ones((3, 2, 4)), np.zeros(2)).statistics() == {}
