"""Surrogates whose model is a class of a plugin: evaluated, sampled and stored like those of polynomials."""

from __future__ import annotations

from uqmbd.results.chaos.custom.models import SurrogateModel, absent_model, model_class, model_problem
from uqmbd.results.chaos.custom.surrogate import Custom, CustomSurrogate

__all__ = ["Custom", "CustomSurrogate", "SurrogateModel", "absent_model", "model_class", "model_problem"]
