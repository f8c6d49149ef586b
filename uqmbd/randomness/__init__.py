"""Random variables and their joint distribution; the only place that imports chaospy."""

from __future__ import annotations

from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.variable import RandomVariable, random_vector, uniform_variable

__all__ = ["JointInput", "RandomVariable", "random_vector", "uniform_variable"]
