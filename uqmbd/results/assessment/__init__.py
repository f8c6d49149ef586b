"""Assess the reliability of results: compare methods and their stated errors, and recommend a method."""

from __future__ import annotations

from uqmbd.results.assessment.accuracy import StatedAccuracy, stated_accuracy
from uqmbd.results.assessment.alignment import align
from uqmbd.results.assessment.assessment import LEVELS, Assessment, OutputReliability, assess
from uqmbd.results.assessment.costs import error_against_cost
from uqmbd.results.assessment.coupled import coupled_systems
from uqmbd.results.assessment.differences import choose_reference, compare
from uqmbd.results.assessment.error_norms import relative_errors
from uqmbd.results.assessment.error_sentences import own_statements
from uqmbd.results.assessment.integration_share import IntegrationShare, integration_shares, worst_integration_share
from uqmbd.results.assessment.judgements import Judgement, judgements_of, worst
from uqmbd.results.assessment.limits import COARSE, EXACT
from uqmbd.results.assessment.own_errors import NO_SPREAD, NO_VARIATION
from uqmbd.results.assessment.recommendation import recommend, recommended
from uqmbd.results.assessment.verdicts import AGREES, DIFFERS, REFERENCE, UNDER_RESOLVED

__all__ = [
    "AGREES",
    "Assessment",
    "COARSE",
    "DIFFERS",
    "EXACT",
    "IntegrationShare",
    "Judgement",
    "LEVELS",
    "NO_SPREAD",
    "REFERENCE",
    "OutputReliability",
    "NO_VARIATION",
    "StatedAccuracy",
    "UNDER_RESOLVED",
    "align",
    "assess",
    "choose_reference",
    "compare",
    "coupled_systems",
    "error_against_cost",
    "integration_shares",
    "judgements_of",
    "own_statements",
    "recommend",
    "recommended",
    "relative_errors",
    "stated_accuracy",
    "worst",
    "worst_integration_share",
]
