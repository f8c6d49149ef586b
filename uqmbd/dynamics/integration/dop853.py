"""Explicit integration of realisations: method of order 8 on the index-1 form, with projection after each step.

The driver makes the steps; this module makes decisions: at jumps of prescribed speeds, near singular poses, and about
realisations for another method.

Length: the module contains one class, whose methods share the state of an integration.

References
----------
.. [1] E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., Springer 1993, II.5,
   II.6; the test of stiffness: IV.2 of the second volume.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uqmbd.compiled import ORDER, PLACES, Dynamics, ExplicitOptions, ExplicitStatus, IntegrationState, InterpolatedState
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration.cost_comparison import FIRST, Comparison, Rival
from uqmbd.dynamics.integration.costs import implicit_attempt_cost
from uqmbd.dynamics.integration.ida import can_finish_with_ida
from uqmbd.dynamics.integration.intervals import Interval, intervals_of_members
from uqmbd.dynamics.integration.restarts import speed_jumps
from uqmbd.dynamics.integration.singular_poses import SingularPoseWatcher, regular
from uqmbd.dynamics.integration.slow_progress import Pace
from uqmbd.dynamics.integration.steps import projected_steps
from uqmbd.dynamics.integration.trajectories import Counters, Solved
from uqmbd.dynamics.linear import RADAU_STAGES, excess, implicit_dynamics
from uqmbd.typing import Array, Index

__all__ = ["explicit_method", "integrate_by_dop853", "stopped"]


STIFF, EARLY_STIFF = 6.1, 4.5
"""Step size times a rate of the equations above which stability instead of accuracy limits the step.

Steps are stable up to 6.0 to 6.8 times a rate with damping, and safety factors make them shorter. An oscillation of
tolerance 1e-2 limits them to 3.4, of tolerance 1e-6 to 1.1."""
PATIENCE, EARLY_PATIENCE = 15, 8
"""Number of steps that must indicate stiffness: consecutive ones, because the decision is a failure.

If costs are compared, an early decision saves steps: up to five other steps may be between them, and rejected steps
count."""
STEPS = 20_000
"""Largest number of attempted steps in an interval."""
MOST = 200_000
"""Largest number of steps if costs are compared and no other method is known to cost less."""
REFUSALS = 3
"""Number of consecutive rejected steps before the rank is checked."""
SURPLUS = 4.0
"""Residual of the constraints after a step, in tolerances, above which the rank is checked."""
BETWEEN = 3.0
"""Interpolation error above which a step is rejected, relative to the largest error in a smooth oscillation."""
SETTLED = 3
"""Number of projections after which a state satisfies the constraints to rounding."""
FAR = 1000.0
"""Residual of an interpolated state, in tolerances, above which the state is computed by integration."""
FARTHEST = 3e-3
"""Absolute limit of the residual of an interpolated state, for loose tolerances."""
RUNNING, DONE, JUMP, ASKED = (
    int(status) for status in (ExplicitStatus.RUNNING, ExplicitStatus.DONE, ExplicitStatus.JUMP, ExplicitStatus.ASKED)
)
"""Statuses as plain integers, because the look-up of attributes of an enumeration takes time in each step."""
POOR = 50
"""Largest number of states of a realisation that are computed by integration instead of interpolation."""


def integrate_by_dop853(
    ensemble: Batch,
    members: Index,
    times: Array,
    rtol: float,
    *,
    comparing: bool = False,
    patient: bool = False,
    recording: bool = False,
) -> Solved:
    """Integrate the assembled realisations `members` (M,) of a batch with a compiled index-1 system.

    Realisations that this method cannot integrate have a message. With `comparing`, this includes realisations that an
    implicit method integrates at lower cost, by counts. With `patient`, many steps are allowed, also for stiff
    realisations. With `recording`, the steps are also returned.
    """
    begin = clock.perf_counter()
    run = Integration(ensemble.select(members), times, rtol, comparing=comparing, patient=patient, recording=recording)
    with np.errstate(all="ignore"):
        run.run()
    return replace(run.solved(), counters=run.counters + Counters(seconds=clock.perf_counter() - begin))


def explicit_method(rtol: float, *, guarded: bool, attempts: int | None = None) -> ExplicitOptions:
    """Return the options of the explicit method for the driver."""
    return ExplicitOptions(
        rtol=rtol,
        far=min(FAR * rtol, FARTHEST),
        surplus=SURPLUS,
        stiff=STIFF,
        patience=PATIENCE,
        refusals=REFUSALS,
        attempts=STEPS if attempts is None else attempts,
        guarded=guarded,
        # the error estimate has order 7, and the step size control assumes order 8
        between=BETWEEN * rtol ** (-1 / ORDER),
    )


def stopped(now: float, size: float, *, many: bool, most: int = STEPS) -> str:
    """Return why an integration stopped: too many or too small steps."""
    if many:
        return f"the integration stopped at t = {now:.6g} s: more than {most} steps"
    return (
        f"the integration stopped at t = {now:.6g} s: the step size fell to {size:.1g} s; probably a singular "
        "pose, a stop or an impact, or a force that jumps or grows without bound"
    )


IMPLICIT_SHARE = 0.4
"""Tolerance of implicit steps, relative to that of the motion.

