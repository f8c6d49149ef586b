"""Events of a component type in local symbols."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism import DryFriction, Event, flatten

__all__ = ["EventType", "friction_event", "local_event"]

GAP = 5e-10
"""Depth of the gap of dry friction under load, m: closed, not an overlap, and larger than errors of gaps."""
LEAST = 1e-9
"""Load, N or N m, above which dry friction is closed."""


@dataclass(frozen=True)
class EventType:
    """Event in local symbols; if velocities jump, it has directions, with the normal direction first."""

    label: str
    guard: sympy.Expr
    directions: tuple[sympy.Expr, ...] = ()
    restitution: sympy.Expr = sympy.S.Zero
    friction: sympy.Expr = sympy.S.Zero
    load: sympy.Expr = sympy.S.Zero  # given normal force of dry friction, whose first direction is zero
    dry: bool = False  # whether the event is dry friction

    @property
    def expressions(self) -> tuple[sympy.Expr, ...]:
        """All expressions of the event."""
        return (self.guard, *self.directions, self.restitution, self.friction, self.load)


def friction_event(
    where: str, term: DryFriction, settled: Callable[[Any], sympy.Expr], velocities: set[sympy.Symbol]
) -> EventType:
    """Return dry friction in local symbols: a contact without a gap, whose normal force is the limit."""
    load, sliding = settled(term.limit), tuple(settled(x) for x in flatten(term.sliding))
    if still := [x for x in sliding if not x.free_symbols & velocities]:
        raise StudyError(f"{where}: sliding={still[0]} of a DryFriction contains no velocity; expected a velocity.")
    gap = -GAP * load / sympy.sqrt(load**2 + LEAST**2)
    return EventType("slip", gap, (sympy.S.Zero, *sliding), sympy.S.Zero, sympy.S.One, load, dry=True)


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
