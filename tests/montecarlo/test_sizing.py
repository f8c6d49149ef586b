"""Sizes for an accuracy: designs grow by further replicates, and their intervals hold where they end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from uqmbd.extend import Moments, replicate_errors
from uqmbd.propagation.budget.sized import RemainingBudget, Sized, Stage
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.gathering import replicate_sizes, uniform_samples
from uqmbd_montecarlo.sizing import replicated

from .conftest import resting

Function = Callable[[np.ndarray], np.ndarray]

SEEDS = 120
OUTPUTS: dict[str, tuple[Function, float, float]] = {
    "interaction and a skewed part": (
        lambda u: norm.ppf(u[:, 0]) * (1 + 0.5 * norm.ppf(u[:, 1])) + np.exp(norm.ppf(u[:, 1]) / 2),
        np.exp(1 / 8),
        np.sqrt(1 + 0.25 + np.exp(1 / 2) - np.exp(1 / 4)),
    ),
    "two groups": (
        lambda u: np.where(u[:, 0] < 0.1, 6 + norm.ppf(u[:, 1]) / 2, norm.ppf(u[:, 1])),
        0.6,
        np.sqrt(0.9 + 0.1 * 36.25 - 0.36),
    ),
}
"""Functions of uniform numbers (S, 2), with mean and standard deviation in closed form."""


@pytest.mark.parametrize("replicates", [2, 3, 16, 20])
def test_sizes_between_powers_of_two_have_further_replicates(replicates: int) -> None:
    for samples in range(2 * replicates, 70 * replicates, 3):
        size, count = replicated("sobol", samples, replicates)
        assert size <= samples and replicates <= count < 2 * replicates
        assert replicate_sizes("sobol", size, count) == [size // count] * count
        # less than a quarter is left, of which a replicate is the least part
        assert samples < size + max(replicates // 4, 1) * (size // count)


def test_further_replicates_extend_a_design() -> None:
    few, more = (uniform_samples("sobol", [8] * count, 3, 5) for count in (16, 20))
    np.testing.assert_array_equal(more[: len(few)], few)


def ended(accuracy: float, function: Function, seed: int) -> tuple[np.ndarray, tuple[Any, Any]]:
    """Return samples at the size at which a design ends for an accuracy, with the errors of both moments."""
    method = MonteCarlo(samples=512, seed=seed, sampling="sobol")
    study = resting({"fixed": None})
    sizing = method.sizing(study, accuracy)
    one, size = Sized(method, sizing, study, accuracy), sizing.least
    while True:
        made = sizing.at(size)
        sizes = replicate_sizes("sobol", made.samples, made.replicates)
        y = function(uniform_samples("sobol", sizes, 2, seed))
        parts = np.split(y[:, None], np.cumsum(sizes)[:-1])
        errors = tuple(float(error[0]) for error in replicate_errors([Moments.of(part) for part in parts]))
        stated, kind = 1.96 * max(errors) / y.std(), ("mean", "std")[int(np.argmax(errors))]
        one.add(Stage(size, size, size, 1.0, 1.0, stated, "", kind, stated, kind), None)
        following = one.following(RemainingBudget())
        if following is None:
            return y, (errors[0], errors[1])
        size = following


@pytest.mark.thorough
@pytest.mark.parametrize("name", OUTPUTS)
def test_intervals_hold_where_a_design_ends(name: str) -> None:
    """A design that ends at a small stated error selects favourable ones: shares are 95 % within three standard errors."""
    function, mean, std = OUTPUTS[name]
    held, near = [], []
    for seed in range(SEEDS):
        y, errors = ended(0.1, function, seed)
        off = np.abs([y.mean() - mean, y.std() - std])
        held.append(off <= 1.96 * np.array(errors))
        near.append(off.max() <= 0.1 * std)
    low = 0.95 - 3 * np.sqrt(0.95 * 0.05 / SEEDS)
    assert np.mean(held, axis=0).min() >= low and np.mean(near) >= low
