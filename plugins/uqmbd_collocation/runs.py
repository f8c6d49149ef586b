"""Realisations at germ points, each computed only once during a refinement."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

import uqmbd
from uqmbd.extend import Labels
from uqmbd.results import Status
from uqmbd.typing import Array, Index, Mask

__all__ = ["DIGITS", "DerivedSource", "CollocationRuns", "announced_once"]


DIGITS = 11
"""Decimals for the comparison of germ points: common nodes of rules of different sizes differ by rounding."""


class RealisationSource(Protocol):
    """Source of realisations: a problem, or a problem with other outputs."""

    @property
    def label(self) -> str: ...

    @property
    def rtol(self) -> float: ...

    @property
    def labels(self) -> Labels: ...

    def realise(self, values: Array) -> uqmbd.extend.Realisations:
        """Compute the response to each row of inputs."""


class DerivedSource:
    """Source of realisations derived from a problem, with the problem's outputs unless a subclass replaces them."""

    problem: uqmbd.extend.Problem

    @property
    def label(self) -> str:
        """Label of the propagator."""
        return self.problem.label

    @property
    def rtol(self) -> float:
        """Relative tolerance of the integration."""
        return self.problem.rtol

    @property
    def labels(self) -> Labels:
        """Names and units of outputs, inputs and times."""
        return self.problem.labels


@dataclass
class CollocationRuns:
    """All realisations of a collocation so far."""

    problem: RealisationSource  # computes the realisations
    space: uqmbd.extend.GermSpace
    counters: Counter[str] = field(default_factory=Counter)  # counters of the solver, summed over all realisations
    wall_time: float = 0.0  # time of the computation, s
    _where: dict[tuple[float, ...], int] = field(default_factory=dict)
    _germs: list[Array] = field(default_factory=list)
    _parts: list[uqmbd.extend.Realisations] = field(default_factory=list)
    _joined: Array | None = None
    scale: Array | None = None
    """Scale of the errors of the outputs (O,); default: the largest standard deviation."""

    @classmethod
    def filled(
        cls, problem: RealisationSource, space: uqmbd.extend.GermSpace, germs: Array, found: uqmbd.extend.Realisations
    ) -> CollocationRuns:
        """Return the runs that contain realisations at `germs` (K, d), without repeated points."""
        runs = cls(problem, space)
        rows = runs.missing(germs)
        runs._add(germs[rows], found[rows])
        return runs

    def joined(self, germs: Array, found: uqmbd.extend.Realisations) -> CollocationRuns:
        """Return the runs with additional realisations at `germs` (K, d), which must be new points."""
        more = replace(
            self,
            counters=Counter(self.counters),
            _where=dict(self._where),
            _germs=[*self._germs],
            _parts=[*self._parts],
        )
        rows = more.missing(germs)
        more._add(germs[rows], found[rows])
        return more

    def __len__(self) -> int:
        return len(self._where)

    def missing(self, germs: Array) -> Index:
        """Return the rows of `germs` (K, d) without a realisation, without repeated points."""
        first: dict[tuple[float, ...], int] = {}
        for k, key in enumerate(self._keys(germs)):
            if key not in self._where:
                first.setdefault(key, k)
        return np.array(list(first.values()), dtype=np.int64)

    def at(self, germs: Array) -> Index:
        """Compute missing realisations, and return the indices of the realisations at `germs` (K, d)."""
        rows = self.missing(germs)
        if len(rows):
            self._add(germs[rows], self.problem.realise(self.space.to_inputs(germs[rows])))
        return np.array([self._where[key] for key in self._keys(germs)], dtype=np.int64)

    def _add(self, germs: Array, part: uqmbd.extend.Realisations) -> None:
        for key in self._keys(germs):
            self._where[key] = len(self._where)
        self._germs.append(germs)
        self._parts.append(part)
        self._joined = None
        self.counters.update(part.counters)
        self.wall_time += part.wall_time

    def verification(self, points: uqmbd.extend.VerificationPoints) -> uqmbd.extend.Verification:
        """Return the successful realisations at points that no node uses."""
        where = self.at(points.germs)
        good = np.flatnonzero(self.good(where)) if len(where) else where
        if not len(good):
            nothing = np.zeros((0, *self.problem.labels.shape))
            return uqmbd.extend.Verification(self.space, points[:0], nothing, len(where), lost=float(len(where) > 0))
        known = uqmbd.extend.VerificationPoints(self.germs[where[good]], points.weights[good])
        lost = points.share(~self.good(where))
        return uqmbd.extend.Verification(
            self.space, known, self.response[where[good]], len(where), self.reason(where), lost
        )

    @property
    def germs(self) -> Array:
        """All points in order of computation, shape (K, d)."""
        return np.concatenate(self._germs)

    @property
    def values(self) -> Array:
        """Inputs at all points, shape (K, d)."""
        return np.concatenate([p.values for p in self._parts])

    @property
    def response(self) -> Array:
        """Responses, shape (K, output, time); NaN for failed realisations."""
        if self._joined is None:
            self._joined = np.concatenate([p.response for p in self._parts])
        return self._joined

    @property
    def status(self) -> Index:
        """Status of each realisation; a realisation with outputs that are not finite counts as failed."""
        status = np.concatenate([p.status for p in self._parts])
        infinite = ~np.isfinite(self.response).all(axis=(1, 2))
        return np.where((status == Status.OK) & infinite, Status.NOT_FINITE, status)

    @property
    def messages(self) -> list[str]:
        """Reason of each failure; an empty text for success."""
        found = [m for p in self._parts for m in p.messages]
        return [m or ("an output is not finite" if s else "") for m, s in zip(found, self.status, strict=True)]

    def good(self, where: Index) -> Mask:
        """Return which realisations, given by their indices (K,), succeeded."""
        return np.asarray(self.status[where] == Status.OK)

    def reason(self, where: Index) -> str:
        """Return the first reason of a failure among realisations, given by their indices."""
        messages = self.messages
        return next((messages[k] for k in where if messages[k]), "unknown")

    @staticmethod
    def _keys(germs: Array) -> list[tuple[float, ...]]:
        # add zero to make -0.0 equal to 0.0
        return [tuple(row) for row in (np.round(germs, DIGITS) + 0.0).tolist()]


@dataclass
class _SingleTask:
    """Progress of many small steps, displayed as one task of known size."""

    inner: uqmbd.extend.Progress
    most: int
    begun: bool = False

    def start(self, label: str, total: int) -> None:
        """Start the task at the first call only."""
        if not self.begun:
            self.begun = True
            self.inner.start(label, uqmbd.extend.AtMost(self.most))

    def advance(self, label: str, count: int = 1) -> None:
        """Report progress of the task."""
        self.inner.advance(label, count)

    def finish(self, label: str) -> None:
        """Do nothing, because the creator reports the end of all steps."""


def announced_once(problem: uqmbd.extend.Problem, most: int) -> uqmbd.extend.Problem:
    """Return a problem that displays all its computations as one task of at most `most` realisations."""
    return problem.using(progress=_SingleTask(problem.progress, most))
