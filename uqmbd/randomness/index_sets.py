"""Index sets: the products of one-dimensional polynomials in a polynomial chaos."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.typing import Index

__all__ = ["KINDS", "index_set", "sort_indices", "whole_number"]


KINDS = ("total", "tensor", "hyperbolic")
"""Kinds of index sets."""

MOST_TERMS = 1_000_000
"""Largest number of terms of a basis; using a larger basis would fill any memory."""

ROUNDING = 1e-9
"""Relative tolerance of the comparison of a weighted sum with the order."""


@typechecked
def index_set(
    dimension: int, order: int, kind: str = "total", weights: Sequence[float] | None = None, q: float = 0.5
) -> Index:
    """Return the degrees of all terms of a polynomial chaos.

    A row ``a`` belongs to the set if ``w * a`` has, with the weights ``w``,

    - ``"total"``: a sum of at most `order` (for weights of one there are ``binomial(dimension + order, order)`` rows),
    - ``"tensor"``: a maximum of at most `order`,
    - ``"hyperbolic"``: a quasi-norm ``(sum((w * a)**q))**(1 / q)`` of at most `order`, which excludes high
      interactions (Blatman and Sudret, J. Comput. Phys. 230 (2011) 2345).

    The algorithm constructs only members of the set, so it needs only the memory of the result.

    Parameters
    ----------
    dimension : int
        Number of germs, ``d``.
    order : int
        Highest degree, zero or more.
    kind : {"total", "tensor", "hyperbolic"}
        Kind of the set.
    weights : sequence of float, length d, optional
        Positive weights of an anisotropic set: a germ of weight 2 gets half the order. By default, all are one.
    q : float
        Exponent of the quasi-norm of ``"hyperbolic"``, between 0 (exclusive) and 1; 1 gives the total degree.

    Returns
    -------
    array of int, shape (P, d)
        Degrees of the terms. Row 0 is zero; rows are sorted by total degree, and then earlier germs come first.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid, or there would be more than a million terms.

    Examples
    --------
    >>> index_set(2, 2).tolist()
    [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]]
    >>> index_set(2, 2, "hyperbolic").tolist()
    [[0, 0], [1, 0], [0, 1], [2, 0], [0, 2]]
    >>> index_set(2, 3, weights=[1, 3]).tolist()
    [[0, 0], [1, 0], [0, 1], [2, 0], [3, 0]]
    >>> len(index_set(20, 3))
    1771
    """
    count = whole_number(dimension, "index_set: dimension (the number of germs)", 0)
    if count > MOST_TERMS:
        raise StudyError(f"index_set: dimension is {shown(count)}; expected a whole number up to {MOST_TERMS}.")
    degree = whole_number(order, "index_set: order", 0)
    if kind not in KINDS:
        raise StudyError(f"index_set: kind is {kind!r}; expected one of {', '.join(KINDS)}.")
    scale = np.ones(count) if weights is None else np.array(weights, dtype=float)
    if scale.shape != (count,) or not np.all(np.isfinite(scale) & (scale > 0)):
        raise StudyError(f"index_set: weights is {weights!r}; expected {count} positive numbers, one for each germ.")
    if not 0 < q <= 1:
        raise StudyError(f"index_set: q is {q!r}; expected a number above 0 and at most 1.")
    power = q if kind == "hyperbolic" else 1.0
    if degree > MOST_TERMS:
        raise StudyError(f"index_set: order is {shown(degree)}; expected a whole number up to {MOST_TERMS}.")
    budget = float(degree) ** power

    rows: Index = np.zeros((1, 0), dtype=np.int64)
    spent = np.zeros(1)
    for weight in scale:
        highest = int(np.floor(degree / weight + ROUNDING))
        cost = (weight * np.arange(highest + 1)) ** power
        if kind == "tensor":
            allowed = np.full(len(rows), highest + 1)
        else:
            left = (budget - spent) + ROUNDING * max(budget, 1.0)
            allowed = np.searchsorted(cost, left, side="right")
        # following germs extend every row, so the number of rows cannot decrease
        if int(allowed.sum()) > MOST_TERMS:
            raise StudyError(
                f"index_set: the {kind} set of order {degree} has more than {MOST_TERMS} terms for {count} inputs; "
                f"use a lower order{', or use the total set' if kind == 'tensor' else ''}, or weights."
            )
        before = np.repeat(np.arange(len(rows)), allowed)
        digit = np.arange(len(before)) - np.repeat(np.cumsum(allowed) - allowed, allowed)
        rows = np.column_stack([rows[before], digit])
        spent = spent[before] + cost[digit]
    return sort_indices(rows)


def sort_indices(rows: Index) -> Index:
    """Sort rows by their total degree, and then with earlier columns first.

    >>> sort_indices(np.array([[0, 1], [1, 0], [0, 0]])).tolist()
    [[0, 0], [1, 0], [0, 1]]
    """
    keys = [-rows[:, k] for k in reversed(range(rows.shape[1]))] + [rows.sum(axis=1)]
    return np.ascontiguousarray(rows[np.lexsort(keys)])


def whole_number(value: object, what: str, least: int) -> int:
    """Return `value` as an int; raise StudyError if it is not a whole number of at least `least`.

    >>> whole_number(3, "order", 0)
    3
    >>> whole_number(-1, "order", 0)
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: order is -1; expected a whole number of at least 0.
    """
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or int(value) < least:  # type: ignore[call-overload]
        raise StudyError(f"{what} is {value!r}; expected a whole number of at least {least}.")
    return int(value)  # type: ignore[call-overload,no-any-return]
