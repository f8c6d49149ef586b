"""Strongest spectral lines of signals: numerical analysis of fundamental frequencies.

References
----------
J. Laskar, C. Froeschlé and A. Celletti, Physica D 56 (1992) 253-269.
J. Laskar, Introduction to frequency map analysis, in: Hamiltonian Systems with Three or More Degrees of Freedom,
Kluwer, 1999, 134-150.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from uqmbd.typing import Array
from uqmbd_collocation.two_frequency.series import Signals, fit_series, refine

__all__ = ["SpectralLines", "strongest_lines"]


PADDED = 4
"""Ratio of the lengths of the zero-padded and the original signal."""

CLOSEST = 1.5
"""Least distance of a new maximum from known lines, and from zero, relative to the resolution 2 pi / length."""

WEAKEST = 1e-4
"""Least ratio of a line to the strongest line."""


@dataclass(frozen=True, eq=False)
class SpectralLines:
    """Lines of a spectrum, the strongest first."""

    frequencies: Array  # (L,) rad/s
    sizes: Array  # (L,) root mean square over the signals


def strongest_lines(signals: Signals, count: int) -> SpectralLines:
    """Return the strongest lines, at most `count`.

    Each new line is the maximum in the spectrum of the residual, after subtraction of the earlier lines. After each new
    line, all lines are fitted again.

    The analysis cannot separate lines nearer to each other, or to zero, than the resolution 2 pi / length. The search
    ends before it adds such a line.
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
        # fit all lines together with their amplitudes; otherwise the residual of a line would appear as another line
        joint = refine(signals, np.array(tried), np.eye(len(tried), dtype=np.int64))
        lines = np.sort(np.abs(joint.frequencies))
        if np.diff(np.concatenate([[0.0], lines])).min() < resolution:
            break
        found = np.abs(joint.frequencies).tolist()
        left = signals.values - _fit(signals, np.array(found))
    frequencies = np.array(found)
    sizes = _sizes(signals, frequencies)
    kept = np.argsort(-sizes)
    kept = kept[sizes[kept] >= WEAKEST * sizes.max(initial=0.0)]
    return SpectralLines(frequencies[kept], sizes[kept])


def _smooth(signals: Signals) -> Array:
    """Return the least-squares fit by a constant and a linear drift for each output, shape (N, O)."""
    return _fit(signals, np.zeros(0))


def _fit(signals: Signals, frequencies: Array) -> Array:
    """Return the least-squares fit by lines, a constant and a linear drift, shape (N, O)."""
    series = fit_series(signals, frequencies, np.eye(len(frequencies), dtype=np.int64))
    return series.at(signals.times)


def _sizes(signals: Signals, frequencies: Array) -> Array:
    series = fit_series(signals, frequencies, np.eye(len(frequencies), dtype=np.int64))
    return np.asarray(np.sqrt(np.mean(series.sizes() ** 2, axis=1)))


def _highest(signals: Signals, left: Array, known: Array, resolution: float) -> float | None:
    """Return the frequency of the maximum of the discrete spectrum away from known lines and zero, rad/s."""
    length = PADDED * len(signals.times)
    step = signals.times[1]
    power = np.sum(np.abs(np.fft.rfft(left * signals.window[:, None], length, axis=0)) ** 2, axis=1)
    frequencies = 2 * np.pi * np.fft.rfftfreq(length, step)
    near = np.abs(frequencies[:, None] - np.concatenate([[0.0], known])).min(axis=1) < CLOSEST * resolution
    power[near] = 0.0
    best = int(np.argmax(power))
    return float(frequencies[best]) if power[best] > 0 else None


def _refined(signals: Signals, left: Array, guess: float, resolution: float) -> float:
    """Return the frequency of the maximum of the windowed spectrum near a guess, rad/s."""
    weighted = left * signals.window[:, None]

    def lower(frequency: float) -> float:
        wave = np.exp(-1j * frequency * signals.times)
        return -float(np.sum(np.abs(wave @ weighted) ** 2))

    half = resolution / PADDED
    bounds = (guess - half, guess + half)
    found = optimize.minimize_scalar(lower, bounds=bounds, method="bounded", options={"xatol": 1e-7 * half})
    return float(found.x)
