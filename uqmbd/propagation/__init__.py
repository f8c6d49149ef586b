"""Propagation: problem, propagators, studies, and the work behind them."""

from __future__ import annotations

from uqmbd.propagation.chaos import ElementLimits, ElementRefinement, refine_elements
from uqmbd.propagation.deterministic import simulate
from uqmbd.propagation.equilibrium import eigenfrequencies, static_equilibrium
from uqmbd.propagation.estimate import Estimate
from uqmbd.propagation.execution import History, Progress, Realisations
from uqmbd.propagation.problem import Problem
from uqmbd.propagation.propagator import Propagator
from uqmbd.propagation.study import Study

__all__ = [
    "ElementLimits",
    "ElementRefinement",
    "Estimate",
    "History",
    "Problem",
    "Progress",
    "Propagator",
    "Realisations",
    "Study",
    "eigenfrequencies",
    "refine_elements",
    "simulate",
    "static_equilibrium",
]
