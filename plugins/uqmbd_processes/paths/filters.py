"""Shaping filters of processes with a rational spectrum, covariances that have one, and their discretised paths.

The states of a filter at equal distances are a Markov chain, ``s[k + 1] = F s[k] + L z[k]`` with normal ``z``. Its
covariances are exactly those of the process (Van Loan 1978). A path starts at the argument zero with the stationary
distribution. Before zero it is the chain of the reversed process, whose matrix is ``P A^T P^-1``.

C. F. Van Loan, "Computing integrals involving the matrix exponential", IEEE Transactions on Automatic Control 23 (1978)
395-404.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_processes.descriptions import check_family
from uqmbd_processes.paths.harmonics import (
    KNOTS_PER_WAVE,
    MARGIN,
    MOST_KNOTS,
    UNITS,
    SampledProcess,
    check_interval,
    highest_frequency,
    integral_above,
    normal_numbers,
)

__all__ = [
    "ExponentialCovariance",
    "FilterPaths",
    "ShapingFilter",
    "check_positive",
    "exponential_covariance",
    "shaping_filter",
]

Array = NDArray[np.float64]

REACH = 28
"""Number of knots on either side that determine a coefficient of a spline; the weights of others are below 1e-16."""

ACCURATE = 1e-6
"""Largest rate of change of the covariances of the reversed filter, relative to its rates."""


@dataclass(frozen=True)
class ShapingFilter:
    """Filter of white noise ``n`` of unit intensity: ``s' = a s + b n``, ``w = c s + d n``, as plain numbers.

    Attributes
    ----------
    a : tuple of tuple of float
        System matrix.
    b, c : tuple of float
        Input and output.
    d : float
        Direct feedthrough of the white noise to the output.

    Examples
    --------
    >>> ShapingFilter(((-2.0,),), (2.0,), (1.0,)).variance
    1.0
    """

    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    d: float = 0.0

    @property
    def matrices(self) -> tuple[Array, Array, Array]:
        """System matrix (n, n), input (n,) and output (n,)."""
        n = len(self.b)
        return np.array(self.a, dtype=float).reshape(n, n), np.array(self.b, dtype=float), np.array(self.c, dtype=float)

    @property
    def resonances(self) -> list[tuple[float, float]]:
        """Angular frequencies and decay rates of the oscillations of the filter."""
        found = np.linalg.eigvals(self.matrices[0]) if self.b else np.zeros(0)
        return [(abs(float(x.imag)), abs(float(x.real))) for x in found if x.imag]

    @property
    def variance(self) -> float:
        """Variance of the filtered noise; infinite for white noise."""
        from scipy.linalg import solve_continuous_lyapunov

        if self.d:
            return math.inf
        a, b, c = self.matrices
        return float(c @ solve_continuous_lyapunov(a, -np.outer(b, b)) @ c)

    def two_sided(self, frequency: Array) -> Array:
        """Return the two-sided density per rad at angular frequencies."""
        a, b, c = self.matrices
        shape = np.full(frequency.shape, complex(self.d))
        if len(b):
            systems = 1j * frequency[..., None, None] * np.eye(len(b)) - a
            right = np.broadcast_to(b[:, None], (*frequency.shape, len(b), 1))
            shape = shape + (c @ np.linalg.solve(systems, right))[..., 0]
        return np.asarray(np.abs(shape) ** 2 / (2 * math.pi))


@dataclass(frozen=True)
class ExponentialCovariance:
    """Covariance ``s^2 exp(-|lag| / length)``, a function of the lag.

    Attributes
    ----------
    deviation : float
        Standard deviation s of the process, in its units.
    length : float
        Correlation length, m, or correlation time, s.

    Examples
    --------
    >>> float(exponential_covariance(2.0, 5.0)(5 * 0.0))
    4.0
    """

    deviation: float
    length: float

    def __call__(self, lag: Any) -> Any:
        """Return the covariance of a lag."""
        return self.deviation**2 * np.exp(-np.abs(lag) / self.length)

    @property
    def filter(self) -> ShapingFilter:
        """Shaping filter of first order."""
        return ShapingFilter(((-1 / self.length,),), (self.deviation * math.sqrt(2 / self.length),), (1.0,))


def check_positive(where: str, **numbers: Any) -> None:
    """Raise StudyError unless numbers are positive."""
    for name, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not 0 < value < math.inf:
            raise uqmbd.StudyError(f"{where}: {name} is {value!r}; expected a positive number.")


@typechecked(values=False)
def exponential_covariance(deviation: float, length: float) -> ExponentialCovariance:
    """Return the covariance ``s^2 exp(-|lag| / length)`` of a process, for roads, wind and first-order noise.

    Parameters
    ----------
    deviation : float
        Standard deviation s of the process, in its units.
    length : float
        Correlation length, m, or correlation time, s.

    Returns
    -------
    ExponentialCovariance
        Function of the lag, with its shaping filter.

    Raises
    ------
    uqmbd.StudyError
        If a number is not positive.

    Notes
    -----
    This is the process of Ornstein and Uhlenbeck [1]_, with the two-sided spectrum
    ``s^2 length / (pi (1 + (w length)^2))`` per rad. The rate of the process has no finite variance.

    References
    ----------
    .. [1] G. E. Uhlenbeck, L. S. Ornstein, "On the theory of the Brownian motion", Physical Review 36 (1930) 823-841.

    Examples
    --------
    >>> covariance = exponential_covariance(0.01, 5.0)
    >>> float(covariance(0.0)), round(covariance.filter.variance, 12)
    (0.0001, 0.0001)
    """
    check_positive("exponential_covariance", deviation=deviation, length=length)
    return ExponentialCovariance(float(deviation), float(length))


def shaping_filter(where: str, given: Any) -> ShapingFilter:
    """Return the filter of three matrices; raise StudyError if they are invalid."""
    expected = "expected (A, B, C): a square matrix, and two vectors of its size"
    try:
        a, b, c = (np.array(x, dtype=float) for x in given)
    except (TypeError, ValueError):
        raise uqmbd.StudyError(f"{where}: filter is {given!r}; {expected}.") from None
    a = a.reshape(1, 1) if a.size == 1 else a
    n = len(a) if a.ndim == 2 else 0
    if not n or a.shape != (n, n) or b.size != n or c.size != n or not all(np.isfinite(x).all() for x in (a, b, c)):
        raise uqmbd.StudyError(f"{where}: filter has the shapes {a.shape}, {b.shape}, {c.shape}; {expected}.")
    if np.linalg.eigvals(a).real.max() >= 0:
        raise uqmbd.StudyError(
            f"{where}: filter is not stable: an eigenvalue of A has no negative real part, so that the process is not "
            "stationary. Give a matrix A whose eigenvalues have negative real parts."
        )
    rows = tuple(tuple(float(x) for x in row) for row in a)
    return ShapingFilter(rows, tuple(b.ravel().tolist()), tuple(c.ravel().tolist()))


@dataclass(frozen=True)
class DiscretisedFilter:
    """Exact discretisation of a filter at a distance of knots: ``y[k + 1] = triangle y[k] + noise z[k]``, ``w = c y``.

    The states are those of the complex Schur form, so that each one is a recursion of first order.
    """

    triangle: NDArray[np.complex128]  # (n, n)
    noise: NDArray[np.complex128]  # (n, n)
    first: NDArray[np.complex128]  # (n, n): from the states of the filter at the first knot
    seen: NDArray[np.complex128]  # (n,): output

    @classmethod
    def of(cls, a: Array, b: Array, c: Array, step: float) -> DiscretisedFilter:
        """Discretise a filter with the matrices (n, n), (n,) and (n,)."""
        from scipy.linalg import expm, schur

        # compute covariances over a short interval, then double it: sums of positive definite terms are accurate
        n, halvings = len(b), max(0, math.ceil(math.log2(max(float(np.linalg.norm(a)) * step, 1e-300))) + 1)
        short = step / 2.0**halvings
        block = expm(short * np.block([[-a, np.outer(b, b)], [np.zeros((n, n)), a.T]]))
        transition = block[n:, n:].T
        covariance = transition @ block[:n, n:]
        for _ in range(halvings):
            covariance = covariance + transition @ covariance @ transition.T
            transition = transition @ transition
        triangle, basis = schur(transition, output="complex")
        back = basis.conj().T
        return cls(triangle, back @ square_root(covariance), back, c @ basis)

    def density(self, angle: Array) -> Array:
        """Return the two-sided density per rad at angles, which are frequencies times the distance of the knots."""
        systems = np.exp(1j * angle)[..., None, None] * np.eye(len(self.seen)) - self.triangle.T
        seen = np.broadcast_to(self.seen[:, None], (*angle.shape, len(self.seen), 1))
        response = np.linalg.solve(systems, seen)[..., 0]
        return np.asarray(np.sum(np.abs(response @ self.noise) ** 2, axis=-1) / (2 * math.pi))

    def values(self, start: Array, normal: Array) -> Array:
        """Return outputs (N + 1,) from the states of the filter (n,) at the first knot, and normal numbers (N, n)."""
        from scipy.signal import lfilter

        n = len(self.seen)
        states = np.zeros((n, len(normal) + 1), dtype=complex)
        total = np.zeros(len(normal) + 1)
        for i in reversed(range(n)):
            # use sums of real products, whose rounding does not depend on the length
            driven = np.zeros(len(normal) + 1, dtype=complex)
            driven[0] = sum(complex(self.first[i, j]) * float(start[j]) for j in range(n))
            for j in range(n):
                driven.real[1:] += self.noise[i, j].real * normal[:, j]
                driven.imag[1:] += self.noise[i, j].imag * normal[:, j]
            for j in range(i + 1, n):
                factor, other = self.triangle[i, j], states[j, :-1]
                driven.real[1:] += factor.real * other.real - factor.imag * other.imag
                driven.imag[1:] += factor.real * other.imag + factor.imag * other.real
            states[i] = lfilter([1.0], [1.0, -self.triangle[i, i]], driven)
            total += self.seen[i].real * states[i].real - self.seen[i].imag * states[i].imag
        return total


def square_root(covariance: Array) -> Array:
    """Return a matrix whose product with its transpose is a covariance (n, n), which may be singular."""
    scale = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(covariance / scale[:, None] / scale)
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


@dataclass(frozen=True)
class FilterPaths:
    """Paths of a filter at knots of a constant distance, with exact covariances; they do not repeat."""

    process: SampledProcess
    shape: ShapingFilter

    period = math.inf

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Angular frequency of the cutoff, and the lost fraction of the variance."""
        high, edges, above = highest_frequency(self.process)
        return high, integral_above(self.process.two_sided, edges, above, self.band_of(high)) / float(above[0])

    @staticmethod
    def band_of(high: float) -> float:
        """Return half of the angular frequency of the knots."""
        return high * KNOTS_PER_WAVE / 2

    @property
    def step(self) -> float:
        """Distance of the knots, m or s."""
        return math.pi / self.band[1]

    @property
    def band(self) -> tuple[float, float]:
        """Angular frequencies that the knots resolve."""
        return 0.0, self.band_of(self._ends[0])

    @property
    def lost(self) -> float:
        """Fraction of the variance above the band, which the knots fold into the band."""
        return self._ends[1]

    def changed(self, factor: float, frequency: Array) -> Array:
        """Return how much knots change the two-sided density, if the cutoff is multiplied by a factor.

        The density at the knots is the density of the chain, which is periodic. The spline multiplies this density by a
        weight.
        """
        step = self.step / factor
        chain = self.chains[0] if factor == 1.0 else DiscretisedFilter.of(*self.shape.matrices, step)
        half = 0.5 * step * frequency
        # transfer function of the cardinal spline
        weight = np.sinc(half / np.pi) ** 4 * 3 / (2 + np.cos(2 * half))
        return np.asarray(np.abs(chain.density(2 * half) * step * weight**2 - self.shape.two_sided(frequency)))

    @cached_property
    def chains(self) -> tuple[DiscretisedFilter, DiscretisedFilter, Array]:
        """Chains forwards and backwards, and the square root of the covariance at each knot."""
        from scipy.linalg import solve_continuous_lyapunov

        a, b, c = self.shape.matrices
        covariance = solve_continuous_lyapunov(a, -np.outer(b, b))
        scale = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv(covariance / scale[:, None] / scale, rcond=1e-13, hermitian=True)
        reversed_a = covariance @ a.T @ (inverse / scale[:, None] / scale)
        rest = (reversed_a @ covariance + covariance @ reversed_a.T + np.outer(b, b)) / scale[:, None] / scale
        if np.abs(rest).max() > ACCURATE * float(np.abs(a).max()):
            raise uqmbd.StudyError(
                f"random process {self.process.family!r}: the states of the filter are too dependent to compute paths "
                "before zero. Use a filter of lower order, or paths='harmonics'."
            )
        return (
            DiscretisedFilter.of(a, b, c, self.step),
            DiscretisedFilter.of(reversed_a, b, c, self.step),
            square_root(covariance),
        )

    def draw(
        self, sources: Sequence[SampledProcess], keys: Array, begin: float, end: float
    ) -> tuple[float, float, Array]:
        """Return the first knot, the step and the coefficients (K, sources, n) of paths on an interval."""
        where, units = f"random process {self.process.family!r}", UNITS[self.process.over]
        check_interval(where, begin, end)
        check_family(sources)
        step = self.step
        start, stop = math.floor(begin / step) - MARGIN, math.ceil(end / step) + MARGIN
        low, high = start - 1 - REACH, stop + 1 + REACH
        if max(high, -low) > MOST_KNOTS:
            raise uqmbd.StudyError(
                f"{where}: a path from {begin:g} to {end:g} {units[0]} has {max(high, -low)} knots from zero; at most "
                f"{MOST_KNOTS} are supported. Give the process a lower cutoff=, {units[1]}."
            )
        found = np.empty((len(keys), len(sources), stop - start + 3))
        for k, key in enumerate(keys.tolist()):
            found[k] = _coefficients(self._values(key, low, high))
        return start * step, step, found

    def _values(self, key: float, low: int, high: int) -> Array:
        """Return the path of a key at the knots from `low` to `high`."""
        after, before, root = self.chains
        n, count = len(root), (max(high, 0), max(-low, 0))
        normal = [normal_numbers(self.process, key, n * (m or 1), k) for k, m in enumerate((1, *count))]
        # add numbers in a fixed order, so that rounding does not depend on the interval
        first = np.array([sum(float(root[i, j] * normal[0][j]) for j in range(n)) for i in range(n)])
        forwards = after.values(first, normal[1].reshape(-1, n)[: count[0]])
        backwards = before.values(first, normal[2].reshape(-1, n)[: count[1]])
        return np.concatenate([backwards[:0:-1], forwards])[low + count[1] : high + count[1] + 1]


def _coefficients(values: Array) -> Array:
    """Return the coefficients of the cubic B-spline through values at knots, without `REACH` knots at both ends."""
    pole, count = math.sqrt(3.0) - 2.0, len(values) - 2 * REACH
    found = math.sqrt(3.0) * values[REACH : REACH + count]
    for k in range(1, REACH + 1):
        both = values[REACH - k : REACH - k + count] + values[REACH + k : REACH + k + count]
        found += math.sqrt(3.0) * pole**k * both
    return np.asarray(found)
