"""The names of `uqmbd.dynamics.contact` and their modules, for type checkers and for lazy imports."""

from .evaluator import ContactEvaluator as ContactEvaluator
from .impacts import impact as impact
from .integrate import event_times as event_times
from .integrate import integrate_with_events as integrate_with_events
from .integrate import motion_in_segments as motion_in_segments
from .persistent import states_in_contact as states_in_contact
from .programs import contact_programs as contact_programs
from .undetermined import undetermined_forces as undetermined_forces
