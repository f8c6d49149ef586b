"""Compute Sobol' indices of chaoses from squared coefficients, or from exact integrals over elements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.results.chaos.terms.moments import column_blocks, constant_columns, standard_deviation
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import Germ, GermBox

__all__ = [
    "closed_variance",
    "first_order_masks",
    "interaction_mask",
    "second_order_masks",
    "total_order_masks",
    "variance_shares",
]

Interval = tuple[float, float]


def first_order_masks(multi_index: Index) -> Mask:
    """Return masks (d, P) of terms that involve only one germ, for each germ."""
    involved = multi_index > 0
    return np.asarray((involved & (involved.sum(axis=1, keepdims=True) == 1)).T)


def total_order_masks(multi_index: Index) -> Mask:
    """Return masks (d, P) of terms that involve a germ, for each germ."""
    return (multi_index > 0).T


def interaction_mask(multi_index: Index, columns: Sequence[int]) -> Mask:
    """Return the mask (P,) of terms that involve all given germs and no other germ."""
    involved = np.zeros(multi_index.shape[1], dtype=bool)
    involved[list(columns)] = True
    return np.asarray(np.all((multi_index > 0) == involved, axis=1))


def second_order_masks(multi_index: Index) -> Mask:
    """Return masks of terms that involve only a pair of germs, in the order of ``numpy.triu_indices(d, 1)``."""
    pairs = np.stack(np.triu_indices(multi_index.shape[1], 1), axis=1).tolist()
    masks = [interaction_mask(multi_index, pair) for pair in pairs]
    return np.array(masks, dtype=bool).reshape(-1, len(multi_index))


def variance_shares(coefficients: Array, masks: Mask, std: Array | None = None) -> Array:
    """Return the share of the variance of each group of terms.

    `coefficients` (P, C): coefficients in an orthonormal basis, with the mean in row 0; `masks` (G, P): terms of each
    group; `std` (C,): standard deviation, if known. The shares (G, C) are from 0 to 1. They are 0 for a column that is
    constant within the rounding of its mean.

    >>> import numpy as np
    >>> coefficients = np.array([[5.0, 5.0], [3.0, 0.0], [4.0, 0.0]])
    >>> variance_shares(coefficients, np.array([[False, True, False]])).tolist()
    [[0.36, 0.0]]
    """
    deviation = standard_deviation(coefficients) if std is None else std
    constant = constant_columns(coefficients[0], deviation, len(coefficients))
    divisor = np.where(constant, 1.0, deviation)
    weights = masks[:, 1:].astype(float)
    found = np.empty((len(masks), coefficients.shape[1]))
    with one_thread():
        for part in column_blocks(coefficients.shape[1], len(coefficients)):
            unit = coefficients[1:, part] / divisor[part]
            np.matmul(weights, np.square(unit, out=unit), out=found[:, part])
    found[:, constant] = 0.0
    # rounding may raise sums of shares above 1
    return np.minimum(found, 1.0)


def closed_variance(
    coefficients: Array, multi_index: Index, boxes: Sequence[GermBox], mean: Array, germs: Sequence[int]
) -> Array:
    """Compute Var(E[f | germs]) (C,) of piecewise polynomial outputs (E, P, C) in boxes that fill the germ space."""
    # The expectation of an element over the other germs consists of its terms without these germs, times the
    # probability of its intervals in these germs. Expectations add up where marginal boxes of elements overlap. The
    # expectation of the square is therefore a sum over pairs of elements. Gauss rules integrate the products of
    # polynomials over overlaps exactly. Indices of groups of variables: I. M. Sobol', Mathematics and Computers in
    # Simulation 55 (2001) 271-280.
    given = list(germs)
    others = [k for k in range(multi_index.shape[1]) if k not in given]
    included = ~np.any(multi_index[:, others] > 0, axis=1)
    index = multi_index[included][:, given]
    sums: dict[tuple[Interval, ...], Array] = {}
    for box, local in zip(boxes, coefficients, strict=True):
        part = local[included].copy()
        part[0] -= mean
        part *= np.prod([box.probabilities[k] for k in others])
        key = tuple((box.lower[k], box.upper[k]) for k in given)
        sums[key] = sums[key] + part if key in sums else part
    whole = [boxes[0].space.germs[k] for k in given]
    tables: dict[tuple[int, Interval, Interval], Array] = {}
    total = np.zeros(len(mean))
    keys = list(sums)
    for place, one in enumerate(keys):
        for other in keys[place:]:
            matrix = np.ones((len(index), len(index)))
            for k, germ in enumerate(whole):
                pair = (k, one[k], other[k])
                if pair not in tables:
                    tables[pair] = _products(germ, one[k], other[k], int(index[:, k].max(initial=0)))
                table = tables[pair]
                if not table.any():
                    break
                matrix = matrix * table[np.ix_(index[:, k], index[:, k])]
            else:
                part = np.einsum("pc,pc->c", sums[one], matrix @ sums[other])
                total += part if one == other else 2 * part
    return total


def _products(germ: Germ, one: Interval, other: Interval, degree: int) -> Array:
    """Integrate products of the polynomials of two intervals of a germ over their overlap, shape (degree + 1, same)."""
    from uqmbd.randomness import cumulated, truncate_germ

    found = np.zeros((degree + 1, degree + 1))
    low, high = max(one[0], other[0]), min(one[1], other[1])
    first = 0.0 if low <= germ.bounds[0] else float(cumulated(germ, low))
    probability = float(cumulated(germ, high)) - first
    if not (low < high and probability > 0):
        return found
    overlap = truncate_germ(germ, low, high)
    nodes, weights = overlap.gauss(min(degree + 1, overlap.values or degree + 1))
    values = []
    for ends in (one, other):
        local = truncate_germ(germ, *ends)
        known = min(degree, (local.values or degree + 1) - 1)
        psi = np.zeros((len(nodes), degree + 1))
        psi[:, : known + 1] = local.polynomials(nodes, known)
        values.append(psi)
    return np.asarray(probability * (values[0] * weights[:, None]).T @ values[1])
