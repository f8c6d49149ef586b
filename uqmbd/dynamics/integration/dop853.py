"""Explicit integration of the index-1 form, many realisations in a batch.

After each step coordinates and velocities are projected onto the constraints [1]_, in the metric of the masses: the
matrix is that of the accelerations.

References
----------
.. [1] E. Eich, SIAM Journal on Numerical Analysis 30 (1993) 1467-1482.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence

import numpy as np

from uqmbd.compiled import Kernel
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration.batched import BatchedIntegration
from uqmbd.dynamics.integration.legs import legs_of, longest_step, pace
from uqmbd.dynamics.integration.restarts import speed_jumps
from uqmbd.dynamics.integration.roles import Out
from uqmbd.dynamics.integration.singular_poses import SingularPoseWatcher
from uqmbd.dynamics.integration.trajectories import Counters, Solved
from uqmbd.dynamics.linear import System, excess
from uqmbd.typing import Array, Index

__all__ = ["BatchEquations", "integrate_by_dop853"]


BLOCK = 2048
"""States that are projected at once."""
FAR = 1000.0
"""Tolerances by which an interpolated state may be off the constraints: beyond, it is integrated to."""
FARTHEST = 3e-3
"""The same as a number, for loose tolerances."""
POOR = 50
"""Most states that are integrated to."""


def integrate_by_dop853(ensemble: Batch, members: Index, times: Array, rtol: float) -> Solved:
    """Integrate the assembled realisations `members` (M,) of a batch, whose index-1 system is compiled.

    Each that this method cannot integrate has a message.
    """
    begin = clock.perf_counter()
    states = np.full((len(members), len(times), ensemble.model.layout.width), np.nan)
    messages, final, notes = [""] * len(members), [False] * len(members), list[str]()
    counters = Counters()
    todo = [np.arange(len(members))]
    while todo:
        part = todo.pop(0)
        some = ensemble.select(members[part])
        start, equations = some.start, BatchEquations(some.model, some.block)
        guard = SingularPoseWatcher(some.model, BatchEquations, rtol)
        longest = longest_step(some.model.rough, times)
        length = np.minimum(1.0, np.maximum(1e-3, np.abs(start.q).max(axis=1, initial=0.0)))
        legs = pace(some, times, rtol, knots=True)
        stack = BatchedIntegration(
            equations, start.state, times, legs, rtol, rtol * length[:, None], None, longest, guard
        )
        stack.run()
        states[part] = _projected(some, guard.models, times, stack.result, rtol)
        apart = [part[k] for k in sorted(stack.apart)]
        todo += [np.array([k]) for k in apart]
        for k, message in stack.failed.items():
            messages[part[k]], final[part[k]] = message, guard.final or k in stack.refused
        notes += [note for note in guard.notes if note not in notes]
        counters = counters + Counters(
            integrations=1,
            alone=len(apart),
            accelerations=stack.equations.evaluations,
            steps=stack.steps,
            stiff=len(stack.failed) if not guard.final else 0,
            passages=guard.passed,
            repivots=len(guard.notes),
        )
    counters = counters + Counters(seconds=clock.perf_counter() - begin)
    return Solved(states, tuple(messages), counters, tuple(final), tuple(notes))


class BatchEquations:
    """Rates and projection of M realisations, with buffers of their own."""

    def __init__(self, model: Model, block: Array) -> None:
        layout, self.model = model.layout, model
        self.n, self.velocities, self.width = layout.coordinates, layout.velocities, layout.width
        system: System = model.system
        assert system.accelerate is not None and system.project is not None
        self.accelerate, self.project = system.accelerate, system.project
        self.motion, self.drift = model.evaluators["acceleration"], model.evaluators["drift"]
        found = self.motion.index.get("s")
        self.auxiliary = None if found is None else (found[1][0] + self.n, found[0])
        self.kernel = self.motion.fused_kernel
        self.evaluations, self.coupled = 0, False
        self.moving = layout.width - 2 * len(layout.frozen) - layout.held
        self._allocate(block)

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
        if self.kernel is None or not isinstance(self.accelerate, Kernel):

            def general() -> None:
                self.values = np.ascontiguousarray(self.motion(self.arguments[:, : self.width + 2], self.block))
                self.accelerate(self.values, self.acceleration)

            return general
        evaluate = self.kernel.bound(self.arguments, self.values)
        accelerate = self.accelerate.bound(self.values, self.acceleration)

        def fused() -> None:
            evaluate()
            accelerate()

        return fused

    def rate(self, time: float, out: Out) -> None:
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
            found = kernel(self.arguments)
        else:
            found = self.drift(self.arguments[:, : self.width + 2], self.block)
        both = self.project(np.concatenate([self.values, found], axis=1))
        return both[:, : self.n], both[:, self.n :]

    def impulse(self, time: float, rtol: float) -> tuple[Array, dict[int, str]]:
        """Find how velocities of ``self.state`` jump where prescribed speeds do, and who cannot go on."""
        return speed_jumps(self.model, self.state, time, self.block, rtol)

    def keep(self, rows: Index) -> None:
        """Go on with some realisations only."""
        self._allocate(self.block[rows])


def _projected(
    ensemble: Batch, models: Sequence[tuple[float, Model]], times: Array, states: Array, rtol: float
) -> Array:
    """Put interpolated states (M, T, width) on the constraints, but the first, which are there.

    `models` are the choices of independent equations, each with the time from which it holds.  Within a step over a
    singular pose interpolation may be poor: states that are far off the constraints are integrated to instead.
    """
    layout, (count, number, width) = ensemble.model.layout, states.shape
    n, velocities = layout.coordinates, layout.velocities
    time, owner = np.tile(times, count), np.repeat(np.arange(count), number)
    poor: list[tuple[int, int]] = []
    off = min(FAR * rtol, FARTHEST)
    flat = states.reshape(-1, width).copy()
    since = _since(models, time)
    for k, (_, model) in enumerate(models):
        for part in _parts(since, k, len(models)):
            with np.errstate(all="ignore"):
                q, v = excess(model, flat[part], time[part], ensemble.block[owner[part]])
            flat[part, :n] -= q
            flat[part, velocities:] -= v
            if not np.vdot(q, q) + np.vdot(v, v) <= off**2:  # else nobody can be
                far = np.maximum(np.abs(q).max(axis=1), np.abs(v).max(axis=1)) > off
                poor += [divmod(int(row), number) for row in np.arange(len(flat))[part][far]]
    found = flat.reshape(states.shape)
    found[:, 0] = states[:, 0]
    for member, where in poor[:POOR]:
        before = found[member, where - 1 : where]
        if where and np.isfinite(before).all():
            model = models[int(since[member * number + where])][1]
            block = ensemble.block[member : member + 1]
            equations, grid = BatchEquations(model, block), times[where - 1 : where + 1]
            legs = legs_of(ensemble.breaks[member], grid, model.max_step)
            run = BatchedIntegration(equations, before, grid, legs, rtol, np.full((1, 1), rtol))
            run.steps_at_most = 100
            run.run()
            if np.isfinite(run.result[0, -1]).all():
                found[member, where] = run.result[0, -1]
    return found


def _since(models: Sequence[tuple[float, Model]], times: Array) -> Index:
    """Find the choice of equations that holds at each time, by number."""
    if len(models) == 1:
        return np.zeros(len(times), dtype=np.int64)
    return np.searchsorted([begin for begin, _ in models], times, side="right") - 1


def _parts(since: Index, choice: int, choices: int) -> list[slice] | list[Index]:
    """Cut the states for which a choice holds into blocks."""
    if choices == 1:
        return [slice(first, first + BLOCK) for first in range(0, len(since), BLOCK)]
    held = np.flatnonzero(since == choice)
    return [held[first : first + BLOCK] for first in range(0, len(held), BLOCK)]
