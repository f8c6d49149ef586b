"""Quasi-periodic series fitted to signals: frequencies by the Gauss-Newton method, amplitudes by least squares.

The derivative of the residuals with respect to a frequency is analytical (variable projection). The analytical
derivative takes a fifth of the time of :func:`scipy.optimize.least_squares`, which computes the whole design matrix
again for each difference quotient.

References
----------
G. Golub and V. Pereyra, Inverse Problems 19 (2003) R1-R26 (variable projection; Kaufman's derivative).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from uqmbd.typing import Array, Index

__all__ = ["HarmonicSeries", "Signals", "fit_series", "refine"]


RIDGE = 1e-5
"""Weight of the amplitudes relative to the residuals: signals determine only the sum of amplitudes of one frequency."""

GROWTH, HEAVIEST = 4.0, 256.0
"""Factor by which the weight grows from order to order, and largest total factor. Growing weights favour low orders."""

STEPS = 12
"""Largest number of Gauss-Newton steps."""

SETTLED = 1e-11
"""Change of a phase in rad at the end of the signal, below which the iteration stops."""

FARTHEST = 1.0
"""Largest change of a phase at the end of the signal in one step, rad."""

FEWEST = 512
"""Least number of values of a signal."""

HALVINGS = 6
"""Largest number of halvings of a step that increases the residual."""


@dataclass(frozen=True, eq=False)
class Signals:
    """Outputs of one realisation."""

    times: Array  # (N,) evenly spaced, from 0, s
    values: Array  # (N, O) divided by their scales

    @property
    def length(self) -> float:
        """Duration of the signal, s."""
        return float(self.times[-1])

    def until(self, end: float) -> Signals:
        """Return the part of the signal until a time, s."""
        count = int(np.searchsorted(self.times, end * (1 + 1e-12), side="right"))
        return Signals(self.times[:count], self.values[:count])

    def thinned(self, lost: float) -> Signals:
        """Return every n-th value; n is the largest power of two for which the removed frequencies have little energy.

        `lost` is the largest share of the energy at the removed frequencies.
        """
        power = np.sum(np.abs(np.fft.rfft(self.values * self.window[:, None], axis=0)) ** 2, axis=1)
        above = np.cumsum(power[::-1])[::-1] / max(float(power.sum()), 1e-300)
        stride = 1
        # aliasing must not affect the lower three quarters of the remaining band
        while len(self.times) > 2 * FEWEST * stride and above[int(0.75 * len(power) / (2 * stride))] < lost:
            stride *= 2
        return Signals(self.times[::stride], self.values[::stride])

    @property
    def window(self) -> Array:
        """Weights (N,) of a Hann window with the sum 1, which reduces the effect of omitted lines on others."""
        found: Array = np.sin(np.pi * (np.arange(len(self.times)) + 0.5) / len(self.times)) ** 2
        return np.asarray(found / found.sum())


@dataclass(frozen=True, eq=False)
class HarmonicSeries:
    """Sum of harmonics of few frequencies, a constant, and a drift."""

    frequencies: Array  # (M,) base frequencies, rad/s
    lattice: Index  # (H, M) multiples of the base frequencies in each harmonic
    amplitudes: Array  # (2 + 2 H, O) constants, drifts (1/s), cosines, sines
    residual: Array  # (O,) root mean square over all times with equal weights
    misfit: float  # mean square of the weighted residuals of all signals, which the fit minimises

    def at(self, times: Array) -> Array:
        """Return the sum at times (N,): (N, O)."""
        return np.asarray(_design(times, self.frequencies, self.lattice) @ self.amplitudes)

    def sizes(self) -> Array:
        """Return the size (H, O) of each harmonic."""
        half = len(self.lattice)
        return np.hypot(self.amplitudes[2 : 2 + half], self.amplitudes[2 + half :])


@dataclass(frozen=True, eq=False)
class _SolvedAmplitudes:
    """Least-squares amplitudes at given frequencies."""

    design: Array
    factor: tuple[Array, bool]
    amplitudes: Array
    left: Array
    misfit: float


def fit_series(signals: Signals, frequencies: Array, lattice: Index) -> HarmonicSeries:
    """Return a series with least-squares amplitudes at given frequencies (M,), rad/s."""
    return _as_series(signals, frequencies, lattice, _solve(signals, frequencies, lattice))


def refine(signals: Signals, frequencies: Array, lattice: Index) -> HarmonicSeries:
    """Return a series with fitted frequencies, from a guess (M,), rad/s, and fitted amplitudes."""
    now, found = np.array(frequencies, dtype=float), _solve(signals, frequencies, lattice)
    for _ in range(STEPS):
        step = _step(signals, now, lattice, found)
        farthest = float(np.abs(step).max(initial=0.0)) * signals.length
        if farthest > FARTHEST:
            step = step * (FARTHEST / farthest)
        for _ in range(HALVINGS):
            following = _solve(signals, now + step, lattice)
            if following.misfit <= found.misfit:
                break
            step = step / 2
        else:
            break
        now, found = now + step, following
        if farthest < SETTLED:
            break
    return _as_series(signals, now, lattice, found)


def _as_series(signals: Signals, frequencies: Array, lattice: Index, found: _SolvedAmplitudes) -> HarmonicSeries:
    amplitudes = found.amplitudes.copy()
    amplitudes[1] /= signals.length
    residual = np.sqrt(np.mean(found.left**2, axis=0))
    return HarmonicSeries(np.array(frequencies), lattice, amplitudes, residual, found.misfit)


def _design(times: Array, frequencies: Array, lattice: Index) -> Array:
    phases = times[:, None] * (lattice @ frequencies)
    ones = np.ones((len(times), 1))
    return np.concatenate([ones, times[:, None], np.cos(phases), np.sin(phases)], axis=1)


def _solve(signals: Signals, frequencies: Array, lattice: Index) -> _SolvedAmplitudes:
    design = _design(signals.times, frequencies, lattice)
    # scale a drift by the length, so that it has the size of its contribution at the end
    design[:, 1] /= signals.length
    weights = signals.window[:, None]
    order = np.abs(lattice).sum(axis=1)
    heavy = np.minimum(GROWTH ** (order - 1.0), HEAVIEST)
    ridge = RIDGE**2 * np.concatenate([[0.0, 0.0], heavy, heavy]) ** 2
    weighted = design * weights
    gram = design.T @ weighted
    gram[np.diag_indices_from(gram)] += ridge
    factor = cho_factor(gram)
    amplitudes = cho_solve(factor, weighted.T @ signals.values)
    left = signals.values - design @ amplitudes
    misfit = float(np.sum(weights * left**2) + np.sum(ridge[:, None] * amplitudes**2))
    return _SolvedAmplitudes(design, factor, amplitudes, left, misfit)


def _step(signals: Signals, frequencies: Array, lattice: Index, found: _SolvedAmplitudes) -> Array:
    """Return the change of the frequencies (M,) from linearised residuals orthogonal to the amplitudes."""
    half, weights = len(lattice), signals.window[:, None]
    cosines, sines = found.design[:, 2 : 2 + half], found.design[:, 2 + half :]
    slopes = []
    for multiples in lattice.T:
        used = np.flatnonzero(multiples)
        a = found.amplitudes[2 + used] * multiples[used, None]
        b = found.amplitudes[2 + half + used] * multiples[used, None]
        slope = signals.times[:, None] * (cosines[:, used] @ b - sines[:, used] @ a)
        slope -= found.design @ cho_solve(found.factor, found.design.T @ (weights * slope))
        slopes.append((np.sqrt(weights) * slope).ravel())
    jacobian = np.array(slopes).T
    step: Array = np.linalg.lstsq(jacobian, (np.sqrt(weights) * found.left).ravel(), rcond=1e-9)[0]
    return step
