"""The names of `uqmbd.propagation.methods` and their modules, for type checkers and for lazy imports."""

from .estimate import Estimate as Estimate
from .estimate import Sizing as Sizing
from .estimate import readable as readable
from .keys import require_keys_accepted as require_keys_accepted
from .keys import require_smooth_outputs as require_smooth_outputs
from .propagator import Propagator as Propagator
from .propagator import check_propagators as check_propagators
from .propagator import labelled as labelled
from .running import obstacle_of as obstacle_of
from .running import run_method as run_method
from .studied import Studied as Studied
