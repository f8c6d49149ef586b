"""Outputs, requirements and start conditions of a mechanism, and the symbols that their expressions may contain."""

from __future__ import annotations

from uqmbd.mechanism.declared.holonomic import require_holonomic
from uqmbd.mechanism.declared.output import Output
from uqmbd.mechanism.declared.rates import mode_shape, time_derivative
from uqmbd.mechanism.declared.recorded import output_of
from uqmbd.mechanism.declared.requirement import Requirement, requirement_of
from uqmbd.mechanism.declared.scope import (
    Described,
    require_free,
    require_known,
    require_measured,
    unseen_numbers,
)
from uqmbd.mechanism.declared.start import StartCondition, start_condition

__all__ = [
    "Described",
    "Output",
    "Requirement",
    "StartCondition",
    "mode_shape",
    "output_of",
    "require_free",
    "require_holonomic",
    "require_known",
    "require_measured",
    "requirement_of",
    "start_condition",
    "time_derivative",
    "unseen_numbers",
]
