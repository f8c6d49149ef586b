"""Statistics of angles, which must not be averaged like plain numbers.

:func:`scipy.stats.circmean` and ``circstd`` take no weights (those of a quadrature), return a direction where there is
none, and lose the digits of small deviations: the deviation of 1e-9 and -1e-9 is 0 to them.
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
"""Below this length, relative to single directions, a mean direction is rounding."""

BLOCK_NUMBERS = 1_000_000
"""Angles (8 bytes each) that are averaged at once."""


@typechecked
def circular_mean(angles: ArrayLike, axis: Axis = 0, weights: ArrayLike | None = None) -> Array:
    """Return the direction of the mean of the unit vectors of angles.

    Parameters
    ----------
    angles : array_like
        In radians.
    axis : int
        Along which to average.
    weights : array_like, shape (S,), optional
        Of the S angles along `axis`; default all alike. They need not sum to 1.

    Returns
    -------
    array
        Without `axis`, in radians, in (-pi, pi]; NaN where the directions cancel, so that no mean exists.

    Raises
    ------
    StudyError
        If there are no angles, or the weights have another number or no positive sum.

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

    Of a normal angle wrapped around the circle it is the standard deviation of the normal, however wide that is.

    Parameters
    ----------
    angles : array_like
        In radians.
    axis : int
        Along which to average.
    weights : array_like, shape (S,), optional
        As for :func:`circular_mean`.

    Returns
    -------
    array
        Without `axis`, in radians; infinite where the directions cancel.

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
    # R = mean cos(angle - mean) = 1 - lack: no digits are lost for small deviations
    lack = weighted_mean(2.0 * np.sin((given - np.expand_dims(mean, axis)) / 2.0) ** 2, axis, weights)
    std = np.sqrt(-2.0 * np.log1p(-np.where(np.isnan(mean), 0.0, np.minimum(lack, 1.0 - ROUNDING))))
    return np.where(np.isnan(mean), np.inf, std + 0.0)


@typechecked
def circular_of_components(mean_cosine: ArrayLike, mean_sine: ArrayLike) -> tuple[Array, Array]:
    """Return circular mean and standard deviation from the means of cosine and sine.

    Made for a chaos whose outputs are the cosine and the sine of an angle: the statistics of the angle come straight
    from the two means, exact where those are.

    `mean_cosine`, `mean_sine` (...): expectations of the cosine and of the sine, as two rows of
    `PolynomialChaos.mean`. Return (...): in radians; as of :func:`circular_mean` and :func:`circular_std`.

    >>> mean, std = circular_of_components(0.0, 1.0)
    >>> float(mean.round(6)), float(std)
    (1.570796, 0.0)
    """
    c, s = np.asarray(mean_cosine, dtype=float), np.asarray(mean_sine, dtype=float)
    length = np.hypot(c, s)
    cancels = length <= ROUNDING
    mean = np.where(cancels, np.nan, np.arctan2(s, c))
    safe = np.where(cancels, 1.0, length)
    # rounding may carry a length past 1 by some last bits (and -0.0 is no deviation)
    std = np.where(cancels, np.inf, np.sqrt(np.maximum(-2.0 * np.log(safe), 0.0)))
    return np.where(mean == -np.pi, np.pi, mean), std


@typechecked
def unwrap_samples(angles: ArrayLike, axis: Axis = -1) -> Array:
    """Make the angles of samples continuous in time, and bring the samples near one another at the first time.

    Each sample loses its jumps of a full turn along `axis`; then whole turns are added to it, so that its first angle
    lies within half a turn of the circular mean of all first angles. Then plain means and deviations make sense as
    long as the samples stay together within some turns; and a chaos of the angle is smooth.

    Parameters
    ----------
    angles : array_like, shape (S, ...) with the times along `axis`
        In radians, samples along the first axis. Failed samples (NaN) stay NaN.
    axis : int
        Of the times; not the first. Times must be so dense that no true step passes half a turn.

    Returns
    -------
    array, shape (S, ...)
        In radians.

    Raises
    ------
    StudyError
        If there is no axis of times besides that of the samples.

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
            f"Samples must lie along the first axis and times along another; shape {given.shape} with the times along "
            f"axis {axis} was given."
        )
    moved = np.moveaxis(np.unwrap(given, axis=axis), axis, -1)
    first = moved[..., 0]
    known = np.isfinite(first)
    count = np.maximum(known.sum(axis=0), 1)
    cosine = np.where(known, np.cos(np.where(known, first, 0.0)), 0.0).sum(axis=0) / count
    sine = np.where(known, np.sin(np.where(known, first, 0.0)), 0.0).sum(axis=0) / count
    centre = circular_of_components(cosine, sine)[0]
    # directions that cancel have no centre: angles stay within half a turn of zero
    centre = np.where(np.isnan(centre), 0.0, centre)
    turns = np.round((first - centre) / (2.0 * np.pi))
    return np.moveaxis(moved - 2.0 * np.pi * turns[..., None], -1, axis)


def circular_of_samples(response: Array, turns: Array) -> dict[str, Array]:
    """Average the directions of samples.

    `response` (S, O, T): finite, in the units of the outputs; `turns` (O,): length of a turn in these units; 0: the
    output is no angle. Return ``circular_mean`` and ``circular_std``, shape (O, T) or (O,), in the units of the
    outputs, NaN for those that are no angles; empty where none is. Made for ``statistics_dataset(labels, **it)``.

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
    """Compute `circular_of_samples` from samples (S, t) that a function returns for an output and a slice of times.

    The shape of the outputs is (O, T) or (O,), `count` is S.
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
            f"A mean needs at least one value, and weights of positive sum, one for each; {count} values and weights "
            f"of the shape {w.shape} were given."
        )
    return np.asarray(np.tensordot(w / w.sum(), values, axes=(0, axis)), dtype=float)
