"""The names of `uqmbd.dynamics.summaries` and their modules, for type checkers and for lazy imports."""

from .domain import Domain as Domain
from .domain import domain_map as domain_map
from .polynomials import MotionPolynomials as MotionPolynomials
from .summaries import MissingReason as MissingReason
from .summaries import SummaryMap as SummaryMap
from .summaries import running_minimum as running_minimum
from .summaries import summarised as summarised
from .summaries import summary_map as summary_map
