"""The strongest spectral lines of signals: numerical analysis of fundamental frequencies.

References
----------
J. Laskar, C. Froeschlé and A. Celletti, Physica D 56 (1992) 253-269.
J. Laskar, Introduction to frequency map analysis, in: Hamiltonian Systems with Three or More Degrees of Freedom,
Kluwer, 1999, 134-150.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from uqmbd.typing import Array
from uqmbd_collocation.two_frequency.series import Signals, fit_series, refine

__all__ = ["SpectralLines", "strongest_lines"]


PADDED = 4
"""Values of the discrete spectrum for each independent one."""

CLOSEST = 1.5
"""Least distance of a line from others, and from zero, over the resolution 2 pi / length."""

WEAKEST = 1e-4
"""Size of a line over the strongest below which there are none."""


@dataclass(frozen=True, eq=False)
class SpectralLines:
    """Lines of a spectrum, the strongest first."""

    frequencies: Array  # (L,) rad/s
    sizes: Array  # (L,) root mean square over the signals


def strongest_lines(signals: Signals, count: int) -> SpectralLines:
    """Return at most `count` lines: maxima of the spectrum of the residual of earlier lines, refitted each time.

    Lines that are nearer to each other, or to zero, than the resolution 2 pi / length are not told apart: none is added
    that comes so near to another.
    """
    resolution = 2 * np.pi / signals.length
    found: list[float] = []
    left = signals.values - _smooth(signals)
    while len(found) < count:
        guess = _highest(signals, left, np.array(found), resolution)
        if guess is None:
            break
        tried = [*found, _refined(signals, left, guess, resolution)]
        sizes = _sizes(signals, np.array(tried))
        if sizes[-1] < WEAKEST * sizes.max():
            break
        # all lines and their sizes together: what one of them misses is no line beside it
        joint = refine(signals, np.array(tried), np.eye(len(tried), dtype=np.int64))
        lines = np.sort(np.abs(joint.frequencies))
        if np.diff(np.concatenate([[0.0], lines])).min() < resolution:
            break
        found = np.abs(joint.frequencies).tolist()
        left = signals.values - _explained(signals, np.array(found))
    frequencies = np.array(found)
    sizes = _sizes(signals, frequencies)
    kept = np.argsort(-sizes)
    kept = kept[sizes[kept] >= WEAKEST * sizes.max(initial=0.0)]
    return SpectralLines(frequencies[kept], sizes[kept])


def _smooth(signals: Signals) -> Array:
    """Constants and drifts (N, O)."""
    return _explained(signals, np.zeros(0))


def _explained(signals: Signals, frequencies: Array) -> Array:
    """Least squares by lines (N, O)."""
    series = fit_series(signals, frequencies, np.eye(len(frequencies), dtype=np.int64))
    return series.at(signals.times)


def _sizes(signals: Signals, frequencies: Array) -> Array:
    series = fit_series(signals, frequencies, np.eye(len(frequencies), dtype=np.int64))
    return np.asarray(np.sqrt(np.mean(series.sizes() ** 2, axis=1)))


def _highest(signals: Signals, left: Array, known: Array, resolution: float) -> float | None:
    """Frequency of the highest value of the discrete spectrum apart from known lines and zero."""
    length = PADDED * len(signals.times)
    step = signals.times[1]
    power = np.sum(np.abs(np.fft.rfft(left * signals.window[:, None], length, axis=0)) ** 2, axis=1)
    frequencies = 2 * np.pi * np.fft.rfftfreq(length, step)
    near = np.abs(frequencies[:, None] - np.concatenate([[0.0], known])).min(axis=1) < CLOSEST * resolution
    power[near] = 0.0
    best = int(np.argmax(power))
    return float(frequencies[best]) if power[best] > 0 else None


def _refined(signals: Signals, left: Array, guess: float, resolution: float) -> float:
    """Maximum of the windowed spectrum near a guess."""
    weighted = left * signals.window[:, None]

    def lower(frequency: float) -> float:
        wave = np.exp(-1j * frequency * signals.times)
        return -float(np.sum(np.abs(wave @ weighted) ** 2))

    half = resolution / PADDED
    bounds = (guess - half, guess + half)
    found = minimize_scalar(lower, bounds=bounds, method="bounded", options={"xatol": 1e-7 * half})
    return float(found.x)
