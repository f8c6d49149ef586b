"""Compute statistics of angles, for which plain averages are wrong.

:func:`scipy.stats.circmean` and ``circstd`` accept no weights, such as weights of a quadrature. These functions return
a direction even if directions cancel, and lose the digits of small deviations: for 1e-9 and -1e-9 they return the
deviation 0.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import Axis, typechecked
from uqmbd.errors import StudyError
from uqmbd.threads import one_thread
from uqmbd.typing import Array

__all__ = [
    "ROUNDING",
    "circular_mean",
    "circular_of_blocks",
    "circular_of_components",
    "circular_of_samples",
    "circular_std",
    "unwrap_samples",
    "weighted_mean",
]


ROUNDING = 32.0 * np.finfo(float).eps
"""Length of a mean direction, relative to single directions, below which it counts as rounding."""

BLOCK_NUMBERS = 1_000_000
"""Number of angles (8 bytes each) that are averaged at once."""


@typechecked
def circular_mean(angles: ArrayLike, axis: Axis = 0, weights: ArrayLike | None = None) -> Array:
    """Return the direction of the mean of the unit vectors of angles.

    Parameters
    ----------
    angles : array_like
        Angles, rad.
    axis : int
        Axis along which to average.
    weights : array_like, shape (S,), optional
        Weights of the S angles along `axis`, of any sum. Default: equal weights.

    Returns
    -------
    array
        Mean direction without `axis`, rad, in (-pi, pi]; NaN if the directions cancel.

    Raises
    ------
    StudyError
        If there are no angles, or the number of weights is wrong or their sum is not positive.

    References
    ----------
    K. V. Mardia and P. E. Jupp, Directional Statistics, Wiley, 2000, section 2.2.

    Examples
    --------
    >>> import numpy as np
    >>> float(np.degrees(circular_mean(np.radians([350.0, 20.0]))).round(9))
    5.0
    """
    given = np.asarray(angles, dtype=float)
    cosine, sine = (weighted_mean(part, axis, weights) for part in (np.cos(given), np.sin(given)))
    return circular_of_components(cosine, sine)[0]


@typechecked
def circular_std(angles: ArrayLike, axis: Axis = 0, weights: ArrayLike | None = None) -> Array:
    r"""Return the circular standard deviation :math:`\sqrt{-2 \ln R}`, with the mean resultant length R.

    For a normal angle wrapped around the circle, the result is the standard deviation of the normal, of any size.

    Parameters
    ----------
    angles : array_like
        Angles, rad.
    axis : int
        Axis along which to average.
    weights : array_like, shape (S,), optional
        Weights of the angles, as for :func:`circular_mean`.

    Returns
    -------
    array
        Standard deviation without `axis`, rad; infinite if the directions cancel.

    References
    ----------
    K. V. Mardia and P. E. Jupp, Directional Statistics, Wiley, 2000, section 2.3.

    Examples
    --------
    >>> import numpy as np
    >>> float(circular_std(np.radians([359.0, 1.0])).round(6)), round(float(np.radians(1.0)), 6)
    (0.017454, 0.017453)
    """
    given = np.asarray(angles, dtype=float)
    mean = circular_mean(given, axis, weights)
    # R = mean cos(angle - mean) = 1 - lack; the computation of `lack` loses no digits for small deviations
    lack = weighted_mean(2.0 * np.sin((given - np.expand_dims(mean, axis)) / 2.0) ** 2, axis, weights)
    std = np.sqrt(-2.0 * np.log1p(-np.where(np.isnan(mean), 0.0, np.minimum(lack, 1.0 - ROUNDING))))
    return np.where(np.isnan(mean), np.inf, std + 0.0)


@typechecked
def circular_of_components(mean_cosine: ArrayLike, mean_sine: ArrayLike) -> tuple[Array, Array]:
    """Return circular mean and standard deviation from the means of cosine and sine.

    The function is for a chaos whose outputs are the cosine and the sine of an angle. If both means are exact, the
    statistics of the angle are exact, too.

    `mean_cosine`, `mean_sine` (...): expectations of cosine and sine, such as two rows of `PolynomialChaos.mean`.
    Return (...) in radians, as :func:`circular_mean` and :func:`circular_std` do.

    >>> mean, std = circular_of_components(0.0, 1.0)
    >>> float(mean.round(6)), float(std)
    (1.570796, 0.0)
    """
    c, s = np.asarray(mean_cosine, dtype=float), np.asarray(mean_sine, dtype=float)
    length = np.hypot(c, s)
    cancels = length <= ROUNDING
    mean = np.where(cancels, np.nan, np.arctan2(s, c))
    safe = np.where(cancels, 1.0, length)
    # rounding may raise a length above 1; the maximum also avoids -0.0
    std = np.where(cancels, np.inf, np.sqrt(np.maximum(-2.0 * np.log(safe), 0.0)))
    return np.where(mean == -np.pi, np.pi, mean), std


@typechecked
def unwrap_samples(angles: ArrayLike, axis: Axis = -1) -> Array:
    """Make the angles of samples continuous in time, and bring the samples near one another at the first time.

    The function removes jumps of a full turn along `axis` from each sample. It then adds whole turns to each sample:
    its first angle is then within half a turn of the circular mean of all first angles. Plain means and deviations are
    then meaningful as long as the samples differ by few turns. A chaos of the angle is smooth.

    Parameters
    ----------
    angles : array_like, shape (S, ...) with the times along `axis`
        Angles of the samples, rad, with the samples along the first axis. Failed samples (NaN) stay NaN.
    axis : int
        Axis of the times; not the first. Angles must change by less than half a turn between two times.

    Returns
    -------
    array, shape (S, ...)
        Unwrapped angles, rad.

    Raises
    ------
    StudyError
        If there is no axis of times in addition to the axis of the samples.

    Examples
    --------
    >>> import numpy as np
    >>> turning = np.radians([[179.0, -179.0, -177.0], [-179.0, -177.0, -175.0]])
    >>> np.degrees(unwrap_samples(turning)).round(6).tolist()
    [[179.0, 181.0, 183.0], [181.0, 183.0, 185.0]]
    """
    given = np.asarray(angles, dtype=float)
    if given.ndim < 2 or axis in (0, -given.ndim) or not given.shape[axis]:
        raise StudyError(
            f"The samples have the shape {given.shape}, with the times along axis {axis}; expected samples along the "
            "first axis, and times along another axis."
        )
    moved = np.moveaxis(np.unwrap(given, axis=axis), axis, -1)
    first = moved[..., 0]
    known = np.isfinite(first)
    count = np.maximum(known.sum(axis=0), 1)
    cosine = np.where(known, np.cos(np.where(known, first, 0.0)), 0.0).sum(axis=0) / count
    sine = np.where(known, np.sin(np.where(known, first, 0.0)), 0.0).sum(axis=0) / count
    centre = circular_of_components(cosine, sine)[0]
    # directions that cancel have no centre; angles are then within half a turn of zero
    centre = np.where(np.isnan(centre), 0.0, centre)
    turns = np.round((first - centre) / (2.0 * np.pi))
    return np.moveaxis(moved - 2.0 * np.pi * turns[..., None], -1, axis)


def circular_of_samples(response: Array, turns: Array) -> dict[str, Array]:
    """Compute circular mean and standard deviation of samples.

    `response` (S, O, T): finite samples, in the units of the outputs; `turns` (O,): length of a full turn in these
    units, 0 if the output is no angle. Return ``circular_mean`` and ``circular_std``, shape (O, T) or (O,), in the
    units of the outputs, NaN for other outputs. The result is empty if no output is an angle. Pass the result to
    ``statistics_dataset(labels, **it)``.

    >>> import numpy as np
    >>> found = circular_of_samples(np.array([[179.0, 1.0], [183.0, 2.0]]), np.array([360.0, 0.0]))
    >>> found["circular_mean"].round(6).tolist(), found["circular_std"].round(3).tolist()
    ([-179.0, nan], [2.0, nan])
    """
    flat = response.reshape(*response.shape[:2], -1)
    return circular_of_blocks(response.shape[1:], len(response), turns, lambda output, part: flat[:, output, part])


def circular_of_blocks(
    shape: tuple[int, ...], count: int, turns: Array, samples: Callable[[int, slice], Array]
) -> dict[str, Array]:
    """Compute the result of `circular_of_samples` block by block.

    `shape`: shape of the outputs, (O, T) or (O,); `count`: number S of samples; `turns` (O,): length of a full turn;
    `samples`: function that returns samples (S, t) of an output at a slice of t times.
    """
    if not np.any(turns):
        return {}
    mean, std = np.full((2, shape[0], int(np.prod(shape[1:]))), np.nan)
    size = max(1, BLOCK_NUMBERS // max(count, 1))
    with one_thread():
        for output in np.flatnonzero(turns):
            radians = 2.0 * np.pi / turns[output]
            for start in range(0, mean.shape[1], size):
                part = slice(start, start + size)
                angles = samples(int(output), part) * radians
                mean[output, part] = circular_mean(angles) / radians
                std[output, part] = circular_std(angles) / radians
    return {"circular_mean": mean.reshape(shape), "circular_std": std.reshape(shape)}


def weighted_mean(values: Array, axis: int, weights: ArrayLike | None) -> Array:
    """Average along an axis; the weights need not sum to 1."""
    count = values.shape[axis] if values.ndim else 0
    w = np.ones(count) if weights is None else np.asarray(weights, dtype=float)
    if not count or w.shape != (count,) or not w.sum() > 0:
        raise StudyError(
            f"{count} values and weights of the shape {w.shape} are given; expected at least one value, and one "
            "weight for each with a positive sum."
        )
    return np.asarray(np.tensordot(w / w.sum(), values, axes=(0, axis)), dtype=float)
