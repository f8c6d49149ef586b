"""Responses of realisations, margins of requirements, and the selection of realisations for error measurement."""

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
        Inputs of the realisations.
    response : array, shape (K, output, time)
        Outputs; NaN for failed realisations.
    status : array of int, shape (K,)
        Status of each realisation; 0 means success. `uqmbd.results.STATUS_MEANINGS` explains the other values.
    messages : tuple of str
        Reason of each failure; empty for successful realisations.
    counters : dict
        Solver counters, summed over the realisations.
    wall_time : float
        Wall-clock time, s.
    scalars : ScalarValues, optional
        Scalar outputs: `values` (K, scalar), with a separate `status` and `messages`. None if there are no scalar
        outputs.
    margins : MarginValues, optional
        Margins of requirements: `running` (K, requirement, T), `values` (K, requirement) and `failed` (K,). `values`
        refer to the whole motion; a value is negative if the requirement is violated. None if there are no
        requirements.

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
        """Join several chunks into one object for all inputs (K, input), with responses of shape (output, time).

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of all realisations.
        parts : sequence of Realisations
            Chunks, in order.
        shape : tuple of int
            Shape (output, T) of each response.
        wall_time : float
            Wall-clock time, s.

        Returns
        -------
        Realisations
            All K realisations.
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
        """Return selected realisations in the order of `rows`; solver counters are empty, and the time is 0 s."""
        messages = tuple(np.array(self.messages, dtype=object)[rows])
        return Realisations(self.values[rows], self.response[rows], self.status[rows], messages, {}, 0.0)

    @classmethod
    def of(cls, values: Array, chunk: Chunk, wall_time: float) -> Realisations:
        """Return the realisations of a chunk.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of the realisations.
        chunk : Chunk
            Results that a worker computed.
        wall_time : float
            Wall-clock time, s.
        """
        about = (chunk.response, chunk.status, chunk.messages, dict(chunk.counters), wall_time)
        return cls(values, *about, chunk.scalars, chunk.margins)

    def choosing(self, seen: ScalarMap, chosen: Sequence[str]) -> Realisations:
        """Return realisations with some of the scalar outputs; a realisation without one of these outputs is censored.

        Parameters
        ----------
        seen : ScalarMap
            Scalar outputs of the model.
        chosen : sequence of str
            Names of the scalar outputs to select.
        """
        columns = [k for k, name in enumerate(seen.names) if name in chosen]
        response, status, messages = self.response[:, columns], self.status.copy(), list(self.messages)
        for k in np.flatnonzero((status == Status.OK) & np.isnan(response).any(axis=(1, 2))).tolist():
            late = columns[int(np.argmax(np.isnan(response[k]).any(axis=1)))]
            status[k], messages[k] = Status.CENSORED, seen.late[late]
        return replace(self, response=response, status=status, messages=tuple(messages))

    @property
    def censored(self) -> int:
        """Return the number of realisations without a requested output; they do not count as failures."""
        return int(np.count_nonzero(self.status == Status.CENSORED))

    @property
    def good(self) -> Mask:
        """Return a mask of the successful realisations with finite outputs, shape (K,)."""
        return np.asarray((self.status == Status.OK) & np.isfinite(self.response).all(axis=(1, 2)))

    @property
    def failures(self) -> int:
        """Return the number of failed realisations."""
        return int(np.count_nonzero(self.status)) - self.censored

    def most_frequent_reason(self) -> str:
        """Return the first message with the most frequent reason of failure; the comparison ignores digits."""
        reasons = [m for m, status in zip(self.messages, self.status, strict=True) if m and status != Status.CENSORED]
        if not reasons:
            return ""
        shapes = ["".join(c for c in m if not c.isdigit()) for m in reasons]
        return reasons[shapes.index(Counter(shapes).most_common(1)[0][0])]


@dataclass(frozen=True)
class Margins:
    """Distances of realisations from the limits of requirements.

    Attributes
    ----------
    values : array, shape (K, requirement)
        Margins over the whole motion, in the units of the relations. A negative margin violates the requirement. NaN
        for failed realisations.
    running : array, shape (K, requirement, T)
        The smallest margin until each output time, including minima between the times. If a margin is only defined at
        the end, such as the margin of an integral, its values before the last time are +inf.
    failed : array of bool, shape (K,)
        Whether each realisation failed. A failed realisation has no margins, and is neither safe nor unsafe.
    messages : tuple of str
        Reason of each failure; empty for successful realisations.
    counters : dict
        Solver counters, summed over the realisations.
    wall_time : float
        Wall-clock time, s.

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
        """Return the margins of realisations, each of shape (requirement, T).

        Parameters
        ----------
        found : Realisations
            Realisations with margins.
        shape : tuple of int
            Shape (requirement, T) of the margins of a realisation.
        """
        known = found.margins
        if known is None:
            return cls(np.zeros((0, shape[0])), np.zeros((0, *shape)), np.zeros(0, dtype=bool), (), {}, 0.0)
        return cls(known.values, known.running, known.failed, known.messages, found.counters, found.wall_time)


