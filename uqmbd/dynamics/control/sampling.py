"""Samples of an integration: times, and states right after them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from uqmbd.compiled import SampledControl
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.control.calls import called, failures, require_same
from uqmbd.dynamics.control.laws import driver_laws
from uqmbd.dynamics.control.loop import ControlLoop
from uqmbd.dynamics.equations import state_arguments
from uqmbd.dynamics.integration import instant
from uqmbd.dynamics.linear import impulses
from uqmbd.dynamics.observation import observe
from uqmbd.errors import StudyError
from uqmbd.typing import Array, Index, Mask

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
        self.times, self.acting, self.sampled = _instants(self.loops, times, self.near)
        # lists, because entries of arrays are slow to read
        self.instants, self.listed = self.times.tolist(), self.sampled.tolist()
        self.waiting: dict[tuple[int, int], tuple[Array, Index]] = {}
        self.functions, self.entries = _functions(self.loops, batch.model.layout.coordinates)

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
        time, held = float(self.times[number]), self.batch.model.layout.coordinates
        before, states, reasons = states, states.copy(), dict[int, str]()
        sampled = self._numbered(self.sampled[number])
        measured = [self._measured(self.loops[k], time, before, members) for k, _ in sampled]
        self._act(self._numbered(self.acting[number]), states, members)
        for (k, sample), seen in zip(sampled, measured, strict=True):
            loop = self.loops[k]
            memory = held + loop.held[len(loop.commands) :]
            commands, state, given = self._called(loop, sample, time, seen, before[:, memory], members)
            states[:, memory] = state
            low, high = (bound[members] for bound in self.bounds[k])
            failed = failures(loop, time, seen, commands, state, low, high, given)
            reasons = failed | reasons
            self.waiting[k, sample] = np.clip(commands, low, high), members
            if loop.delay <= self.near:
                self._act([(k, sample)], states, members)
        return states, reasons

    def control(self) -> SampledControl | None:
        """Return the samples for the driver, if it can take them; None: call `after` at each instant."""
        laws = driver_laws(self.batch.model, self.loops)
        if laws is None:
            return None
        # commands of samples that wait for the end of the delay have separate places
        counts = np.array([len(loop.commands) for loop in self.loops])
        waiting = np.array([int(loop.delay * loop.rate) + 2 for loop in self.loops])
        first = np.cumsum([0, *(counts * waiting)])
        acting, sampled = (
            np.where(number >= 0, first[:-1] + counts * (number % waiting), -1).astype(np.int64)
            for number in (self.acting, self.sampled)
        )
        direct = np.array([loop.delay <= self.near for loop in self.loops], dtype=np.int64)
        low, high = (
            np.concatenate(
                [_with_state_columns(bounds[side], len(loop.states)) for loop, bounds in self._limited()], axis=1
            )
            for side in (0, 1)
        )
        numbers = np.concatenate([self.batch.block, self.batch.values], axis=1)
        return SampledControl(laws, self.times, acting, sampled, direct, numbers, low, high, int(first[-1]))

    def answering(self, measured: Array, states: Array, members: Index, found: Array) -> Callable[[int], None]:
        """Return a function of an instant that calls the functions of controllers; it writes their results to `found`.

        The function reads the present values of the arrays, so that one serves for all instants of these realisations.

        Parameters
        ----------
        measured : array, shape (M, measured)
            Measured values of all functions.
        states : array, shape (M, width)
            States right before the instant.
        members : array of int, shape (M,)
            Indices of these realisations in the batch.
        found : array, shape (M, entry)
            Commands and new states of each controller, one after the other.
        """
        parts = [
            (k, measured[:, seen], memory, found[:, sent], found[:, kept])
            for k, seen, memory, sent, kept in self.functions
        ]

        def answer(number: int) -> None:
            time, sampled = self.instants[number], self.listed[number]
            for k, own, memory, commands, kept in parts:
                if (sample := sampled[k]) < 0:
                    continue
                loop = self.loops[k]
                state = states[:, memory] if loop.states else kept
                commands[:], new, reasons = called(loop, time, own, state)
                if loop.states:
                    kept[:] = new
                if rows := _parts(sample, own):
                    self._verify(loop, time, own, state, (commands, kept), rows)
                # the driver skips a sample without a value; `alone` takes it and states the reason
                for row in reasons:
                    commands[row] = np.nan

        return answer

    def alone(self, control: SampledControl, row: int, member: int, state: Array) -> tuple[Array, str]:
        """Take a sample that the driver has skipped; return the state and the reason of a failure.

        Parameters
        ----------
        control : SampledControl
            Samples that the driver takes.
        row : int
            Row of the realisation in `control`.
        member : int
            Index of the realisation in the batch.
        state : array, shape (width,)
            State right before the instant.

        Returns
        -------
        state : array, shape (width,)
        reason : str
            Why the realisation cannot continue; empty if it can.
        """
        number, members = int(control.instant[row]), np.array([member])
        for k, sample in self._numbered(self.acting[number]):
            first = control.acting[number, k]
            self.waiting[k, sample] = control.pending[row, None, first : first + len(self.loops[k].commands)], members
        states, reasons = self.after(number, state[None], members)
        for k, sample in self._numbered(self.sampled[number]):
            first = control.sampled[number, k]
            if not control.direct[k]:
                control.pending[row, first : first + len(self.loops[k].commands)] = self.waiting.pop((k, sample))[0]
        control.instant[row], control.answered[row] = -1, 0
        return states[0], reasons.get(0, "")

    def _limited(self) -> Iterable[tuple[ControlLoop, tuple[Array, Array]]]:
        return zip(self.loops, self.bounds, strict=True)

    def _numbered(self, samples: Index) -> list[tuple[int, int]]:
        """Return the loops with a sample in a row of `acting` or `sampled`, and their samples."""
        return [(k, sample) for k, sample in enumerate(samples.tolist()) if sample >= 0]

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
        self, loop: ControlLoop, sample: int, time: float, measured: Array, state: Array, members: Index
    ) -> tuple[Array, Array, dict[int, str]]:
        """Evaluate the law or function of a controller; return commands, new states and reasons."""
        if loop.law is not None:
            about = np.full((len(measured), 1), time), measured, state, self.batch.values[members]
            results = loop.law(np.concatenate(about, axis=1))
            return results[:, : len(loop.commands)], results[:, len(loop.commands) :], {}
        commands, kept, reasons = called(loop, time, measured, state)
        found = commands.copy(), kept.copy()
        self._verify(loop, time, measured, state, found, _parts(sample, measured))
        return *found, reasons

    def _verify(
        self,
        loop: ControlLoop,
        time: float,
        measured: Array,
        state: Array,
        found: tuple[Array, Array],
        parts: Sequence[slice],
    ) -> None:
        """Call a function again with parts of a group; raise unless it returns equal commands and states."""
        for part in parts:
            commands, kept, _ = called(loop, time, measured[part], state[part], whole=len(measured))
            # equal bits are the rule, and their comparison takes the least time
            if loop.states or commands.tobytes() != found[0][part].tobytes():
                require_same(loop, time, [x[part] for x in found], (commands, kept), len(measured))

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


def _functions(
    loops: Sequence[ControlLoop], coordinates: int
) -> tuple[list[tuple[int, slice, Index, slice, slice]], int]:
    """Return each function, its measured values, states, commands and new states; and the number of entries.

    Measured values are given as columns of the measured values of all functions, and states as indices in a state.
    Commands and new states are given as columns of the entries of all loops.
    """
    found: list[tuple[int, slice, Index, slice, slice]] = []
    first, entry = 0, 0
    for k, loop in enumerate(loops):
        commands, end = entry + len(loop.commands), entry + len(loop.held)
        if loop.law is None:
            seen = slice(first, first + len(loop.measure.names))
            memory = coordinates + loop.held[len(loop.commands) :]
            found.append((k, seen, memory, slice(entry, commands), slice(commands, end)))
            first = seen.stop
        entry = end
    return found, entry


def _with_state_columns(bounds: Array, states: int) -> Array:
    """Append columns for controller states, which have no limits."""
    return np.concatenate([bounds, np.zeros((len(bounds), states))], axis=1)


def _parts(sample: int, measured: Array) -> list[slice]:
    """Return rows for second calls of a function, which test that the results of a row do not depend on other rows.

    The samples 0, 1, 2, 4, 8, ... use every second row. Every sample also uses, one by one, the rows with the least and
    the greatest value of a measurement. A condition on any or all rows of a group has a different result for one of
    them.
    """
    count = len(measured)
    parts = [slice(None, None, -2 if count > 1 else 1)] if count and sample & (sample - 1) == 0 else []
    if count > 1:
        column = measured[:, sample % measured.shape[1]]
        low, high = int(column.argmin()), int(column.argmax())
        parts.append(slice(low, low + 1))
        if high != low:
            parts.append(slice(high, high + 1))
    return parts


def _instants(loops: Sequence[ControlLoop], times: Array, near: float) -> tuple[Array, Index, Index]:
    """Return the times (N,) of all instants in s, and the numbers (N, loop) of acting and of taken samples; -1: none.

    The commands of an acting sample take effect at the instant, after the delay; the sample was taken earlier.
    """
    begin, end = float(times[0]), float(times[-1])
    found: list[tuple[Array, Index, Mask, Index]] = []
    for k, loop in enumerate(loops):
        count = (end - begin) * loop.rate
        if count > MOST:
            raise StudyError(
                f"Controller {loop.name!r}: a rate of {loop.rate:g} Hz over {end - begin:g} s needs {count:.3g} "
                f"samples; expected at most {MOST:g}. The units are samples per second for the rate, and s for times."
            )
        if 1 / loop.rate <= 2 * near:
            raise StudyError(
                f"Controller {loop.name!r}: a rate of {loop.rate:g} Hz is too high, because samples at t = {end:g} s "
                "differ by rounding only. The units are samples per second for the rate, and s for times."
            )
        sample = np.arange(int(np.floor(count * (1 + NEAR) + NEAR)) + 1)
        at = begin + sample / loop.rate
        found.append((at, np.full(len(at), k), np.zeros(len(at), dtype=bool), sample))
        if loop.delay > near:
            late = at + loop.delay
            some = late <= end + near
            found.append((late[some], np.full(int(some.sum()), k), np.ones(int(some.sum()), dtype=bool), sample[some]))
    at, loop_of, acts, sample = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(at, kind="stable")
    at, loop_of, acts, sample = at[order], loop_of[order], acts[order], sample[order]
    nearest = _nearest(times, at)
    at = np.where(np.abs(nearest - at) <= near, nearest, at)
    new = np.diff(at, prepend=-np.inf) > near
    place = np.cumsum(new) - 1
    acting, sampled = np.full((2, int(new.sum()), len(loops)), -1, dtype=np.int64)
    acting[place[acts], loop_of[acts]] = sample[acts]
    sampled[place[~acts], loop_of[~acts]] = sample[~acts]
    return at[new], acting, sampled


def _nearest(times: Array, at: Array) -> Array:
    """Return the nearest of the times (T,) to each of `at`."""
    right = np.clip(np.searchsorted(times, at), min(1, len(times) - 1), len(times) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(times[left] - at) <= np.abs(times[right] - at), times[left], times[right])
