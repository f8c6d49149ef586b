"""Expressions of time, inputs and quantities without a time, and what users may give as values."""

from __future__ import annotations

from uqmbd.mechanism.expressions.computable import WITHOUT_DERIVATIVE, foreign_part, told
from uqmbd.mechanism.expressions.spline import Spline, spline
from uqmbd.mechanism.expressions.spline_table import LOOKED_UP, SplineTable, polynomial
from uqmbd.mechanism.expressions.time import step, t
from uqmbd.mechanism.expressions.timeless import (
    AtEquilibrium,
    AtSteady,
    EventTime,
    MotionSymbol,
    ScalarSymbol,
    at_equilibrium,
    at_steady,
    check_scalar,
    damping_ratio,
    eigenfrequency,
    event_name,
    is_scalar,
)
from uqmbd.mechanism.expressions.user_values import LARGEST, flatten, numbers, random_variables, shown, unknown_symbol

__all__ = [
    "AtEquilibrium",
    "AtSteady",
    "EventTime",
    "LARGEST",
    "MotionSymbol",
    "LOOKED_UP",
    "ScalarSymbol",
    "Spline",
    "SplineTable",
    "WITHOUT_DERIVATIVE",
    "at_equilibrium",
    "at_steady",
    "check_scalar",
    "damping_ratio",
    "eigenfrequency",
    "event_name",
    "flatten",
    "foreign_part",
    "is_scalar",
    "numbers",
    "polynomial",
    "random_variables",
    "shown",
    "spline",
    "step",
    "t",
    "told",
    "unknown_symbol",
]
