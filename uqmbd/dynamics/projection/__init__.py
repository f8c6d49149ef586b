"""Galerkin projection of an ensemble: its equations and their integration."""

from __future__ import annotations

from uqmbd.dynamics.projection.constraint_check import projected_off
from uqmbd.dynamics.projection.dop853 import integrate_coefficients
from uqmbd.dynamics.projection.ensemble import ProjectedEquations, ProjectedStart
from uqmbd.dynamics.projection.ida import LINEAR_SOLVERS, LinearSolver, implicit
from uqmbd.dynamics.projection.phase import PhaseMotion, PhaseRates, require_phase
from uqmbd.dynamics.projection.trajectories import ProjectedTrajectories, Watch

__all__ = [
    "LINEAR_SOLVERS",
    "LinearSolver",
    "PhaseMotion",
    "PhaseRates",
    "ProjectedStart",
    "ProjectedTrajectories",
    "ProjectedEquations",
    "Watch",
    "implicit",
    "integrate_coefficients",
    "projected_off",
    "require_phase",
]
