"""Margins of requirements: how far realisations are from the limits that they have to stay within, over time."""

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

    # (K, requirement, T): smallest margin up to each output time; NaN: failed; +inf: not known before the end
    running: Array
    status: Index  # (K,): `Status` of the motion and the margins
    messages: tuple[str, ...]  # reasons

    @property
    def values(self) -> Array:
        """Margins of the whole motion, shape (K, requirement): below zero is violated; NaN where it failed."""
        return self.running[:, :, -1]

    @property
    def failed(self) -> Mask:
        """Realisations without margins, shape (K,): they are neither safe nor unsafe."""
        return np.asarray(self.status != Status.OK)

    @classmethod
    def joined(cls, parts: Sequence[MarginValues]) -> MarginValues:
        """Join those of several chunks."""
        return cls(
            np.concatenate([p.running for p in parts]),
            np.concatenate([p.status for p in parts]),
            tuple(m for p in parts for m in p.messages),
        )


@dataclass(frozen=True)
class MarginMap:
    """Compiled margins."""

    requirements: tuple[Requirement, ...]  # as the user stated them
    moving: OutputMap | None  # margins that change with time
    still: ScalarMap | None  # the others
    domain: Domain  # conditions under which the margins that change with time are finite real numbers

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
        """Which requirements have to hold at all times, shape (requirement,)."""
        return np.array([requirement.over_time for requirement in self.requirements], dtype=bool)

    @property
    def at_the_end(self) -> NDArray[np.bool_]:
        """Whether margins are known at the end of the motion only, shape (requirement,)."""
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
    """Return the requirements on quantities that redundant constraints leave undetermined; see `not_unique`."""
    moving = None if model.margins is None else model.margins.moving
    names = () if moving is None else not_unique(model, moving, q, time, parameters)
    return tuple(
        Finding(
            Severity.WARNING,
            f"requirement {name!r}",
            f"requirement {name!r} limits a reaction that redundant constraints leave undetermined, so that its "
            "probability means nothing",
            "Take out the redundant constraint, which `uqmbd check` names, or limit another one",
        )
        for name in names
    )


def _unknown(seen: MarginMap, number: int) -> str:
    """Return a message on a requirement without a time, by its number, whose result is unknown."""
    name = [one.name for one in seen.requirements if not one.over_time][number]
    what = "an event" if seen.still is not None and seen.still.of_events(number) else "a first time"
    return (
        f"requirement {name!r}: {what} in it does not happen until the last output time, and whether it is met depends "
        "on when"
    )


def margins_of(ensemble: Batch, times: Array, trajectories: Trajectories | None = None) -> MarginValues:
    """Evaluate the margins of K realisations at output times (T,), s, from their motion where the margins need it."""
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
        # where a first time, or an event, does not happen, the margin is beyond that at the end
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
        told = [f"the margin of requirement {moving[one.number]!r} {one.text}" if one else "" for one in lost]
        fail(np.array([Status.OK if one is None else one.status for one in lost]), told)
    wrong = np.isnan(running).any(axis=2) | np.isinf(running[:, :, -1])
    names = [requirement.name for requirement in seen.requirements]
    reasons = [
        f"the margin of requirement {names[int(np.argmax(row))]!r} is not finite" if row.any() else "" for row in wrong
    ]
    fail(np.where(wrong.any(axis=1), Status.NOT_FINITE, Status.OK), reasons)
    running[status != Status.OK] = np.nan
    return MarginValues(running, status, tuple(messages))
