"""Mean and deviation of rotations."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.results.statistics.circular import ROUNDING, unit_vectors, weighted_mean
from uqmbd.typing import Array

__all__ = ["mean_rotation", "rotation_std"]


def mean_rotation(quaternions: ArrayLike, axis: int = 0, weights: ArrayLike | None = None) -> Array:
    """Return the mean of rotations: the quaternion with the least mean square (chordal) distance from all of them.

    It is the eigenvector of the largest eigenvalue of the mean of ``q q^T`` [1]_, to which q and -q, the same rotation,
    are the same.

    Parameters
    ----------
    quaternions : array_like, shape (S, ..., 4)
        Their lengths and signs do not count; either order of the components will do.
    axis : int
        Along which to average; not the last.
    weights : array_like, shape (S,), optional
        Default all alike.

    Returns
    -------
    array, shape (..., 4)
        Of unit length, its largest component positive; NaN where no single rotation is nearest.

    Raises
    ------
    StudyError
        If a quaternion has no length, there are none, or the weights do not fit.

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
        raise StudyError(f"Quaternions need four components along the last axis, (S, ..., 4); found {given.shape}.")
    unit = np.moveaxis(unit_vectors(given, "quaternion"), axis, 0)
    moment = weighted_mean(unit[..., :, None] * unit[..., None, :], 0, weights)
    values, vectors = np.linalg.eigh(moment)
    found = vectors[..., -1]
    largest = np.take_along_axis(found, np.abs(found).argmax(axis=-1)[..., None], axis=-1)
    tie = (values[..., -1] - values[..., -2] <= ROUNDING)[..., None]
    return np.where(tie, np.nan, found * np.sign(largest)) + 0.0


def rotation_std(quaternions: ArrayLike, axis: int = 0, weights: ArrayLike | None = None) -> Array:
    """Return the root mean square of the angles between rotations and their mean.

    Parameters
    ----------
    quaternions, axis, weights
        As for :func:`mean_rotation`.

    Returns
    -------
    array, shape (...)
        In radians, from 0 to pi; NaN where there is no mean.

    Examples
    --------
    >>> import numpy as np
    >>> a = 0.1
    >>> turns = [[np.cos(a / 2), np.sin(a / 2), 0.0, 0.0], [np.cos(a / 2), -np.sin(a / 2), 0.0, 0.0]]
    >>> float(rotation_std(turns).round(9))
    0.1
    """
    mean = np.expand_dims(mean_rotation(quaternions, axis, weights), axis)
    unit = unit_vectors(np.asarray(quaternions, dtype=float), "quaternion")
    cosine = np.abs(np.sum(unit * mean, axis=-1, keepdims=True))
    # by the sine too: an arc cosine loses half the digits of small angles
    sine = np.linalg.norm(unit - np.sum(unit * mean, axis=-1, keepdims=True) * mean, axis=-1, keepdims=True)
    square = (2.0 * np.arctan2(sine, cosine)) ** 2
    result: Array = np.sqrt(weighted_mean(square, axis, weights)[..., 0])
    return result
