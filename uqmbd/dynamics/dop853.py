"""Explicit integration of the index-1 form, many realisations in lock-step, with projection onto the constraints.

The Runge-Kutta method of order 8 with its interpolant of order 7 is that of Dormand and Prince [1]_; its coefficients
are SciPy's.  Realisations of a stack share the steps, whose size follows the worst of them.  A realisation that needs
far smaller steps than the others leaves the stack and is integrated alone; one that is stiff, by the criterion of [1]_,
or fails, is left to the caller.

After each step coordinates and velocities are projected onto the constraints [2]_, in the metric of the masses: the
matrix is that of the accelerations.

References
----------
.. [1] E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer 1993, II.5,
   II.6; the test of stiffness: IV.2 of the second volume.
.. [2] E. Eich, SIAM Journal on Numerical Analysis 30 (1993) 1467-1482.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.index1 import System, excess
from uqmbd.dynamics.trajectories import Counters, Solved, stops

__all__ = ["integrate_by_dop853"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Rate = Callable[[float, Array, Array], None]

STAGES = 12
ORDER = 8
STIFF = 6.1
"""Step size times the size of the Jacobian from which the method's stability, not its accuracy, limits the step."""
PATIENCE = 15
"""Steps in a row that must look stiff."""
APART = 3.0
"""A realisation that wants steps smaller than the median of its stack by this factor, ..."""
APART_FOR = 5
"""... this many steps in a row, is integrated alone."""
BLOCK = 2048
"""States that are projected at once."""
STEPS = 20_000
"""Most attempted steps."""


def integrate_by_dop853(ensemble: Ensemble, members: Index, times: Array, rtol: float) -> Solved:
    """Integrate a stack of assembled realisations.

    Parameters
    ----------
    ensemble : Ensemble
        All realisations; the model's index-1 system must be compiled.
    members : array of int, shape (M,)
        Those of the stack.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance.

    Returns
    -------
    Solved
        With a message for each realisation that this method cannot integrate.
    """
    begin = clock.perf_counter()
    states = np.full((len(members), len(times), ensemble.model.layout.width), np.nan)
    messages = [""] * len(members)
    counters = Counters()
    todo = [np.arange(len(members))]
    while todo:
        part = todo.pop(0)
        stack = _Stack(ensemble.select(members[part]), times, rtol)
        stack.run()
        states[part] = stack.projected()
        apart = [part[k] for k in sorted(stack.apart)]
        todo += [np.array([k]) for k in apart]
        for k, message in stack.failed.items():
            messages[part[k]] = message
        counters = counters + Counters(
            integrations=1,
            alone=len(apart),
            accelerations=stack.evaluations,
            steps=stack.steps,
            stiff=len(stack.failed),
        )
    return Solved(states, tuple(messages), counters + Counters(seconds=clock.perf_counter() - begin))


@dataclass(frozen=True)
class _Tableau:
    """Coefficients: stages, the step, estimates of its error of order 5 and 3, and the interpolant."""

    a: Array
    c: Array
    b: Array
    errors: Array
    more_a: Array
    more_c: Array
    dense: Array


def _tableau() -> _Tableau:
    from scipy.integrate import DOP853 as method

    stages, count = np.eye(STAGES + 4), STAGES + 1
    step = np.concatenate([method.B, np.zeros(4)])
    dense = np.array([step, stages[0] - step, 2 * step - stages[STAGES] - stages[0], *method.D])
    errors = np.array([method.E5[:count], method.E3[:count]])
    return _Tableau(
        np.array(method.A[:STAGES, :STAGES]), method.C, method.B, errors, method.A_EXTRA, method.C_EXTRA, dense
    )


