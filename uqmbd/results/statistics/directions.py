"""Compute mean and standard deviation of directions and of rotations.

:func:`scipy.stats.directional_stats` accepts no weights, such as weights of a quadrature, and returns a direction even
if directions cancel. :meth:`scipy.spatial.transform.Rotation.mean` also returns a rotation if rotations cancel, and
accepts stacks of rotations only from SciPy 1.17 on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import Axis, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.statistics.circular import ROUNDING, weighted_mean
from uqmbd.typing import Array

__all__ = ["mean_direction", "mean_rotation", "rotation_std"]


@typechecked
def mean_direction(vectors: ArrayLike, axis: Axis = 0, weights: ArrayLike | None = None) -> tuple[Array, Array]:
    """Return the mean direction of vectors, and the mean resultant length.

    Parameters
    ----------
    vectors : array_like, shape (S, ..., N)
        Vectors, with components along the last axis; their lengths have no effect.
    axis : int
        Axis along which to average; not the last.
    weights : array_like, shape (S,), optional
        Weights of the vectors. Default: equal weights.

    Returns
    -------
    direction : array, shape (..., N)
        Unit vector; NaN if the directions cancel.
    length : array, shape (...)
        Mean resultant length, from 0 (the directions cancel) to 1 (they agree).

    Raises
    ------
    StudyError
        If there are no vectors, one has zero length, or the weights do not fit.

    Examples
    --------
    >>> direction, length = mean_direction([[2.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    >>> direction.round(6).tolist(), float(length.round(6))
    ([0.707107, 0.707107, 0.0], 0.707107)
    """
    given = np.asarray(vectors, dtype=float)
    if given.ndim < 2 or axis in (-1, given.ndim - 1):
        raise StudyError(
            f"The vectors have the shape {given.shape}; expected (S, ..., N), with the components along the last axis."
        )
    mean = weighted_mean(_unit_vectors(given, "vector"), axis, weights)
    length = np.linalg.norm(mean, axis=-1)
    cancels = length <= ROUNDING
    direction = np.where(cancels[..., None], np.nan, mean / np.where(cancels, 1.0, length)[..., None])
    return direction, np.minimum(length, 1.0)


@typechecked
def mean_rotation(quaternions: ArrayLike, axis: Axis = 0, weights: ArrayLike | None = None) -> Array:
    """Return the mean of rotations: the quaternion with the least mean square (chordal) distance from all rotations.

    The mean is the eigenvector of the largest eigenvalue of the mean of ``q q^T`` [1]_. Opposite quaternions q and -q
    describe the same rotation, and have the same matrix ``q q^T``.

    Parameters
    ----------
    quaternions : array_like, shape (S, ..., 4)
        Quaternions with the components in any fixed order; their lengths and signs have no effect.
    axis : int
        Axis along which to average; not the last.
    weights : array_like, shape (S,), optional
        Weights of the quaternions. Default: equal weights.

    Returns
    -------
    array, shape (..., 4)
        Unit quaternion whose largest component is positive; NaN if no single rotation is nearest.

    Raises
    ------
    StudyError
        If there are no quaternions, one has zero length, or the weights do not fit.

    References
    ----------
    .. [1] F. L. Markley, Y. Cheng, J. L. Crassidis and Y. Oshman, Averaging quaternions, Journal of Guidance, Control,
       and Dynamics 30 (2007) 1193-1197.

    Examples
    --------
    >>> mean_rotation([[1.0, 0.1, 0.0, 0.0], [-1.0, 0.1, 0.0, 0.0]]).round(9).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    given = np.asarray(quaternions, dtype=float)
    if given.ndim < 2 or given.shape[-1] != 4 or axis in (-1, given.ndim - 1):
        raise StudyError(
            f"The quaternions have the shape {given.shape}; expected (S, ..., 4), with four components "
            "along the last axis."
        )
    unit = np.moveaxis(_unit_vectors(given, "quaternion"), axis, 0)
    moment = weighted_mean(unit[..., :, None] * unit[..., None, :], 0, weights)
    values, vectors = np.linalg.eigh(moment)
    found = vectors[..., -1]
    largest = np.take_along_axis(found, np.abs(found).argmax(axis=-1)[..., None], axis=-1)
    tie = (values[..., -1] - values[..., -2] <= ROUNDING)[..., None]
    return np.where(tie, np.nan, found * np.sign(largest)) + 0.0


@typechecked
def rotation_std(quaternions: ArrayLike, axis: Axis = 0, weights: ArrayLike | None = None) -> Array:
    """Return the root mean square of the angles between rotations and their mean.

    Parameters
    ----------
    quaternions, axis, weights
        Quaternions, axis and weights, as for :func:`mean_rotation`.

    Returns
    -------
    array, shape (...)
        Root mean square angle, rad, from 0 to pi; NaN if there is no mean.

    Examples
    --------
    >>> import numpy as np
    >>> a = 0.1
    >>> turns = [[np.cos(a / 2), np.sin(a / 2), 0.0, 0.0], [np.cos(a / 2), -np.sin(a / 2), 0.0, 0.0]]
    >>> float(rotation_std(turns).round(9))
    0.1
    """
    mean = np.expand_dims(mean_rotation(quaternions, axis, weights), axis)
    unit = _unit_vectors(np.asarray(quaternions, dtype=float), "quaternion")
    cosine = np.abs(np.sum(unit * mean, axis=-1, keepdims=True))
    # use the sine, too, because an arc cosine loses half the digits of small angles
    sine = np.linalg.norm(unit - np.sum(unit * mean, axis=-1, keepdims=True) * mean, axis=-1, keepdims=True)
    square = (2.0 * np.arctan2(sine, cosine)) ** 2
    result: Array = np.sqrt(weighted_mean(square, axis, weights)[..., 0])
    return result


def _unit_vectors(vectors: Array, name: str) -> Array:
    """Scale vectors (..., N) to length 1."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if np.any(length == 0):
        raise StudyError(
            f"The {name} with the index {int(np.argmin(length))} has length zero, so it has no direction; expected "
            "non-zero values."
        )
    return np.asarray(vectors / length)
