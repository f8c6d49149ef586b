"""Common parts of polynomial-chaos propagators."""

from __future__ import annotations

from uqmbd.propagation.chaos.clock_choice import (
    choose_clock,
    clock_at_means,
    require_clock,
    require_outputs_over_time,
    watched_angles,
)
from uqmbd.propagation.chaos.clocks import Clock, Phases
from uqmbd.propagation.chaos.dense_output import Dense, dense
from uqmbd.propagation.chaos.elements import ElementLimits, ElementRefinement, refine_elements
from uqmbd.propagation.chaos.exceedances import Exceedance, errors_over_largest, find_exceedances, varying
from uqmbd.propagation.chaos.nodes import NodeFit, fit_nodes
from uqmbd.propagation.chaos.surrogate_check import warn_of_surrogates
from uqmbd.propagation.chaos.verification import Verification
from uqmbd.propagation.chaos.verification_points import VerificationPoints

__all__ = [
    "Clock",
    "Dense",
    "Exceedance",
    "ElementLimits",
    "ElementRefinement",
    "NodeFit",
    "Phases",
    "Verification",
    "VerificationPoints",
    "choose_clock",
    "clock_at_means",
    "dense",
    "find_exceedances",
    "errors_over_largest",
    "fit_nodes",
    "refine_elements",
    "require_clock",
    "require_outputs_over_time",
    "varying",
    "warn_of_surrogates",
    "watched_angles",
]
