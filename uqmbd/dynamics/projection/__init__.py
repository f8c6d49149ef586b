"""Galerkin projection of an ensemble: its equations and their integration."""

from __future__ import annotations

from uqmbd.dynamics.projection.ensemble import ProjectedEnsemble
from uqmbd.dynamics.projection.integrate import ProjectedTrajectories

__all__ = [
    "ProjectedEnsemble",
    "ProjectedTrajectories",
]
