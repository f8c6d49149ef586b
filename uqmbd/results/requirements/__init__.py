"""Probabilities of violation of requirements, from counts and from surrogates, with confidence intervals."""

from __future__ import annotations

from uqmbd.results.requirements.counting import Violations
from uqmbd.results.requirements.dataset import requirement_names, requirements_dataset
from uqmbd.results.requirements.intervals import clopper_pearson
from uqmbd.results.requirements.methods import requirements_of
from uqmbd.results.requirements.reading import (
    Answer,
    answers,
    compare_requirements,
    differing,
    meets,
    met_in_words,
    unmet,
)
from uqmbd.results.requirements.tightening import TightenedProbability, tightened_probabilities

__all__ = [
    "Answer",
    "TightenedProbability",
    "Violations",
    "answers",
    "clopper_pearson",
    "compare_requirements",
    "differing",
    "meets",
    "met_in_words",
    "requirement_names",
    "requirements_dataset",
    "requirements_of",
    "tightened_probabilities",
    "unmet",
]
