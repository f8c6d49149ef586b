"""Realisations that are followed beyond the last output time, until each has reached the same phase of a clock."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Array
from uqmbd_collocation.alignment.landmarks import PER_TURN, Landmarked, marks_behind, phase_landmarks, time_landmarks

__all__ = ["PhasePaths"]


AHEAD = 1.15
"""How much longer than the output times realisations are followed at first."""

LONGEST = 8.0
"""How much longer at most."""

POINTS = 16
"""Chebyshev points of a segment, a quarter of a turn."""

RUNS: tuple[str, ...]
STANDS: tuple[str, ...]
RUNS, STANDS = ("the clock runs",), ("the clock stands",)


@dataclass(frozen=True)
class _Path:
    """One realisation: where it is among those that were computed with it, and what became of it."""

    found: uqmbd.Dense
    row: int
    status: int
    message: str


@dataclass
class PhasePaths:
    """Realisations over longer times, each computed once, or anew where it has to go further.

    Attributes
    ----------
    problem : uqmbd.Problem
        That of the study.
    wanted : str, optional
        Name of the clock that the user asks for.
    clock : uqmbd.Clock
        Set by `find_clock`.
    spent : int
        Realisations so far, those that were computed anew counted again.
    counters : Counter
        Of the solver, summed.
    longest : float
        How much longer than the output times realisations were followed, at most.
    error : float
        Of the interpolation, over the range of an output: the largest.
    """

    problem: uqmbd.Problem
    wanted: str | None = None
    clock: uqmbd.Clock | None = None
    spent: int = 0
    counters: Counter[str] = field(default_factory=Counter)
    longest: float = 1.0
    error: float = 0.0
    _known: dict[bytes, _Path] = field(default_factory=dict)

    points: ClassVar[int] = POINTS
    least: ClassVar[int] = 0
    what: ClassVar[str] = "phases"
    landmarks: ClassVar[str] = "times of equal phase"

    @property
    def failures(self) -> int:
        """Realisations that failed."""
        return sum(path.status != Status.OK for path in self._known.values())

    def attributes(self) -> dict[str, Any]:
        """Return what the results say of the alignment."""
        return {
            "clock": self._clock.name,
            "clock_kind": "angle" if self._clock.turn else "oscillation",
            "longer": self.longest,
            "interpolation_error": self.error,
        }

    @property
    def begin(self) -> float:
        """First output time, s."""
        return float(self.problem.times[0])

    @property
    def end(self) -> float:
        """Last output time, s."""
        return float(self.problem.times[-1])

    def find_clock(self, values: Array) -> str:
        """Choose the clock from realisations at inputs (K, d); return why there is none, or nothing."""
        groups, paths = self._groups(values, AHEAD)
        if not groups:
            return f"all realisations failed: {paths[0].message}"
        self.clock, why = uqmbd.choose_clock(self.problem, groups[0][0], self.end, self.wanted)
        return why

    def sequences(self, values: Array) -> list[tuple[str, ...]]:
        """Say of realisations at inputs (K, d) whether the clock runs; those that fail go with the others."""
        found = [RUNS] * len(values)
        groups, _ = self._groups(values, AHEAD)
        for seen, rows in groups:
            for k, runs in zip(rows, self._clock.phases(seen, self.end).running(self.end), strict=True):
                found[k] = RUNS if runs else STANDS
        return found

    def marks(self, space: uqmbd.GermSpace, germs: Array, spread: Array) -> Array:
        """Return the phases of landmarks (S,) that all realisations of an element need.

        Parameters
        ----------
        space : uqmbd.GermSpace
            Of the element.
        germs : array, shape (K, d)
            Nodes.
        spread : array, shape (N, d)
            Where the chaos is evaluated: the phases there are those of a polynomial of order 2 through the nodes.
        """
        begins, ends, used = [], [], []
        for seen, rows in self._groups(space.to_inputs(germs), AHEAD)[0]:
            phases = self._clock.phases(seen, self.end)
            begins.append(phases.values[:, 0])
            ends.append(phases.at(self.end))
            used += rows
        known = np.stack([np.concatenate(begins), np.concatenate(ends)], axis=1)
        terms = uqmbd.index_set(space.dimension, 2)
        terms = terms if len(used) >= 2 * len(terms) else terms[terms.sum(axis=1) <= 1]
        psi = space.evaluate(germs[used], terms)
        fit = np.linalg.lstsq(psi, known, rcond=1e-10)[0]
        others = np.concatenate([known, space.evaluate(spread, terms) @ fit])
        return marks_behind(others[:, 0], float(others[:, 1].max()) + 2 * np.pi / PER_TURN)

    def cut(self, values: Array, marks: Array) -> tuple[Landmarked, uqmbd.Realisations]:
        """Return realisations from phase to phase; one that does not reach the last has failed."""
        factor, outputs = max(AHEAD, self.longest), self.problem.labels.shape[0]
        while True:
            groups, paths = self._groups(values, factor)
            short = 0.0
            for seen, _ in groups:
                phases = self._clock.phases(seen, self.end)
                short = max(short, phases.lacking(float(marks[-1])))
            if not short or factor >= LONGEST:
                break
            factor = min(LONGEST, 1.0 + (factor - 1.0 + short / (self.end - self.begin)) * 1.05)
        edges = np.full((len(values), len(marks) + 1), np.nan)
        response = np.full((len(values), len(marks), outputs, POINTS), np.nan)
        for seen, rows in groups:
            part = phase_landmarks(seen, self._clock, marks, self.end, outputs, POINTS)
            edges[rows], response[rows] = part.edges, part.response
        return Landmarked(edges, response), self._told(values, paths, edges)

    def cut_in_time(self, values: Array, segments: int) -> tuple[Landmarked, uqmbd.Realisations]:
        """Return realisations in segments of the same times."""
        outputs = self.problem.labels.shape[0]
        groups, paths = self._groups(values, AHEAD)
        edges = np.full((len(values), segments + 1), np.nan)
        response = np.full((len(values), segments, outputs, POINTS), np.nan)
        for seen, rows in groups:
            part = time_landmarks(seen, np.linspace(self.begin, self.end, segments + 1), outputs, POINTS)
            edges[rows], response[rows] = part.edges, part.response
        return Landmarked(edges, response), self._told(values, paths, edges)

    def _told(self, values: Array, paths: list[_Path], edges: Array) -> uqmbd.Realisations:
        status = np.array([path.status for path in paths])
        lost = (status == Status.OK) & ~np.isfinite(edges).all(axis=1)
        late = f"the clock, {self._clock.words}, does not reach the phase that others have at the last output time"
        messages = tuple(late if x else path.message for x, path in zip(lost, paths, strict=True))
        status = np.where(lost, int(Status.INTEGRATION_FAILED), status)
        return uqmbd.Realisations(values, np.zeros((len(values), 0, 0)), status, messages, {}, 0.0)

    @property
    def _clock(self) -> uqmbd.Clock:
        if self.clock is None:
            raise uqmbd.StudyError(f"{self.problem.label}: no clock was chosen.")
        return self.clock

    def _groups(self, values: Array, factor: float) -> tuple[list[tuple[uqmbd.Dense, list[int]]], list[_Path]]:
        """Realisations (K) for so many times the output times, put together where they have the same times."""
        until = self.begin + factor * (self.end - self.begin)
        keys = [row.tobytes() for row in np.ascontiguousarray(values, dtype=float)]
        missing: dict[bytes, int] = {}
        for k, key in enumerate(keys):
            if key not in self._known or self._known[key].found.times[-1] < until - 1e-9 * abs(until):
                missing[key] = k
        if missing:
            rows = values[list(missing.values())]
            found, told = uqmbd.dense(self.problem.watching(), rows, until, 2 * len(self.problem.times))
            self.spent += len(rows)
            self.counters.update(told.counters)
            self.longest, self.error = max(self.longest, factor), max(self.error, found.error)
            status = np.where(told.good | (told.status != Status.OK), told.status, int(Status.NOT_FINITE))
            beyond = f" (followed beyond the last output time, to t = {until:g} s, since phases are compared)"
            for n, key in enumerate(missing):
                message = told.messages[n] or "an output is not finite" if status[n] != Status.OK else ""
                self._known[key] = _Path(found, n, int(status[n]), message and message + beyond)
        paths = [self._known[key] for key in keys]
        groups: dict[int, list[int]] = {}
        for k, path in enumerate(paths):
            if path.status == Status.OK:
                groups.setdefault(id(path.found), []).append(k)
        found_groups = []
        for members in groups.values():
            whole = paths[members[0]].found
            found_groups.append((replace(whole, values=whole.values[[paths[k].row for k in members]]), members))
        return found_groups, paths
