"""The names of `uqmbd.propagation.chaos` and their modules, for type checkers and for lazy imports."""

from .clock_choice import choose_clock as choose_clock
from .clock_choice import clock_at_means as clock_at_means
from .clock_choice import require_clock as require_clock
from .clock_choice import require_outputs_over_time as require_outputs_over_time
from .clock_choice import watched_angles as watched_angles
from .clocks import Clock as Clock
from .clocks import Phases as Phases
from .dense_output import Dense as Dense
from .dense_output import dense as dense
from .elements import ElementLimits as ElementLimits
from .elements import ElementRefinement as ElementRefinement
from .elements import refine_elements as refine_elements
from .exceedances import Exceedance as Exceedance
from .exceedances import errors_over_largest as errors_over_largest
from .exceedances import find_exceedances as find_exceedances
from .exceedances import varying as varying
from .nodes import NodeFit as NodeFit
from .nodes import fit_nodes as fit_nodes
from .surrogate_check import warn_of_surrogates as warn_of_surrogates
from .verification import Verification as Verification
from .verification_points import VerificationPoints as VerificationPoints
