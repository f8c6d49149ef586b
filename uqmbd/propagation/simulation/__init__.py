"""One motion or one equilibrium, without uncertainty."""

from __future__ import annotations

from uqmbd.propagation.simulation.deterministic import input_point, simulate
from uqmbd.propagation.simulation.equilibrium import eigenfrequencies, static_equilibrium

__all__ = [
    "eigenfrequencies",
    "input_point",
    "simulate",
    "static_equilibrium",
]
