"""Names for plugins that fill, fit or read results: datasets, labels, moments, surrogates."""

from __future__ import annotations

from uqmbd.results.assessment import error_against_cost as error_against_cost
from uqmbd.results.chaos import AlignedElement as AlignedElement
from uqmbd.results.chaos import CustomSurrogate as CustomSurrogate
from uqmbd.results.chaos import Markers as Markers
from uqmbd.results.chaos import QuasiPeriodicElement as QuasiPeriodicElement
from uqmbd.results.chaos import SurrogateModel as SurrogateModel
from uqmbd.results.chaos import least_squares as least_squares
from uqmbd.results.chaos import project as project
from uqmbd.results.chaos import regress_on_nodes as regress_on_nodes
from uqmbd.results.chaos import stored_as as stored_as
from uqmbd.results.requirements import Violations as Violations
from uqmbd.results.requirements import requirements_dataset as requirements_dataset
from uqmbd.results.schema import DEFAULT_PROBABILITIES as DEFAULT_PROBABILITIES
from uqmbd.results.schema import InputInfo as InputInfo
from uqmbd.results.schema import Labels as Labels
from uqmbd.results.schema import OutputInfo as OutputInfo
from uqmbd.results.schema import StatedError as StatedError
from uqmbd.results.schema import labels as labels
from uqmbd.results.schema import sample_dataset as sample_dataset
from uqmbd.results.schema import statistics_dataset as statistics_dataset
from uqmbd.results.schema import with_reasons as with_reasons
from uqmbd.results.statistics import CircularMoments as CircularMoments
from uqmbd.results.statistics import CountedQuantiles as CountedQuantiles
from uqmbd.results.statistics import Moments as Moments
from uqmbd.results.statistics import quantiles_of_chunks as quantiles_of_chunks
from uqmbd.results.statistics import replicate_errors as replicate_errors
from uqmbd.results.statistics import statistics_of_samples as statistics_of_samples
from uqmbd.results.storage import read_root as read_root
