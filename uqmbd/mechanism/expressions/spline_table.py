"""Table of a spline: knots, values and evaluation."""

from __future__ import annotations

import base64
import hashlib
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from uqmbd.mechanism.expressions.computable import FunctionData
from uqmbd.typing import Array

__all__ = ["LOOKED_UP", "SplineTable", "polynomial", "table_of"]


BOUNDARY = {"not-a-knot": "not-a-knot", "natural": "natural", "flat": "clamped", "periodic": "periodic"}
"""End conditions and their names in SciPy."""
SLIVER = 1e-12
"""Length beyond the ends, relative to the length of the table, that counts as rounding and as inside the table."""
LOOKED_UP = 5
"""Numbers per interval: its begin, and the coefficients of the cubic about the begin, constant first."""


class SplineTable(FunctionData):
    """Knots and values of a spline as an atom of expressions; tables with the same numbers are equal."""

    knots: Array  # (n,), ascending
    values: Array  # (n, 1 + M): one column for the constant, one column for each of the M terms
    ends: str  # "not-a-knot", "natural", "flat" or "periodic"
    beyond: str  # "constant" or "linear"; unused if periodic
    digest: str

    def __new__(cls, knots: Array, values: Array, ends: str, beyond: str) -> SplineTable:
        """Copy and store the numbers."""
        self: SplineTable = super().__new__(cls)
        self.knots = np.array(knots, dtype=float)
        self.values = np.array(values, dtype=float)
        self.ends, self.beyond = ends, beyond
        about = repr((self.values.shape, ends, beyond)).encode()
        self.digest = hashlib.sha256(about + self.knots.tobytes() + self.values.tobytes()).hexdigest()
        return self

    def _hashable_content(self) -> tuple[Any, ...]:
        return (self.digest,)

    def __reduce__(self) -> tuple[Any, ...]:
        return (SplineTable, (self.knots, self.values, self.ends, self.beyond))

    @property
    def name(self) -> str:
        """Name of the look-up function; equal tables have equal names."""
        return f"_table{self.digest[:24]}"

    @cached_property
    def rows(self) -> Array:
        """Rows of coefficients, shape (n + 1, 1 + M, LOOKED_UP): below the table, in its intervals, above the table."""
        from scipy.interpolate import CubicSpline

        x, y = self.knots, self.values
        cubic = np.asarray(CubicSpline(x, y, bc_type=BOUNDARY[self.ends]).c)  # (4, n - 1, 1 + M)
        rows = np.zeros((len(x) + 1, y.shape[1], LOOKED_UP))
        rows[1:-1, :, 1:] = np.moveaxis(cubic[::-1], 0, -1)
        rows[:, 0, 0] = np.concatenate([x[:1], x])
        rows[0, :, 1], rows[-1, :, 1] = y[0], y[-1]
        if self.beyond == "linear":
            rows[0, :, 2] = rows[1, :, 2]
            h = x[-1] - x[-2]
            rows[-1, :, 2] = rows[-2, :, 2] + h * (2 * rows[-2, :, 3] + 3 * h * rows[-2, :, 4])
        return rows

    @cached_property
    def edges(self) -> Array:
        """Lower ends of the intervals; the end knots are inside the table."""
        edges = self.knots.copy()
        sliver = SLIVER * (edges[-1] - edges[0])
        edges[0], edges[-1] = edges[0] - sliver, np.nextafter(edges[-1] + sliver, np.inf)
        return edges

    @property
    def period(self) -> float:
        """Period of the table, which begins at its first knot; 0 for a table that is not periodic."""
        return float(self.knots[-1] - self.knots[0]) if self.ends == "periodic" else 0.0

    @cached_property
    def deviations(self) -> Array:
        """Deviation of the next interval from the cubic before each knot, divided by the range of the values."""
        x = self.knots
        cubic = self.rows[1:-1, :, 4]
        before, after = cubic[:-1], cubic[1:]
        inside = np.maximum(np.diff(x)[:-1], np.diff(x)[1:])[:, None] ** 3 * np.abs(after - before)
        found = np.zeros((len(x), cubic.shape[1]))
        found[1:-1] = inside
        if self.ends == "periodic":
            found[0] = max(x[1] - x[0], x[-1] - x[-2]) ** 3 * np.abs(cubic[0] - cubic[-1])
        size = np.ptp(self.values, axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.where(found > 0, found / size, 0.0).max(axis=1))

    @property
    def breaks(self) -> tuple[float, ...]:
        """End knots at which the slope or the curvature jumps."""
        if self.ends == "periodic" or (self.ends == "natural" and self.beyond == "linear"):
            return ()
        return float(self.knots[0]), float(self.knots[-1])

    @property
    def corners(self) -> tuple[float, ...]:
        """End knots at which the slope jumps."""
        return () if self.ends == "flat" or self.beyond == "linear" else self.breaks

    def look_up(self, x: Array, terms: Array | None = None) -> Array:
        """Return the lower end of the interval and the coefficients of its cubic, (K, LOOKED_UP), for arguments (K,).

        The values of the terms (K, M), if there are any, multiply the columns of the table.
        """
        if self.ends == "periodic":
            first, period = self.knots[0], self.knots[-1] - self.knots[0]
            with np.errstate(invalid="ignore"):
                turns = np.floor((x - first) / period) * period
                which = np.clip(self.edges.searchsorted(x - turns, "right"), 1, len(self.knots) - 1)
        else:
            turns, which = None, self.edges.searchsorted(x, "right")
        if terms is None:
            found: Array = self.rows[which, 0]
        else:
            some = self.rows[which]
            found = some[:, 0] + np.einsum("km,kmc->kc", terms, some[:, 1:])
        if turns is not None:
            found[:, 0] += turns
        return found

    def value(self, x: Array, order: int, terms: Array | None = None) -> Array:
        """Return values of the spline or of a derivative, shape (K,); arguments as for `look_up`."""
        knot, c0, c1, c2, c3 = self.look_up(np.asarray(x, dtype=float), terms).T
        result: Array = polynomial(order, x - knot, c0, c1, c2, c3)
        return result

    def folded(self, terms: dict[int, float]) -> SplineTable:
        """Return the table after replacement of terms by given numbers, by index of the term."""
        values = self.values.copy()
        for k, number in terms.items():
            values[:, 0] += number * values[:, 1 + k]
        return SplineTable(self.knots, np.delete(values, [1 + k for k in terms], axis=1), self.ends, self.beyond)

    def _sympystr(self, printer: Any) -> str:
        return f"table{self.digest}"

    def _sympyrepr(self, printer: Any) -> str:
        return f"SplineTable({self.digest!r})"

    def _latex(self, printer: Any) -> str:
        return r"\mathrm{table}"

    def _text(self, printer: Any) -> str:
        """Return the table as a string literal in the source of a function for `sympy.lambdify`."""
        numbers = base64.b64encode(np.column_stack([self.knots, self.values]).tobytes()).decode()
        return repr(f"{len(self.knots)} {self.ends} {self.beyond} {numbers}")

    _pythoncode = _numpycode = _scipycode = _mpmathcode = _lambdacode = _text


@lru_cache(maxsize=64)
def table_of(text: str) -> SplineTable:
    """Return the table from the string that `_text` wrote for `sympy.lambdify`."""
    count, ends, beyond, rest = text.split(" ")
    stored = np.frombuffer(base64.b64decode(rest)).reshape(int(count), -1)
    return SplineTable(stored[:, 0], stored[:, 1:], ends, beyond)


def polynomial(order: int, offset: Any, c0: Any, c1: Any, c2: Any, c3: Any) -> Any:
    """Return the value of a cubic or its derivative at an offset, for numbers, arrays or expressions."""
    match order:
        case 0:
            return ((c3 * offset + c2) * offset + c1) * offset + c0
        case 1:
            return (3 * c3 * offset + 2 * c2) * offset + c1
        case 2:
            return 6 * c3 * offset + 2 * c2
        case _:
            return 6 * c3
