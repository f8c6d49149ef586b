"""Realisations that are followed beyond the last output time, until each has reached the same phase of a clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Array, Mask
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
"""Length over which realisations are followed first, over that of the output times."""

LONGEST = 8.0
"""Largest such length."""

MARGIN = 0.02
"""Part of the output times by which realisations are followed farther than they seem to need."""

NEAR = 1e-3
"""Share of the output times: a realisation that fails within it behind the needed time is abandoned."""

TRIES = 8
"""Integrations in which a realisation reaches the phase that is needed."""

POINTS = 16
"""Chebyshev points of a segment, a quarter of a turn."""

Sequence = tuple[str, ...]
STANDS: Sequence = ("the clock stands",)


@dataclass(frozen=True)
class _PhaseTrajectory:
    """One realisation, known until the end of `found`; it fails on the way to `limit`, with the reason `beyond`."""

    found: uqmbd.extend.Dense
    row: int
    status: int
    message: str
    limit: float = np.inf
    beyond: str = ""


@dataclass
class PhaseTrajectories:
    """Realisations over longer times, each computed once, or anew where it has to be longer."""

    problem: uqmbd.extend.Problem
    wanted: str | None = None  # name of the clock that the user requests
    clock: uqmbd.extend.Clock | None = None  # set by `prepare`
    spent: int = 0  # realisations so far; those that were computed anew count again
    counters: Counter[str] = field(default_factory=Counter)
    error: float = 0.0  # largest interpolation error, relative to the range of an output
    turns: tuple[float, float] = (np.inf, 0.0)
    """Turns that the clock makes in nodes until the last output time, at least and at most."""
    rests: tuple[float, float] = (np.inf, -np.inf)
    """First and last time, s, at which nodes pass the last common phase before their clock comes to rest."""
    starts: Starts | None = None
    better: str = ""
    """Name of a clock that runs in all nodes, if another one was requested."""
    _known: dict[bytes, _PhaseTrajectory] = field(default_factory=dict)
    _late: set[bytes] = field(default_factory=set)
    _fine: int = 0
    """Times that resolved the last realisations."""

    points: ClassVar[int] = POINTS
    least: ClassVar[int] = 0
    longer: ClassVar[float] = 1.0
    what: ClassVar[str] = "phases"
    landmarks: ClassVar[str] = "times of equal phase"

    @property
    def failures(self) -> int:
        """Realisations that failed, those included that do so before they reach the phase that is needed."""
        return len(self._late) + sum(path.status != Status.OK for path in self._known.values())

    @property
    def longest(self) -> float:
        """Longest time that realisations were followed, over that of the output times."""
        ends = [path.found.times[-1] for path in self._known.values() if path.status == Status.OK]
        return float((max(ends, default=self.end) - self.begin) / (self.end - self.begin))

    def attributes(self, sequences: Iterable[Sequence]) -> dict[str, Any]:
        """Return attributes of the alignment for the results, from the sequences of the elements."""
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
        """Return a message on the share of the probability in which the clock stands, from sequences of elements."""
        standing = sequences.count(STANDS)
        text = (
            f"{self.problem.label}: the clock, {self._clock.words}, stands or turns back in realisations of about "
            f"{max(share, 1e-3):.1%} of the probability. There is no common phase: they are compared at equal times, "
            f"in {standing} of {len(sequences)} elements, where a chaos holds for some turns only."
        )
        return text + (f" The clock {self.better!r} runs in all nodes; try clock={self.better!r}." * bool(self.better))

    @property
    def begin(self) -> float:
        """First output time, s."""
        return float(self.problem.times[0])

    @property
    def end(self) -> float:
        """Last output time, s."""
        return float(self.problem.times[-1])

    def prepare(self, values: Array) -> None:
        """Choose the clock from realisations at inputs (K, d), or raise `Impossible`."""
        groups, paths = self._groups(values)
        if not groups:
            raise without_clock(self.problem, f"all realisations failed: {paths[0].message}")
        found, rows = max(groups, key=lambda group: len(group[1]))
        self.clock, why = uqmbd.extend.choose_clock(self.problem, found, self.end, self.wanted)
        if self.clock is not None and self.wanted is not None:
            other, _ = uqmbd.extend.choose_clock(self.problem, found, self.end, None)
            if other is not None and other.name != self.clock.name and self._in_all(other, found):
                self.better = other.name
        swings = self.clock.kinds[-1] if self.clock else None
        if swings and not swings.turn:
            phases = swings.phases(found)
            runs = phases.running(self.end)
            self.starts = Starts.of(values[rows][runs], phases.values[runs, 0]) if runs.any() else None
        if why:
            raise without_clock(self.problem, why)

    def sequences(self, values: Array) -> list[Sequence]:
        """Return the motion of the clock in realisations at inputs (K, d); failed ones are grouped with the others."""
        found = np.full(len(values), len(self._kinds))
        groups, paths = self._groups(values)
        for seen, rows in groups:
            runs = [self._phases(kind, seen, values[rows]).running(self.end) for kind in self._clock.kinds]
            found[rows] = np.argmax([*runs, np.ones(len(rows), dtype=bool)], axis=0)
        failed = np.array([path.status != Status.OK for path in paths])
        found[failed] = Counter(found[~failed].tolist()).most_common(1)[0][0] if not failed.all() else 0
        return [[*self._kinds, STANDS][k] for k in found]

    def elsewhere(self, sequence: Sequence, seen: Array) -> Mask:
        """Return which realisations (K, watched, T), at the output times, surely do not have a sequence.

        They are too few times for an oscillation, but tell whether an angle turns.
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

        There are no markers where the clock of the element stands. A polynomial of order 2 through the nodes gives the
        phases at the points `spread` (N, d), at which the chaos is evaluated. Where the clock comes to rest in some
        realisations, the markers are those that all nodes have; the motion after the last of them is compared at equal
        steps of time.
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
        """Return the marks (S,) that all of some realisations pass before their clock comes to rest, if it does."""
        groups, _ = self._reaching(kind, values, float(marks[-1]))
        common = marks[marks <= min((p.lasting.min(initial=np.inf) for _, p, _ in groups), default=np.inf) + 1e-9]
        if len(common) in (0, len(marks)):
            return Marks(common)
        passed = np.array([phases.passed(k, common[-1:])[0] for _, phases, rows in groups for k in range(len(rows))])
        self.rests = (min(self.rests[0], float(np.nanmin(passed))), max(self.rests[1], float(np.nanmax(passed))))
        first = min(float(np.nanmin(passed)), self.end)
        tail = self.end - first + MARGIN * (self.end - self.begin)
        return Marks(common, tail, 1 + int(np.count_nonzero(self.problem.times > first)) // STANDING)

    def cutting(self, space: uqmbd.extend.GermSpace, germs: Array, spread: Array, sequence: Sequence) -> MarkerRule:
        """Return how realisations of an element are cut; see `marks`."""
        return self._cutting(sequence, self.marks(space, germs, spread, sequence))

    def _cutting(self, sequence: Sequence, marks: Marks) -> MarkerRule:
        if marks.count:

            def farther(late: float, pace: float) -> MarkerRule:
                return self._cutting(sequence, marks.farther(late, pace))

            return MarkerRule(lambda values: self.cut(values, marks, sequence), ("",) * marks.count, "phase", farther)
        segments = -(-len(self.problem.times) // STANDING)
        return MarkerRule(lambda values: self.cut_in_time(values, segments), ("",) * segments, "time")

    def cut(
        self, values: Array, marks: Marks, sequence: Sequence
    ) -> tuple[MarkedRealisations, uqmbd.extend.Realisations]:
        """Return realisations from phase to phase; one that does not reach the last has failed."""
        outputs = self.problem.labels.shape[0]
        groups, paths = self._reaching(self._kind(sequence), values, float(marks.phases[-1]), marks.tail)
        edges = np.full((len(values), marks.count + 1), np.nan)
        response = np.full((len(values), marks.count, outputs, POINTS), np.nan)
        for seen, phases, rows in groups:
            part = phase_markers(seen, phases, marks, outputs, POINTS)
            edges[rows], response[rows] = part.edges, part.response
        return MarkedRealisations(edges, response), self._told(values, paths, edges, sequence)

    def _reaching(
        self, kind: uqmbd.extend.Clock, values: Array, last: float, more: float = 0.0
    ) -> tuple[list[tuple[uqmbd.extend.Dense, uqmbd.extend.Phases, list[int]]], list[_PhaseTrajectory]]:
        """Follow realisations (K, d) until their phases are the last, rad, and longer, s, if they get there."""
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
        """Return realisations in segments of the same times."""
        outputs = self.problem.labels.shape[0]
        groups, paths = self._groups(values)
        edges = np.full((len(values), segments + 1), np.nan)
        response = np.full((len(values), segments, outputs, POINTS), np.nan)
        for seen, rows in groups:
            part = time_markers(seen, np.linspace(self.begin, self.end, segments + 1), outputs, POINTS)
            edges[rows], response[rows] = part.edges, part.response
        return MarkedRealisations(edges, response), self._told(values, paths, edges, STANDS)

    def at_times(self, values: Array) -> uqmbd.extend.Realisations:
        """Return realisations at the output times: of those that are followed, and anew of those that failed."""
        outputs = self.problem.labels.shape[0]
        response = np.full((len(values), *self.problem.labels.shape), np.nan)
        for seen, rows in self._groups(values)[0]:
            if seen.asked is not None:
                response[rows] = seen.asked[:, :outputs]
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

    def _told(
        self, values: Array, paths: list[_PhaseTrajectory], edges: Array, sequence: Sequence
    ) -> uqmbd.extend.Realisations:
        status = np.array([path.status for path in paths])
        lost = (status == Status.OK) & ~np.isfinite(edges).all(axis=1)
        same = np.array([other == sequence for other in self.sequences(values)])
        self._late.update(row.tobytes() for row in np.ascontiguousarray(values, dtype=float)[lost & same])
        until = f"until the clock, {self._clock.words}, reaches the phase that others have at the last output time"
        messages = []
        for path, gone in zip(paths, lost, strict=True):
            reason = path.message
            if gone and path.beyond:
                reason = f"{path.beyond} (it is followed beyond the last output time, {until})"
            elif gone:
                reason = (
                    f"the clock, {self._clock.words}, does not reach the phase that others have at the last output "
                    f"time, until t = {path.found.times[-1]:g} s"
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
        """Names of the sequences of realisations with a running clock, by kind."""
        names = [kind.words for kind in self._clock.kinds]
        if len(names) > 1:
            names[1] += ", backwards"
        return [(name,) for name in names]

    def _kind(self, sequence: Sequence) -> uqmbd.extend.Clock:
        return self._clock.kinds[self._kinds.index(sequence)]

    def _in_all(self, clock: uqmbd.extend.Clock, found: uqmbd.extend.Dense) -> bool:
        good = np.isfinite(found.values).all(axis=(1, 2))
        if not good.all():
            return False
        return bool(np.any([k.phases(found).running(self.end) for k in clock.kinds], axis=0).all())

    def _phases(self, kind: uqmbd.extend.Clock, seen: uqmbd.extend.Dense, values: Array) -> uqmbd.extend.Phases:
        """Read the phases of realisations at inputs (K, d)."""
        near = self.starts.near(values) if self.starts is not None and not kind.turn else None
        return kind.phases(seen, near)

    def _groups(self, values: Array) -> tuple[list[tuple[uqmbd.extend.Dense, list[int]]], list[_PhaseTrajectory]]:
        """Return the known motion of realisations (K), grouped by equal times."""
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        missing = {key: k for k, key in enumerate(keys) if key not in self._known}
        if missing:
            self._follow(values[list(missing.values())], self.begin + AHEAD * (self.end - self.begin))
        paths = [self._known[key] for key in keys]
        groups: dict[int, list[int]] = {}
        for k, path in enumerate(paths):
            if path.status == Status.OK:
                groups.setdefault(id(path.found), []).append(k)
        found_groups = []
        for members in groups.values():
            whole = paths[members[0]].found
            found_groups.append((whole.of([paths[k].row for k in members]), members))
        return found_groups, paths

    def _continue(self, values: Array, paths: list[_PhaseTrajectory], needed: Array) -> bool:
        """Continue realisations (K, d) whose known motion is too short to times (K,), s; return whether there are any.

        Those that fail farther on are followed one by one, as far as each of them needs.
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
                # it fails so near behind what is needed, too: it is not tried again
                self._known[key] = replace(self._known[key], limit=float(needed[k]))
        return bool(short.any())

    def _follow(self, values: Array, until: float) -> None:
        """Compute realisations; the known part of one that fails behind the last output time is stored."""
        times = self.problem.times
        found, told = uqmbd.extend.dense(self.problem.watching(), values, until, max(2 * len(times), self._fine), times)
        self._fine = len(found.times)
        self.spent += len(values) * found.integrations
        self.counters.update(told.counters)
        self.error = max(self.error, found.error)
        status = np.where(told.good | (told.status != Status.OK), told.status, int(Status.NOT_FINITE))
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        reasons = [told.messages[n] or "an output is not finite" for n in range(len(values))]
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
