"""Responses of some realisations, margins of requirements, and the realisations that errors are measured on."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import MarginValues, ScalarMap, ScalarValues
from uqmbd.logs import realisations
from uqmbd.propagation.execution.chunks import Chunk
from uqmbd.status import Status
from uqmbd.typing import Array, Index, Mask

__all__ = ["AGAIN", "Margins", "Observed", "Realisations", "late_outputs", "log_realisations", "offered"]


@dataclass(frozen=True)
class Realisations:
    """Responses of a mechanism to given inputs.

    Attributes
    ----------
    values : array, shape (K, input)
        The inputs.
    response : array, shape (K, output, time)
        NaN where a realisation failed.
    status : array of int, shape (K,)
        0: fine; `uqmbd.results.STATUS_MEANINGS` names the others.
    messages : tuple of str
        Reason of each failure, else empty.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.
    scalars : ScalarValues, optional
        Outputs without a time: `values` (K, scalar) with a `status` and `messages` of their own, where the mechanism
        has some.
    margins : MarginValues, optional
        Margins of requirements: `running` (K, requirement, T), `values` (K, requirement) of the whole motion, negative
        if the requirement is violated, and `failed` (K,). It is None without requirements.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> found = problem.realise(np.array([[6.0], [7.0]]))
    >>> found.response[:, 0, -1].round(4).tolist(), found.good.tolist(), found.failures  # after 2 s, rad
    ([12.0, 14.0], [True, True], 0)
    >>> found[:1].values.tolist()
    [[6.0]]
    """

    values: Array
    response: Array
    status: NDArray[np.int64]
    messages: tuple[str, ...]
    counters: dict[str, float]
    wall_time: float
    scalars: ScalarValues | None = None
    margins: MarginValues | None = None

    @classmethod
    def joined(
        cls, values: Array, parts: Sequence[Realisations], shape: tuple[int, ...], wall_time: float
    ) -> Realisations:
        """Join those of several chunks: of all inputs (K, input), with responses of a shape (output, time).

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of all.
        parts : sequence of Realisations
            In their order.
        shape : tuple of int
            (output, T) of each response.
        wall_time : float
            s.

        Returns
        -------
        Realisations
            K of them.
        """
        counters: Counter[str] = Counter()
        for part in parts:
            counters.update(part.counters)
        scalars = [p.scalars for p in parts if p.scalars is not None]
        margins = [p.margins for p in parts if p.margins is not None]
        return cls(
            values,
            np.concatenate([np.zeros((0, *shape)), *(p.response for p in parts)]),
            np.concatenate([np.zeros(0, dtype=np.int64), *(p.status for p in parts)]),
            tuple(m for p in parts for m in p.messages),
            dict(counters),
            wall_time,
            ScalarValues.joined(scalars) if scalars else None,
            MarginValues.joined(margins) if margins else None,
        )

    def __getitem__(self, rows: slice | Index) -> Realisations:
        """Return some of them, in order; what solvers counted, and the time, are those of all alone."""
        messages = tuple(np.array(self.messages, dtype=object)[rows])
        return Realisations(self.values[rows], self.response[rows], self.status[rows], messages, {}, 0.0)

    @classmethod
    def of(cls, values: Array, chunk: Chunk, wall_time: float) -> Realisations:
        """Return those of a chunk.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs.
        chunk : Chunk
            What a worker computed.
        wall_time : float
            s.
        """
        about = (chunk.response, chunk.status, chunk.messages, dict(chunk.counters), wall_time)
        return cls(values, *about, chunk.scalars, chunk.margins)

    def choosing(self, seen: ScalarMap, chosen: Sequence[str]) -> Realisations:
        """Return them with some of the outputs without a time; those in which one does not happen are censored.

        Parameters
        ----------
        seen : ScalarMap
            Which outputs without a time the model has.
        chosen : sequence of str
            Names of some of them.
        """
        columns = [k for k, name in enumerate(seen.names) if name in chosen]
        response, status, messages = self.response[:, columns], self.status.copy(), list(self.messages)
        for k in np.flatnonzero((status == Status.OK) & np.isnan(response).any(axis=(1, 2))).tolist():
            late = columns[int(np.argmax(np.isnan(response[k]).any(axis=1)))]
            status[k], messages[k] = Status.CENSORED, seen.late[late]
        return replace(self, response=response, status=status, messages=tuple(messages))

    @property
    def censored(self) -> int:
        """In how many of them an output that is asked for does not happen: they have not failed."""
        return int(np.count_nonzero(self.status == Status.CENSORED))

    @property
    def good(self) -> Mask:
        """Which succeeded, with outputs that are all finite, shape (K,)."""
        return np.asarray((self.status == Status.OK) & np.isfinite(self.response).all(axis=(1, 2)))

    @property
    def failures(self) -> int:
        """How many failed."""
        return int(np.count_nonzero(self.status)) - self.censored

    def most_frequent_reason(self) -> str:
        """Return the reason that most failures share (numbers aside), in its first wording."""
        reasons = [m for m, status in zip(self.messages, self.status, strict=True) if m and status != Status.CENSORED]
        if not reasons:
            return ""
        shapes = ["".join(c for c in m if not c.isdigit()) for m in reasons]
        return reasons[shapes.index(Counter(shapes).most_common(1)[0][0])]


@dataclass(frozen=True)
class Margins:
    """How far realisations are from the limits that they have to stay within.

    Attributes
    ----------
    values : array, shape (K, requirement)
        Of the whole motion, in the units of the relations: below zero, the requirement is violated.  NaN where a
        realisation failed.
    running : array, shape (K, requirement, T)
        The smallest margin until each output time, located between the times, too.  Margins that are known at the end
        only, as of an integral, are +inf before the last time.
    failed : array of bool, shape (K,)
        Which realisations have no margins: they are neither safe nor unsafe.
    messages : tuple of str
        Reasons of failures, else empty.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> mechanism.require("slow", wheel.angle < 13, "it does not turn by more than 13 rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> margins = problem.margins(np.array([[6.0], [7.0]]))
    >>> margins.values.round(4).tolist(), margins.failed.tolist()  # rad
    ([[1.0], [-1.0]], [False, False])
    """

    values: Array
    running: Array
    failed: Mask
    messages: tuple[str, ...]
    counters: dict[str, float]
    wall_time: float

    @classmethod
    def of(cls, found: Realisations, shape: tuple[int, ...]) -> Margins:
        """Return those of some realisations, the shape of each being (requirement, T).

        Parameters
        ----------
        found : Realisations
            With margins.
        shape : tuple of int
            (requirement, T).
        """
        known = found.margins
        if known is None:
            return cls(np.zeros((0, shape[0])), np.zeros((0, *shape)), np.zeros(0, dtype=bool), (), {}, 0.0)
        return cls(known.values, known.running, known.failed, known.messages, found.counters, found.wall_time)


AGAIN, MOST = 3, 100
"""Realisations that are integrated again, at least and at most."""

EACH = 20
"""Successful realisations per realisation that is integrated again: an integration with a hundredth of the tolerance
costs up to twice as much."""

NUMBERS = 1 << 24
"""Numbers in the responses of realisations that are integrated again, at most, except for the first `AGAIN`."""


@dataclass
class Observed:
    """Some of the successful realisations of a method, and counts of all of them."""

    values: list[Array] = field(default_factory=list)  # inputs (input,)
    responses: list[Array] = field(default_factory=list)  # (output, time)
    counters: Counter[str] = field(default_factory=Counter)  # of the solvers, summed
    missing: Counter[int] = field(default_factory=Counter)
    """Realisations without the output, by its index; outputs that always occur are not in it."""
    counted: int = 0  # successful realisations, those in `missing` included
    failed: int = 0  # failed realisations
    extent: tuple[Array, Array, int] | None = None
    """Smallest and largest values (output, time) and number of successful realisations that workers do not reduce."""

    def add(self, part: Realisations) -> None:
        """Count those of a chunk, and take some of it, evenly spread, until there are enough."""
        self.count(part, late_outputs(part))
        chosen = offered(part.status)
        self.take(part.values[chosen], part.response[chosen])
        good = part.response[part.status == Status.OK]
        if len(good):
            low, high, count = good.min(axis=0), good.max(axis=0), len(good)
            if self.extent is not None:
                before = self.extent
                low, high, count = np.minimum(low, before[0]), np.maximum(high, before[1]), count + before[2]
            self.extent = low, high, count

    def count(self, part: Realisations, late: Index) -> None:
        """Count those of a chunk, and in how many of them each output does not happen."""
        self.counters.update(part.counters)
        self.missing.update({k: int(late[k]) for k in np.flatnonzero(late).tolist()})
        self.counted += int(np.count_nonzero(part.status == Status.OK)) + part.censored
        self.failed += part.failures

    def take(self, values: Array, responses: Array) -> None:
        """Select some of those offered, evenly spread, until there are enough for the realisations so far."""
        most = min(MOST, NUMBERS // max(1, responses[:1].size), self.counted // EACH)
        wanted = min(max(AGAIN, most) - len(self.values), len(values))
        for k in np.linspace(0, len(values) - 1, max(0, wanted)).round().astype(int).tolist():
            self.values.append(values[k].copy())
            self.responses.append(responses[k].copy())


def offered(status: Index) -> Index:
    """Return the indices of successful realisations of a chunk that may be integrated again, evenly spread."""
    good = np.flatnonzero(status == Status.OK)
    count = min(max(AGAIN, -(-len(status) // EACH)), len(good))
    found: Index = good[np.linspace(0, len(good) - 1, count).round().astype(int)]
    return found


def late_outputs(part: Realisations) -> Index:
    """Return in how many realisations each output does not happen."""
    found: Index = np.isnan(part.response[part.status == Status.CENSORED]).any(axis=2).sum(axis=0)
    return found


def log_realisations(label: str, kind: str, part: Realisations) -> None:
    """Log a chunk of realisations, and what failed in it, for who listens to ``uqmbd.realisations``."""
    if not realisations.isEnabledFor(logging.INFO):
        return
    realisations.debug("%s: %d realisations of %s in %.3g s", label, len(part.status), kind, part.wall_time)
    failed = np.flatnonzero((part.status != Status.OK) & (part.status != Status.CENSORED))
    if len(failed):
        first = part.messages[int(failed[0])]
        realisations.info(
            "%s: %d of %d realisations failed; the first: %s", label, len(failed), len(part.status), first
        )
    for row in failed.tolist() if realisations.isEnabledFor(logging.DEBUG) else ():
        realisations.debug("%s: inputs %s failed: %s", label, part.values[row].tolist(), part.messages[row])
