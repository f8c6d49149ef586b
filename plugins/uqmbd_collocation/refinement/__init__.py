"""Refinement of a chaos by orders or by levels of a sparse grid, its steps and its limits."""

from __future__ import annotations

from uqmbd_collocation.refinement.dimensions import refine_dimensions
from uqmbd_collocation.refinement.orders import raise_order
from uqmbd_collocation.refinement.steps import (
    Limits,
    Refinement,
    RefinementStep,
    UnmetWarning,
    history,
    missed_share,
    prospect,
    scale_of,
    warn_unmet,
)

__all__ = [
    "Limits",
    "Refinement",
    "RefinementStep",
    "UnmetWarning",
    "history",
    "missed_share",
    "prospect",
    "raise_order",
    "refine_dimensions",
    "scale_of",
    "warn_unmet",
]