AGAIN, MOST = 3, 100
"""Minimum and maximum number of realisations that are integrated again."""

EACH = 20
"""Number of successful realisations for each realisation that is integrated again. An integration with one hundredth of
the tolerance costs up to twice as much."""

NUMBERS = 1 << 24
"""Maximum number of response values of realisations that are integrated again; the first `AGAIN` are exempt."""


@dataclass
class Observed:
    """A selection of the successful realisations of a method, and counts of all realisations."""

    values: list[Array] = field(default_factory=list)  # inputs (input,)
    responses: list[Array] = field(default_factory=list)  # (output, time)
    counters: Counter[str] = field(default_factory=Counter)  # counters of the solvers, summed
    missing: Counter[int] = field(default_factory=Counter)
    """Number of realisations without an output, by the index of the output; outputs that always occur have no entry."""
    counted: int = 0  # successful realisations, including those in `missing`
    failed: int = 0  # failed realisations
    extent: tuple[Array, Array, int] | None = None
    """Minimum and maximum (output, time), and number, of the successful realisations that workers do not reduce."""

    def add(self, part: Realisations) -> None:
        """Count the realisations of a chunk, and select evenly spread realisations until there are enough."""
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
        """Count the realisations of a chunk, and count for each output the realisations in which it does not occur."""
        self.counters.update(part.counters)
        self.missing.update({k: int(late[k]) for k in np.flatnonzero(late).tolist()})
        self.counted += int(np.count_nonzero(part.status == Status.OK)) + part.censored
        self.failed += part.failures

    def take(self, values: Array, responses: Array) -> None:
        """Select evenly spread realisations until there are enough for the current number of realisations."""
        most = min(MOST, NUMBERS // max(1, responses[:1].size), self.counted // EACH)
        count = min(max(AGAIN, most) - len(self.values), len(values))
        for k in np.linspace(0, len(values) - 1, max(0, count)).round().astype(int).tolist():
            self.values.append(values[k].copy())
            self.responses.append(responses[k].copy())


def offered(status: Index) -> Index:
    """Return the indices of successful realisations of a chunk for re-integration, evenly spread."""
    good = np.flatnonzero(status == Status.OK)
    count = min(max(AGAIN, -(-len(status) // EACH)), len(good))
    found: Index = good[np.linspace(0, len(good) - 1, count).round().astype(int)]
    return found


def late_outputs(part: Realisations) -> Index:
    """Return, for each output, the number of realisations in which it does not occur."""
    found: Index = np.isnan(part.response[part.status == Status.CENSORED]).any(axis=2).sum(axis=0)
    return found


def log_realisations(label: str, kind: str, part: Realisations) -> None:
    """Log a chunk of realisations and its failures to the logger ``uqmbd.realisations``."""
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
