"""Provide surrogates with a model class of a plugin, with the same interface as polynomial surrogates."""

from __future__ import annotations

from uqmbd.results.chaos.custom.models import SurrogateModel, model_problem
from uqmbd.results.chaos.custom.surrogate import Custom, CustomSurrogate

__all__ = ["Custom", "CustomSurrogate", "SurrogateModel", "model_problem"]
