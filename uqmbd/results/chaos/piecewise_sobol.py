"""Variance of the conditional expectation of a piecewise chaos, given some germs: exact, by overlaps of boxes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import Germ, GermBox

__all__ = ["closed_variance"]

Interval = tuple[float, float]


def closed_variance(
    coefficients: Array, multi_index: Index, boxes: Sequence[GermBox], mean: Array, germs: Sequence[int]
) -> Array:
    r"""Compute :math:`\mathrm{Var}(E[f | \xi_S])` of outputs that are a polynomial in each of some boxes.

    In the marginal box of an element over S the expectation over the other germs keeps the terms without these, with
    the probability of the element's other intervals as factor.  Where marginal boxes of elements overlap these add up,
    so that the expectation of the square is a sum over pairs of elements; its integrals of products of polynomials
    over overlaps are those of Gauss rules that are exact.

    Parameters
    ----------
    coefficients : array, shape (E, P, C)
        Of the local orthonormal polynomials of each element.
    multi_index : array of int, shape (P, d)
        Degrees, the mean first.
    boxes : sequence of GermBox, length E
        They fill the germ space.
    mean : array, shape (C,)
        Of the whole.
    germs : sequence of int
        S, the germs that are given.

    Returns
    -------
    array, shape (C,)
        The first-order Sobol' index of S times the variance.

    References
    ----------
    I. M. Sobol', Mathematics and Computers in Simulation 55 (2001) 271-280 (indices of groups of variables).
    """
    given = list(germs)
    others = [k for k in range(multi_index.shape[1]) if k not in given]
    kept = ~np.any(multi_index[:, others] > 0, axis=1)
    index = multi_index[kept][:, given]
    sums: dict[tuple[Interval, ...], Array] = {}
    for box, local in zip(boxes, coefficients, strict=True):
        part = local[kept].copy()
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
    from uqmbd.randomness import cumulated, truncated

    found = np.zeros((degree + 1, degree + 1))
    low, high = max(one[0], other[0]), min(one[1], other[1])
    first = 0.0 if low <= germ.bounds[0] else float(cumulated(germ, low))
    probability = float(cumulated(germ, high)) - first
    if not (low < high and probability > 0):
        return found
    overlap = truncated(germ, low, high)
    nodes, weights = overlap.gauss(min(degree + 1, overlap.values or degree + 1))
    values = []
    for ends in (one, other):
        local = truncated(germ, *ends)
        known = min(degree, (local.values or degree + 1) - 1)
        psi = np.zeros((len(nodes), degree + 1))
        psi[:, : known + 1] = local.polynomials(nodes, known)
        values.append(psi)
    return np.asarray(probability * (values[0] * weights[:, None]).T @ values[1])
