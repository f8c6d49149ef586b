"""The names of `uqmbd.viewer` and their modules, for type checkers and for lazy imports."""

from .child import end_early as end_early
from .child import start_early as start_early
from .viewing import FileViewer as FileViewer
from .viewing import MechanismView as MechanismView
from .viewing import view_mechanism as view_mechanism
from .viewing import view_study as view_study
