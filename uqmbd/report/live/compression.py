"""Coefficients of a surrogate in few numbers: main components of what varies over time, as float32 where that does.

The terms of a chaos are orthonormal: what a compression loses, as a root mean square over the inputs, is the norm over
the terms of what it changes.  Columns are weighted by what may be lost there: components count where they are seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from uqmbd.report.charts import Kind, packed, unpacked
from uqmbd.typing import Array

__all__ = ["compressed", "expanded"]


TRUNCATED = 0.4
"""Part of what may be lost that components which are left out take; the rest is for rounding."""

ROUNDING = 1e-15
"""Part of the largest coefficient of an output that is always allowed."""


def compressed(coefficients: Array, allowed: Array) -> dict[str, Any]:
    """Compress coefficients of several elements.

    `coefficients` (E, P, O, C): of E elements, P terms, the first of which is the mean, O outputs, and C columns,
    mostly times; `allowed` (O, C): what may be lost in each element, as a root mean square over the inputs, in the
    units of the coefficients. Return ``base`` (O, C), to be added to the mean; for each output ``left`` (E, P, R) and
    ``right`` (R, C), whose product is the rest; or the rest as a whole, ``left`` (E, P, C), and ``right`` None, where
    that is shorter.
    """
    base = coefficients[:, 0].mean(axis=0)
    rest = coefficients.copy()
    rest[:, 0] -= base
    outputs = [_output(rest[:, :, k], allowed[k], float(np.abs(base[k]).max(initial=0))) for k in range(len(base))]
    return {"base": packed(base), "outputs": outputs}


def expanded(data: Mapping[str, Any]) -> Array:
    """Return the coefficients (E, P, O, C) that compressed ones stand for."""
    found = []
    for one in cast(Sequence[Mapping[str, Any]], data["outputs"]):
        left = unpacked(one["left"]).astype(float)
        found.append(left if one["right"] is None else left @ unpacked(one["right"]).astype(float))
    whole = np.stack(found, axis=2)
    whole[:, 0] += unpacked(data["base"])
    return whole


def _output(rest: Array, allowed: Array, size: float) -> dict[str, Any]:
    """Compress the coefficients (E, P, C) of one output."""
    elements, terms, columns = rest.shape
    least = ROUNDING * max(size, float(np.abs(rest).max(initial=0)))
    limit = np.maximum(allowed, least if least > 0 else 1.0)
    rows = rest.reshape(-1, columns)
    used = rows.any(axis=1)
    weighted = rows[used] / limit
    u, s, vt = np.linalg.svd(weighted, full_matrices=False)
    owner = np.repeat(np.arange(elements), terms)[used]

    def lasting(count: int) -> bool:
        """Return whether what is left out beyond some components is little in every element, at every column."""
        out = (u[:, count:] * s[count:]) @ vt[count:]
        starts = np.flatnonzero(np.r_[True, np.diff(owner) > 0])
        return not len(out) or bool(np.add.reduceat(out**2, starts).max() <= TRUNCATED**2)

    few, count = -1, len(s)
    while count - few > 1:
        middle = (few + count) // 2
        few, count = (few, middle) if lasting(middle) else (middle, count)
    shorter = count * (len(rows) + columns) < rows.size

    def fits(kind: Kind) -> dict[str, Any] | None:
        factors = [rest]
        if shorter:
            left = np.zeros((len(rows), count))
            left[used] = u[:, :count] * s[:count]
            factors = [left.reshape(elements, terms, count), vt[:count] * limit]
        with np.errstate(over="ignore", under="ignore"):
            stored = [x.astype(kind).astype(float) for x in factors]
        if not all(np.isfinite(x).all() for x in stored):
            return None
        made = stored[0] @ stored[1] if shorter else stored[0]
        lost = np.sqrt(((made - rest) ** 2).sum(axis=1)) / limit
        if lost.max(initial=0) > 1:
            return None
        return {"left": packed(factors[0], kind), "right": packed(factors[1], kind) if shorter else None}

    return fits("float32") or fits("float64") or {"left": packed(rest), "right": None}
