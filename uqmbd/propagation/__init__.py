"""Propagation: problem, propagators, studies, and the work behind them."""

from __future__ import annotations

from uqmbd.propagation.deterministic import simulate
from uqmbd.propagation.equilibrium import eigenfrequencies, static_equilibrium
from uqmbd.propagation.problem import Problem, Realisations
from uqmbd.propagation.progress import Progress
from uqmbd.propagation.propagator import Propagator
from uqmbd.propagation.study import Study

__all__ = [
    "Problem",
    "Progress",
    "Propagator",
    "Realisations",
    "Study",
    "eigenfrequencies",
    "simulate",
    "static_equilibrium",
]
