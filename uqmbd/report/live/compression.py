"""Compress coefficients of a surrogate: principal components over time, with the required number of digits.

The terms of a chaos are orthonormal. The root mean square error over the inputs is therefore the norm of the changes in
the coefficients. Each column is divided by its allowed error before the decomposition, so all columns share one limit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from uqmbd.report.charts import packed, packed_within, unpacked
from uqmbd.typing import Array

__all__ = ["compressed", "expanded"]


TRUNCATED = 0.4
"""Part of the allowed error for omitted components."""

STEPPED = 0.85
"""Part of the allowed error for the rounding of factors; its root sum of squares with `TRUNCATED` is below one."""

BASE = 0.1
"""Allowed difference of the base from the mean over the elements, relative to the allowed error."""

ROUNDING = 1e-15
"""Error that is always allowed, relative to the largest coefficient of an output."""


def compressed(coefficients: Array, allowed: Array, lags: Sequence[int] = ()) -> dict[str, Any]:
    """Compress coefficients of several elements.

    `coefficients` (E, P, O, C) belong to E elements, P terms (first the mean), O outputs, and C columns, mostly times.
    `allowed` (O, C) is the allowed error in each element, as a root mean square over the inputs, in the units of the
    coefficients. `lags` are possible distances of similar columns.

    Return ``base`` (C,), ``left`` (E, P, R) and ``right`` (R, C) for each output. The coefficients are the product of
    ``left`` and ``right``, plus ``base`` in the term of the mean. If it is shorter, ``left`` (E, P, C) is the product
    itself, and ``right`` is None.
    """
    outputs = [_output(coefficients[:, :, k], allowed[k], lags) for k in range(coefficients.shape[2])]
    return {"outputs": outputs}


def expanded(data: Mapping[str, Any]) -> Array:
    """Return the coefficients (E, P, O, C) from compressed coefficients."""
    found = []
    for one in cast(Sequence[Mapping[str, Any]], data["outputs"]):
        left = unpacked(one["left"]).astype(float)
        found.append(left if one["right"] is None else left @ unpacked(one["right"]).astype(float))
        found[-1][:, 0] += unpacked(one["base"])
    return np.stack(found, axis=2)


def _output(coefficients: Array, allowed: Array, lags: Sequence[int]) -> dict[str, Any]:
    """Compress the coefficients (E, P, C) of one output."""
    elements, terms, columns = coefficients.shape
    mean = coefficients[:, 0].mean(axis=0)
    rest = coefficients.copy()
    rest[:, 0] -= mean
    least = ROUNDING * max(float(np.abs(x).max(initial=0)) for x in (mean, rest))
    limit = np.maximum(allowed, least if least > 0 else 1.0)
    # the rest contains the rounding error of the base
    base = packed_within(mean, BASE * limit, lags=lags)
    rest[:, 0] += mean - unpacked(base)
    rows = rest.reshape(-1, columns)
    used = rows.any(axis=1)
    left, s, right = np.linalg.svd(rows[used] / limit, full_matrices=False)
    owner = np.repeat(np.arange(elements), terms)[used]

    def lasting(count: int) -> bool:
        """Return whether the remainder after `count` components is small in every element and column."""
        out = (left[:, count:] * s[count:]) @ right[count:]
        starts = np.flatnonzero(np.r_[True, np.diff(owner) > 0])
        return not len(out) or bool(np.add.reduceat(out**2, starts).max() <= TRUNCATED**2)

    few, count = -1, len(s)
    while count - few > 1:
        middle = (few + count) // 2
        few, count = (few, middle) if lasting(middle) else (middle, count)
    flat, v = np.zeros((len(rows), count)), s[:count, None] * right[:count] * limit
    flat[used] = left[:, :count]
    u = flat.reshape(elements, terms, count)
    # the errors of the terms or components add up as root sum of squares, so each has the allowed error over the root
    found: list[tuple[dict[str, Any], dict[str, Any] | None]] = [
        (packed_within(rest, limit / math.sqrt(terms)), None),
        (packed(u, "float32"), packed_within(v, STEPPED * limit / math.sqrt(max(count, 1)), lags=lags)),
        (packed(u), packed(v)),
    ]
    fits = [pair for pair in found if _lost(pair, rest, limit) <= 1]
    shortest = min(fits, key=lambda pair: len(str(pair)), default=(packed(rest), None))
    return {"base": base, "left": shortest[0], "right": shortest[1]}


def _lost(pair: tuple[dict[str, Any], dict[str, Any] | None], rest: Array, limit: Array) -> float:
    """Return the largest difference of the product of two factors from `rest` (E, P, C), over the allowed error."""
    left, right = pair
    made = unpacked(left).astype(float)
    if right is not None:
        made = made @ unpacked(right).astype(float)
    return float((np.sqrt(((made - rest) ** 2).sum(axis=1)) / limit).max(initial=0.0))
