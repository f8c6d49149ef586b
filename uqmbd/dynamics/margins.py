"""Margins of requirements: distances of realisations from required limits over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.assembly import not_unique
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model, OutputMap, output_map
from uqmbd.dynamics.integration import Trajectories
from uqmbd.dynamics.statics import ScalarMap, scalar_map, scalars_of
from uqmbd.dynamics.summaries import Domain, domain_map, running_minimum
from uqmbd.errors import Finding, Severity
from uqmbd.mechanism import Mechanism, Requirement
from uqmbd.status import Status
from uqmbd.typing import Array, Index, Mask

__all__ = ["MarginMap", "MarginValues", "margin_map", "margins_of", "undetermined_margins"]


@dataclass(frozen=True)
class MarginValues:
    """Margins of K realisations."""

    # (K, requirement, T): smallest margin up to each output time; NaN: failed; +inf: known only at the end of the
    # motion
    running: Array
    status: Index  # (K,): `Status` of the motion and the margins
    messages: tuple[str, ...]  # reasons

    @property
    def values(self) -> Array:
        """Margins of the whole motion, shape (K, requirement): violated below zero; NaN for failed realisations."""
        return self.running[:, :, -1]

    @property
    def failed(self) -> Mask:
        """Mask of realisations without margins, shape (K,): neither safe nor unsafe."""
        return np.asarray(self.status != Status.OK)

    @classmethod
    def joined(cls, parts: Sequence[MarginValues]) -> MarginValues:
        """Join the margins of several chunks."""
        return cls(
            np.concatenate([p.running for p in parts]),
            np.concatenate([p.status for p in parts]),
            tuple(m for p in parts for m in p.messages),
        )


@dataclass(frozen=True)
class MarginMap:
    """Compiled margins."""

    requirements: tuple[Requirement, ...]  # requirements of the user
    moving: OutputMap | None  # margins that change with time
    still: ScalarMap | None  # margins that do not change with time
    domain: Domain  # conditions for finite real values of margins that change with time

    @property
    def needs_motion(self) -> bool:
        """Whether the motion must be integrated."""
        return self.moving is not None or (self.still is not None and self.still.needs_motion)

    @property
    def needs_dense_output(self) -> bool:
        """Whether the motion between the output times is needed."""
        return self.moving is not None or (self.still is not None and self.still.needs_dense_output)

    @property
    def over_time(self) -> NDArray[np.bool_]:
        """Mask of requirements at all times, shape (requirement,)."""
        return np.array([requirement.over_time for requirement in self.requirements], dtype=bool)

    @property
    def at_the_end(self) -> NDArray[np.bool_]:
        """Mask of requirements with margins known only at the end of the motion, shape (requirement,)."""
        return np.array([requirement.at_the_end for requirement in self.requirements], dtype=bool)


def margin_map(mechanism: Mechanism, places: Sequence[Any]) -> MarginMap | None:
    """Compile the margins of the requirements of a mechanism; None if there are none."""
    requirements = tuple(mechanism.requirements.values())
    if not requirements:
        return None
    moving, still = (
        [mechanism.margins[r.name] for r in requirements if r.over_time == wanted] for wanted in (True, False)
    )
    compiled = output_map(moving, *places) if moving else None
    expressions = [output.expression for output in moving]
    domain = domain_map(expressions, expressions, lambda parts: output_map(parts, *places))
    return MarginMap(requirements, compiled, scalar_map(still, *places), domain)


def undetermined_margins(model: Model, q: Array, time: float, parameters: Array) -> tuple[Finding, ...]:
    """Return findings on requirements that limit reactions which redundant constraints leave undetermined.

    See `not_unique`.
    """
    moving = None if model.margins is None else model.margins.moving
    names = () if moving is None else not_unique(model, moving, q, time, parameters)
    return tuple(
        Finding(
            Severity.WARNING,
            f"requirement {name!r}",
            f"requirement {name!r} limits a reaction that redundant constraints leave undetermined, so its "
            "probability is meaningless",
            "Remove the redundant constraint that `uqmbd check` names, or limit another reaction",
        )
        for name in names
    )


def _unknown(seen: MarginMap, number: int) -> str:
    """Return a message that it is unknown whether a requirement is met; `number` counts requirements without a time."""
    name = [one.name for one in seen.requirements if not one.over_time][number]
    what = "an event" if seen.still is not None and seen.still.of_events(number) else "a first time"
    return (
        f"requirement {name!r}: {what} in it does not occur by the last output time, so it is unknown whether the "
        "requirement is met"
    )


def margins_of(ensemble: Batch, times: Array, trajectories: Trajectories | None = None) -> MarginValues:
    """Evaluate the margins of K realisations at output times (T,), s; some margins need `trajectories`."""
    seen: MarginMap = ensemble.model.margins
    count, over_time, start = len(ensemble), seen.over_time, ensemble.start
    running = np.full((count, len(over_time), len(times)), np.inf)
    status = start.status
    messages = list(start.messages)

    def fail(kinds: Index, reasons: Sequence[str]) -> None:
        for k in np.flatnonzero((status == Status.OK) & (kinds != Status.OK)).tolist():
            status[k], messages[k] = kinds[k], reasons[k]

    if seen.still is not None:
        found = scalars_of(ensemble, trajectories, seen.still, never=float(times[-1]))
        fail(found.status, found.messages)
        # if a first time or an event does not occur, only a bound of the margin is known: its value at the last output
        # time
        above = np.array([one.open for one in seen.requirements], dtype=np.int64)[~over_time]
        unknown = found.censored & ~np.where(found.values < 0, above < 0, above > 0)
        reasons = [_unknown(seen, int(np.argmax(row))) if row.any() else "" for row in unknown]
        fail(np.where(unknown.any(axis=1), Status.OTHER, Status.OK), reasons)
        running[:, ~over_time] = found.values[:, :, None]
        running[:, seen.at_the_end, :-1] = np.inf
    if seen.moving is not None and trajectories is not None:
        fail(
            np.where([bool(m) for m in trajectories.messages], Status.INTEGRATION_FAILED, Status.OK),
            trajectories.messages,
        )
        good = np.flatnonzero(status == Status.OK)
        smallest, lost = running_minimum(ensemble, seen.moving, trajectories, seen.domain)
        running[np.ix_(good, over_time)] = smallest[good]
        moving = seen.moving.names
        texts = [f"the margin of requirement {moving[one.number]!r} {one.text}" if one else "" for one in lost]
        fail(np.array([Status.OK if one is None else one.status for one in lost]), texts)
    wrong = np.isnan(running).any(axis=2) | np.isinf(running[:, :, -1])
    names = [requirement.name for requirement in seen.requirements]
    reasons = [
        f"the margin of requirement {names[int(np.argmax(row))]!r} is not finite" if row.any() else "" for row in wrong
    ]
    fail(np.where(wrong.any(axis=1), Status.NOT_FINITE, Status.OK), reasons)
    running[status != Status.OK] = np.nan
    return MarginValues(running, status, tuple(messages))
