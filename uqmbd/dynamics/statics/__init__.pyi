"""The names of `uqmbd.dynamics.statics` and their modules, for type checkers and for lazy imports."""

from .equilibrium import Equilibrium as Equilibrium
from .equilibrium import equilibrium_start as equilibrium_start
from .equilibrium import static_equilibria as static_equilibria
from .linear_system import Channel as Channel
from .linear_system import LinearSystem as LinearSystem
from .modes import Modes as Modes
from .modes import linearise as linearise
from .steady_modes import linearise_steady as linearise_steady
from .steady_motion import SteadyMotions as SteadyMotions
from .steady_motion import steady_motions as steady_motions
from .timeless_outputs import ScalarMap as ScalarMap
from .timeless_outputs import ScalarValues as ScalarValues
from .timeless_outputs import scalar_map as scalar_map
from .timeless_outputs import scalars_of as scalars_of
from .unilateral import Range as Range
from .unilateral import has_dry_friction as has_dry_friction
from .unilateral import ranges_by_friction as ranges_by_friction
