"""Exact arithmetic of the symbolic route: moments of germs, and polynomials in many variables."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cache
from math import factorial
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["FAMILIES", "Compiled", "Sum", "gradient", "moment"]

Sum = dict[tuple[int, ...], Any]
"""A polynomial: sorted numbers of the variables in each product -> its rational factor."""

FAMILIES = ("hermite", "legendre")
"""Germs whose moments are known: standard normal, and uniform on [-1, 1]."""


@cache
def _polynomial(family: str, degree: int) -> tuple[Any, ...]:
    """Coefficients, constant first, of the monic Hermite or the Legendre polynomial of a degree."""
    x = sympy.Symbol("x")
    if family == "hermite":
        found = sympy.Poly(2 ** -sympy.Rational(degree, 2) * sympy.hermite(degree, x / sympy.sqrt(2)), x)
    else:
        found = sympy.Poly(sympy.legendre(degree, x), x)
    return tuple(sympy.QQ.from_sympy(sympy.nsimplify(c)) for c in reversed(found.all_coeffs()))


@cache
def moment(family: str, power: int, degrees: tuple[int, ...]) -> Any:
    """``E[x^power h_i h_j ...]`` of the polynomials of `degrees`, exactly.

    Examples
    --------
    >>> print(moment("hermite", 1, (1, 2)), moment("legendre", 2, ()))
    2 1/3
    """
    total: list[Any] = [sympy.QQ(0)] * power + [sympy.QQ(1)]
    for degree in degrees:
        factor = _polynomial(family, degree)
        longer = [sympy.QQ(0)] * (len(total) + len(factor) - 1)
        for i, a in enumerate(total):
            for j, b in enumerate(factor):
                longer[i + j] += a * b
        total = longer
    even = range(0, len(total), 2)  # odd moments vanish
    if family == "hermite":
        raw = {n: sympy.QQ(factorial(n), 2 ** (n // 2) * factorial(n // 2)) for n in even}
    else:
        raw = {n: sympy.QQ(1, n + 1) for n in even}
    return sum((total[n] * raw[n] for n in even), sympy.QQ(0))


def gradient(polynomial: Sum) -> dict[int, Sum]:
    """Derive in every variable."""
    found: dict[int, Sum] = defaultdict(lambda: defaultdict(lambda: sympy.QQ(0)))
    for monomial, factor in polynomial.items():
        for variable, power in Counter(monomial).items():
            rest = list(monomial)
            rest.remove(variable)
            found[variable][tuple(rest)] += power * factor
    return found


@dataclass(frozen=True)
class Compiled:
    """Polynomials of many rows, for evaluation: factors, and the variables of each product."""

    rows: NDArray[np.int64]
    factors: Array
    variables: NDArray[np.int64]
    count: int

    @classmethod
    def of(cls, rows: list[Sum], one: int) -> Compiled:
        """Compile; variable `one` is 1."""
        longest = max((len(m) for row in rows for m in row), default=0)
        entries = [
            (k, float(f), (*m, *[one] * (longest - len(m)))) for k, row in enumerate(rows) for m, f in row.items()
        ]
        return cls(
            np.array([k for k, _, _ in entries], dtype=np.int64),
            np.array([f for _, f, _ in entries], dtype=float),
            np.array([m for *_, m in entries], dtype=np.int64).reshape(len(entries), longest),
            len(rows),
        )

    def __call__(self, values: Array) -> Array:
        """Evaluate every row for the values of all variables."""
        products = self.factors * values[self.variables].prod(axis=1)
        return np.bincount(self.rows, products, self.count).astype(float)
