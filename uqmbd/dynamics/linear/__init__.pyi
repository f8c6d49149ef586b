"""The names of `uqmbd.dynamics.linear` and their modules, for type checkers and for lazy imports."""

from .implicit import IMPLICIT_LIMIT as IMPLICIT_LIMIT
from .implicit import RADAU_STAGES as RADAU_STAGES
from .implicit import implicit_dynamics as implicit_dynamics
from .index1 import RANK_TOLERANCE as RANK_TOLERANCE
from .index1 import RESIDUAL as RESIDUAL
from .index1 import System as System
from .index1 import accelerations as accelerations
from .index1 import excess as excess
from .index1 import impulses as impulses
from .index1 import index1_system as index1_system
from .index1 import massless_direction as massless_direction
from .index1 import residuals as residuals
from .nodal import nodal_systems as nodal_systems
from .nodal import write_solver as write_solver
from .pivoting import lemke as lemke
from .programs import Programs as Programs
