"""Sampling designs: points in the unit cube, by name; those of the core and those of plugins alike."""

from __future__ import annotations

from uqmbd.randomness.designs.registry import (
    Design,
    SamplingDesign,
    Seed,
    design_problem,
    sampling_design,
    sampling_designs,
)

__all__ = ["Design", "SamplingDesign", "Seed", "design_problem", "sampling_design", "sampling_designs"]
