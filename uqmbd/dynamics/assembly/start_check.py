"""Check whether start conditions can be satisfied, and report an impossible condition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from uqmbd.dynamics.assembly.assembly import placed, statement_rows, velocities
from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.errors import AssemblyError, StudyError
from uqmbd.typing import Array, Index

__all__ = ["require_conditions"]


DEPENDENT = 1e-6
"""A condition counts as dependent if the part of its gradient outside the span of the others is below this share."""


def require_conditions(where: str, model: Model, time: float, parameters: Array) -> None:
    """Raise if start conditions are impossible at the means, or follow from constraints and other conditions.

    The parameters (1, parameter) apply at the means.  Raises `uqmbd.AssemblyError` or `uqmbd.StudyError`.
    """
    conditions = model.conditions
    q, s, messages = placed(model, parameters[:, model.drawn], time, parameters, model.layout.independent_holonomic)
    if messages[0]:
        raise AssemblyError(f"{where} cannot start: {messages[0]}")
    _, by_q, by_v = conditions(q, s, time, parameters)
    v, contradictions = velocities(model, q, s, time, parameters, parameters)
    if contradictions[0]:
        raise AssemblyError(f"{where} cannot start: {contradictions[0]}")
    geometric = model.evaluate("position", state_arguments(time, q, s, v), parameters)["phi_q"][0]
    moving = model.evaluate("velocity", state_arguments(time, q, s, v), parameters)["d"][0]
    free = np.setdiff1d(np.arange(q.shape[1]), model.held)
    stated = [np.zeros((0, q.shape[1])), *(x[0] for x in statement_rows(model, q))]
    cases = (
        (_chosen(model, time, parameters), geometric[:, free], by_q[0][:, free]),
        (conditions.velocities, np.concatenate([moving, *stated]), by_v[0]),
    )
    for which, held, rows in cases:
        k = _dependent(held, rows[which])
        if k >= 0:
            raise StudyError(
                f"{where}: start condition {conditions.names[which[k]]} is redundant at the means of the inputs. It "
                "follows from joints, drivers, stated velocities or earlier conditions, or its quantity cannot change "
                "at the start. Omit this condition, or use another quantity."
            )


def _chosen(model: Model, time: float, parameters: Array) -> Index:
    """Return the conditions of positions that select a pose, without conditions that only count turns."""
    conditions = model.conditions
    which: Index = conditions.positions
    if not len(which) or not model.turned:
        return which
    # the assembly without conditions gives the initial angles of bodies held by drivers
    q, s, _ = placed(
        replace(model, conditions=None),
        parameters[:, model.drawn],
        time,
        parameters,
        model.layout.independent_holonomic,
    )
    residual = conditions(q, s, time, parameters)[0][0, which]
    turns = residual / (2 * np.pi)
    whole = (np.abs(turns) > 0.5) & (np.abs(turns - np.round(turns)) < 1e-6)
    # with random inputs, some realisations only may differ by whole turns, so no condition of positions is checked
    return which[:0] if len(conditions.inputs) else which[~whole]


def _dependent(held: Array, conditions: Array) -> int:
    """Return the index of the first condition that depends on constraints and earlier conditions; -1: none.

    The arguments are gradients of constraints (m, n) and of conditions (c, n).
    """
    basis = scipy.linalg.orth(held.T) if len(held) else np.zeros((conditions.shape[1], 0))
    for k, row in enumerate(conditions):
        length = np.linalg.norm(row)
        rest = row - basis @ (basis.T @ row)
        rest -= basis @ (basis.T @ rest)
        if not np.linalg.norm(rest) > DEPENDENT * max(float(length), 1e-9):
            return k
        basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return -1
