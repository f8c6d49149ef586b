"""Copulas on the unit cube, by their conditional distributions.

The Gumbel, Joe and Student copulas of chaospy are not copulas: their marginal distributions are not uniform. The Gumbel
generator has an exponent of the wrong sign. The Student copula multiplies variables whose sum is not Student
distributed. The inverse of the Clayton copula is a search with random steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.special
from numpy.polynomial import Polynomial

from uqmbd.errors import StudyError
from uqmbd.randomness.rosenblatt.bisection import bisected
from uqmbd.typing import Array

__all__ = [
    "FAMILIES",
    "Archimedean",
    "Copula",
    "Elliptical",
    "combined",
    "cumulated",
    "decoded_copula",
    "scores",
    "separated",
    "triangular",
    "unscored",
]


FAMILIES = {"clayton": 0.0, "gumbel": 1.0, "joe": 1.0}
"""Families with a generator, and the least value of their parameter; for Clayton, this value is excluded."""

SMALLEST, LARGEST = 1e-300, 1 - 2.0**-53
"""Bounds of coordinates: generators are infinite at zero."""


class Copula(Protocol):
    """Map between independent and dependent uniform variables; points are columns, shape (n, N)."""

    @property
    def order(self) -> tuple[int, ...]:
        """Components in the order of conditioning."""

    def inverse(self, u: Array) -> Array:
        """Map independent variables to dependent ones."""

    def forward(self, v: Array) -> Array:
        """Map dependent variables to independent ones."""

    def encoded(self) -> Any:
        """Return the copula as data."""


@dataclass(frozen=True, eq=False)
class Archimedean:
    """Copula psi(psi^-1(v_1) + ... + psi^-1(v_n)) of the family "clayton", "gumbel" or "joe".

    psi^-1 is the generator: v^-theta - 1 for Clayton, (-log v)^theta for Gumbel, and -log(1 - (1 - v)^theta) for Joe.
    Given k earlier components, the next component has the distribution function psi^(k)(s + psi^-1(v)) / psi^(k)(s).
    Here s is the sum of the generators of the earlier components, and psi^(k) is the k-th derivative. See Joe,
    Dependence Modeling with Copulas, 2014, section 3.4. Each derivative is a polynomial in a variable of the family,
    times powers and exponentials. Raise StudyError, whose message is part of a sentence, if the parameter is invalid.
    """

    family: str
    parameter: float
    dimension: int

    def __post_init__(self) -> None:
        """Check the parameter."""
        least = FAMILIES[self.family]
        if not (least <= self.parameter < np.inf) or self.parameter == 0:
            bound = "positive" if least == 0 else f"at least {least:g}"
            raise StudyError(f"the parameter theta of a {self.family.capitalize()} copula is {self.parameter:g}; "
                             f"expected a number that is {bound}")  # fmt: skip

    @property
    def order(self) -> tuple[int, ...]:
        """Components in the order of conditioning: unchanged."""
        return tuple(range(self.dimension))

    def inverse(self, u: Array) -> Array:
        """Map independent variables to dependent ones."""
        u = np.clip(u, SMALLEST, LARGEST)
        found = np.empty_like(u)
        found[0] = u[0]
        sums = self._sums(u[0])
        for k in range(1, self.dimension):
            found[k] = self._solved(u[k], sums, k)
            sums = self._added(sums, found[k])
        return found

    def forward(self, v: Array) -> Array:
        """Map dependent variables to independent ones."""
        v = np.clip(v, SMALLEST, LARGEST)
        found = np.empty_like(v)
        found[0] = v[0]
        sums = self._sums(v[0])
        for k in range(1, self.dimension):
            after = self._added(sums, v[k])
            found[k] = np.exp(np.minimum(self._derivative(after, k) - self._derivative(sums, k), 0.0))
            sums = after
        return found

    def encoded(self) -> Any:
        """Return the copula as data."""
        return ["archimedean", self.family, self.parameter, self.dimension]

    def _solved(self, u: Array, sums: Array, k: int) -> Array:
        if self.family == "clayton":
            rate = self.parameter / (1 + k * self.parameter)
            own = sums[0] + np.log(np.expm1(-rate * np.log(u)))  # logarithm of the generator
            return np.asarray(np.clip(np.exp(-np.logaddexp(0.0, own) / self.parameter), SMALLEST, LARGEST))
        whole = self._derivative(sums, k)

        def missing(place: Array) -> Array:
            return self._derivative(self._added(sums, scipy.special.expit(place)), k) - whole - np.log(u)

        # the logit scale resolves small values with small relative errors
        found = bisected(missing, np.full(u.shape, -690.0), np.full(u.shape, 36.7))
        return np.asarray(np.clip(scipy.special.expit(found), SMALLEST, LARGEST))

    def _sums(self, v: Array) -> Array:
        """Return the sum s of generators for one component, in the representation of the family, shape (m, N)."""
        theta = self.parameter
        if self.family == "clayton":  # logarithm of one plus the sum
            return -theta * np.log(v)[None, :]
        if self.family == "gumbel":  # logarithm of the sum
            return theta * np.log(-np.log(v))[None, :]
        # Joe: exp(-sum) and 1 - exp(-sum), both with small relative errors
        log_rest = theta * np.log1p(-v)
        return np.stack([-np.expm1(log_rest), np.maximum(np.exp(log_rest), SMALLEST)])

    def _added(self, sums: Array, v: Array) -> Array:
        own = self._sums(v)
        if self.family == "clayton":
            return np.asarray(np.logaddexp(sums, own + np.log(-np.expm1(-own))))
        if self.family == "gumbel":
            return np.asarray(np.logaddexp(sums, own))
        return np.stack([sums[0] * own[0], sums[1] + own[1] * sums[0]])

    def _derivative(self, sums: Array, k: int) -> Array:
        """Return the logarithm of the absolute k-th derivative of psi at `sums`, k >= 1, up to a term without s."""
        alpha = 1 / self.parameter
        with np.errstate(all="ignore"):
            if self.family == "clayton":
                return np.asarray(-(alpha + k) * sums[0])
            if self.family == "gumbel":
                x = np.exp(alpha * sums[0])
                return np.asarray(-x - k * sums[0] + np.log(_value(_of_gumbel(alpha, k), x)))
            z, rest = sums
            return np.asarray(np.log(z) + (alpha - k) * np.log(rest) + np.log(_value(_of_joe(alpha, k), z)))


@dataclass(frozen=True, eq=False)
class Elliptical:
    """Copula of a normal vector or of a Student vector."""

    factor: Array  # (n, n), rows of norm one; lower triangular factor of the correlation in `order`
    order: tuple[int, ...]  # components in the order of conditioning
    freedom: float = np.inf  # degrees of freedom; infinite for a normal vector

    def inverse(self, u: Array) -> Array:
        """Map independent variables to dependent ones."""
        return cumulated(combined(self.factor, self.order, scores(u, self.order, self.freedom)), self.freedom)

    def forward(self, v: Array) -> Array:
        """Map dependent variables to independent ones."""
        parts = separated(self.factor, self.order, quantiles(v, self.freedom))
        return unscored(parts, self.order, self.freedom)

    def encoded(self) -> Any:
        """Return the copula as data."""
        freedom = None if np.isinf(self.freedom) else self.freedom
        return ["elliptical", self.factor.tolist(), list(self.order), freedom]


def triangular(matrix: Array, order: tuple[int, ...]) -> Array:
    """Return the factor (n, n) of a covariance that is lower triangular if rows and columns are sorted by `order`.

    Raise StudyError, whose message is part of a sentence, if the matrix is singular or indefinite.
    """
    factor = np.zeros_like(matrix, dtype=float)
    try:
        factor[np.ix_(order, order)] = np.linalg.cholesky(matrix[np.ix_(order, order)])
    except np.linalg.LinAlgError:
        raise StudyError(f"the matrix {matrix.round(6).tolist()} is singular or indefinite") from None
    return factor


def quantiles(u: Array, freedom: float) -> Array:
    """Return quantiles of the Student distribution, or of the normal one for infinite `freedom`."""
    found = scipy.special.ndtri(u) if np.isinf(freedom) else scipy.special.stdtrit(freedom, u)
    return np.asarray(found, dtype=float)


def cumulated(x: Array, freedom: float) -> Array:
    """Return probabilities of the Student distribution, or of the normal one for infinite `freedom`."""
    found = scipy.special.ndtr(x) if np.isinf(freedom) else scipy.special.stdtr(freedom, x)
    return np.asarray(found, dtype=float)


def scores(u: Array, order: tuple[int, ...], freedom: float) -> Array:
    """Map independent uniform variables to uncorrelated variables of a normal or Student vector, shape (n, N).

    Variables of a Student vector are dependent. Given k variables with the sum of squares q, the next variable is
    ``sqrt((freedom + q) / (freedom + k))`` times a Student variable with ``freedom + k`` degrees of freedom.
    """
    found, total = np.empty_like(u), np.zeros(u.shape[1])
    for k, row in enumerate(order):
        widening = 1.0 if np.isinf(freedom) else np.sqrt((freedom + total) / (freedom + k))
        found[row] = widening * quantiles(u[row], freedom + k)
        total = total + found[row] ** 2
    return found


def unscored(parts: Array, order: tuple[int, ...], freedom: float) -> Array:
    """Invert :func:`scores`."""
    found, total = np.empty_like(parts), np.zeros(parts.shape[1])
    for k, row in enumerate(order):
        widening = 1.0 if np.isinf(freedom) else np.sqrt((freedom + total) / (freedom + k))
        found[row] = cumulated(parts[row] / widening, freedom + k)
        total = total + parts[row] ** 2
    return found


def combined(factor: Array, order: tuple[int, ...], parts: Array) -> Array:
    """Return the product of a factor and columns; its rounding does not depend on the number of columns."""
    found = np.zeros_like(parts)
    for k, row in enumerate(order):
        for column in order[: k + 1]:
            found[row] = found[row] + factor[row, column] * parts[column]
    return found


def separated(factor: Array, order: tuple[int, ...], values: Array) -> Array:
    """Solve :func:`combined` for the parts."""
    found = np.zeros_like(values)
    for k, row in enumerate(order):
        rest = values[row]
        for column in order[:k]:
            rest = rest - factor[row, column] * found[column]
        found[row] = rest / factor[row, row]
    return found


def decoded_copula(data: Any) -> Copula:
    """Return the copula from its ``encoded`` form; raise ValueError for other data.

    >>> decoded_copula(["archimedean", "clayton", 2.0, 2]).inverse(np.array([[0.5], [0.5]])).round(6).ravel().tolist()
    [0.5, 0.546391]
    """
    kind, *parts = data
    if kind == "archimedean":
        return Archimedean(str(parts[0]), float(parts[1]), int(parts[2]))
    if kind == "elliptical":
        freedom = np.inf if parts[2] is None else float(parts[2])
        return Elliptical(np.array(parts[0], dtype=float), tuple(map(int, parts[1])), freedom)
    raise ValueError(f"unknown copula {kind!r}")


def _value(coefficients: Array, x: Array) -> Array:
    return np.asarray(np.polynomial.polynomial.polyval(x, coefficients))


def _of_gumbel(alpha: float, k: int) -> Array:
    """Return the polynomial in ``x = s**alpha`` in the derivative of ``exp(-x)``; the rest is ``exp(-x) s**-k``."""
    found = Polynomial([1.0])
    for order in range(k):
        found = Polynomial([float(order), alpha]) * found - Polynomial([0.0, alpha]) * found.deriv()
    return np.asarray(found.coef, dtype=float)


def _of_joe(alpha: float, k: int) -> Array:
    """Return the polynomial in ``z = exp(-s)`` in the derivative; the rest is ``alpha z (1 - z)**(alpha - k)``."""
    found = Polynomial([1.0])
    for order in range(1, k):
        found = Polynomial([1.0, order - 1 - alpha]) * found + Polynomial([0.0, 1.0, -1.0]) * found.deriv()
    return np.asarray(found.coef, dtype=float)
