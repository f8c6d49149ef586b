"""Tables of splines inside kernels: their numbers are constants of the kernel, which the driver looks up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from uqmbd.typing import Array

__all__ = ["IntervalTable", "Tables", "table_constants"]


class IntervalTable(Protocol):
    """Table of numbers by interval: `edges` (n,), ascending, and `rows` (n + 1, 1 + M, number).

    A row holds the numbers below the table, in an interval, or above the table; the first number is the begin of the
    interval.  They are a constant and the factors of M terms.  The table repeats with `period` from its first knot
    ``rows[0, 0, 0]`` on; 0: it is not periodic.
    """

    @property
    def edges(self) -> Array:
        """See above."""

    @property
    def rows(self) -> Array:
        """See above."""

    @property
    def period(self) -> float:
        """See above."""

    def look_up(self, x: Array, terms: Array | None = None) -> Array:
        """Look up arguments (K,) with terms (K, M) by NumPy, shape (K, number), which a kernel is compared with."""


Tables = Mapping[str, IntervalTable]
"""Tables by the names of the functions that look them up; the name tells the numbers."""


def table_constants(name: str, table: IntervalTable) -> str:
    """Write the numbers of a table as constants of a module: byte by byte, which LLVM reads faster than numbers."""
    text = ""
    for kind, array in (("edges", table.edges), ("rows", table.rows)):
        numbers = np.ascontiguousarray(array, dtype=float).tobytes()
        escaped = numbers.hex("\\")
        text += f'@{kind}.{name} = private constant [{len(numbers)} x i8] c"\\{escaped}", align 64\n'
    return text
