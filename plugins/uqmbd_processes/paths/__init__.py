"""Sampled paths of stationary Gaussian processes: sums of harmonics, shaping filters, and Karhunen-Loeve expansions."""

from __future__ import annotations

from uqmbd_processes.paths.filters import (
    ExponentialCovariance,
    FilterPaths,
    ShapingFilter,
    check_positive,
    exponential_covariance,
    shaping_filter,
)
from uqmbd_processes.paths.harmonics import KNOTS_PER_WAVE, LineSpectrum, draw_splines, line_powers, line_spectrum
from uqmbd_processes.paths.karhunen_loeve import KarhunenLoevePaths

__all__ = [
    "KNOTS_PER_WAVE",
    "ExponentialCovariance",
    "FilterPaths",
    "KarhunenLoevePaths",
    "LineSpectrum",
    "ShapingFilter",
    "check_positive",
    "draw_splines",
    "exponential_covariance",
    "line_powers",
    "line_spectrum",
    "shaping_filter",
]
