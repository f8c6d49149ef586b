"""Names for plugins that add a propagator: the problem, options, verification, alignment, costs."""

from __future__ import annotations

from uqmbd.packages import require_package as require_package
from uqmbd.plugins import InputTreatment as InputTreatment
from uqmbd.plugins import propagator as propagator
from uqmbd.progress import AtMost as AtMost
from uqmbd.progress import Progress as Progress
from uqmbd.propagation import Clock as Clock
from uqmbd.propagation import Dense as Dense
from uqmbd.propagation import ElementLimits as ElementLimits
from uqmbd.propagation import ElementRefinement as ElementRefinement
from uqmbd.propagation import Estimate as Estimate
from uqmbd.propagation import Exceedance as Exceedance
from uqmbd.propagation import History as History
from uqmbd.propagation import Margins as Margins
from uqmbd.propagation import NodeFit as NodeFit
from uqmbd.propagation import Phases as Phases
from uqmbd.propagation import Problem as Problem
from uqmbd.propagation import Propagator as Propagator
from uqmbd.propagation import Realisations as Realisations
from uqmbd.propagation import Reduced as Reduced
from uqmbd.propagation import Reductions as Reductions
from uqmbd.propagation import Sizing as Sizing
from uqmbd.propagation import Verification as Verification
from uqmbd.propagation import VerificationPoints as VerificationPoints
from uqmbd.propagation import choose_clock as choose_clock
from uqmbd.propagation import clock_at_means as clock_at_means
from uqmbd.propagation import dense as dense
from uqmbd.propagation import errors_over_largest as errors_over_largest
from uqmbd.propagation import find_exceedances as find_exceedances
from uqmbd.propagation import fit_nodes as fit_nodes
from uqmbd.propagation import nothing_random as nothing_random
from uqmbd.propagation import output_folder as output_folder
from uqmbd.propagation import pool as pool
from uqmbd.propagation import refine_elements as refine_elements
from uqmbd.propagation import require_clock as require_clock
from uqmbd.propagation import require_outputs_over_time as require_outputs_over_time
from uqmbd.propagation import varying as varying
from uqmbd.propagation import watched_angles as watched_angles
