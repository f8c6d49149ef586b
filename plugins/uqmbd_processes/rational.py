"""Variances of responses with rational transfer functions, by polynomials of all realisations, with error bounds.

A response ``y = N(s) / D(s) n`` to white noise ``n`` of unit intensity has the variance ``sum b_k^2 / (2 a_k)``.  The
sum is over the steps of Routh's array, which also shows whether all roots of ``D`` decay (Astrom 1970, section 5.2).
All terms are positive. Each number has a bound of its rounding error.  Where the bound of the variance is too large, as
for rates that differ much, Lyapunov's equation is solved instead. The array costs a small part of this equation.

K. J. Astrom, "Introduction to stochastic control theory", Academic Press, 1970.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uqmbd_processes.paths import ShapingFilter

__all__ = ["MOST_STATES", "CharacteristicPolynomials", "balancing_scales", "rational_variance"]

if TYPE_CHECKING:
    from uqmbd.extend import LinearSystem

Array = NDArray[np.float64]

EPS = float(np.finfo(float).eps)

MOST_STATES = 10
"""Largest number of states whose characteristic polynomials are computed."""


@dataclass(frozen=True)
class Bounded:
    """Numbers of K realisations with bounds of their errors."""

    value: Array
    error: Array

    def __add__(self, other: Bounded) -> Bounded:
        value = self.value + other.value
        return Bounded(value, self.error + other.error + EPS * np.abs(value))

    def __sub__(self, other: Bounded) -> Bounded:
        value = self.value - other.value
        return Bounded(value, self.error + other.error + EPS * np.abs(value))

    def __mul__(self, other: Bounded) -> Bounded:
        value = self.value * other.value
        error = np.abs(self.value) * other.error + self.error * (np.abs(other.value) + other.error)
        return Bounded(value, error + EPS * np.abs(value))

    def __truediv__(self, other: Bounded) -> Bounded:
        """Divide by positive numbers whose errors are smaller than they are."""
        value = self.value / other.value
        error = (self.error + np.abs(value) * other.error) / (other.value - other.error)
        return Bounded(value, error + EPS * np.abs(value))


Polynomial = list[Bounded]
"""Coefficients, the one of the highest power first."""


def balancing_scales(a: Array) -> Array:
    """Return factors of states (K, n) that balance the rows and columns of matrices (K, n, n), as powers of two."""
    return np.ascontiguousarray(_balancing_scales(_last(a)).T)


def _applied(matrices: Array, vectors: Array) -> Array:
    """Return products (n, K) of matrices (n, n, K) and vectors (n, K); sums have the same order for all K."""
    found = np.zeros(matrices.shape[1:])
    for j in range(len(vectors)):
        found = found + matrices[:, j] * vectors[j]
    return found


def _sum(terms: Array) -> Array:
    """Return the sums (K,) of terms (n, K), in the same order for all K."""
    found = np.zeros(terms.shape[1:])
    for one in terms:
        found = found + one
    return found


def _last(matrices: Array) -> Array:
    """Copy matrices with the realisations (K, ...) on the last axis, along which loops over small matrices are fast."""
    return np.array(np.moveaxis(matrices, 0, -1), order="C")


def _balancing_scales(a: Array) -> Array:
    """Return factors of states (n, K) for matrices (n, n, K), as `balancing_scales`."""
    scale = np.ones(a.shape[1:])
    size = np.abs(a)
    size[np.arange(len(a)), np.arange(len(a))] = 0.0
    for _ in range(12):
        row = scale * _applied(size, 1 / scale)
        column = _applied(np.swapaxes(size, 0, 1), scale) / scale
        usable = (row > 0) & (column > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.exp2(np.round(np.log2(np.where(usable, column / row, 1.0)) / 4))
        if (factor == 1.0).all():
            break
        scale *= factor
    return scale


@dataclass(frozen=True)
class CharacteristicPolynomials:
    """Characteristic polynomials of K systems (K, n, n), in units of their rates, and the scaled systems."""

    scale: Array  # (n, K): factors of the states
    rate: Array  # (K,): unit of the frequency
    scaled: Array  # (n, n, K)
    coefficients: Polynomial
    stable: NDArray[np.bool_]  # (K,): whether all roots decay, by more than rounding

    @classmethod
    def of(cls, a: Array) -> CharacteristicPolynomials:
        """Compute the polynomials of systems by the algorithm of Faddeev and Le Verrier."""
        count, n = a.shape[:2]
        scaled = _last(a)
        scale = _balancing_scales(scaled)
        scaled *= scale[:, None]
        scaled /= scale
        norm = _norm(scaled)
        rate = np.where(norm > 0, norm, 1.0)
        scaled /= rate
        own, coefficients = np.arange(n), [_exact(np.ones(count))]
        matrix, error, size = scaled, np.zeros(count), np.full(count, np.sqrt(n))
        # norms bound errors: the norm of a system is 1, up to its rounding
        for k in range(1, n + 1):
            product = scaled
            if k > 1:
                product = np.stack([_applied(scaled, matrix[:, m]) for m in range(n)], axis=1)
            wrong = error + (n + 2) * EPS * size
            trace = -_sum(product[own, own]) / k
            size = _norm(product)
            wrong_trace = np.sqrt(n) / k * (wrong + (n + 2) * EPS * size)
            coefficients.append(Bounded(trace, wrong_trace))
            if k < n:
                matrix = product.copy()
                matrix[own, own] += trace
                error = wrong + np.sqrt(n) * (wrong_trace + EPS * np.abs(trace)) + EPS * size
                size = _norm(matrix)
        with np.errstate(all="ignore"):
            stable = _routh(coefficients, None)[1]
        return cls(scale, rate, scaled, coefficients, stable & (norm > 0))

    def select(self, members: NDArray[np.int64]) -> CharacteristicPolynomials:
        """Return the polynomials of some realisations."""
        if len(members) == len(self.rate):
            return self
        chosen = [Bounded(x.value[members], x.error[members]) for x in self.coefficients]
        return CharacteristicPolynomials(
            self.scale[:, members], self.rate[members], self.scaled[..., members], chosen, self.stable[members]
        )

    def numerator(self, c: Array, b: Array) -> Polynomial:
        """Return the numerators of ``c (s - a)^-1 b``, times the rates, for vectors (K, n) and (K, n)."""
        n = len(self.scaled)
        seen, driven = c.T / self.scale, b.T * self.scale
        weight, size = np.abs(seen), np.abs(self.scaled)
        vector, error, drive = driven, np.zeros_like(driven), np.abs(driven)
        found = []
        for k in range(1, n + 1):
            terms = _sum(weight * np.abs(vector))
            value, bound = _sum(seen * vector), _sum(weight * error)
            found.append(Bounded(value, bound + (n + 2) * EPS * terms))
            if k < n:
                factor = self.coefficients[k]
                more = error + (n + 4) * EPS * np.abs(vector)
                bound = (np.abs(factor.value) * (4 * EPS) + factor.error) * drive
                error = _applied(size, more) + bound
                vector = _applied(self.scaled, vector) + factor.value * driven
        return found


def _exact(values: Array) -> Bounded:
    return Bounded(values, np.zeros_like(values))


def _norm(matrices: Array) -> Array:
    """Return the Frobenius norms (K,) of matrices (n, n, K)."""
    return np.sqrt(_sum((matrices * matrices).reshape(-1, matrices.shape[-1])))


def rational_variance(
    system: LinearSystem, polynomials: CharacteristicPolynomials, shape: ShapingFilter, channel: int
) -> tuple[Array, Array]:
    """Return the variances (K,) of responses to noise with a filter, without rates of the noise, and error bounds (K,).

    The error is infinite if the bounds do not show that the system decays.
    """
    rate, speed = polynomials.rate, np.abs(system.channels[channel].speed)
    above, below = _quotient(shape)
    # the frequency of the filter is the angular frequency over the speed
    ratio = rate / speed

    def scaled(numbers: tuple[float, ...]) -> Polynomial:
        powers = [x * ratio ** (len(numbers) - 1 - k) for k, x in enumerate(numbers)]
        return [Bounded(x, np.abs(x) * (2 * len(numbers) + 2) * EPS) for x in powers]

    numerator = [_exact(np.zeros(len(system))), *polynomials.numerator(system.c, system.b[:, :, channel])]
    direct = system.e[:, 0, channel] * rate
    if direct.any():
        factor = Bounded(direct, EPS * np.abs(direct))
        numerator = [x + factor * y for x, y in zip(numerator, polynomials.coefficients, strict=True)]
    with np.errstate(all="ignore"):
        # the first coefficient of the filter is zero: no white noise
        whole = _product(numerator, scaled(above)[1:])
        total, clear = _routh(_product(polynomials.coefficients, scaled(below)), whole)
        value = total.value / (rate * speed)
        error = np.where(clear, total.error / (rate * speed) + 8 * EPS * value, np.inf)
    return value, np.where(np.isnan(error), np.inf, error)


@cache
def _quotient(shape: ShapingFilter) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return numerator and denominator of a filter, exactly rounded, with the highest powers first."""
    n = len(shape.b)
    a = [[Fraction(x) for x in row] for row in shape.a]
    b, c = [Fraction(x) for x in shape.b], [Fraction(x) for x in shape.c]
    eye = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
    matrix, below, above = eye, [Fraction(1)], list[Fraction]()
    for k in range(1, n + 1):
        above.append(sum((c[i] * matrix[i][j] * b[j] for i in range(n) for j in range(n)), Fraction(0)))
        product = [[sum((a[i][m] * matrix[m][j] for m in range(n)), Fraction(0)) for j in range(n)] for i in range(n)]
        below.append(-sum((product[i][i] for i in range(n)), Fraction(0)) / k)
        matrix = [[product[i][j] + below[-1] * eye[i][j] for j in range(n)] for i in range(n)]
    direct = Fraction(shape.d)
    whole = [direct * x + y for x, y in zip(below, [Fraction(0), *above], strict=True)]
    return tuple(map(float, whole)), tuple(map(float, below))


