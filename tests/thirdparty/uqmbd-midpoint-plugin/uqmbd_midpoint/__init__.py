"""The implicit midpoint rule with extrapolation, on the numeric residual and Jacobian of an ensemble."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csc_array

import uqmbd
from uqmbd.typing import Array

__all__ = ["Midpoint", "midpoint_step"]

NEWTON = 12
"""Iterations of Newton's method, at most."""

LEVELS = 9
"""Numbers of steps per output interval: 2, 4, 8, ..."""


def midpoint_step(one: uqmbd.extend.Ensemble, time: float, y: Array, h: float) -> Array:
    """Return the unknowns (n,) after a step of h seconds; NaN if Newton's method does not converge.

    The unknowns Y at the midpoint satisfy ``r(t + h / 2, Y, 2 (Y - y) / h) = 0``. The matrix of Newton's method is
    ``dr/dy + 2 / h dr/dyp``, which `Ensemble.jacobian` returns on `Ensemble.pattern`.
    """
    middle = y.copy()
    for _ in range(NEWTON):
        rates = 2 * (middle - y) / h
        r = one.residual(time + h / 2, middle[None], rates[None])[0]
        values = one.jacobian(time + h / 2, middle[None], rates[None], 2 / h)[0]
        if not (np.isfinite(r).all() and np.isfinite(values).all()):
            break
        matrix = csc_array((values, *one.pattern), shape=(len(y), len(y))).toarray()
        change = np.linalg.solve(matrix, r)
        middle = middle - change
        if np.abs(change).max() <= 1e-13 * (1 + np.abs(middle).max()):
            found = 2 * middle - y
            for letter in "lm":  # multipliers are those of the midpoint
                found[one.unknowns[letter]] = middle[one.unknowns[letter]]
            return found
    return np.full_like(y, np.nan)


class Midpoint:
    """Implicit midpoint rule, extrapolated over 2, 4, 8, ... steps of each output interval."""

    name: ClassVar[str] = "midpoint"

    def integrate(self, ensemble: uqmbd.extend.Ensemble, times: Array, rtol: float) -> uqmbd.extend.Trajectories:
        """Integrate realisations one by one."""
        start = ensemble.start
        states = np.full((len(ensemble), len(times), start.state.shape[1]), np.nan)
        messages, steps = list(start.messages), 0
        for k in np.flatnonzero(start.ok):
            one = ensemble.select(np.array([k]))
            states[k, 0] = one.start.state[0]
            y = one.pack(one.start.q, one.start.s, one.start.v, one.start.multipliers)[0]
            for j in range(1, len(times)):
                y, taken = self.interval(one, float(times[j - 1]), float(times[j]), y, rtol)
                steps += taken
                if not np.isfinite(y).all():
                    messages[k] = f"the midpoint rule does not reach t = {times[j]:g} s"
                    break
                q, s, v = one.expand(y[None])
                states[k, j] = one.on_constraints(times[j], np.concatenate([q, s, v], axis=1))[0]
                parts = one.expand(y[None])[0].shape[1], s.shape[1]
                now = states[k : k + 1, j]
                ends = parts[0], parts[0] + parts[1]
                multipliers = one.accelerations(times[j], now)[1]
                y = one.pack(now[:, : ends[0]], now[:, ends[0] : ends[1]], now[:, ends[1] :], multipliers)[0]
        return uqmbd.extend.Trajectories(times, states, tuple(messages), uqmbd.extend.Counters(steps=steps))

    def interval(self, one: Any, begin: float, end: float, y: Array, rtol: float) -> tuple[Array, int]:
        """Return the unknowns at the end of an output interval, and how many steps were taken.

        The error of the rule has even powers of the step, as the extrapolation of Romberg needs them.
        """
        row: list[Array] = []
        taken = 0
        for level in range(LEVELS):
            count = 2 ** (level + 1)
            h, found = (end - begin) / count, y
            for number in range(count):
                found = midpoint_step(one, begin + number * h, found, h)
                if not np.isfinite(found).all():
                    break
            taken += count
            new = [found]
            for power, old in enumerate(row, start=1):
                new.append(new[-1] + (new[-1] - old) / (4.0**power - 1))
            if row and np.abs(new[-1] - row[-1])[: one.unknowns["l"].start].max() <= rtol * (1 + np.abs(y).max()):
                return new[-1], taken
            row = new
        return np.full_like(y, np.nan), taken


@uqmbd.hookimpl
def uqmbd_integrators() -> list[type]:
    """Return the integrator of this package."""
    return [Midpoint]
