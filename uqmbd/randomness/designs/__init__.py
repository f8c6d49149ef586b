"""Sampling designs of the core and of plugins, by name: points in the unit cube."""

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
