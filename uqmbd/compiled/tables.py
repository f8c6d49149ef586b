"""Spline tables in kernels: the numbers are constants of the kernel, and the driver performs the lookup."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from uqmbd.typing import Array

__all__ = ["PATHS", "IntervalTable", "PathTable", "Tables", "table_constants"]


class IntervalTable(Protocol):
    """Table of numbers by interval: `edges` (n,), ascending, and `rows` (n + 1, 1 + M, number).

    A row contains the numbers below the table, in an interval, or above the table: a constant and the factors of M
    terms. The first number of the constant, ``rows[k, 0, 0]``, is the start of the interval. The table repeats with
    `period`, starting at its first knot ``rows[0, 0, 0]``; 0: not periodic.
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
        """Look up arguments (K,) with terms (K, M) in NumPy, shape (K, number): the reference for kernels."""


class PathTable:
    """Lookup of sampled paths: the term is the memory address of a path, which differs between realisations."""

    def look_up(self, x: Array, terms: Array | None = None) -> Array:
        """Look up arguments (K,) in paths of zeros, shape (K, number): the reference for kernels without paths."""
        return np.column_stack([x, np.zeros((len(x), PATH_NUMBERS - 1))])


PATHS = PathTable()
PATH_NUMBERS = 5
"""Numbers of a lookup: the knot before the argument, and the coefficients of the cubic about it."""

Tables = Mapping[str, IntervalTable | PathTable]
"""Tables by the names of their lookup functions; tables of the same name have the same numbers."""


def table_constants(name: str, table: IntervalTable) -> str:
    """Write the numbers of a table as module constants, as bytes, which LLVM reads faster than numbers."""
    text = ""
    for kind, array in (("edges", table.edges), ("rows", table.rows)):
        numbers = np.ascontiguousarray(array, dtype=float).tobytes()
        escaped = numbers.hex("\\")
        text += f'@{kind}.{name} = private constant [{len(numbers)} x i8] c"\\{escaped}", align 64\n'
    return text
