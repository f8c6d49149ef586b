"""Spectral densities of covariances and of records."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd_processes.densities import PowerSpectralDensity

__all__ = ["Smooth", "Tabulated", "covariance_density", "welch_density", "welch_error"]

Array = NDArray[np.float64]

DECAYED = 1e-9
"""Covariance, relative to the variance, that counts as zero."""

POINTS, DECADES = 1200, 3.5
"""Number of frequencies of a transformed covariance, and their decades above the reciprocal of its extent."""

AGREES = 1e-4
"""Largest relative difference between the integral of the density and the variance."""

NEGLIGIBLE = 1e-11
"""Density, relative to the largest one, at which a transformed covariance ends."""

SEGMENTS = 16
"""Number of segments of a record, which overlap by half."""


@dataclass(frozen=True)
class Smooth:
    """Density through points by a cubic spline of the logarithms; constant below them, ``a / x^2 + b / x^4`` above."""

    frequencies: tuple[float, ...]
    values: tuple[float, ...]

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline

        return CubicSpline(np.log(self.frequencies), np.log(self.values))

    def __call__(self, frequency: Array) -> Array:
        """Return densities."""
        first, last = self.frequencies[0], self.frequencies[-1]
        near, far = np.exp(self._spline(np.log([last / 2, last]))) * np.array([last / 2, last]) ** 2
        quartic = (near - far) * last**2 / 3
        square = far - quartic / last**2
        inside = np.exp(self._spline(np.log(np.clip(frequency, first, last))))
        beyond = np.maximum(frequency, last)
        return np.asarray(np.where(frequency <= last, inside, np.maximum(square + quartic / beyond**2, 0) / beyond**2))


@dataclass(frozen=True)
class Tabulated:
    """Density through points by linear interpolation of the logarithms, or of the values if one of them is zero."""

    frequencies: tuple[float, ...]
    values: tuple[float, ...]

    def __call__(self, frequency: Array) -> Array:
        """Return densities."""
        x, y = np.array(self.frequencies), np.array(self.values)
        if (y > 0).all():
            with np.errstate(divide="ignore"):
                return np.asarray(np.exp(np.interp(np.log(frequency), np.log(x), np.log(y))))
        return np.asarray(np.interp(frequency, x, y))


@lru_cache(maxsize=32)
def covariance_density(where: str, covariance: Callable[[Array], Array], over: str) -> PowerSpectralDensity:
    """Return the density of a covariance: its cosine transform, interpolated over a grid of frequencies."""
    if not callable(covariance):
        raise uqmbd.StudyError(f"{where}: covariance is {covariance!r}; expected a function of the lag.")
    try:
        zero = float(np.asarray(covariance(np.zeros(1)))[0])
    except (TypeError, ValueError, IndexError) as error:
        raise uqmbd.StudyError(
            f"{where}: covariance failed for an array of lags ({error}); expected a function of NumPy arrays."
        ) from None
    if not 0 < zero < math.inf:
        raise uqmbd.StudyError(f"{where}: the covariance at lag zero is {zero}; expected a positive number.")

    def later(lag: float) -> float:
        found = np.abs(np.asarray(covariance(lag * np.geomspace(1, 100, 200)), dtype=float))
        return float(found.max()) if np.isfinite(found).all() else math.inf

    extent = next((x for x in 10.0 ** np.arange(-6, 9, 0.25) if later(x) <= DECAYED * zero), math.nan)
    if math.isnan(extent):
        raise uqmbd.StudyError(
            f"{where}: covariance does not decay to zero within 1e8 {'m' if over == 'distance' else 's'}; the process "
            "has no spectral density."
        )
    # panels finer towards zero, where the covariance may have a corner
    edges = np.concatenate([[0.0], extent * np.geomspace(1e-5, 1, 120)])
    nodes, weights = np.polynomial.legendre.leggauss(16)
    frequencies = np.geomspace(0.03, 10.0**DECADES, POINTS) / extent
    values = np.zeros(POINTS)
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        # at least one panel for each period of the highest frequency
        parts = max(1, math.ceil((end - begin) * frequencies[-1] / 8))
        bounds = np.linspace(begin, end, parts + 1)
        lag = (bounds[:-1, None] + np.diff(bounds)[:, None] * (nodes + 1) / 2).ravel()
        weight = (np.diff(bounds)[:, None] * weights / 2).ravel()
        values += np.cos(np.outer(frequencies, lag)) @ (weight * np.asarray(covariance(lag), dtype=float)) / math.pi
    if values.min() < -AGREES * values.max():
        raise uqmbd.StudyError(
            f"{where}: the spectral density of covariance is negative, so the function is not a covariance."
        )
    count = int(np.argmax(values <= NEGLIGIBLE * values.max())) or POINTS
    table = Smooth(tuple(frequencies[:count].tolist()), tuple(values[:count].tolist()))
    band = (0.0, math.inf if count == POINTS else float(frequencies[count - 1]))
    found = PowerSpectralDensity(table, "two", "rad/m" if over == "distance" else "rad/s", band)
    if not math.isclose(found.variance, zero, rel_tol=AGREES):
        raise uqmbd.StudyError(
            f"{where}: the density computed from covariance has the variance {found.variance:.6g} instead of "
            f"{zero:.6g}; give its psd= or filter= instead."
        )
    return found


def _segment(count: int) -> int:
    """Return the length of the segments of a record."""
    return max(16, 2 * count // (SEGMENTS + 1))


def welch_error(count: int) -> float:
    """Return the relative standard error of a density that is estimated from a record of `count` values.

    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Transactions on Audio and
    Electroacoustics 15 (1967) 70-73: segments that overlap by half have the correlation (1 / 6)^2 with Hann's window.
    """
    size = _segment(count)
    segments = max((count - size // 2) // (size - size // 2), 1)
    return math.sqrt((1 + 2 * (1 - 1 / segments) / 36) / segments)


def welch_density(where: str, given: Any, over: str) -> tuple[PowerSpectralDensity, tuple[float, tuple[float, ...]]]:
    """Return Welch's estimate of the density of a record, and the record as plain numbers."""
    expected = "expected (step, values): a positive number, and at least 64 finite numbers"
    try:
        step, values = float(given[0]), np.asarray(given[1], dtype=float)
    except (TypeError, ValueError, IndexError):
        raise uqmbd.StudyError(f"{where}: record is {given!r}; {expected}.") from None
    if not 0 < step < math.inf or values.ndim != 1 or len(values) < 64 or not np.isfinite(values).all():
        raise uqmbd.StudyError(f"{where}: record has the step {step} and the shape {values.shape}; {expected}.")
    from scipy.signal import welch

    frequencies, density = welch(values, fs=1 / step, nperseg=_segment(len(values)))
    table = Tabulated(tuple(frequencies[1:].tolist()), tuple(density[1:].tolist()))
    found = PowerSpectralDensity(
        table, "one", "cycle/m" if over == "distance" else "Hz", (float(frequencies[1]), float(frequencies[-1]))
    )
    return found, (step, tuple(values.tolist()))
