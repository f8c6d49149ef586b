"""Samples of an integration: times, and states right after them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.control.calls import called, failures, require_same
from uqmbd.dynamics.control.loop import ControlLoop
from uqmbd.dynamics.equations import state_arguments
from uqmbd.dynamics.integration import instant
from uqmbd.dynamics.linear import impulses
from uqmbd.dynamics.observation import observe
from uqmbd.errors import StudyError
from uqmbd.typing import Array, Index

__all__ = ["Sampling"]


MOST = 1_000_000
"""Largest number of samples of an integration; more samples indicate wrong units."""
NEAR = 1e-12
"""Time difference, relative to the larger of 1 s and the time, within which two instants are merged."""
FELT = 1e-14
"""Rate of a constraint residual, in the units of its equation, that counts as rounding."""
CONTRADICTION = 1e-6
"""Residual speed after an impulse, relative to the jump, that indicates contradictory equations."""
ROUNDING = 1e-10
"""Residual speed after an impulse, relative to the largest speed, that counts as rounding."""


@dataclass
class _SamplingInstant:
    """Actions at one time: commands to apply (loop, number of the sample), and loops to sample."""

    time: float
    acting: list[tuple[int, int]] = field(default_factory=list)
    sampled: list[tuple[int, int]] = field(default_factory=list)


class Sampling:
    """Samples of the controllers of a batch, from the first to the last output time, both included.

    Parameters
    ----------
    batch : Batch
        K realisations of a model with controllers.
    times : array, shape (T,)
        Output times, s; samples that differ from an output time only by rounding are moved to it.

    Attributes
    ----------
    times : array, shape (N,)
        Ascending times of samples and of the start of commands, s.

    Raises
    ------
    uqmbd.StudyError
        If the number of samples is unreasonably large.

    Examples
    --------
    An integrator requests the samples of a mechanism with a controller that samples twice a second:

    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_springs import PointForce
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    >>> cart = mechanism.body("cart", mass=2)
    >>> def pull(time, measured):
    ...     return 1 - measured
    >>> controller = uqmbd.Controller(measured=[cart.position[0]], commanded={"force": "N"}, rate=2, function=pull)
    >>> controller = mechanism.add(controller)
    >>> push = mechanism.add(PointForce("push", cart, 0, controller.command("force")))
    >>> mechanism.output("way", cart.position[0], units="m")
    >>> study = uqmbd.Study("pushed", mechanism, [0, 1], [Collocation(order=1)])
    >>> ensemble = study.problem(study.propagators[0]).ensemble(np.zeros((1, 0)))
    >>> ensemble.sampling(np.array([0.0, 1.0])).times.tolist()
    [0.0, 0.5, 1.0]
    """

    def __init__(self, batch: Batch, times: Array) -> None:
        self.batch, self.loops = batch, batch.model.controls
        self.bounds = [loop.bounds(batch.values) for loop in self.loops]
        self.near = NEAR * max(1.0, float(np.abs(times).max()))
        self.instants = _instants(self.loops, times, self.near)
        self.times = np.array([instant.time for instant in self.instants])
        self.waiting: dict[tuple[int, int], tuple[Array, Index]] = {}

    def after(self, number: int, states: Array, members: Index) -> tuple[Array, dict[int, str]]:
        """Return states right after an instant; call the method in the order of the instants.

        Parameters
        ----------
        number : int
            Index of the instant in `times`.
        states : array, shape (M, width)
            States right before the instant.
        members : array of int, shape (M,)
            Indices of these realisations in the batch.

        Returns
        -------
        states : array, shape (M, width)
        reasons : dict of int to str
            Reasons of realisations that cannot continue, by row.

        Raises
        ------
        uqmbd.StudyError
            If a function raises, returns a wrong shape, or depends on other realisations of the group.
        """
        instant, held = self.instants[number], self.batch.model.layout.coordinates
        before, states, reasons = states, states.copy(), dict[int, str]()
        measured = [self._measured(self.loops[k], instant.time, before, members) for k, _ in instant.sampled]
        self._act(instant.acting, states, members)
        for (k, sample), seen in zip(instant.sampled, measured, strict=True):
            loop = self.loops[k]
            memory = held + loop.held[len(loop.commands) :]
            commands, state = self._called(loop, sample, instant.time, seen, before[:, memory])
            states[:, memory] = state
            low, high = (bound[members] for bound in self.bounds[k])
            told = failures(loop, instant.time, seen, commands, state, low, high)
            reasons = told | reasons
            self.waiting[k, sample] = np.clip(commands, low, high), members
            if loop.delay <= self.near:
                self._act([(k, sample)], states, members)
        return states, reasons

    def _act(self, acting: Sequence[tuple[int, int]], states: Array, members: Index) -> None:
        """Apply commands after their delay."""
        for k, sample in acting:
            commands, owners = self.waiting.pop((k, sample))
            where = self.batch.model.layout.coordinates + self.loops[k].held[: len(self.loops[k].commands)]
            # realisations that have failed since then stay failed
            states[:, where] = commands[np.searchsorted(owners, members)]

    def _measured(self, loop: ControlLoop, time: float, states: Array, members: Index) -> Array:
        """Return the measured quantities, shape (M, measured)."""
        return observe(self.batch, loop.measure, states, np.full(len(states), time), members)

    def _called(
        self, loop: ControlLoop, sample: int, time: float, measured: Array, state: Array
    ) -> tuple[Array, Array]:
        """Call the function of a controller; return commands (M, command) and new states (M, state)."""
        found, count = called(loop, time, measured, state), len(measured)
        for part in _parts(sample, measured):
            again = called(loop, time, measured[part], state[part], f", called again for {len(part)} of {count}")
            require_same(loop, time, [x[part] for x in found], again, count)
        return found

    def jumps(
        self, time: float, states: Array, members: Index, before: Array | None = None
    ) -> tuple[Array, dict[int, str]]:
        """Return the jumps of velocities due to impulses at changes of commanded speeds.

        Parameters
        ----------
        time : float
            Time of the change, s.
        states : array, shape (M, width)
            States right after the change of the commands.
        members : array of int, shape (M,)
            Indices of these realisations in the batch.
        before : array, shape (M, width), optional
            States right before the change. Constraint residuals of their speeds, from a truncated expansion, are also
            allowed after the change.

        Returns
        -------
        change : array, shape (M, coordinate)
            Change of the velocities.
        reasons : dict of int to str
            Reasons of realisations that cannot continue, by row.
        """
        model, block = self.batch.model, self.batch.block[members]
        change = np.zeros((len(states), model.layout.coordinates))
        if not model.speeds_commanded or not len(states):
            return change, {}
        off = self._off(states, time, members)
        some = np.flatnonzero(off > FELT)
        if not len(some):
            return change, {}
        change[some] = impulses(model, states[some], time + instant(time), block[some])
        moved = states[some].copy()
        moved[:, model.layout.velocities :] += change[some]
        left = self._off(moved, time, members[some])
        rounding = ROUNDING * np.maximum(1e-3, np.abs(states[some, model.layout.velocities :]).max(axis=1, initial=0.0))
        least = np.maximum(CONTRADICTION * off[some], rounding)
        if before is not None:
            least = np.maximum(least, 10 * self._off(before[some], time, members[some]))
        reasons = {
            int(some[k]): f"a commanded speed jumps at t = {time:.6g} s, but other constraints contradict this jump"
            for k in np.flatnonzero(~(left <= least))
        }
        return change, reasons

    def _off(self, states: Array, time: float, members: Index) -> Array:
        """Return the largest rate of constraint residuals of each state (M, width) right after a time, s."""
        after = state_arguments(time + instant(time), states)
        found = self.batch.model.evaluate("drift", after, self.batch.block[members])["psi"]
        return np.asarray(np.abs(found).max(axis=1, initial=0.0))


def _parts(sample: int, measured: Array) -> list[Index]:
    """Return rows for a second call of a function, which test the independence of its results from other rows.

    The samples 0, 1, 2, 4, 8, ... use every second row. Every sample also uses, one by one, the rows with the least and
    the greatest value of a measurement. A condition on any or all rows of a group has a different result for one of
    them.
    """
    count = len(measured)
    parts = [np.arange(count)[:: -2 if count > 1 else 1]] if count and sample & (sample - 1) == 0 else []
    if count > 1:
        column = measured[:, sample % measured.shape[1]]
        parts += [np.array([k]) for k in dict.fromkeys((int(np.argmin(column)), int(np.argmax(column))))]
    return parts


def _instants(loops: Sequence[ControlLoop], times: Array, near: float) -> list[_SamplingInstant]:
    """Return all instants of samples and commands, in the order of time."""
    begin, end = float(times[0]), float(times[-1])
    happening: list[tuple[float, bool, int, int]] = []
    for k, loop in enumerate(loops):
        count = (end - begin) * loop.rate
        if count > MOST:
            raise StudyError(
                f"Controller {loop.name!r}: a rate of {loop.rate:g} Hz over {end - begin:g} s needs {count:.3g} "
                f"samples; expected at most {MOST:g}. The units are samples per second for the rate, and s for times."
            )
        for sample in range(int(np.floor(count * (1 + NEAR) + NEAR)) + 1):
            at = begin + sample / loop.rate
            happening.append((at, False, k, sample))
            if loop.delay > near and at + loop.delay <= end + near:
                happening.append((at + loop.delay, True, k, sample))
    found: list[_SamplingInstant] = []
    for at, acts, k, sample in sorted(happening):
        nearest = float(times[np.argmin(np.abs(times - at))]) if len(times) < 2 else _nearest(times, at)
        at = nearest if abs(nearest - at) <= near else at
        if not found or at - found[-1].time > near:
            found.append(_SamplingInstant(at))
        (found[-1].acting if acts else found[-1].sampled).append((k, sample))
    return found


def _nearest(times: Array, at: float) -> float:
    right = int(np.clip(np.searchsorted(times, at), 1, len(times) - 1))
    pair = times[right - 1 : right + 1]
    return float(pair[np.argmin(np.abs(pair - at))])
