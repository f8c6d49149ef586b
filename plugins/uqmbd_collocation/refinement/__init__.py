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
    warn_unmet,
)

__all__ = [
    "Limits",
    "Refinement",
    "RefinementStep",
    "UnmetWarning",
    "history",
    "raise_order",
    "refine_dimensions",
    "warn_unmet",
]
