"""The names of `uqmbd.propagation.studies` and their modules, for type checkers and for lazy imports."""

from .checks import findings as findings
from .checks import warning_of as warning_of
from .script import load_mechanism as load_mechanism
from .script import load_study as load_study
from .study import Study as Study
