"""Events of a component type in local symbols."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism import Event, flatten

__all__ = ["EventType", "local_event"]


@dataclass(frozen=True)
class EventType:
    """Event in local symbols; if velocities jump, it has directions, with the normal direction first."""

    label: str
    guard: sympy.Expr
    directions: tuple[sympy.Expr, ...] = ()
    restitution: sympy.Expr = sympy.S.Zero
    friction: sympy.Expr = sympy.S.Zero

    @property
    def expressions(self) -> tuple[sympy.Expr, ...]:
        """All expressions of the event."""
        return (self.guard, *self.directions, self.restitution, self.friction)


def local_event(
    where: str, event: Event, settled: Callable[[Any], sympy.Expr], velocities: set[sympy.Symbol]
) -> EventType:
    """Return an event of terms in local symbols; raise `uqmbd.StudyError` if its jump is invalid."""
    guard, jump = settled(event.guard), event.jump
    if jump is None:
        return EventType(event.label, guard)
    sliding = [settled(x) for x in flatten(jump.sliding)]
    directions = (settled(jump.speed), *sliding)
    if still := [x for x in directions if x != 0 and not x.free_symbols & velocities]:
        raise StudyError(f"{where}: the speed {still[0]} of an Impact contains no velocity; give p.rate_of(gap).")
    friction = settled(jump.friction)
    if friction != 0 and not sliding:
        raise StudyError(f"{where}: an Impact has friction but no sliding velocity; give sliding=.")
    if friction == 0:
        directions = directions[:1]
    return EventType(event.label, guard, directions, settled(jump.restitution), friction)
