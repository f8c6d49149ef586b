"""Consistent initial states, and choice of independent equations."""

from __future__ import annotations

from uqmbd.dynamics.assembly.assembly import (
    assemble,
    dropped_in_dead_centre,
    independent_rows,
    positions,
    statement_rows,
    velocities,
)
from uqmbd.dynamics.assembly.programs import equation_programs
from uqmbd.dynamics.assembly.rank import Rank, dead_end, gradient, named, rank_along, ranks_along, violated
from uqmbd.dynamics.assembly.start import Start, gradient_lengths
from uqmbd.dynamics.assembly.start_check import require_conditions
from uqmbd.dynamics.assembly.undefined import ahead
from uqmbd.dynamics.assembly.uniqueness import not_unique, reaction_symbols

__all__ = [
    "Rank",
    "Start",
    "ahead",
    "assemble",
    "dead_end",
    "dropped_in_dead_centre",
    "equation_programs",
    "gradient",
    "gradient_lengths",
    "independent_rows",
    "named",
    "not_unique",
    "positions",
    "rank_along",
    "ranks_along",
    "reaction_symbols",
    "require_conditions",
    "statement_rows",
    "velocities",
    "violated",
]
