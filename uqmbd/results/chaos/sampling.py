"""Sample a polynomial chaos, and estimate quantiles and densities from the samples.

:class:`scipy.stats.gaussian_kde` takes three times as long for the same density, because it evaluates distant kernels
whose values are negligible.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import shown
from uqmbd.compiled import order_statistics
from uqmbd.errors import StudyError
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = [
    "affordable",
    "basis_values",
    "kernel_density",
    "quantiles_of_rows",
    "random_germs",
    "sampled_shape",
    "spread_germs",
]


ROWS = 4096
"""Number of germ points at which the basis is evaluated at once."""

BASIS_NUMBERS = 50_000_000
"""Maximum number of basis values (8 bytes each) in memory during the computation of statistics."""

WORK = 1e12
"""Maximum number of multiplications for samples of statistics; they take one or two minutes."""

LEAST = 512
"""Minimum number of samples for any number of terms."""

BLOCK_NUMBERS = 4_000_000
"""Number of responses (8 bytes each) that are sampled and sorted at once."""


def random_germs(space: GermSpace, count: int, seed: int) -> Array:
    """Draw independent germ points (K, d)."""
    _check_count(count, 1)
    uniform = np.random.default_rng(seed).random((count, len(space.inputs)))
    return space.from_uniform(_inside(uniform))


def spread_germs(space: GermSpace, count: int, seed: int) -> Array:
    """Return germ points (K, d) of a scrambled Sobol' sequence; K is `count`, rounded up to a power of two."""
    from scipy.stats import qmc

    _check_count(count, 2)
    sequence = qmc.Sobol(len(space.inputs), scramble=True, seed=np.random.default_rng(seed))
    return space.from_uniform(_inside(sequence.random_base2(int(np.ceil(np.log2(count))))))


def affordable(requested: int, terms: int, columns: int) -> int:
    """Return the number of surrogate samples within the limits of memory and time: `requested`, or a power of two.

    >>> affordable(8192, terms=1771, columns=1000), affordable(8192, terms=53130, columns=1000)
    (8192, 512)
    """
    most = min(BASIS_NUMBERS / max(terms, 1), WORK / max(terms * columns, 1))
    return requested if requested <= most else min(requested, max(LEAST, 2 ** int(np.log2(max(most, 1.0)))))


def sampled_shape(
    space: GermSpace, coefficients: Array, multi_index: Index, std: Array, samples: int
) -> tuple[Array, Array]:
    """Estimate skewness and kurtosis (C,) for coefficients (P, C) from Sobol' points of the surrogate."""
    # standardised by the mean and deviation of the samples; 0 and 3 where `std` (C,) is 0
    basis = basis_values(space, spread_germs(space, samples, 0), multi_index)
    skewness, kurtosis = np.zeros(len(std)), np.full(len(std), 3.0)
    varies = np.flatnonzero(std > 0)
    size = max(1, BLOCK_NUMBERS // len(basis))
    with one_thread():
        for start in range(0, len(varies), size):
            part = varies[start : start + size]
            unit = coefficients[:, part] / std[part]
            unit[0] = 0.0
            values = basis @ unit
            values -= values.mean(axis=0)
            square = values * values
            variance = square.mean(axis=0)
            skewness[part] = np.einsum("kc,kc->c", values, square) / len(values) / variance**1.5
            kurtosis[part] = np.einsum("kc,kc->c", square, square) / len(values) / variance**2
    return skewness, kurtosis


def basis_values(space: GermSpace, germs: Array, multi_index: Index, by: int | None = None) -> Array:
    """Evaluate the basis (K, P), or its derivative with respect to a germ, in blocks of `ROWS` points."""
    found = np.empty((len(germs), len(multi_index)))
    for start in range(0, len(germs), ROWS):
        part = germs[start : start + ROWS]
        values = space.evaluate(part, multi_index) if by is None else space.evaluate_derivative(part, multi_index, by)
        found[start : start + ROWS] = values
    return found


def quantiles_of_rows(rows: Callable[[slice], Array], count: int, columns: int, probabilities: ArrayLike) -> Array:
    """Return quantiles (N, C) of K samples, computed in blocks of rows (c, K); NaN where a sample is NaN."""
    levels = np.array(probabilities, dtype=float)
    if levels.ndim != 1 or not levels.size or np.any((levels < 0) | (levels > 1)) or np.any(np.diff(levels) <= 0):
        raise StudyError(f"The probabilities are {levels.tolist()}; expected increasing numbers between 0 and 1.")
    position = levels * (count - 1)
    below = np.minimum(position.astype(int), max(count - 2, 0))
    above = np.minimum(below + 1, count - 1)
    ranks, of_both = np.unique(np.concatenate([below, above]), return_inverse=True)
    of_below, of_above = of_both[: len(levels)], of_both[len(levels) :]
    found = np.empty((len(levels), columns))
    size = max(1, BLOCK_NUMBERS // count)
    with one_thread():
        for start in range(0, columns, size):
            part = slice(start, min(start + size, columns))
            ordered = order_statistics(np.ascontiguousarray(rows(part), dtype=float), ranks)
            low, high = ordered[:, of_below], ordered[:, of_above]
            found[:, part] = (low + (position - below) * (high - low)).T
    # rounding in the interpolation may reverse the order of close quantiles
    return np.maximum.accumulate(found, axis=0)


def kernel_density(samples: Array, values: ArrayLike) -> Array:
    """Estimate a density (1 / units of the samples) at values (N,) from samples (K,) by Gaussian kernels."""
    # bandwidth: B. W. Silverman, Density Estimation for Statistics and Data Analysis, 1986, section 3.4.2
    points = np.asarray(values, dtype=float)
    if np.isnan(points).any():
        raise StudyError(
            f"values is {shown(values)} and contains {np.isnan(points).sum()} NaN; expected values of the output."
        )
    low, high = np.quantile(samples, [0.25, 0.75])
    spread = min(float(samples.std(ddof=1)), float(high - low) / 1.34) or float(samples.std(ddof=1))
    width = 0.9 * spread * len(samples) ** -0.2
    ordered = np.sort(samples)
    found = np.empty(points.size)
    for k, point in enumerate(points.ravel()):
        # kernels at more than nine bandwidths are below rounding
        first, last = np.searchsorted(ordered, [point - 9.0 * width, point + 9.0 * width])
        found[k] = np.exp(-0.5 * ((ordered[first:last] - point) / width) ** 2).sum()
    return np.asarray(found.reshape(points.shape) / (len(samples) * width * np.sqrt(2.0 * np.pi)))


def _inside(uniform: Array) -> Array:
    """Clip numbers in [0, 1) to the open interval, because germs may be infinite at its ends."""
    tiny = 2.0**-53
    result: Array = np.clip(uniform, tiny, 1.0 - tiny)
    return result


def _check_count(count: int, least: int) -> None:
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < least:
        raise StudyError(f"The number of samples is {count!r}; expected a whole number of at least {least}.")
