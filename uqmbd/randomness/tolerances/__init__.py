"""Distributions of sizes with tolerances, from limits or from classes of ISO 286."""

from __future__ import annotations

from uqmbd.randomness.tolerances.classes import iso286
from uqmbd.randomness.tolerances.limits import Toleranced, stated_tolerance, tolerance

__all__ = ["Toleranced", "iso286", "stated_tolerance", "tolerance"]
