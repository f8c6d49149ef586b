"""Sampled paths by a truncated Karhunen-Loeve expansion of the covariance on an interval.

A path is ``sum_m sqrt(l_m) f_m(x) z_m`` with independent normal ``z`` and the eigenfunctions of the covariance with the
largest eigenvalues. Those of an exponential covariance are known in closed form (Ghanem & Spanos 1991, section 2.3.3).
Others are computed by Nystroem's method at the knots and between them.

The omitted terms are not stationary. Their spectrum is therefore a mean over the interval with the weight of Hann's
window: the sum of ``l_m |F_m|^2`` with the Fourier transforms ``F_m`` of the eigenfunctions times a sine half-wave.

R. G. Ghanem, P. D. Spanos, "Stochastic Finite Elements: A Spectral Approach", Springer, 1991.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd_processes.descriptions import check_family
from uqmbd_processes.paths.filters import ExponentialCovariance
from uqmbd_processes.paths.harmonics import (
    KNOTS_PER_WAVE,
    MARGIN,
    UNITS,
    LineSpectrum,
    SampledProcess,
    check_interval,
    highest_frequency,
    line_powers,
    normal_numbers,
)

__all__ = ["MOST_TERMS", "KarhunenLoevePaths", "eigenfunctions"]

Array = NDArray[np.float64]

MOST_TERMS = 512
"""Largest number of terms; the eigenvalues of more terms need too much time."""

FINE = 2
"""Points of Nystroem's method for each knot."""

SPECTRUM = 2
"""Ratio of the number of eigenfunctions with a computed spectrum to the number of terms."""

PERIODS = 8
"""Period of the lines that approximate a covariance, relative to the length of the interval."""

ACCURATE = 1e-3
"""Largest error of the eigenvalues, relative to their sum."""

GREGORY = (3 / 8, 7 / 6, 23 / 24)
"""Weights of the first points of Gregory's rule, of the order 4."""

RESOLUTION = 16
"""Length of a transform, relative to the number of points."""


