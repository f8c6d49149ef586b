"""Summaries of a motion between the output times: extremes, integrals, first times, margins."""

from __future__ import annotations

from uqmbd.dynamics.summaries.domain import Domain, domain_map
from uqmbd.dynamics.summaries.polynomials import MotionPolynomials
from uqmbd.dynamics.summaries.summaries import (
    MissingReason,
    SummaryMap,
    running_minimum,
    summarised,
    summary_map,
)

__all__ = [
    "Domain",
    "MissingReason",
    "MotionPolynomials",
    "SummaryMap",
    "domain_map",
    "running_minimum",
    "summarised",
    "summary_map",
]