Errors of rotations have the same sign in each step and accumulate: with 1, rotors were off by one tolerance after 160
turns.  With 0.4 they are off by at most half a tolerance.  Steps of mechanisms cost between 4 % less and 37 % more."""


class Integration:
    """Integration of M realisations at output times (T,), s.

    `comparing` compares costs with an implicit method; `patient` allows many steps, even for stiff realisations;
    `recording` records the steps.  Steps are implicit with `stages`; `allowed` (M,) limits the attempted steps.
    """

    def __init__(
        self,
        batch: Batch,
        times: Array,
        rtol: float,
        *,
        comparing: bool = False,
        patient: bool = False,
        recording: bool = False,
        stages: int = 0,
        allowed: Index | None = None,
    ) -> None:
        self.batch, self.times, self.rtol, self.model, self.stages = batch, times, rtol, batch.model, stages
        self.dynamics = self._dynamics_of(batch.model)
        start, layout = batch.start, self.model.layout
        self.jumping = bool(layout.rank) and self.model.rheonomic
        self.sampling = batch.sampling(times)
        samples = np.zeros(0) if self.sampling is None else self.sampling.times
        self.sampled = {time: k for k, time in enumerate(samples.tolist())}
        # jumps of prescribed speeds precede samples, so Python handles both
        self.control = None if self.sampling is None or self.jumping else self.sampling.control()
        method = explicit_method(rtol, guarded=bool(layout.rank), attempts=FIRST if comparing else None)
        if comparing and not layout.states:  # the ratio of auxiliary states depends on the phase
            method = replace(method, stiff=EARLY_STIFF, patience=EARLY_PATIENCE, early=True)
        if patient:
            method = replace(method, attempts=MOST, patience=2**62)
        # Most intervals between samples of controllers are shorter than accuracy requires.  The few stages of order 5
        # may all miss a pulse that a function of time repeats in every interval.
        method = replace(method, brief=self.sampling is not None and self.model.timed is None)
        share = IMPLICIT_SHARE if stages else 1.0
        method = replace(method, rtol=share * rtol)
        self.most = MOST if comparing or patient else STEPS
        length = np.minimum(1.0, np.maximum(1e-3, np.abs(start.q).max(axis=1, initial=0.0)))
        self.layouts = intervals_of_members(batch, times, rtol, samples=samples, jumping=self.jumping)
        self.main = IntegrationState(
            self.dynamics,
            method,
            start.state,
            batch.block,
            times,
            self.layouts,
            share * rtol * length,
            recording=recording,
            control=self.control,
        )
        if allowed is not None:
            self.main.allowed[:] = allowed
        self.pace = Pace(self.model, float(times[0]), float(times[-1]))
        self.others: dict[int, IntegrationState] = {}
        self.retired: list[IntegrationState] = []
        self.watchers: dict[int, SingularPoseWatcher] = {}
        self.messages, self.final, self.stiff = [""] * len(batch), [False] * len(batch), 0
        self.comparing = comparing and self.sampling is None  # with controllers, the caller compares costs
        self.comparison: Comparison | None = None
        self.explicit_cost = [0.0] * len(batch)
        self.changed: set[int] = set()
        self.every = np.arange(len(batch))

    def _dynamics_of(self, model: Model) -> Dynamics:
        """Return the equations of a model for the steps."""
        if not self.stages:
            explicit: Dynamics = model.system.programs.dynamics
            return explicit
        implicit = implicit_dynamics(model, self.stages)
        assert implicit is not None
        return implicit

    # -- the whole integration ---------------------------------------------------------------------------------------
    def run(self) -> None:
        """Integrate all members to the end, or until they fail."""
        every, begin, end = self.every, float(self.times[0]), float(self.times[-1])
        self._stop(every, begin)
        while True:
            self.main.advance(watch=self.pace.watch)
            if not self.others:
                self._answer_together()
            status, now = self.main.status.copy(), self.main.now.copy()
            for member, other in self.others.items():
                other.advance(watch=self.pace.watch)
                status[member], now[member] = other.status[0], other.now[0]
            members = np.flatnonzero(status != DONE)  # members that wait for a decision
            if not len(members):
                break
            status, now = status[members], now[members]
            waiting = status == ASKED
            if waiting.all():
                self._answer(members, now)
                continue
            members, status, now = members[~waiting], status[~waiting], now[~waiting]
            jump = status == JUMP
            stops = np.unique(now[jump]).tolist()
            # controllers are called when all members without failure have reached the sample
            there = bool(jump.all()) and self.sampled.keys() >= set(stops)
            for time in stops[:1] if there else [time for time in stops if time not in self.sampled]:
                self._stop(members[jump & (now == time)], time)
            self._decide_all(members[~jump], status[~jump])
        if end in self.sampled and end > begin and self.control is None:
            self._stop(every[[not message for message in self.messages]], end)
        for pool in self._pools:
            pool.project()
        self.recompute_poor()

    def solved(self) -> Solved:
        """Return the integrated realisations."""
        notes: list[str] = []
        for watcher in self.watchers.values():
            notes += [note for note in watcher.notes if note not in notes]
        off = self.main.off.copy() if self.model.layout.rank else None
        if off is not None:  # some members used other equations, and states were changed
            off[[*self.others, *self.changed]] = np.nan
        messages, final, explicit_cost = tuple(self.messages), tuple(self.final), tuple(self.explicit_cost)
        path = self.main.recorder.found
        return Solved(self.main.result, messages, Counters(), final, tuple(notes), explicit_cost, off, path)

    @property
    def counters(self) -> Counters:
        """Return the counts of operations."""
        pools = self._pools
        compared = Counters() if self.comparison is None else self.comparison.counters
        return compared + Counters(
            integrations=len(self.batch),
            accelerations=sum(pool.evaluations for pool in pools),
            steps=sum(int(pool.steps.sum()) for pool in pools),
            stiff=self.stiff,
            passages=sum(watcher.passed for watcher in self.watchers.values()),
            repivots=sum(len(watcher.notes) for watcher in self.watchers.values()),
        )

    @property
    def _pools(self) -> list[IntegrationState]:
        """Return all integration states."""
        return [self.main, *self.others.values(), *self.retired]

    def _place(self, member: int) -> tuple[IntegrationState, int]:
        """Return the integration state of a member, and the row of the member in it."""
        other = self.others.get(member)
        return (self.main, member) if other is None else (other, 0)

    def _by_state(self, members: Index) -> Iterator[tuple[IntegrationState, Index, Index]]:
        """Yield the integration states of members, their rows in it, and their indices in `members`."""
        apart = [row for row, m in enumerate(members.tolist()) if m in self.others] if self.others else []
        rest = np.arange(len(members))
        rest = np.delete(rest, apart) if apart else rest
        yield self.main, members[rest], rest
        for row in apart:
            yield self.others[int(members[row])], np.zeros(1, dtype=np.int64), np.array([row])

    def _fail(self, member: int, reason: str, *, final: bool = False) -> None:
        pool, k = self._place(member)
        pool.status[k] = ExplicitStatus.DONE
        self.messages[member], self.final[member] = reason, final

    # -- stops at given times ----------------------------------------------------------------------------------------
    def _stop(self, members: Index, time: float) -> None:
        """Apply jumps of prescribed speeds, then sample controllers; store the results after the jumps and samples."""
        if not len(members) or not (self.jumping or self.sampled) or self.control is not None:
            return
        before = np.empty((len(members), self.model.layout.width))
        for pool, k, rows in self._by_state(members):
            before[rows] = pool.z[k]
        after = before.copy()
        if self.jumping:
            change, reasons = speed_jumps(self.model, before, time, self.batch.block[members], self.rtol)
            after[:, self.model.layout.velocities :] += change
            self._record_reasons(members, reasons)
        if self.sampling is not None and time in self.sampled:
            going = np.flatnonzero([not self.messages[m] for m in members.tolist()])
            some = members[going]
            states, reasons = self.sampling.after(self.sampled[time], after[going], some)
            change, more = self.sampling.jumps(time, states, some)
            states[:, self.model.layout.velocities :] += change
            after[going] = states
            self._record_reasons(some, more | reasons)
        changed, at = np.any(after != before, axis=1), np.flatnonzero(self.times == time)
        for pool, k, rows in self._by_state(members):
            pool.status[k] = np.where(pool.status[k] == ExplicitStatus.JUMP, ExplicitStatus.RUNNING, pool.status[k])
            pool.stiff[k] = 0
            k, rows = k[changed[rows]], rows[changed[rows]]
            pool.z[k] = pool.nodes[k, -1] = after[rows]
            pool.result[np.ix_(k, at)] = after[rows, None]

    def _answer_together(self) -> None:
        """Call the functions of controllers as long as all members wait for them at the same time."""
        main, control, sampling = self.main, self.control, self.sampling
        if control is None or sampling is None or not len(main.status):
            return
        count, status, instants = len(main.status), main.status, control.instant
        waiting, answer = np.full(count, ASKED).tobytes(), None
        # comparisons of bytes take less time than those of arrays
        width = instants.itemsize
        while status.tobytes() == waiting and (due := instants.tobytes()) == due[:width] * count:
            if answer is None:
                answer = sampling.answering(control.measured, main.z, self.every, control.answers)
            answer(int(instants[0]))
            control.answered.fill(1)
            status.fill(RUNNING)
            main.advance(watch=self.pace.watch)

    def _answer(self, members: Index, now: Array) -> None:
        """Call the functions of controllers for the members that wait at the earliest sample."""
        time = float(now.min())
        members = members[now == time]
        assert self.sampling is not None and self.control is not None
        states, parts = np.empty((len(members), self.model.layout.width)), list(self._by_state(members))
        measured = np.empty((len(members), self.control.measured.shape[1]))
        for pool, k, rows in parts:
            assert pool.control is not None
            states[rows], measured[rows] = pool.z[k], pool.control.measured[k]
        answers = np.empty_like(self.control.answers[: len(members)])
        self.sampling.answering(measured, states, members, answers)(self.sampled[time])
        for pool, k, rows in parts:
            assert pool.control is not None
            pool.control.answers[k], pool.control.answered[k] = answers[rows], 1
            pool.status[k] = ExplicitStatus.RUNNING

    def _sample(self, member: int) -> None:
        """Take a sample that the driver has skipped, because it fails or needs other equations."""
        pool, k = self._place(member)
        assert self.sampling is not None and pool.control is not None
        state, reason = self.sampling.alone(pool.control, k, member, pool.z[k])
        pool.status[k] = ExplicitStatus.DONE if pool.interval[k] > pool.last_interval[k] else ExplicitStatus.RUNNING
        pool.z[k] = pool.nodes[k, -1] = state
        pool.result[k, self.times == pool.now[k]] = state
        pool.stiff[k] = 0
        if reason:
            self._fail(member, reason, final=True)

    def _record_reasons(self, members: Index, reasons: dict[int, str]) -> None:
        """Mark members as failed, for reasons that apply to every method."""
        for row, reason in reasons.items():
            self._fail(int(members[row]), reason, final=True)

    # -- difficulties ------------------------------------------------------------------------------------------------
    def _decide_all(self, members: Index, status: Array) -> None:
        """Decide how to continue waiting members; check the ranks of those with rejected steps together."""
        rejected: list[int] = []
        for member, what in zip(members.tolist(), status.tolist(), strict=True):
            if what == ExplicitStatus.UNSAMPLED:
                self._sample(member)
            elif self.comparing and self._compared(member, what):
                continue
            elif what in (ExplicitStatus.REFUSED, ExplicitStatus.STRAYED) and member not in self.watchers:
                rejected.append(member)
            else:
                self._decide(member, what)
        if not rejected:
            return
        main, some = self.main, np.array(rejected)
        previous = np.where(main.known[some] > 1, main.node_times[some, -2], main.now[some])
        calm = regular(
            self.model,
            main.nodes[some, -1],
            previous,
            main.now[some],
            main.tried[some],
            self.batch.block[some],
            self.rtol,
        )
        calm_ones = some[calm]
        main.trusted[calm_ones[main.status[calm_ones] == ExplicitStatus.STRAYED]] = 1
        main.status[calm_ones] = RUNNING
        main.limit[calm_ones], main.told[calm_ones] = np.inf, 0
        for member in some[~calm].tolist():
            self._decide(member, int(main.status[member]))

    def _decide(self, member: int, status: int) -> None:
        """Decide how to continue a waiting member."""
        pool, k = self._place(member)
        now, size = float(pool.now[k]), float(pool.tried[k])
        if status == ExplicitStatus.STIFF:
            self.stiff += 1
            self._fail(member, f"stiff at t = {now:.6g} s")
        elif status in (ExplicitStatus.MANY, ExplicitStatus.SMALL):
            self._fail(
                member,
                self._reason(member, now, size, many=status == ExplicitStatus.MANY),
                final=self._is_final(member),
            )
        elif status in (ExplicitStatus.REFUSED, ExplicitStatus.STRAYED, ExplicitStatus.STEPPED):
            pool.status[k] = ExplicitStatus.RUNNING
            if status == ExplicitStatus.STEPPED:
                self._settle(member)
            void = self._check_rank(member, size)
            pool, k = self._place(member)
            if status == ExplicitStatus.STRAYED:
                pool.trusted[k] = not void
                if void:
                    pool.wanted[k], pool.refused[k] = size, 0

    def _rival(self) -> Rival:
        """Return the implicit method for comparisons: that of the driver, or IDA for large systems."""
        implicit = implicit_dynamics(self.model)
        if implicit is None:
            return can_finish_with_ida
        cost = implicit_attempt_cost(implicit)

        def can_finish(batch: Batch, times: Array, rtol: float, most: float) -> tuple[bool, Counters]:
            allowed = np.array([int(min(most / cost, 1e15))])
            run = Integration(batch, times, rtol, patient=True, stages=RADAU_STAGES, allowed=allowed)
            run.run()
            return not run.messages[0], run.counters

        return can_finish

    def _compared(self, member: int, status: int) -> bool:
        """Compare costs with an implicit method if a comparison is due; return whether it decided on the member."""
        if self.comparison is None:
            self.comparison = Comparison(self.batch, self.times, self.rtol, self.dynamics, self._rival())
        comparison = self.comparison
        pool, k = self._place(member)
        now, steps = float(pool.now[k]), int(pool.steps[k])
        more: int | None = 0
        if status == ExplicitStatus.MANY:
            more = comparison.attempts(member, int(pool.interval[k]), steps, now, self.most)
        elif status == ExplicitStatus.STIFF:
            more = None
        elif status != ExplicitStatus.SMALL and comparison.rank_checked(member, steps, now):
            more = None
        if more is None:
            self.stiff += 1
            self.explicit_cost[member] = comparison.expected(member, steps, now)
            what = "stiff at" if status == ExplicitStatus.STIFF else "implicit steps are cheaper until"
            self._fail(member, f"{what} t = {now:.6g} s")
        elif more:
            pool.attempts[k] -= more
            pool.status[k] = ExplicitStatus.RUNNING
        return more != 0

    def _watcher(self, member: int) -> SingularPoseWatcher:
        if member not in self.watchers:
            self.watchers[member] = SingularPoseWatcher(self.model, self.batch.block[member], self.rtol)
        return self.watchers[member]

    def _is_final(self, member: int) -> bool:
        return member in self.watchers and self.watchers[member].final

    def _check_rank(self, member: int, size: float) -> bool:
        """Check the rank for a member in difficulties; return whether the last step is void."""
        pool, k = self._place(member)
        watcher, calm = self._watcher(member), not pool.told[k]
        end, back = float(pool.interval_ends[pool.interval[k]]), False
        while True:
            now = float(pool.now[k])
            continuation = watcher.check(now, pool.last_nodes(k), size, end)
            pool.limit[k], pool.told[k] = watcher.limit, watcher.approaching
            if continuation is None:
                return back
            if continuation.reason:
                self._fail(member, continuation.reason, final=watcher.final)
                return True
            if continuation.others:
                if member in self.others:
                    self.retired.append(pool)
                self.others[member] = pool.moved(k, self._dynamics_of(watcher.model))
                self._settle(member)
            elif continuation.back and pool.known[k] > 1:
                pool.step_back(k)
                back = True
                continue
            elif continuation.state is not None and continuation.curve is not None:
                inside = np.flatnonzero((self.times > now) & (self.times <= continuation.time))
                inside = inside[inside >= pool.column[k]]
                if len(inside):
                    pool.result[k, inside] = continuation.curve(self.times[inside])
                    pool.column[k] = inside[-1] + 1
                ends = np.array([[now, continuation.time]])
                curve = continuation.curve(now + (continuation.time - now) * PLACES)
                pool.recorder.passed(k, ends, projected_steps(self.batch, np.array([member]), ends, curve[None]))
                pool.go_on_from(k, continuation.time, continuation.state)
            elif calm and watcher.approaching:
                self._settle(member)
            else:
                return back or watcher.limit < size
            return True

    def _settle(self, member: int) -> None:
        """Project the state onto the constraints to rounding, because singular poses magnify every residual."""
        pool, k = self._place(member)
        model = self._watcher(member).model
        layout, state = model.layout, pool.z[k : k + 1].copy()
        for _ in range(SETTLED):
            q, v = excess(model, state, pool.now[k], pool.parameters[k : k + 1])
            state[:, : layout.coordinates] -= q
            state[:, layout.velocities :] -= v
        pool.settle(k, state[0])

    def _reason(self, member: int, now: float, size: float, *, many: bool) -> str:
        pool, k = self._place(member)
        found = self._watcher(member).reason(now, pool.z[k]) if self.model.layout.rank else ""
        if found:
            return found
        return stopped(now, size, many=many, most=self.most)

    # -- poor interpolation ------------------------------------------------------------------------------------------
    def recompute_poor(self) -> None:
        """Recompute interpolated states far off the constraints by integration, for example near a singular pose."""
        result = self.main.result
        far = self.main.poor == InterpolatedState.FAR
        for member in np.flatnonzero(far.any(axis=1)).tolist():
            for at in np.flatnonzero(far[member])[:POOR].tolist():
                before = result[member, at - 1 : at]
                if not np.isfinite(before).all():
                    continue
                grid, one = self.times[at - 1 : at + 1], slice(member, member + 1)
                if any(grid[0] < time <= grid[1] for time in self.sampled):
                    continue  # commands after a sample are no longer known; at a sample the state is a node
                model = self.watchers[member].model_at(self.times[at]) if member in self.watchers else self.model
                method = explicit_method(self.rtol, guarded=False, attempts=100)
                intervals, floor = [self._intervals_between(member, *grid.tolist())], self.main.floor[one]
                dynamics = self._dynamics_of(model)
                run = IntegrationState(dynamics, method, before, self.batch.block[one], grid, intervals, floor)
                while run.status[0] in (ExplicitStatus.RUNNING, ExplicitStatus.JUMP):
                    if run.status[0] == ExplicitStatus.JUMP:
                        change, _ = speed_jumps(self.model, run.z, run.now[0], self.batch.block[one], self.rtol)
                        run.z[:, self.model.layout.velocities :] += change
                    run.status[0] = ExplicitStatus.RUNNING
                    run.advance()
                if run.status[0] == ExplicitStatus.DONE and np.isfinite(run.result[0, -1]).all():
                    result[member, at] = run.result[0, -1]
                    self.changed.add(member)

    def _intervals_between(self, member: int, begin: float, end: float) -> list[Interval]:
        """Return the intervals of a member from one time to another, s."""
        intervals = self.layouts[member if len(self.layouts) > 1 else 0]
        last = next(interval for interval in intervals if interval.end >= end)
        return [
            *(interval for interval in intervals if begin < interval.end < end),
            Interval(end, last.longest, jumps=False),
        ]
