"""The names of `uqmbd.dynamics.assembly` and their modules, for type checkers and for lazy imports."""

from .assembly import assemble as assemble
from .assembly import dropped_in_dead_centre as dropped_in_dead_centre
from .assembly import independent_rows as independent_rows
from .assembly import positions as positions
from .assembly import statement_rows as statement_rows
from .assembly import velocities as velocities
from .programs import equation_programs as equation_programs
from .rank import Rank as Rank
from .rank import dead_end as dead_end
from .rank import gradient as gradient
from .rank import named as named
from .rank import rank_along as rank_along
from .rank import ranks_along as ranks_along
from .rank import violated as violated
from .start import Start as Start
from .start import gradient_lengths as gradient_lengths
from .start_check import require_conditions as require_conditions
from .undefined import ahead as ahead
from .uniqueness import not_unique as not_unique
from .uniqueness import reaction_symbols as reaction_symbols
