"""Static equilibria, modes about them, and outputs without a time."""

from __future__ import annotations

from uqmbd.dynamics.statics.equilibrium import Equilibrium, equilibrium_start, static_equilibria
from uqmbd.dynamics.statics.modes import Modes, linearise
from uqmbd.dynamics.statics.timeless_outputs import ScalarValues, scalar_map, scalars_of

__all__ = [
    "Equilibrium",
    "Modes",
    "ScalarValues",
    "equilibrium_start",
    "linearise",
    "scalar_map",
    "scalars_of",
    "static_equilibria",
]
