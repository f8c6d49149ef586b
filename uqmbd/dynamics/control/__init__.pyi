"""The names of `uqmbd.dynamics.control` and their modules, for type checkers and for lazy imports."""

from .loop import ControlLoop as ControlLoop
from .loop import loops_of as loops_of
from .loop import require_controllers as require_controllers
from .loop import unused_commands as unused_commands
from .sampling import Sampling as Sampling
