"""Static equilibria, modes, and scalar outputs, which have no time."""

from __future__ import annotations

from uqmbd.dynamics.statics.equilibrium import Equilibrium, equilibrium_start, static_equilibria
from uqmbd.dynamics.statics.linear_system import Channel, LinearSystem
from uqmbd.dynamics.statics.modes import Modes, linearise
from uqmbd.dynamics.statics.steady_modes import linearise_steady
from uqmbd.dynamics.statics.steady_motion import SteadyMotions, steady_motions
from uqmbd.dynamics.statics.timeless_outputs import ScalarMap, ScalarValues, scalar_map, scalars_of
from uqmbd.dynamics.statics.unilateral import Range, has_dry_friction, ranges_by_friction

__all__ = [
    "Channel",
    "Equilibrium",
    "LinearSystem",
    "Modes",
    "Range",
    "ScalarMap",
    "ScalarValues",
    "SteadyMotions",
    "equilibrium_start",
    "has_dry_friction",
    "linearise",
    "linearise_steady",
    "ranges_by_friction",
    "scalar_map",
    "scalars_of",
    "static_equilibria",
    "steady_motions",
]
