"""Controllers as programs that the driver samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uqmbd.compiled import ControlLaws, ProgramWriter
from uqmbd.dynamics.control.loop import ControlLoop
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear import RESIDUAL
from uqmbd.dynamics.observation import output_program, write_outputs
from uqmbd.typing import Index

__all__ = ["driver_laws"]


def driver_laws(model: Model, loops: Sequence[ControlLoop]) -> ControlLaws | None:
    """Return all controllers as programs for the driver; None if Python takes the samples.

    Python takes samples that need decisions: during contact, or if a commanded speed causes an impulse.
    """
    if model.speeds_commanded or any(output_program(model, loop.measure) is None for loop in loops):
        return None
    others = model.system.programs.others
    key = ("laws", tuple(loop.digest for loop in loops))
    if key not in others:
        others[key] = _written(model, loops)
    found: ControlLaws = others[key]
    return found


def _written(model: Model, loops: Sequence[ControlLoop]) -> ControlLaws:
    width, states = model.layout.width, model.layout.coordinates
    inputs = width + 2 + model.block_parameters + np.arange(len(model.inputs))
    writer = ProgramWriter(width + 2 + model.block_parameters + len(model.inputs))
    ends, rows, residuals, seen = [0], list[Index](), list[int](), list[Index]()
    for loop in loops:
        measured, residual = write_outputs(model, writer, loop.measure)
        memory = states + loop.held[len(loop.commands) :]
        if loop.law is None:
            rows.append(np.zeros(len(loop.held), dtype=np.int64))
            seen.append(measured)
        else:
            rows.append(writer.call(loop.law, np.concatenate([[width], measured, memory, inputs])[None]).ravel())
            seen.append(measured[:0])
        residuals.append(int(residual[0]) if len(residual) else -1)
        ends.append(len(writer.steps))
    laws = tuple(writer.part(begin, end) for begin, end in zip(ends[:-1], ends[1:], strict=True))
    return ControlLaws(
        laws,
        writer.size,
        np.cumsum([0, *map(len, seen)]).astype(np.int64),
        np.concatenate(seen).astype(np.int64),
        np.cumsum([0, *(len(loop.held) for loop in loops)]).astype(np.int64),
        np.array([len(loop.commands) for loop in loops], dtype=np.int64),
        np.array(residuals, dtype=np.int64),
        RESIDUAL**2,
        np.concatenate(rows).astype(np.int64),
        np.concatenate([states + loop.held for loop in loops]).astype(np.int64),
    )
