"""Evaluation of contacts at states: gaps, relative velocities, and accelerations due to contact forces."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, fields

import numpy as np

from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.dynamics.linear import System, index1_system
from uqmbd.typing import Array, Index, Mask

__all__ = ["ContactEvaluator", "ContactQuantities"]


@dataclass(frozen=True)
class ContactQuantities:
    """All contact quantities of T states."""

    guard: Array  # (T, event): gaps of contacts, and guards of other events
    first: tuple[int, ...]  # first direction of each event, then the number of directions
    law: Array  # (T, event, 2): coefficients of restitution and friction
    speed: Array  # (T, direction): relative velocities
    bias: Array  # (T, direction): rates of the relative velocities at zero acceleration
    slope: Array  # (T, direction, coordinate): derivatives of relative velocities with respect to velocities
    free: Array  # (T, coordinate + multiplier): accelerations without contacts, then multipliers of the kept equations
    answer: Array  # (T, coordinate + multiplier, direction): changes per force (jumps per impulse)
    delassus: Array  # (T, direction, direction): rates of the relative velocities per force
    given: tuple[int, ...] = ()  # directions of given loads: the normal directions of dry friction

    def select(self, states: Index) -> ContactQuantities:
        """Return the quantities of the selected states."""
        taken = {f.name: getattr(self, f.name)[states] for f in fields(self) if f.name not in ("first", "given")}
        return ContactQuantities(first=self.first, given=self.given, **taken)

    @property
    def coordinates(self) -> int:
        """Number of coordinates."""
        return int(self.slope.shape[-1])

    def normal(self, event: int) -> int:
        """Return the normal direction of an event."""
        return int(self.first[event])

    def tangents(self, event: int) -> list[int]:
        """Return the directions along the surface."""
        return list(range(self.first[event] + 1, self.first[event + 1]))

    @property
    def loads(self) -> Mask:
        """Return a mask (direction,) of normal directions of dry friction.

        Their forces are given limits, which state nothing about the size of the forces of contacts.
        """
        found = np.zeros(self.first[-1], dtype=bool)
        found[list(self.given)] = True
        return found

    def size_of(self, force: Array) -> float:
        """Return the largest contact force (direction,) at the first state in N, without given limits of friction."""
        return float(np.abs(force)[~self.loads].max(initial=0.0))

    def has_friction(self, event: int) -> bool:
        """Return whether a contact has friction at the first state."""
        return bool(self.law[0, event, 1] > 0) and self.first[event + 1] > self.first[event] + 1

    def sliding(self, event: int) -> Array:
        """Return the velocity along the surface, m/s, shape (T, 1 or 2)."""
        return self.speed[:, self.tangents(event)]


class ContactEvaluator:
    """Evaluator of the contact quantities of states of a model with events."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.first = tuple(np.cumsum([0, *(count for *_, count in model.events)]).tolist())
        self.directions, self.n = self.first[-1], model.layout.coordinates
        self.given = tuple(self.first[k] for k, dry in enumerate(model.given_loads) if dry)
        self.system: System = model.system or index1_system(model, None)

    def guards(self, times: Array, states: Array, blocks: Array) -> Array:
        """Return guards of all events at states (T, width) with parameters (T, parameter), shape (T, event)."""
        values = self.model.evaluators["contact"](state_arguments(times, states), blocks)
        return self.model.result("contact", "guard", values)

    def __call__(self, times: Array, states: Array, blocks: Array) -> ContactQuantities:
        """Evaluate contacts in states (T, width) at times (T,) in s, with parameters (T, parameter)."""
        model, n, arguments = self.model, self.n, state_arguments(times, states)
        found = model.evaluate("contact", arguments, blocks)
        values = model.evaluators["acceleration"](arguments, blocks)
        right = np.zeros((len(states), self.system.size, 1 + self.directions))
        right[:, :, 0] = self.system.right(values)
        right[:, :n, 1:] = found["slope"].transpose(0, 2, 1)
        solved = _solved(self.system.matrix(values), right)
        answer = solved[:, :, 1:]
        delassus = found["slope"] @ answer[:, :n]
        # the direction of a given load has no motion: its response is one
        delassus[:, self.given, self.given] = 1.0
        return ContactQuantities(
            first=self.first, given=self.given, free=solved[:, :, 0], answer=answer, delassus=delassus, **found
        )


def _solved(matrix: Array, right: Array) -> Array:
    """Solve each system; use least squares for singular systems."""
    try:
        return np.asarray(np.linalg.solve(matrix, right), dtype=float)
    except np.linalg.LinAlgError:
        pass
    found: Array = np.full(right.shape, np.nan)
    for k in range(len(matrix)):
        with contextlib.suppress(np.linalg.LinAlgError):
            found[k] = np.linalg.lstsq(matrix[k], right[k], rcond=None)[0]
    return found