class _Equations:
    """Rates and projection of M realisations, with buffers of their own."""

    def __init__(self, ensemble: Ensemble) -> None:
        model, layout = ensemble.model, ensemble.model.layout
        self.n, self.velocities, self.width = layout.coordinates, layout.coordinates + layout.states, layout.width
        system: System = model.system
        assert system.accelerate is not None and system.project is not None
        self.accelerate, self.project = system.accelerate, system.project
        self.motion, self.drift = model.evaluators["acceleration"], model.evaluators["drift"]
        found = self.motion.index.get("s")
        self.auxiliary = None if found is None else (found[1][0] + self.n, found[0])
        self.kernel = self.motion.fused_kernel
        self.evaluations = 0
        self._allocate(ensemble.block)

    def _allocate(self, block: Array) -> None:
        """Lay out the arguments ``(state, t, 0, parameters)``, and everything that is computed from them."""
        self.block, count = np.ascontiguousarray(block), len(block)
        self.arguments = np.concatenate([np.zeros((count, self.width + 2)), self.block], axis=1)
        self.state, self.time = self.arguments[:, : self.width], self.arguments[:, self.width]
        self.velocity = self.state[:, self.velocities :]
        self.values = np.zeros((count, len(self.motion.targets)))
        self.acceleration = np.zeros((count, self.n))
        self.call = self._call()

    def _call(self) -> Callable[[], None]:
        """Make what turns arguments into values and accelerations, with as little Python as possible."""
        if self.kernel is None or len(self.accelerate.stages) > 1:

            def general() -> None:
                self.values = np.ascontiguousarray(self.motion(self.arguments[:, : self.width + 2], self.block))
                self.accelerate(self.values, self.acceleration)

            return general
        kernels = self.kernel.function, self.accelerate.stages[0].kernel.function
        arguments, values, found = (x.reshape(-1) for x in (self.arguments, self.values, self.acceleration))
        count = len(self.arguments)
        if count == 1:
            one, two = (k.unsafe_real for k in kernels)

            def single() -> None:
                one(arguments, values)
                two(values, found)

            return single
        many, solve = (k.unsafe_eval for k in kernels)

        def stacked() -> None:
            many(arguments, values, count)
            solve(values, found, count)

        return stacked

    def rate(self, time: float, out: tuple[Array, Array, Array]) -> None:
        """Write the rate of ``self.state`` to `out`: its coordinates, its velocities, and all of it."""
        self.evaluations += 1
        self.time.fill(time)
        self.call()
        out[0][:] = self.velocity
        out[1][:] = self.acceleration
        if self.auxiliary is not None:
            out[2][:, self.auxiliary[0]] = self.values[:, self.auxiliary[1]]

    def excess(self) -> tuple[Array, Array]:
        """By what coordinates and velocities of ``self.state``, whose rate is known, exceed the constraints."""
        if (kernel := self.drift.fused_kernel) is not None:
            found = kernel.fast(self.arguments)
        else:
            found = self.drift(self.arguments[:, : self.width + 2], self.block)
        both = self.project(np.concatenate([self.values, found], axis=1))
        return both[:, : self.n], both[:, self.n :]

    def keep(self, rows: Index) -> None:
        """Go on with some realisations only."""
        self._allocate(self.block[rows])


