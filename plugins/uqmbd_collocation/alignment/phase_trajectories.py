"""Realisations integrated beyond the last output time, until each has reached the same phase of a clock.

Length: a single class, whose methods all use the stored data of each realisation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Array, Mask
from uqmbd_collocation.alignment.event_trajectories import EventTrajectories
from uqmbd_collocation.alignment.impossible import without_clock
from uqmbd_collocation.alignment.markers import (
    PER_TURN,
    STANDING,
    MarkedRealisations,
    MarkerRule,
    Marks,
    everywhere,
    marks_behind,
    phase_markers,
    time_markers,
)
from uqmbd_collocation.alignment.starts import Starts

__all__ = ["PhaseTrajectories"]


AHEAD = 1.15
"""Initial ratio of integration time to output time."""

LONGEST = 8.0
"""Largest ratio of integration time to output time."""

MARGIN = 0.02
"""Additional integration time beyond the estimated need, relative to the range of output times."""

NEAR = 1e-3
"""A realisation that fails within this share of the output times after the required time is not continued."""

TRIES = 8
"""Largest number of integrations of a realisation to reach the required phase."""

EVEN = 1024
"""Smallest number of times at which motions between events are evaluated."""

FIRST = 8
"""Number of realisations of the initial search for a clock, which are integrated together."""

UNSEEN = 0.01
"""A motion is resolved if a spline through every second time has at most this error, relative to the range of each
output. At a tenth of the times, such as near kinks and jumps, the error may be larger."""

POINTS = 16
"""Number of Chebyshev points of a segment (a quarter of a turn)."""

Sequence = tuple[str, ...]
STANDS: Sequence = ("the clock stands",)


@dataclass(frozen=True)
class _PhaseTrajectory:
    """Realisation up to the end of `found`.

    If the integration is continued, it fails before the time `limit` in s, with the message `beyond`.
    """

    found: uqmbd.extend.Dense
    row: int
    status: int
    message: str
    limit: float = np.inf
    beyond: str = ""


@dataclass
class PhaseTrajectories:
    """Realisations beyond the output times; each is computed once, and again only for a longer time."""

    problem: uqmbd.extend.Problem
    wanted: str | None = None  # name of the clock in the option
    clock: uqmbd.extend.Clock | None = None  # set by `prepare`
    spent: int = 0  # number of realisations so far; repeated integrations count again
    counters: Counter[str] = field(default_factory=Counter)
    error: float = 0.0  # largest interpolation error, relative to the range of an output
    turns: tuple[float, float] = (np.inf, 0.0)
    """Least and largest number of turns of the clock in nodes until the last output time."""
    rests: tuple[float, float] = (np.inf, -np.inf)
    """First and last time in s at which nodes pass the last common phase before their clock comes to rest."""
    starts: Starts | None = None
    better: str = ""
    """Name of a clock that runs in all nodes, if the option names another clock."""
    tentative: bool = False
    """Whether to search for a clock up to the last output time before all nodes are integrated for longer."""
    events: EventTrajectories | None = None
    """Realisations from event to event, whose outputs are used if available."""
    _known: dict[bytes, _PhaseTrajectory] = field(default_factory=dict)
    _late: set[bytes] = field(default_factory=set)
    _fine: int = 0
    """Number of times with which the last realisations were resolved."""

    points: ClassVar[int] = POINTS
    least: ClassVar[int] = 0
    longer: ClassVar[float] = 1.0
    what: ClassVar[str] = "phases"
    landmarks: ClassVar[str] = "times of equal phase"

    @property
    def failures(self) -> int:
        """Number of failed realisations, including failures before the required phase."""
        return len(self._late) + sum(path.status != Status.OK for path in self._known.values())

    @property
    def longest(self) -> float:
        """Largest ratio of integration time to output time."""
        ends = [path.found.times[-1] for path in self._known.values() if path.status == Status.OK]
        return float((max(ends, default=self.end) - self.begin) / (self.end - self.begin))

    def attributes(self, sequences: Iterable[Sequence]) -> dict[str, Any]:
        """Return the attributes of the alignment in the results, from the sequences of the elements."""
        used = [kind for kind, name in zip(self._clock.kinds, self._kinds, strict=True) if name in set(sequences)]
        return {
            "clock": self._clock.name,
            "clock_kind": ", ".join(dict.fromkeys("angle" if kind.turn else "oscillation" for kind in used)),
            "clock_turns": list(self.turns),
            "longer": self.longest,
            **({"clock_rests": list(self.rests)} if np.isfinite(self.rests).all() else {}),
            "interpolation_error": self.error,
        }

    def of_standing(self, share: float, sequences: list[Sequence]) -> str:
        """Return a message on the probability that the clock stops, from the sequences of the elements."""
        standing = sequences.count(STANDS)
        text = (
            f"{self.problem.label}: the clock, {self._clock.words}, stops or reverses with a probability of about "
            f"{max(share, 1e-3):.1%}. Realisations in {standing} of {len(sequences)} elements therefore have no common "
            "phase and are compared at equal times. Such a comparison is accurate for a few turns only."
        )
        return text + (
            f" The clock {self.better!r} does not stop in any node; try clock={self.better!r}." * bool(self.better)
        )

    @property
    def begin(self) -> float:
        """First output time, s."""
        return float(self.problem.times[0])

    @property
    def end(self) -> float:
        """Last output time, s."""
        return float(self.problem.times[-1])

    @property
    def _initial_end(self) -> float:
        """Initial end of the integration, s."""
        return self.begin + AHEAD * (self.end - self.begin)

    def prepare(self, values: Array) -> None:
        """Choose the clock from realisations at inputs (K, d), or raise `Impossible`."""
        if self.tentative:
            self._refuse_without_clock(values)
        groups, paths = self._groups(values)
        if not groups:
            raise without_clock(self.problem, f"all realisations failed: {paths[0].message}")
        found, rows = max(groups, key=lambda group: len(group[1]))
        self.clock, why = uqmbd.extend.choose_clock(self.problem, found, self.end, self.wanted)
        if self.clock is not None and self.wanted is not None:
            other, _ = uqmbd.extend.choose_clock(self.problem, found, self.end, None)
            if other is not None and other.name != self.clock.name and self._runs_in_all(other, found):
                self.better = other.name
        swings = self.clock.kinds[-1] if self.clock else None
        if swings and not swings.turn:
            phases = swings.phases(found)
            runs = phases.running(self.end)
            self.starts = Starts.of(values[rows][runs], phases.values[runs, 0]) if runs.any() else None
        if why:
            raise without_clock(self.problem, why)

    def _refuse_without_clock(self, values: Array) -> None:
        """Raise `Impossible` if realisations at inputs (K, d) show no clock until the last output time.

        Some realisations are integrated for as long as a clock needs. If they show no clock, the other realisations are
        integrated only until the last output time. Outputs at equal times reuse all these realisations.
        """

        def clock(found: uqmbd.extend.Dense) -> tuple[uqmbd.extend.Clock | None, str]:
            return uqmbd.extend.choose_clock(self.problem, found, self.end, self.wanted)

        if self.events is not None:
            times = np.linspace(self.begin, self.end, max(2 * len(self.problem.times), EVEN))
            motion = uqmbd.extend.Dense(times, self.events.at_times(values, times), 0.0)
            if np.isfinite(motion.values).all():
                one, why = clock(motion)
                if one is None:
                    raise without_clock(self.problem, why)
                return
        some = np.unique(np.linspace(0, len(values) - 1, FIRST).round().astype(int))
        self._follow(values[some], self._initial_end, lambda found: clock(found)[0] is not None)
        groups, _ = self._groups(values[some])
        if not groups:
            return
        clocks = [clock(seen) for seen, _ in groups]
        others = np.delete(values, some, axis=0)
        if any(one is not None for one, _ in clocks):
            return
        if len(others):
            found, realised = self._at_even_times(others, self._fine)
            good = np.flatnonzero(realised.good).tolist()
            if good and (not _is_resolved(found.of(good)) or clock(found)[0] is not None):
                return
            for n, row in enumerate(np.ascontiguousarray(others, dtype=float)):
                self._known[row.tobytes()] = _PhaseTrajectory(found, n, int(realised.status[n]), realised.messages[n])
        raise without_clock(self.problem, clocks[0][1])

    def _at_even_times(self, values: Array, count: int) -> tuple[uqmbd.extend.Dense, uqmbd.extend.Realisations]:
        """Compute realisations at `count` evenly spaced times until the last output time, and at the output times."""
        times = np.linspace(self.begin, self.end, count)
        every = np.union1d(times, self.problem.times)
        realised = self.problem.watching(every).realise(values)
        self.spent += len(values)
        self.counters.update(realised.counters)
        evenly, requested = (realised.response[..., np.searchsorted(every, at)] for at in (times, self.problem.times))
        return uqmbd.extend.Dense(times, evenly, 0.0, requested), realised

    def sequences(self, values: Array) -> list[Sequence]:
        """Return the clock motion of realisations at inputs (K, d); failed ones get the most frequent clock motion."""
        found = np.full(len(values), len(self._kinds))
        groups, paths = self._groups(values)
        for seen, rows in groups:
            runs = [self._phases(kind, seen, values[rows]).running(self.end) for kind in self._clock.kinds]
            found[rows] = np.argmax([*runs, np.ones(len(rows), dtype=bool)], axis=0)
        failed = np.array([path.status != Status.OK for path in paths])
        found[failed] = Counter(found[~failed].tolist()).most_common(1)[0][0] if not failed.all() else 0
        return [[*self._kinds, STANDS][k] for k in found]

    def elsewhere(self, sequence: Sequence, seen: Array) -> Mask:
        """Return which realisations (K, watched, T), at the output times, certainly have another sequence.

        There are too few output times to detect an oscillation, but enough to detect whether an angle turns.
        """
        if not self._clock.turn or sequence not in (*self._kinds, STANDS):
            return np.zeros(len(seen), dtype=bool)
        at_times = uqmbd.extend.Dense(self.problem.times, seen, 0.0)
        turns = [kind.phases(at_times).running(self.end) for kind in self._clock.kinds[:2]]
        if sequence in self._kinds[:2]:
            return np.asarray(~turns[self._kinds.index(sequence)])
        return np.asarray(turns[0] | turns[1])

    def marks(self, space: uqmbd.extend.GermSpace, germs: Array, spread: Array, sequence: Sequence) -> Marks:
        """Return the markers that all realisations of an element with nodes `germs` (K, d) need.

        If the clock of the element stops, the element has no markers. A polynomial of order 2 through the nodes gives
        the phases at the points `spread` (N, d), at which the chaos is evaluated. If the clock comes to rest in some
        realisations, the markers are the phases that all nodes pass. The motion after the last marker is compared at
        equal steps of time.
        """
        if sequence == STANDS:
            return Marks(np.zeros(0))
        values = space.to_inputs(germs)
        same = np.array([other == sequence for other in self.sequences(values)])
        kind = self._kind(sequence)
        begins, ends, used = [], [], list[int]()
        for seen, rows in self._groups(values)[0]:
            phases = self._phases(kind, seen, values[rows])
            fine = np.flatnonzero(same[rows])
            begins.append(phases.values[fine, 0])
            ends.append(phases.at(self.end)[fine])
            used += [rows[k] for k in fine]
        known = np.stack([np.concatenate(begins), np.concatenate(ends)], axis=1)
        turned = (known[:, 1] - known[:, 0]) / (2 * np.pi)
        self.turns = (min(self.turns[0], float(turned.min())), max(self.turns[1], float(turned.max())))
        others = everywhere(space, germs[used], spread, known)
        marks = marks_behind(others[:, 0], float(others[:, 1].max()) + 2 * np.pi / PER_TURN)
        return self._common(kind, values[same], marks)

    def _common(self, kind: uqmbd.extend.Clock, values: Array, marks: Array) -> Marks:
        """Return the marks (S,) that all realisations pass before their clock comes to rest, if it does."""
        groups, _ = self._integrated_to(kind, values, float(marks[-1]))
        common = marks[marks <= min((p.lasting.min(initial=np.inf) for _, p, _ in groups), default=np.inf) + 1e-9]
        if len(common) in (0, len(marks)):
            return Marks(common)
        passed = np.array([phases.passed(k, common[-1:])[0] for _, phases, rows in groups for k in range(len(rows))])
        self.rests = (min(self.rests[0], float(np.nanmin(passed))), max(self.rests[1], float(np.nanmax(passed))))
        first = min(float(np.nanmin(passed)), self.end)
        tail = self.end - first + MARGIN * (self.end - self.begin)
        return Marks(common, tail, 1 + int(np.count_nonzero(self.problem.times > first)) // STANDING)

    def cutting(self, space: uqmbd.extend.GermSpace, germs: Array, spread: Array, sequence: Sequence) -> MarkerRule:
        """Return the rule that divides realisations of an element; see `marks`."""
        return self._rule(sequence, self.marks(space, germs, spread, sequence))

    def _rule(self, sequence: Sequence, marks: Marks) -> MarkerRule:
        if marks.count:

            def farther(late: float, pace: float) -> MarkerRule:
                return self._rule(sequence, marks.farther(late, pace))

            return MarkerRule(lambda values: self.cut(values, marks, sequence), ("",) * marks.count, "phase", farther)
        segments = -(-len(self.problem.times) // STANDING)
        return MarkerRule(lambda values: self.cut_in_time(values, segments), ("",) * segments, "time")

    def cut(
        self, values: Array, marks: Marks, sequence: Sequence
    ) -> tuple[MarkedRealisations, uqmbd.extend.Realisations]:
        """Return realisations from phase to phase; a realisation that does not reach the last phase has failed."""
        outputs = self.problem.labels.shape[0]
        groups, paths = self._integrated_to(self._kind(sequence), values, float(marks.phases[-1]), marks.tail)
        edges = np.full((len(values), marks.count + 1), np.nan)
        response = np.full((len(values), marks.count, outputs, POINTS), np.nan)
        for seen, phases, rows in groups:
            part = phase_markers(seen, phases, marks, outputs, POINTS)
            edges[rows], response[rows] = part.edges, part.response
        return MarkedRealisations(edges, response), self._as_realisations(values, paths, edges, sequence)

    def _integrated_to(
        self, kind: uqmbd.extend.Clock, values: Array, last: float, more: float = 0.0
    ) -> tuple[list[tuple[uqmbd.extend.Dense, uqmbd.extend.Phases, list[int]]], list[_PhaseTrajectory]]:
        """Integrate realisations (K, d) to the phase `last` in rad; if they reach it, also for `more` s after it."""
        for _ in range(TRIES):
            needed = np.full(len(values), -np.inf)
            groups, paths = self._groups(values)
            read = [(seen, self._phases(kind, seen, values[rows]), rows) for seen, rows in groups]
            for _, phases, rows in read:
                needed[rows] = phases.reaching(last) + more
            if not self._continue(values, paths, needed):
                break
        return read, paths

    def cut_in_time(self, values: Array, segments: int) -> tuple[MarkedRealisations, uqmbd.extend.Realisations]:
        """Return realisations in segments that have the same times in all realisations."""
        outputs = self.problem.labels.shape[0]
        groups, paths = self._groups(values)
        edges = np.full((len(values), segments + 1), np.nan)
        response = np.full((len(values), segments, outputs, POINTS), np.nan)
        for seen, rows in groups:
            part = time_markers(seen, np.linspace(self.begin, self.end, segments + 1), outputs, POINTS)
            edges[rows], response[rows] = part.edges, part.response
        return MarkedRealisations(edges, response), self._as_realisations(values, paths, edges, STANDS)

    def at_times(self, values: Array) -> uqmbd.extend.Realisations:
        """Return realisations at the output times; missing or failed realisations are computed."""
        outputs = self.problem.labels.shape[0]
        response = np.full((len(values), *self.problem.labels.shape), np.nan)
        if self.events is not None:
            response = self.events.at_times(values, self.problem.times)[:, :outputs]
        for k, row in enumerate(np.ascontiguousarray(values, dtype=float)):
            path = self._known.get(row.tobytes())
            if path is not None and path.status == Status.OK and path.found.asked is not None:
                response[k] = path.found.asked[path.row, :outputs]
        status, messages = np.zeros(len(values), dtype=np.int64), [""] * len(values)
        left = np.flatnonzero(~np.isfinite(response).all(axis=(1, 2)))
        if len(left):
            found = self.problem.realise(values[left])
            self.spent += len(left)
            self.counters.update(found.counters)
            response[left], status[left] = found.response, found.status
            for at, message in zip(left.tolist(), found.messages, strict=True):
                messages[at] = message
        return uqmbd.extend.Realisations(values, response, status, tuple(messages), {}, 0.0)

    def known_motion(self, values: Array) -> uqmbd.extend.Dense | None:
        """Return stored realisations at inputs (K, d), at equal times; None if one is missing or has other times."""
        paths = [self._known.get(row.tobytes()) for row in np.ascontiguousarray(values, dtype=float)]
        known = [path for path in paths if path is not None and path.status == Status.OK]
        ends = {(len(path.found.times), float(path.found.times[-1])) for path in known}
        if len(known) != len(values) or len(ends) != 1:
            return None
        found, outputs = _joined(known), self.problem.labels.shape[0]  # variables of the phase come after the outputs
        requested = None if found.asked is None else found.asked[:, :outputs]
        return uqmbd.extend.Dense(found.times, found.values[:, :outputs], found.error, requested, found.integrations)

    def _as_realisations(
        self, values: Array, paths: list[_PhaseTrajectory], edges: Array, sequence: Sequence
    ) -> uqmbd.extend.Realisations:
        status = np.array([path.status for path in paths])
        lost = (status == Status.OK) & ~np.isfinite(edges).all(axis=1)
        same = np.array([other == sequence for other in self.sequences(values)])
        self._late.update(row.tobytes() for row in np.ascontiguousarray(values, dtype=float)[lost & same])
        until = (
            f"until the clock, {self._clock.words}, reaches the phase that other realisations have at "
            "the last output time"
        )
        messages = []
        for path, gone in zip(paths, lost, strict=True):
            reason = path.message
            if gone and path.beyond:
                reason = f"{path.beyond} (the integration must continue beyond the last output time, {until})"
            elif gone:
                reason = (
                    f"until t = {path.found.times[-1]:g} s, the clock, {self._clock.words}, does not reach the phase "
                    "that other realisations have at the last output time"
                )
            messages.append(reason)
        status = np.where(lost, int(Status.INTEGRATION_FAILED), status)
        return uqmbd.extend.Realisations(values, np.zeros((len(values), 0, 0)), status, tuple(messages), {}, 0.0)

    @property
    def _clock(self) -> uqmbd.extend.Clock:
        if self.clock is None:
            raise uqmbd.StudyError(f"{self.problem.label}: no clock was chosen.")
        return self.clock

    @property
    def _kinds(self) -> list[Sequence]:
        """Sequences of realisations with a running clock: the name of the kind of clock, for each kind."""
        names = [kind.words for kind in self._clock.kinds]
        if len(names) > 1:
            names[1] += ", backwards"
        return [(name,) for name in names]

    def _kind(self, sequence: Sequence) -> uqmbd.extend.Clock:
        return self._clock.kinds[self._kinds.index(sequence)]

    def _runs_in_all(self, clock: uqmbd.extend.Clock, found: uqmbd.extend.Dense) -> bool:
        good = np.isfinite(found.values).all(axis=(1, 2))
        if not good.all():
            return False
        return bool(np.any([k.phases(found).running(self.end) for k in clock.kinds], axis=0).all())

    def _phases(self, kind: uqmbd.extend.Clock, seen: uqmbd.extend.Dense, values: Array) -> uqmbd.extend.Phases:
        """Return the phases of realisations at inputs (K, d)."""
        near = self.starts.near(values) if self.starts is not None and not kind.turn else None
        return kind.phases(seen, near)

    def _groups(self, values: Array) -> tuple[list[tuple[uqmbd.extend.Dense, list[int]]], list[_PhaseTrajectory]]:
        """Return the stored motions of realisations at inputs (K, d), in groups with equal times."""
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        missing = {key: k for k, key in enumerate(keys) if key not in self._known}
        if missing:
            self._follow(values[list(missing.values())], self._initial_end)
        paths = [self._known[key] for key in keys]
        groups: dict[tuple[int, float], list[int]] = {}
        for k, path in enumerate(paths):
            if path.status == Status.OK:
                groups.setdefault((len(path.found.times), float(path.found.times[-1])), []).append(k)
        found_groups = [(_joined([paths[k] for k in members]), members) for members in groups.values()]
        return found_groups, paths

    def _continue(self, values: Array, paths: list[_PhaseTrajectory], needed: Array) -> bool:
        """Continue realisations (K, d) that end before the times (K,), s; return whether any of them did.

        Realisations that fail at a later time are continued one by one, each as far as necessary.
        """
        longest = self.begin + LONGEST * (self.end - self.begin)
        known = np.array([path.found.times[-1] for path in paths])
        limits = np.array([path.limit for path in paths])
        short = (needed > known) & np.isfinite(needed) & (known < longest) & (needed < limits)
        farther = np.minimum(needed + MARGIN * (self.end - self.begin), longest)
        free = short & np.isinf(limits)
        if free.any():
            self._follow(np.unique(values[free], axis=0), float(farther[free].max()))
        for k in np.flatnonzero(short & ~free):
            until = float(min(farther[k], (needed[k] + limits[k]) / 2))
            self._follow(values[k : k + 1], until)
            key = np.ascontiguousarray(values[k], dtype=float).tobytes()
            if self._known[key].limit < limits[k] and until - needed[k] < NEAR * (self.end - self.begin):
                # do not continue a realisation that fails so soon after the required time
                self._known[key] = replace(self._known[key], limit=float(needed[k]))
        return bool(short.any())

    def _follow(self, values: Array, until: float, worth: Callable[[uqmbd.extend.Dense], bool] | None = None) -> None:
        """Compute realisations; if one fails after the last output time, store its motion up to the failure.

        `worth`: function that returns whether a computation with more times is worth its cost.
        """
        times, least = self.problem.times, max(2 * len(self.problem.times), self._fine)
        found, realised = uqmbd.extend.dense(self.problem.watching(), values, until, least, times, worth)
        self._fine = len(found.times)
        self.spent += len(values) * found.integrations
        self.counters.update(realised.counters)
        self.error = max(self.error, found.error)
        status = np.where(realised.good | (realised.status != Status.OK), realised.status, int(Status.NOT_FINITE))
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        reasons = [realised.messages[n] or "an output is not finite" for n in range(len(values))]
        beyond = until > self.end + 1e-9 * (self.end - self.begin)
        again = [n for n, key in enumerate(keys) if beyond and status[n] != Status.OK and key not in self._known]
        if again:
            self._follow(values[again], self.end)
        for n, key in enumerate(keys):
            if status[n] == Status.OK or not beyond:
                self._known[key] = _PhaseTrajectory(
                    found, n, int(status[n]), reasons[n] if status[n] != Status.OK else ""
                )
            else:
                self._known[key] = replace(self._known[key], limit=until, beyond=reasons[n])


def _joined(paths: list[_PhaseTrajectory]) -> uqmbd.extend.Dense:
    """Return realisations that have equal times as one object."""
    found, first = [path.found for path in paths], paths[0].found
    if all(one is first for one in found):
        return first.of([path.row for path in paths])
    requested = [path.found.asked[path.row] for path in paths if path.found.asked is not None]
    return uqmbd.extend.Dense(
        first.times,
        np.stack([path.found.values[path.row] for path in paths]),
        max(one.error for one in found),
        np.stack(requested) if len(requested) == len(paths) else None,
        first.integrations,
    )


def _is_resolved(found: uqmbd.extend.Dense) -> bool:
    """Return whether splines through every second value reproduce the others, so that the times resolve the motion."""
    half = uqmbd.extend.Dense(found.times[::2], found.values[..., ::2], 0.0)
    inside = np.arange(half.degree, len(found.times) - half.degree) // 2 * 2 + 1
    inside = np.unique(inside[inside < len(found.times) - half.degree])
    for k in range(len(found.values)):
        wrong = np.abs(half.spline(k)(found.times[inside]).T - found.values[k][:, inside])
        size = np.ptp(found.values[k], axis=1)
        if (np.quantile(wrong, 0.9, axis=1) > UNSEEN * np.where(size > 0, size, 1.0)).any():
            return False
    return True
