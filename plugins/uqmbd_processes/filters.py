"""Shaping filters of processes with a rational spectrum, and covariances that have one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import uqmbd

__all__ = ["ExponentialCovariance", "ShapingFilter", "check_positive", "exponential_covariance", "shaping_filter"]

Array = NDArray[np.float64]


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
        White noise in the output.

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
    """Raise unless numbers are positive."""
    for name, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not 0 < value < math.inf:
            raise uqmbd.StudyError(f"{where}: {name} is {value!r}; expected a positive number.")


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
    """Return the filter of three matrices, or raise if they are invalid."""
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
            "stationary."
        )
    rows = tuple(tuple(float(x) for x in row) for row in a)
    return ShapingFilter(rows, tuple(b.ravel().tolist()), tuple(c.ravel().tolist()))
