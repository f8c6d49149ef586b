"""Sampling designs: stratification, reproducibility, and honest standard errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

import uqmbd
from uqmbd.results import Moments, replicate_errors, sample_statistics
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.replicates import replicate_sizes, uniform_samples

DESIGNS = ("random", "latin-hypercube", "sobol", "halton")
SEEDS = 200
SAMPLES = 256


def response(uniform: np.ndarray) -> np.ndarray:
    """A response with an interaction and a skewed part, in two standard normal inputs; mean and variance are known."""
    x = norm.ppf(uniform)
    return (x[:, 0] + 0.5 * x[:, 0] * x[:, 1] + np.exp(x[:, 1] / 2))[:, None, None]


def replicates(y: np.ndarray, sizes: list[int]) -> list[Moments]:
    return [Moments.of(part) for part in np.split(y, np.cumsum(sizes)[:-1])]


# E exp(x/2) = exp(1/8), var exp(x/2) = exp(1/2) - exp(1/4); the other two parts have variances 1 and 1/4, and no covariance
MEAN = np.exp(1 / 8)
STD = np.sqrt(1 + 0.25 + np.exp(1 / 2) - np.exp(1 / 4))


@pytest.mark.thorough
@pytest.mark.parametrize("design", DESIGNS)
def test_stated_intervals_hold_as_often_as_stated(design: str) -> None:
    sizes = replicate_sizes(design, SAMPLES, 16)
    hits = np.zeros(2)
    for seed in range(SEEDS):
        y = response(uniform_samples(design, sizes, 2, seed))
        found = sample_statistics(y)
        errors = (found["std_error_mean"], found["std_error_std"])
        if design != "random":
            errors = replicate_errors(replicates(y, sizes))
        hits += [
            abs(found["mean"] - MEAN).item() <= 1.96 * errors[0].item(),
            abs(found["std"] - STD).item() <= 1.96 * errors[1].item(),
        ]
    assert np.all(hits >= 0.90 * SEEDS), hits / SEEDS
    assert np.all(hits <= 0.99 * SEEDS), hits / SEEDS


@pytest.mark.thorough
def test_stratified_designs_know_the_mean_better_than_random_points() -> None:
    spread = {}
    for design in DESIGNS:
        sizes = replicate_sizes(design, SAMPLES, 16)
        spread[design] = np.std([response(uniform_samples(design, sizes, 2, seed)).mean() for seed in range(60)])
    assert spread["latin-hypercube"] < 0.8 * spread["random"]
    assert spread["sobol"] < 0.5 * spread["random"]


def test_every_replicate_of_a_latin_hypercube_has_one_point_in_each_slice() -> None:
    sizes = [8, 8, 7]
    u = uniform_samples("latin-hypercube", sizes, 3, seed=2)
    first = 0
    for size in sizes:
        part = u[first : first + size]
        for axis in range(3):
            assert sorted(np.floor(part[:, axis] * size).astype(int)) == list(range(size))
        first += size


def test_every_replicate_of_sobol_points_is_balanced() -> None:
    u = uniform_samples("sobol", [16, 16], 2, seed=2)
    for part in (u[:16], u[16:]):
        cells = np.floor(part * 4).astype(int)
        assert len({tuple(c) for c in cells}) == 16  # a (0, 4, 2)-net: one point in each of 4 x 4 cells
    assert not np.allclose(u[:16], u[16:])


@pytest.mark.parametrize("design", DESIGNS)
def test_seed_gives_the_same_bits_and_another_seed_gives_others(design: str) -> None:
    one, two, other = (uniform_samples(design, [16, 16], 2, seed) for seed in (4, 4, 5))
    assert one.tobytes() == two.tobytes()
    assert not np.any(one == other)
    assert one.min() > 0
    assert one.max() < 1


def test_jackknife_agrees_with_the_variance_of_replicate_means() -> None:
    """For equal replicates the jackknife of the mean is the standard error of the replicate means, exactly."""
    y = np.random.default_rng(0).normal(size=(40, 2, 3))
    error, _ = replicate_errors(replicates(y, [10] * 4))
    means = y.reshape(4, 10, 2, 3).mean(axis=1)
    widening = 3.182446305 / 1.959963985  # Student's t of three degrees of freedom over the normal
    np.testing.assert_allclose(error, widening * means.std(axis=0, ddof=1) / 2, rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"samples": 1}, ["samples is 1", "2 or more"]),
        ({"samples": 10.5}, ["samples is 10.5"]),
        ({"seed": -1}, ["seed is -1"]),
        ({"sampling": "haltn"}, ["'halton'", "'sobol'"]),
        ({"samples": 500, "sampling": "sobol"}, ["256", "512"]),
        ({"samples": 20, "sampling": "latin-hypercube"}, ["20 samples", "32"]),
        ({"replicates": 1}, ["replicates is 1"]),
        ({"max_failures": 2}, ["max_failures is 2"]),
    ],
)
def test_bad_options_are_explained(options: dict, words: list[str]) -> None:
    with pytest.raises(uqmbd.StudyError) as caught:
        MonteCarlo(**options)
    for word in words:
        assert word in str(caught.value)
