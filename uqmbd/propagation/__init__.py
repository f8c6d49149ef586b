"""Propagation: problems, propagators, studies, and the execution of realisations."""

from __future__ import annotations

from uqmbd.propagation.annotations import Bounds, option_types
from uqmbd.propagation.budget import Timing, accuracy_of, allowed_of, budget_of, timing_of
from uqmbd.propagation.chaos import (
    Clock,
    Dense,
    ElementLimits,
    ElementRefinement,
    Exceedance,
    NodeFit,
    Phases,
    Verification,
    VerificationPoints,
    choose_clock,
    clock_at_means,
    dense,
    errors_over_largest,
    find_exceedances,
    fit_nodes,
    refine_elements,
    require_clock,
    require_outputs_over_time,
    varying,
    watched_angles,
)
from uqmbd.propagation.execution import (
    History,
    Margins,
    Realisations,
    claimed,
    output_folder,
    pool,
    set_aside,
    writable,
)
from uqmbd.propagation.inputs import nothing_random
from uqmbd.propagation.methods import Estimate, Propagator, Sizing, obstacle_of, readable
from uqmbd.propagation.observed_model import build_observed_model, warned_elsewhere
from uqmbd.propagation.problem import Problem
from uqmbd.propagation.reduction import Reduced, Reductions, store_name
from uqmbd.propagation.simulation import eigenfrequencies, input_point, simulate, static_equilibrium
from uqmbd.propagation.studies import Study, findings, load_mechanism, load_study, warning_of

__all__ = [
    "Bounds",
    "Clock",
    "Dense",
    "Exceedance",
    "ElementLimits",
    "ElementRefinement",
    "Estimate",
    "History",
    "Margins",
    "NodeFit",
    "Phases",
    "Problem",
    "Propagator",
    "Realisations",
    "Reduced",
    "Reductions",
    "Sizing",
    "Study",
    "Timing",
    "Verification",
    "VerificationPoints",
    "accuracy_of",
    "allowed_of",
    "budget_of",
    "choose_clock",
    "claimed",
    "clock_at_means",
    "dense",
    "find_exceedances",
    "eigenfrequencies",
    "errors_over_largest",
    "findings",
    "fit_nodes",
    "input_point",
    "load_mechanism",
    "load_study",
    "nothing_random",
    "build_observed_model",
    "obstacle_of",
    "option_types",
    "output_folder",
    "pool",
    "readable",
    "refine_elements",
    "require_clock",
    "require_outputs_over_time",
    "set_aside",
    "simulate",
    "static_equilibrium",
    "store_name",
    "timing_of",
    "varying",
    "warned_elsewhere",
    "warning_of",
    "watched_angles",
    "writable",
]
