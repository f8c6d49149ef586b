"""Single steps of the explicit method of order 8, of one realisation, with an interpolant of each.

The method is that of the driver (`uqmbd.compiled`); here somebody else decides where a step ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uqmbd.dynamics.integration.roles import Out
from uqmbd.dynamics.integration.tableau import ORDER, STAGES, interpolation_powers, tableau
from uqmbd.typing import Array

__all__ = ["Curve", "Stepper"]


@dataclass(frozen=True)
class Curve:
    """Interpolant of a step.

    Attributes
    ----------
    begin, size : float
        Of the step, s.
    start : array, shape (width,)
        State at the beginning.
    parts : array, shape (7, width)
        Coefficients.
    """

    begin: float
    size: float
    start: Array
    parts: Array

    def __call__(self, times: Array) -> Array:
        """States at times (T,), shape (T, width)."""
        found: Array = self.start + interpolation_powers((times - self.begin) / self.size) @ self.parts
        return found


class Stepper:
    """Steps of one state.

    Parameters
    ----------
    rate : callable
        From time and state, writes rates of coordinates, of velocities, and of the whole state (`Out`).
    n, velocities, width : int
        Number of coordinates, first velocity, and length of a state.
    rtol : float
        Relative tolerance.
    """

    def __init__(
        self, rate: Callable[[float, Array, Out], None], n: int, velocities: int, width: int, rtol: float
    ) -> None:
        self.rate, self.rtol, self.velocities = rate, rtol, velocities
        self.tableau = tableau()
        self.k = np.zeros((STAGES + 4, width))
        rows = [self.k[i : i + 1] for i in range(STAGES + 4)]
        self.out = [(row[:, :n], row[:, velocities:], row) for row in rows]
        self.moments = self.tableau.c.tolist()
        self.later = self.tableau.more_c.tolist()
        self.rows = [self.tableau.a[i, :i] for i in range(STAGES)]
        self.first = [self.k[:i] for i in range(STAGES + 5)]

    def start(self, time: float, z: Array) -> None:
        """Evaluate the rate at the beginning of a step."""
        self.rate(time, z, self.out[0])

    def attempt(self, time: float, z: Array, size: float, floor: Array) -> tuple[Array, float]:
        """Try a step: the new state, and its error in units of the tolerance."""
        for stage in range(1, STAGES):
            shifted = z + size * (self.rows[stage] @ self.first[stage])
            self.rate(time + size * self.moments[stage], shifted, self.out[stage])
        new = z + size * (self.tableau.b @ self.first[STAGES])
        self.rate(time + size, new, self.out[STAGES])
        scale = floor + self.rtol * np.maximum(np.abs(z), np.abs(new))
        fifth, third = (self.tableau.errors @ self.first[STAGES + 1]) / scale
        squares, others = float(fifth @ fifth), float(third @ third)
        error = size * squares / np.sqrt((squares + 0.01 * others) * len(z) + 1e-300)
        return new, float(error) if np.isfinite(error) and np.isfinite(new).all() else np.inf

    def curve(self, time: float, z: Array, size: float) -> Curve:
        """Interpolant of the step that was tried last."""
        for more in range(3):
            count = STAGES + 1 + more
            shifted = z + size * (self.tableau.more_a[more, :count] @ self.first[count])
            self.rate(time + size * self.later[more], shifted, self.out[count])
        return Curve(time, size, z, size * (self.tableau.dense @ self.k))

    def first_size(self, time: float, z: Array, floor: Array, most: float) -> float:
        """Guess a step; `start` has been called."""
        scale = floor + self.rtol * np.abs(z)
        width = len(z)
        size, slope = (float(np.linalg.norm(x / scale)) / np.sqrt(width) for x in (z, self.k[0]))
        guess = min(1e-6 if min(size, slope) < 1e-5 else 0.01 * size / slope, most)
        self.rate(time + guess, z + guess * self.k[0], self.out[1])
        bend = float(np.linalg.norm((self.k[1] - self.k[0]) / scale)) / np.sqrt(width) / guess
        steep = max(slope, bend)
        second = max(1e-6, guess * 1e-3) if steep <= 1e-15 else (0.01 / steep) ** (1 / ORDER)
        return min(100 * guess, second, most) if np.isfinite(second) else min(1e-6, most)
