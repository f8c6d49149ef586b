"""Evaluate, sample and store surrogates, and compute their statistics and stated errors."""

from __future__ import annotations

from uqmbd.results.chaos.aligned import AlignedChaos
from uqmbd.results.chaos.composed import ComposedChaos, Part, chaos_from_dataset, stored_as
from uqmbd.results.chaos.custom import CustomSurrogate, SurrogateModel, model_problem
from uqmbd.results.chaos.decay import verdict_of_decay
from uqmbd.results.chaos.discontinuity import Discontinuity
from uqmbd.results.chaos.fit import LeastSquares, NodeRegression, least_squares, project, regress_on_nodes
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.piecewise import PiecewiseChaos
from uqmbd.results.chaos.polynomial import PolynomialChaos
from uqmbd.results.chaos.quasi_periodic import QuasiPeriodicChaos, QuasiPeriodicElement
from uqmbd.results.chaos.sampling import random_germs, spread_germs
from uqmbd.results.chaos.segments import AlignedElement, Markers
from uqmbd.results.chaos.stated_error import (
    SPREAD_FLOOR,
    error_words,
    exceeds_locally,
    reference_spread,
    spread_words,
    stated_words,
    weighted_std,
)
from uqmbd.results.chaos.surrogates import (
    StoredSurrogate,
    absent_surrogate,
    stored_surrogates,
    surrogate,
    surrogate_parts,
    verified_range,
    verified_std,
    verified_trials,
)

__all__ = [
    "SPREAD_FLOOR",
    "AlignedChaos",
    "AlignedElement",
    "ComposedChaos",
    "CustomSurrogate",
    "Discontinuity",
    "Markers",
    "LeastSquares",
    "NodeRegression",
    "Part",
    "PiecewiseChaos",
    "PolynomialChaos",
    "QuasiPeriodicChaos",
    "QuasiPeriodicElement",
    "StoredSurrogate",
    "Surrogate",
    "SurrogateModel",
    "absent_surrogate",
    "chaos_from_dataset",
    "error_words",
    "exceeds_locally",
    "least_squares",
    "model_problem",
    "project",
    "random_germs",
    "reference_spread",
    "regress_on_nodes",
    "spread_germs",
    "spread_words",
    "stated_words",
    "stored_as",
    "stored_surrogates",
    "surrogate",
    "surrogate_parts",
    "verdict_of_decay",
    "verified_range",
    "verified_std",
    "verified_trials",
    "weighted_std",
]