@dataclass
class _Stack:
    """One integration of a stack."""

    ensemble: Ensemble
    times: Array
    rtol: float
    apart: set[int] = field(default_factory=set)
    failed: dict[int, str] = field(default_factory=dict)
    steps: int = 0

    def __post_init__(self) -> None:
        start = self.ensemble.start
        self.equations = _Equations(self.ensemble)
        self.members = np.arange(len(self.ensemble))
        self.z = np.concatenate([start.q, start.s, start.v], axis=1)
        self.result = np.full((len(self.members), len(self.times), self.z.shape[1]), np.nan)
        self.result[:, 0] = self.initial = self.z.copy()
        layout = self.ensemble.model.layout
        length = np.minimum(1.0, np.maximum(1e-3, np.abs(start.q).max(axis=1, initial=0.0)))
        self.floor = self.rtol * length[:, None]
        self.moving = self.z.shape[1] - 2 * len(layout.frozen)
        self._allocate()
        self.tableau = _tableau()
        self.scaled = np.empty_like(self.tableau.a)
        self.rows = [self.scaled[i, :i] for i in range(1, STAGES)]
        self.stiff = np.zeros(len(self.members), dtype=int)
        self.slow = np.zeros(len(self.members), dtype=int)

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations of motion."""
        return self.equations.evaluations

    def run(self) -> None:
        """Integrate through all break times."""
        now, size = float(self.times[0]), 0.0
        with np.errstate(all="ignore"):
            for stop in [*stops(self.ensemble.breaks, self.times).tolist(), float(self.times[-1])]:
                size = self._segment(now, stop, size)
                now = stop
                if not len(self.members):
                    return

    def projected(self) -> Array:
        """States at the output times, which are interpolated, on the constraints; shape (M, T, width)."""
        model, (count, times, width) = self.ensemble.model, self.result.shape
        n, velocities = self.equations.n, self.equations.velocities
        time, owner = np.tile(self.times, count), np.repeat(np.arange(count), times)
        flat = self.result.reshape(-1, width)
        for first in range(0, len(flat), BLOCK):
            part = slice(first, first + BLOCK)
            with np.errstate(all="ignore"):
                q, v = excess(model, flat[part], time[part], self.ensemble.block[owner[part]])
            flat[part, :n] -= q
            flat[part, velocities:] -= v
        self.result[:, 0] = self.initial
        return self.result

    def _segment(self, begin: float, end: float, size: float) -> float:
        """Integrate to `end`, where a force may jump; return the last step size."""
        eps = 1e-12 * max(1.0, abs(begin), abs(end))
        self.inside = (begin + eps, end - eps)
        now = begin
        self._rate(now, self.z, 0)
        size = min(size or self._first_size(now, end), end - begin)
        wanted, attempts, rejected = size, 0, False
        while now < end - eps and len(self.members):
            size = min(wanted, end - now)
            if now + size > end - 0.1 * size:  # no tiny last step
                size = end - now
            attempts += 1
            least = 1e-13 * max(abs(now), end - begin)
            error, new = self._attempt(now, size)
            worst = float(error.max()) if np.isfinite(error).all() else np.inf
            if attempts > STEPS or size < least:
                self._leave(np.flatnonzero(~(error < min(worst, 1e300))), self._reason(now, size, attempts))
                attempts, wanted = 0, max(size, 1e-6 * (end - begin))
                self._rate(now, self.z, 0)
                continue
            if worst >= 1.0:
                factor = max(0.2, 0.9 * worst ** (-1 / ORDER)) if np.isfinite(worst) else 0.2
                wanted, rejected = size * factor, True
                continue
            surplus = self.equations.excess()
            self._write(now, size)
            gone = self._judge(size, error, new)
            now = end if size >= end - now else now + size
            self._project(new, surplus)
            self.steps += 1
            factor = min(5.0, 0.9 * max(worst, 1e-10) ** (-1 / ORDER))
            wanted, rejected = size * (min(1.0, factor) if rejected else factor), False
            for rows, reason in gone:
                self._leave(rows, reason and f"{reason} at t = {now:.6g} s")
        return wanted

    def _rate(self, time: float, z: Array, stage: int) -> None:
        self.equations.state[:] = z
        self.equations.rate(min(max(time, self.inside[0]), self.inside[1]), self.out[stage])

    def _first_size(self, now: float, end: float) -> float:
        """Guess the first step as in [1]_, the smallest of all realisations."""
        scale = self.floor + self.rtol * np.abs(self.z)
        size, slope = (np.sqrt(np.mean((x / scale) ** 2, axis=1)) for x in (self.z, self.k[0]))
        guess = float(np.min(np.where((size < 1e-5) | (slope < 1e-5), 1e-6, 0.01 * size / np.maximum(slope, 1e-300))))
        guess = min(guess, end - now)
        self._rate(now + guess, self.z + guess * self.k[0], 1)
        bend = np.sqrt(np.mean(((self.k[1] - self.k[0]) / scale) ** 2, axis=1)) / guess
        most = np.maximum(slope, bend)
        second = np.where(most <= 1e-15, max(1e-6, guess * 1e-3), (0.01 / np.maximum(most, 1e-300)) ** (1 / ORDER))
        best = float(np.min(second))
        return min(100 * guess, best) if np.isfinite(best) else 1e-6 * (end - now)

    def _allocate(self) -> None:
        """Buffers for the stages: as arrays, flat, and the first so many of them."""
        count, width = self.z.shape
        self.k = np.zeros((STAGES + 4, count, width))
        flat = self.k.reshape(STAGES + 4, -1)
        n, velocities = self.equations.n, self.equations.velocities
        self.out = [(k[:, :n], k[:, velocities:], k) for k in self.k]
        self.first = [flat[:i] for i in range(STAGES + 5)]  # the last: all
        self.buffer = np.empty(count * width)
        self.sum = self.buffer.reshape(count, width)

    def _combine(self, weights: Array, count: int) -> Array:
        """Sum of the first `count` stages with weights; overwritten by the next one."""
        np.dot(weights, self.first[count], out=self.buffer)
        return self.sum

    def _attempt(self, now: float, size: float) -> tuple[Array, Array]:
        """Try a step: the error of each realisation in units of the tolerance, and the new states."""
        tableau, equations = self.tableau, self.equations
        low, high = self.inside
        moments = np.clip(now + size * tableau.c, low, high).tolist()
        np.multiply(tableau.a, size, out=self.scaled)
        for stage, weights in enumerate(self.rows, 1):
            np.dot(weights, self.first[stage], out=self.buffer)
            np.add(self.z, self.sum, out=equations.state)
            equations.rate(moments[stage], self.out[stage])
        self.last = equations.state.copy()
        new = self.z + self._combine(size * tableau.b, STAGES)
        self._rate(now + size, new, STAGES)
        scale = self.floor + self.rtol * np.maximum(np.abs(self.z), np.abs(new))
        both = np.dot(tableau.errors, self.first[STAGES + 1]).reshape(2, *scale.shape)
        both /= scale
        fifth, third = np.einsum("ekw,ekw->ek", both, both)
        # where both vanish so does the error; what is not finite stays so
        error = size * fifth / np.sqrt((fifth + 0.01 * third) * self.moving + 1e-300)
        return error, new

    def _write(self, now: float, size: float) -> None:
        """Write the output times of a step, by the interpolant."""
        last = now + size
        if abs(self.times[-1] - last) <= 1e-12 * max(1.0, abs(last)):
            last = self.times[-1]
        inside = np.arange(*np.searchsorted(self.times, (now, last), side="right"))
        if not len(inside):
            return
        tableau, count = self.tableau, STAGES + 1
        for more in range(3):
            shifted = self.z + size * self._combine(tableau.more_a[more, : count + more], count + more)
            self._rate(now + tableau.more_c[more] * size, shifted, count + more)
        x = np.minimum((self.times[inside] - now) / size, 1.0)
        powers = np.empty((len(inside), 7))
        powers[:, ::2], powers[:, 1::2] = x[:, None], (1 - x)[:, None]
        weights = size * (np.cumprod(powers, axis=1) @ tableau.dense)
        found = np.dot(weights, self.first[-1]).reshape(len(inside), *self.z.shape)
        self.result[self.members[:, None], inside] = (self.z + found).transpose(1, 0, 2)

    def _judge(self, size: float, error: Array, new: Array) -> list[tuple[Index, str]]:
        """Find realisations that are stiff (with a reason), or hold the others up."""
        change, apart = self.k[STAGES] - self.k[STAGES - 1], new - self.last
        change, apart = np.einsum("kw,kw->k", change, change), np.einsum("kw,kw->k", apart, apart)
        stiffness = size * np.sqrt(change / (apart + 1e-300))
        self.stiff = np.where(stiffness > STIFF, self.stiff + 1, 0)
        if len(error) > 1:
            wants = np.maximum(error, 1e-10) ** (-1 / ORDER)
            self.slow = np.where(wants * APART < np.median(wants), self.slow + 1, 0)
        stiff, slow = self.stiff >= PATIENCE, self.slow >= APART_FOR
        found = [(np.flatnonzero(stiff), "stiff"), (np.flatnonzero(slow & ~stiff), "")]
        return [(rows, reason) for rows, reason in found if len(rows)]

    def _project(self, new: Array, surplus: tuple[Array, Array]) -> None:
        """Go on from the new states, projected; their rates change by the same little."""
        n, velocities = self.equations.n, self.equations.velocities
        q, v = surplus
        new[:, :n] -= q
        new[:, velocities:] -= v
        self.z = new
        self.k[0] = self.k[STAGES]
        self.k[0][:, :n] -= v

    def _leave(self, rows: Index, reason: str) -> None:
        """Take realisations out: with a reason they have failed, without one they are integrated alone."""
        for row in rows:
            member = int(self.members[row])
            self.result[member] = np.nan
            if reason:
                self.failed[member] = reason
            else:
                self.apart.add(member)
        stay = np.setdiff1d(np.arange(len(self.members)), rows)
        self.equations.keep(stay)
        self.members, self.z, self.floor = self.members[stay], self.z[stay], self.floor[stay]
        first = self.k[0, stay]
        self._allocate()
        self.k[0] = first
        self.stiff, self.slow = self.stiff[stay], self.slow[stay]

    def _reason(self, now: float, size: float, attempts: int) -> str:
        if attempts > STEPS:
            return f"the integration stopped at t = {now:.6g} s: more than {STEPS} steps"
        return (
            f"the integration stopped at t = {now:.6g} s: the step size fell to {size:.1g} s; probably a singular "
            "pose, a stop or an impact, or a force that jumps"
        )