def _product(first: Polynomial, second: Polynomial) -> Polynomial:
    result: list[Bounded | None] = [None] * (len(first) + len(second) - 1)
    for i, x in enumerate(first):
        for j, y in enumerate(second):
            one, before = x * y, result[i + j]
            result[i + j] = one if before is None else before + one
    return [x for x in result if x is not None]


def _routh(denominator: Polynomial, numerator: Polynomial | None) -> tuple[Bounded, NDArray[np.bool_]]:
    """Return the variances of unit noise, and whether all roots of the denominator decay for all errors in the bounds.

    The denominator has n + 1 coefficients, and the numerator n. Without a numerator, the variances are zero.
    """
    clear = denominator[0].value > 4 * denominator[0].error
    total, half = _exact(np.zeros(len(clear))), _exact(np.full(len(clear), 0.5))
    a, b = list(denominator), list(numerator or [])
    while len(a) > 1:
        clear &= a[1].value > 4 * a[1].error
        alpha = a[0] / a[1]
        if b:
            beta = b[0] / a[1]
            total = total + half * beta * beta / alpha
            b = [x if k % 2 else x - beta * a[k + 1] for k, x in enumerate(b) if k]
        a = [x if k % 2 or k + 1 == len(a) else x - alpha * a[k + 1] for k, x in enumerate(a) if k]
    return total, np.asarray(clear & np.isfinite(total.value))
