"""Integration without events: explicit and implicit steps of the driver, and implicit integration by IDA."""

from __future__ import annotations

from uqmbd.dynamics.integration.constraint_check import (
    allowed_residual,
    described,
    off_constraints,
    off_states,
    over_allowed,
    residuals,
)
from uqmbd.dynamics.integration.dop853 import explicit_method, integrate_by_dop853, stopped
from uqmbd.dynamics.integration.functions_of_time import timed
from uqmbd.dynamics.integration.ida import RELAXED, diagnosis, integrate_by_ida, step_limits, step_tolerance
from uqmbd.dynamics.integration.intervals import Interval, intervals_of_members, longest_step, pace, times_between
from uqmbd.dynamics.integration.knots import timed_tables
from uqmbd.dynamics.integration.prescribed import Prescribed, instant, position_jumps, prescribed_by
from uqmbd.dynamics.integration.radau import COSTLY, RADAU_STAGES, allowed_attempts, integrate_by_radau, is_implicit
from uqmbd.dynamics.integration.restarts import speed_jumps
from uqmbd.dynamics.integration.slow_progress import Pace
from uqmbd.dynamics.integration.steps import interpolate_steps, projected_steps
from uqmbd.dynamics.integration.sundials import import_sundials, solve
from uqmbd.dynamics.integration.trajectories import Counters, Segment, SegmentedMotion, Solved, Trajectories, stops

__all__ = [
    "COSTLY",
    "RADAU_STAGES",
    "RELAXED",
    "Counters",
    "Interval",
    "Pace",
    "Prescribed",
    "Segment",
    "SegmentedMotion",
    "Solved",
    "Trajectories",
    "allowed_attempts",
    "allowed_residual",
    "described",
    "diagnosis",
    "explicit_method",
    "instant",
    "integrate_by_dop853",
    "integrate_by_ida",
    "integrate_by_radau",
    "intervals_of_members",
    "is_implicit",
    "longest_step",
    "off_constraints",
    "off_states",
    "over_allowed",
    "pace",
    "interpolate_steps",
    "position_jumps",
    "prescribed_by",
    "residuals",
    "projected_steps",
    "solve",
    "speed_jumps",
    "step_limits",
    "step_tolerance",
    "times_between",
    "stopped",
    "stops",
    "import_sundials",
    "timed",
    "timed_tables",
]
