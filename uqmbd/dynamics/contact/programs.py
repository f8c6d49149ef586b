"""Input of the driver for a mechanism with events: its equations of motion, and programs of its contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uqmbd.compiled import ContactPrograms, Dynamics, ProgramWriter
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear import System, implicit_dynamics, write_solver
from uqmbd.typing import Index

__all__ = ["contact_programs"]


def contact_programs(model: Model, stages: int = 0) -> tuple[Dynamics, ContactPrograms]:
    """Return cached programs of a model with events and a compiled index-1 system, for implicit steps with `stages`."""
    others, key = model.system.programs.others, ("contacts", stages)
    if key not in others:
        others[key] = _written(model, stages)
    found: tuple[Dynamics, ContactPrograms] = others[key]
    return found


def _written(model: Model, stages: int) -> tuple[Dynamics, ContactPrograms]:
    layout, system = model.layout, model.system
    assert isinstance(system, System)
    assert system.programs is not None
    dynamics, n = implicit_dynamics(model, stages) if stages else system.programs.dynamics, layout.coordinates
    assert dynamics is not None
    writer, rows = ProgramWriter(dynamics.rows), np.arange(dynamics.rows)
    end = layout.width + 2
    arguments, parameters = rows[:end], rows[end : end + dynamics.parameters]
    zero = end - 1
    first = np.cumsum([0, *(count for *_, count in model.events)])
    events, directions = len(model.events), int(first[-1])

    evaluator = model.evaluators["contact"]
    found = evaluator.write(writer, arguments, parameters)
    steps = len(writer.steps)

    def placed(letter: str, *shape: int) -> Index:
        where = np.full(shape, zero, dtype=np.int64)
        if letter in evaluator.index:
            results, indices = evaluator.index[letter]
            where[indices] = found[results]
        return where

    guard = placed("guard", events)
    law, speed, bias = placed("law", events, 2), placed("speed", directions), placed("bias", directions)
    slope = placed("slope", directions, n)
    values = model.evaluators["acceleration"].write(writer, arguments, parameters)
    right = np.where(system.motion < 0, zero, values[system.motion])
    evaluated, side = len(writer.steps), writer.room(system.size)
    solution, factored = write_solver(system, writer, values, side) or (np.zeros(0, dtype=np.int64), evaluated)
    contacts = ContactPrograms(
        first=first.astype(np.int64),
        guards=writer.part(0, steps),
        guard=guard,
        contact=writer.part(0, evaluated),
        gap=guard,
        law=law,
        speed=speed,
        bias=bias,
        slope=slope,
        size=system.size,
        rows=np.ascontiguousarray(system.rows, dtype=np.int64),
        columns=np.ascontiguousarray(system.columns, dtype=np.int64),
        values=np.ascontiguousarray(values[system.source], dtype=np.int64),
        right=np.ascontiguousarray(right, dtype=np.int64),
        factor=writer.part(evaluated, factored),
        solve=writer.part(factored),
        side=int(side[0]) if system.size else 0,
        solution=np.ascontiguousarray(solution, dtype=np.int64),
    )
    return replace(dynamics, rows=writer.size), contacts
