"""Sobol' indices of a polynomial chaos: shares of the sum of squared coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.results.chaos.moments import column_blocks, constant_columns, standard_deviation
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask

__all__ = ["first_order_masks", "interaction_mask", "second_order_masks", "total_order_masks", "variance_shares"]


def first_order_masks(multi_index: Index) -> Mask:
    """Mark, for each germ, the terms (d, P) that involve it alone."""
    involved = multi_index > 0
    return np.asarray((involved & (involved.sum(axis=1, keepdims=True) == 1)).T)


def total_order_masks(multi_index: Index) -> Mask:
    """Mark, for each germ, the terms (d, P) that involve it."""
    return (multi_index > 0).T


def interaction_mask(multi_index: Index, columns: Sequence[int]) -> Mask:
    """Mark the terms (P,) that involve all of the given germs and no other."""
    wanted = np.zeros(multi_index.shape[1], dtype=bool)
    wanted[list(columns)] = True
    return np.asarray(np.all((multi_index > 0) == wanted, axis=1))


def second_order_masks(multi_index: Index) -> Mask:
    """Mark, for each pair of different germs (in the order of ``numpy.triu_indices(d, 1)``), its terms."""
    pairs = np.stack(np.triu_indices(multi_index.shape[1], 1), axis=1).tolist()
    masks = [interaction_mask(multi_index, pair) for pair in pairs]
    return np.array(masks, dtype=bool).reshape(-1, len(multi_index))


def variance_shares(coefficients: Array, masks: Mask, std: Array | None = None) -> Array:
    """Return which share of the variance each group of terms carries.

    Parameters
    ----------
    coefficients : array, shape (P, C)
        Of an orthonormal basis; row 0 is the mean.
    masks : array of bool, shape (G, P)
        The terms of each group.
    std : array, shape (C,), optional
        Standard deviation, if it is known already.

    Returns
    -------
    array, shape (G, C)
        From 0 to 1; 0 where a column does not vary (to rounding of its mean): there is no variance to share.

    Examples
    --------
    >>> import numpy as np
    >>> coefficients = np.array([[5.0, 5.0], [3.0, 0.0], [4.0, 0.0]])
    >>> variance_shares(coefficients, np.array([[False, True, False]])).tolist()
    [[0.36, 0.0]]
    """
    deviation = standard_deviation(coefficients) if std is None else std
    constant = constant_columns(coefficients, deviation)
    divisor = np.where(constant, 1.0, deviation)
    weights = masks[:, 1:].astype(float)
    found = np.empty((len(masks), coefficients.shape[1]))
    with one_thread():
        for part in column_blocks(coefficients.shape[1], len(coefficients)):
            unit = coefficients[1:, part] / divisor[part]
            np.matmul(weights, np.square(unit, out=unit), out=found[:, part])
    found[:, constant] = 0.0
    # sums of shares may pass 1 by their last bits
    return np.minimum(found, 1.0)
