"""Costs of integrations by counts of operations, factorisations and checks of the rank, without a clock.

The unit is an operation on a row of eight realisations. The weights were measured on governors, slider-cranks and
masses on springs. Each weight is a rounded ratio of processor times: that of the task, and that of one kernel
operation (0.5 to 1 ns). Rounded weights suffice, because the choice depends on factors of eight, not of two.
"""

from __future__ import annotations

from uqmbd.compiled import LANES, Dynamics
from uqmbd.dynamics.equations import Model

__all__ = ["RANK_CHECK", "attempt_cost", "implicit_attempt_cost", "implicit_costs"]

STAGES = 12
ENTRY = 25
"""Number of operations of the method in one evaluation, for each entry of a state."""
ALGEBRA = 1.0
"""Cost of an operation on blocks in the systems of implicit steps."""
ITERATIONS = 3
"""Typical number of iterations of an implicit step."""
CALL = 12_000
"""Cost of a callback of IDA, with its overhead."""
SOLUTION, FACTORISATION = 1.0, 0.2
"""Costs of the dense solver per n^2 and n^3, with n unknowns."""
SPARSE_SOLUTION, SPARSE_FACTORISATION = 20, 400
"""Costs of the sparse solver per entry of the matrix."""
RANK_CHECK = 1_000_000
"""Cost of a check of the rank of one realisation, which runs in Python."""


def attempt_cost(dynamics: Dynamics) -> float:
    """Return the cost of an attempted step of the explicit method per realisation in a group of eight."""
    evaluation = dynamics.motion.operations + ENTRY * dynamics.width
    excess = dynamics.constraints.operations if dynamics.constraints is not None else 0
    return (STAGES * evaluation + excess) / LANES


def implicit_attempt_cost(dynamics: Dynamics) -> float:
    """Return the cost of an attempted step of the compiled implicit method per realisation in a group of eight."""
    implicit = dynamics.implicit
    assert implicit is not None
    evaluation = implicit.stages * (dynamics.motion.operations + ENTRY * dynamics.width)
    iteration = evaluation + ALGEBRA * implicit.solution_operations
    matrices = implicit.matrix_operations + ALGEBRA * implicit.factor_operations
    return (matrices + ITERATIONS * iteration) / LANES


def implicit_costs(model: Model, count: int, *, sparse: bool) -> tuple[float, float]:
    """Return the costs of a residual with its solution and of a Jacobian with its factorisation, for a stack."""
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
