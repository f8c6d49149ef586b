"""Linear system of accelerations and multipliers, and its solvers."""

from __future__ import annotations

from uqmbd.dynamics.linear.implicit import IMPLICIT_LIMIT, RADAU_STAGES, implicit_dynamics
from uqmbd.dynamics.linear.index1 import (
    RANK_TOLERANCE,
    RESIDUAL,
    System,
    accelerations,
    excess,
    impulses,
    index1_system,
    massless_direction,
    residuals,
)
from uqmbd.dynamics.linear.nodal import nodal_systems, write_solver
from uqmbd.dynamics.linear.pivoting import lemke
from uqmbd.dynamics.linear.programs import Programs

__all__ = [
    "IMPLICIT_LIMIT",
    "RADAU_STAGES",
    "RANK_TOLERANCE",
    "RESIDUAL",
    "Programs",
    "System",
    "accelerations",
    "excess",
    "implicit_dynamics",
    "impulses",
    "index1_system",
    "lemke",
    "massless_direction",
    "nodal_systems",
    "residuals",
    "write_solver",
]