@dataclass(frozen=True)
class KarhunenLoevePaths:
    """Paths of a process between zero and its length, with about ``2 cutoff`` terms per unit of the length."""

    process: SampledProcess
    covariance: ExponentialCovariance | None
    """Covariance with eigenfunctions in closed form."""

    period = math.inf

    @property
    def length(self) -> float:
        """Length of the interval, m or s."""
        assert self.process.length is not None
        return self.process.length

    @cached_property
    def terms(self) -> int:
        """Number of terms."""
        where, units = f"random process {self.process.family!r}", UNITS[self.process.over][1]
        wanted = math.ceil(2 * self.length * highest_frequency(self.process)[0] / (2 * math.pi) - 1e-9)
        if wanted > MOST_TERMS:
            raise uqmbd.StudyError(
                f"{where}: paths='karhunen_loeve' would have {wanted} terms in the length of {self.length:g}; at most "
                f"{MOST_TERMS} are supported. Write a shorter length=, or a lower frequency, such as "
                f"cutoff={0.5 * MOST_TERMS / self.length:.3g} {units}, which has {MOST_TERMS} terms."
            )
        return max(wanted, 1)

    @property
    def band(self) -> tuple[float, float]:
        """Zero, and the angular frequency of the last term."""
        return 0.0, math.pi * self.terms / self.length

    @property
    def knots(self) -> int:
        """Number of intervals between knots."""
        # the last eigenfunctions have up to one half wave more than terms
        return KNOTS_PER_WAVE // 2 * max(self.terms + 1, 4)

    @property
    def step(self) -> float:
        """Distance of the knots, m or s."""
        return self.length / self.knots

    @cached_property
    def _spectra(self) -> dict[float, tuple[Callable[[Array], Array], Callable[[Array], Array]]]:
        return {}

    @cached_property
    def expansion(self) -> tuple[Array, Array]:
        """Return the eigenvalues and the eigenfunctions (terms, points) of the spectrum, at `FINE` points a knot."""
        count, points = SPECTRUM * self.terms, FINE * self.knots
        if self.covariance is not None:
            return eigenfunctions(self.covariance, self.length, count, points)
        values, functions = _nystroem(self.process, self.length, count, points)
        coarse, _ = _nystroem(self.process, self.length, self.terms, self.knots)
        error = float(np.abs(coarse - values[: self.terms]).sum() / values.sum())
        if error > ACCURATE:
            raise uqmbd.StudyError(
                f"random process {self.process.family!r}: the eigenvalues of paths='karhunen_loeve' have the relative "
                f"error {error:.2g}, above {ACCURATE:g}; the {self.terms} terms do not resolve the covariance. Give a "
                "higher cutoff=."
            )
        return values, functions

    @property
    def lost(self) -> float:
        """Fraction of the variance of the omitted terms, a mean over the interval."""
        kept = float(self.expansion[0][: self.terms].sum()) / (self.length * self.process.variance)
        return max(1.0 - kept, 0.0)

    @cached_property
    def _coefficients(self) -> Array:
        """Coefficients of splines (terms, n) through the terms at the knots, from `MARGIN` knots before zero."""
        from scipy.linalg import solve_banded

        values, functions = self.expansion
        at = np.sqrt(values[: self.terms, None]) * functions[: self.terms, ::FINE]
        n = self.knots + 3
        bands = np.zeros((9, n))
        rows = np.arange(1, n - 1)
        for shift, weight in ((-1, 1 / 6), (0, 4 / 6), (1, 1 / 6)):
            bands[4 - shift, rows + shift] = weight
        # the third derivative is continuous at the first and the last inner knot
        for k, weight in enumerate((1.0, -4.0, 6.0, -4.0, 1.0)):
            bands[4 - k, k] = weight
            bands[4 + k, n - 1 - k] = weight
        right = np.zeros((n, self.terms))
        right[1:-1] = at.T
        inner = solve_banded((4, 4), bands, right).T
        # linear beyond the interval, which no argument of a study needs
        reach = np.arange(1, MARGIN + 1)
        before = inner[:, :1] + (inner[:, :1] - inner[:, 1:2]) * reach[::-1]
        after = inner[:, -1:] + (inner[:, -1:] - inner[:, -2:-1]) * reach
        return np.hstack([before, inner, after])

    def draw(
        self, sources: Sequence[SampledProcess], keys: Array, begin: float, end: float
    ) -> tuple[float, float, Array]:
        """Return the first knot, the step and the coefficients (K, sources, n) of paths on an interval."""
        where, units = f"random process {self.process.family!r}", UNITS[self.process.over][0]
        check_interval(where, begin, end)
        check_family(sources)
        if begin < -1e-9 * self.length or end > (1 + 1e-9) * self.length:
            raise uqmbd.StudyError(
                f"{where}: paths='karhunen_loeve' is an expansion between 0 and length={self.length:g} {units}, but a "
                f"path from {begin:g} to {end:g} {units} was requested. Write a greater length=, and add an offset "
                "to arguments below zero."
            )
        step = self.step
        low = min(max(math.floor(begin / step + 1e-6), 0), self.knots)
        high = max(min(math.ceil(end / step - 1e-6), self.knots), low)
        terms = self._coefficients[:, low : high + 2 * MARGIN + 3]
        found = np.empty((len(keys), len(sources), terms.shape[1]))
        for k, key in enumerate(keys.tolist()):
            # sums in a fixed order, so that rounding does not depend on the interval
            path = np.zeros(terms.shape[1])
            for number, term in zip(normal_numbers(self.process, key, self.terms).tolist(), terms, strict=True):
                path += number * term
            found[k] = path
        return (low - MARGIN) * step, step, found

    def changed(self, factor: float, frequency: Array) -> Array:
        """Return the two-sided density of the omitted terms, if the number of terms is multiplied by a factor."""
        if factor not in self._spectra:
            self._spectra[factor] = self._spectrum(max(math.ceil(factor * self.terms), 1))
        inner, every = self._spectra[factor]
        found = np.asarray(inner(frequency))
        # eigenfunctions without a computed spectrum have the remaining density
        high = self.band[1]
        if self.process.band[1] > SPECTRUM * high:
            rest = np.clip((frequency / high - 1) / (SPECTRUM - 1), 0.0, 1.0)
            smooth = rest**2 * (3 - 2 * rest)
            found = found + smooth * np.maximum(self.process.two_sided(frequency) - every(frequency), 0.0)
        return np.maximum(found, 0.0)

    def _spectrum(self, terms: int) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
        """Return the mean density of the eigenfunctions after the first `terms`, and of all eigenfunctions."""
        values, functions = self.expansion
        points = functions.shape[1]
        window = math.sqrt(2 / self.length) * np.sin(np.linspace(0.0, math.pi, points))
        count = 2 * points
        powers = np.zeros((2, count // 2 + 1))
        for m, (value, function) in enumerate(zip(values, functions, strict=True)):
            one = value * np.abs(np.fft.rfft(window * function, count)) ** 2
            powers[1] += one
            if m >= terms:
                powers[0] += one
        step = self.length / (points - 1)
        # zeros between the correlations at the largest lags give more frequencies
        lags = np.fft.irfft(powers, count)
        size = RESOLUTION * points
        padded = np.zeros((2, size))
        padded[:, :points], padded[:, -points + 1 :] = lags[:, :points], lags[:, -points + 1 :]
        density = np.fft.rfft(padded).real * step**2 / (2 * math.pi)
        first = 2 * math.pi / (size * step)
        return _Table(first, density[0]), _Table(first, density[1])


class _Table:
    """Cubic spline through a density at equidistant frequencies from zero; zero beyond them."""

    def __init__(self, step: float, values: Array) -> None:
        from scipy.interpolate import CubicSpline

        self.end = step * (len(values) - 1)
        self.spline = CubicSpline(step * np.arange(len(values)), values)

    def __call__(self, frequency: Array) -> Array:
        """Return densities."""
        inside = frequency < self.end
        return np.asarray(np.where(inside, self.spline(np.where(inside, frequency, 0.0)), 0.0))


def eigenfunctions(covariance: ExponentialCovariance, length: float, count: int, points: int) -> tuple[Array, Array]:
    """Return eigenvalues (count,) and eigenfunctions (count, points + 1) of an exponential covariance on an interval.

    The frequencies solve ``w length = m pi + 2 atan(c / w)`` with ``c = 1 / correlation length``.
    """
    rate = 1 / covariance.length
    number = np.arange(count)
    low, high = number * math.pi / length, (number + 1) * math.pi / length
    for _ in range(64):
        middle = (low + high) / 2
        above = middle * length - number * math.pi - 2 * np.arctan2(rate, middle) > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    frequency = (low + high) / 2
    phase = np.arctan2(rate, frequency)
    square = length / 2 + (np.sin(2 * (frequency * length - phase)) + np.sin(2 * phase)) / (4 * frequency)
    x = np.linspace(0.0, length, points + 1)
    functions = np.cos(frequency[:, None] * x - phase[:, None]) / np.sqrt(square)[:, None]
    return 2 * rate * covariance.deviation**2 / (frequency**2 + rate**2), functions


def _nystroem(process: SampledProcess, length: float, count: int, points: int) -> tuple[Array, Array]:
    """Return the largest eigenvalues (count,) and eigenfunctions (count, points + 1) on an interval.

    The covariance contains the frequencies that the points resolve; it is therefore smooth. The matrix is symmetric
    about both diagonals, so that its eigenvectors are even or odd.
    """
    from scipy.linalg import eigh, toeplitz
    from threadpoolctl import threadpool_limits

    lags = _covariance(process, length, points)
    weights = np.ones(points + 1)
    weights[:3], weights[-3:] = GREGORY, GREGORY[::-1]
    root = np.sqrt(weights * length / points)
    matrix = toeplitz(lags) * root * root[:, None]
    half = points // 2  # the number of points is odd
    corner, mirrored = matrix[:half, :half], matrix[:half, :half:-1]
    even = np.zeros((half + 1, half + 1))
    even[:half, :half], even[half, half] = corner + mirrored, matrix[half, half]
    even[half, :half] = even[:half, half] = math.sqrt(2) * matrix[:half, half]
    # the rounding of one thread does not depend on the number of workers
    with threadpool_limits(1):
        parts = [eigh(even), eigh(corner - mirrored)]
    values = np.concatenate([part[0] for part in parts])
    vectors = np.zeros((len(values), points + 1))
    for place, (_, found), sign in ((0, parts[0], 1.0), (half + 1, parts[1], -1.0)):
        own = vectors[place : place + found.shape[1]]
        own[:, :half] = found[:half].T / math.sqrt(2)
        own[:, half + 1 :] = sign * own[:, half - 1 :: -1]
        if sign > 0:
            own[:, half] = found[half]
    largest = np.argsort(-values, kind="stable")[:count]
    functions = vectors[largest] / root
    values = np.maximum(values[largest], 0.0)
    functions *= np.where(functions[:, :1] < 0, -1.0, 1.0)
    return values, functions


def _covariance(process: SampledProcess, length: float, points: int) -> Array:
    """Return the covariance at equidistant lags (points + 1,) without the frequencies that they do not resolve."""
    low, end = process.band
    period, knots = PERIODS * length, PERIODS * points
    high = min(end, math.pi * points / length)
    spectrum = LineSpectrum(period, (low, high), 0.0, knots)
    numbers, powers = spectrum.lines, line_powers(process, spectrum)
    inside = numbers <= knots // 2
    lines = np.zeros(knots // 2 + 1)
    lines[numbers[inside]] = np.where(numbers == 0, 2 * powers, powers)[inside]
    found = np.fft.irfft(lines, knots, norm="forward")[: points + 1]
    # the mean over the bin of each line
    return np.asarray(found / np.sinc(np.arange(points + 1) / knots))
