"""The names of `uqmbd.results` and their modules, for type checkers and for lazy imports."""

import uqmbd.status

from . import assessment as assessment
from . import chaos as chaos
from . import requirements as requirements
from . import schema as schema
from . import statistics as statistics
from . import storage as storage
from . import tree as tree
from .accessor import Accessor as Accessor
from .assessment import StatedAccuracy as StatedAccuracy
from .assessment import align as align
from .assessment import assess as assess
from .assessment import choose_reference as choose_reference
from .assessment import compare as compare
from .assessment import recommend as recommend
from .assessment import relative_errors as relative_errors
from .assessment import stated_accuracy as stated_accuracy
from .chaos import AlignedChaos as AlignedChaos
from .chaos import ComposedChaos as ComposedChaos
from .chaos import PiecewiseChaos as PiecewiseChaos
from .chaos import PolynomialChaos as PolynomialChaos
from .chaos import QuasiPeriodicChaos as QuasiPeriodicChaos
from .chaos import surrogate as surrogate
from .requirements import Answer as Answer
from .requirements import answers as answers
from .requirements import clopper_pearson as clopper_pearson
from .requirements import compare_requirements as compare_requirements
from .requirements import requirement_names as requirement_names
from .requirements import requirements_of as requirements_of
from .requirements import unmet as unmet
from .schema import STATUS_MEANINGS as STATUS_MEANINGS
from .schema import failed_methods as failed_methods
from .schema import methods as methods
from .schema import propagator_node as propagator_node
from .schema import propagator_nodes as propagator_nodes
from .schema import validate as validate
from .selection import by_output as by_output
from .selection import output as output
from .statistics import circular_mean as circular_mean
from .statistics import circular_std as circular_std
from .statistics import mean_direction as mean_direction
from .statistics import mean_rotation as mean_rotation
from .statistics import rotation_std as rotation_std
from .statistics import sample_statistics as sample_statistics
from .statistics import unwrap_samples as unwrap_samples
from .statistics import varies as varies
from .statistics import varying as varying
from .storage import SampleStore as SampleStore
from .storage import load as load
from .storage import open as open
from .storage import save as save
from .tree import scalar_nodes as scalar_nodes
from .tree import study_tree as study_tree

Status = uqmbd.status.Status
