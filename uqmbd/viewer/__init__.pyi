"""The names of `uqmbd.viewer` and their modules, for type checkers and for lazy imports."""

from .child import first_child as first_child
from .viewing import FileViewer as FileViewer
from .viewing import MechanismView as MechanismView
from .viewing import view_mechanism as view_mechanism
from .viewing import view_study as view_study
