"""Costs of integrations by counts of operations, factorisations and checks of the rank; not by a clock.

The unit is an operation on a row of eight realisations. The weights were measured on governors, slider-cranks and
masses on springs. Each is processor time divided by that of an operation of their kernels (0.5 to 1 ns), and rounded:
which integrator is chosen depends on factors of eight, not of two.
"""

from __future__ import annotations

from uqmbd.compiled import LANES, Dynamics
from uqmbd.dynamics.equations import Model

__all__ = ["LOOK", "attempt_cost", "implicit_costs"]

STAGES = 12
ENTRY = 25
"""Operations of the method for each entry of a state and each evaluation."""
CALL = 12_000
"""Cost of a callback of IDA, with its overhead."""
SOLUTION, FACTORISATION = 1.0, 0.2
"""Costs of the dense solver, for n^2 and n^3 of n unknowns."""
SPARSE_SOLUTION, SPARSE_FACTORISATION = 20, 400
"""Costs of the sparse solver, for each entry of the matrix."""
LOOK = 1_000_000
"""Cost of a check of the rank of one realisation, which runs in Python."""


def attempt_cost(dynamics: Dynamics) -> float:
    """Cost of an attempted step of the explicit method to one realisation of eight that share it."""
    evaluation = dynamics.motion.operations + ENTRY * dynamics.width
    excess = dynamics.constraints.operations if dynamics.constraints is not None else 0
    return (STAGES * evaluation + excess) / LANES


def implicit_costs(model: Model, count: int, *, sparse: bool) -> tuple[float, float]:
    """Costs of a residual and of a Jacobian of a stack, with the solution and the factorisation that follow."""
    layout = model.layout
    n, entries = layout.unknowns, len(model.pattern[0])
    given = n + layout.differential + len(layout.frozen)
    eights = -(-count // LANES)
    residual, jacobian = (
        CALL + eights * model.evaluators[kind].program(given + numbers, model.block_parameters).part.operations
        for kind, numbers in (("residual", 2), ("jacobian", 3))
    )
    if sparse:
        return residual + SPARSE_SOLUTION * entries * count, jacobian + SPARSE_FACTORISATION * entries * count
    return residual + SOLUTION * (n * count) ** 2, jacobian + FACTORISATION * (n * count) ** 3
