"""Sobol' indices by pick-freeze: pairs of realisations that share some inputs, with bootstrap intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["RESAMPLES", "SobolIndices", "mixed_inputs", "obstacle_of", "pick_freeze"]


RESAMPLES = 1000
"""Bootstrap samples of the rows."""

LEVELS = (0.025, 0.975)
"""Probabilities of the ends of the intervals: 95 %."""

BLOCK_NUMBERS = 2_000_000
"""Numbers (8 bytes each) of the largest array of a block of outputs and times."""

_ROUNDING = 32.0 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Estimates and their 95 % intervals.

    Attributes
    ----------
    first, total : array, shape (input, ...)
        Indices of first order and total ones. Estimates, not cut off at 0 and 1.
    first_interval, total_interval : array, shape (2, input, ...)
        Lower and upper ends.
    """

    first: Array
    total: Array
    first_interval: Array
    total_interval: Array


def obstacle_of(inputs: Any) -> str | None:
    """Say why indices of inputs make no sense (where they depend on each other), or return None.

    Inputs of one `uqmbd.random_vector` depend on each other if one of them moves with the uniform number of another.

    Parameters
    ----------
    inputs : JointInput
        The `inputs` of a problem or mechanism.
    """
    variables = inputs.variables
    if all(len(v.joint.names) == 1 for v in variables):
        return None
    uniform = np.random.default_rng(0).uniform(0.1, 0.9, (16, len(variables)))
    base = inputs.from_uniform(uniform)
    for k, moved in enumerate(variables):
        other = uniform.copy()
        other[:, k] = 1.0 - other[:, k]
        change = np.abs(inputs.from_uniform(other) - base)
        change[:, k] = 0.0
        moves = change.max(axis=0) > 1e-9 * np.ptp(base, axis=0)
        if moves.any():
            return (
                f"inputs {moved.name!r} and {variables[int(moves.argmax())].name!r} depend on each other, so that "
                "pick-freeze would give indices of an ordered transform of them, not of inputs; "
                "use Collocation(...), which gives such indices under names of their own"
            )
    return None


def mixed_inputs(a: Array, b: Array) -> Array:
    """Return the further realisations that pick-freeze needs: a with each input in turn from b.

    Parameters
    ----------
    a, b : array, shape (N, d)
        Independent samples of independent inputs.

    Returns
    -------
    array, shape (d * N, d)
        Input after input.

    Examples
    --------
    >>> mixed_inputs(np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]])).tolist()
    [[3.0, 2.0], [1.0, 4.0]]
    """
    count, dimension = a.shape
    found = np.tile(a, (dimension, 1)).reshape(dimension, count, dimension)
    for k in range(dimension):
        found[k, :, k] = b[:, k]
    return found.reshape(-1, dimension)


def pick_freeze(a: Array, b: Array, mixed: Array, seed: np.random.SeedSequence) -> SobolIndices:
    r"""Estimate Sobol' indices of first order and total ones.

    With the responses :math:`f_A, f_B` to two independent samples, and :math:`f_{AB}` to the first with input i from
    the second, Jansen's estimators [1]_ are

    .. math:: S_i = 1 - \frac{\sum (f_B - f_{AB})^2}{\sum (f_B - f_A)^2}, \qquad
              T_i = \frac{\sum (f_A - f_{AB})^2}{\sum (f_B - f_A)^2}.

    Both are exact where an output depends on one input alone, for this input and for all others, and do not depend on
    the mean of the response. The design, N (d + 2) realisations, is that of [2]_. Intervals are the percentiles of a
    bootstrap over the N rows [3]_: all realisations of a row are drawn together.

    Parameters
    ----------
    a, b : array, shape (N, ...)
        Responses, commonly (N, output, time), all finite; N is at least 2.
    mixed : array, shape (d, N, ...)
        Responses to `mixed_inputs`.
    seed : numpy.random.SeedSequence
        Of the bootstrap.

    Returns
    -------
    SobolIndices
        All 0, intervals too, where the response does not vary, or by rounding only.

    References
    ----------
    .. [1] M. J. W. Jansen, Computer Physics Communications 117 (1999) 35-43.
    .. [2] A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270.
    .. [3] G. E. B. Archer, A. Saltelli, I. M. Sobol', Journal of Statistical Computation and Simulation 58 (1997)
       99-120.

    Examples
    --------
    >>> a, b = np.random.default_rng(1).normal(size=(2, 500, 2))
    >>> mixed = mixed_inputs(a, b).reshape(2, 500, 2)
    >>> found = pick_freeze(a[:, 0], b[:, 0], mixed[:, :, 0], np.random.SeedSequence(1))  # of the first input alone
    >>> found.first.tolist(), found.total.tolist()
    ([1.0, 0.0], [1.0, 0.0])
    """
    shape, dimension, count = a.shape[1:], len(mixed), len(a)
    one, two, others = a.reshape(count, -1), b.reshape(count, -1), mixed.reshape(dimension, count, -1)
    columns = one.shape[1]
    estimates, intervals = np.zeros((2, dimension, columns)), np.zeros((2, 2, dimension, columns))
    weights = _resampled(count, np.random.default_rng(seed))
    for part in _blocks(columns, (2 * dimension + 1) * max(count, RESAMPLES)):
        squares, varies = _squares(one[:, part], two[:, part], others[:, :, part])
        estimates[..., part] = _indices(squares.mean(axis=1, keepdims=True), varies)[:, :, 0]
        drawn = _indices(weights @ squares, varies)
        intervals[..., part] = np.quantile(drawn, LEVELS, axis=2)
    return SobolIndices(
        estimates[0].reshape(dimension, *shape),
        estimates[1].reshape(dimension, *shape),
        intervals[:, 0].reshape(2, dimension, *shape),
        intervals[:, 1].reshape(2, dimension, *shape),
    )


def _squares(a: Array, b: Array, mixed: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Squared differences (2 d + 1, N, C) in units of their largest, and whether a column varies at all."""
    differences = np.concatenate([(b - a)[None], b - mixed, a - mixed])
    largest = np.abs(differences).max(axis=(0, 1))
    varies = largest > _ROUNDING * np.maximum(np.abs(a).max(axis=0), np.abs(b).max(axis=0))
    differences /= np.where(varies, largest, 1.0)
    return np.square(differences, out=differences), varies


def _indices(sums: Array, varies: NDArray[np.bool_]) -> Array:
    """First and total indices (2, d, R, C) from sums (2 d + 1, R, C) of squares."""
    base, dimension = sums[0], len(sums) // 2
    usable = (base > 0) & varies
    share = np.divide(sums[1:], base, out=np.zeros_like(sums[1:]), where=usable)
    return np.stack([np.where(usable, 1.0 - share[:dimension], 0.0), share[dimension:]])


def _resampled(count: int, generator: np.random.Generator) -> Array:
    """How often each row is drawn, shape (RESAMPLES, N)."""
    found = np.empty((RESAMPLES, count))
    for row in found:
        row[:] = np.bincount(generator.integers(count, size=count), minlength=count)
    return found


def _blocks(columns: int, numbers: int) -> Iterator[slice]:
    size = max(1, BLOCK_NUMBERS // numbers)
    return (slice(start, start + size) for start in range(0, columns, size))
