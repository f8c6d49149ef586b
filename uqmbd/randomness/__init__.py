"""Random variables, their joint distribution, and the bases and quadratures of polynomial chaos.

The only place that imports chaospy.
"""

from __future__ import annotations

from uqmbd.randomness.germs import Germ, truncated
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.quadrature import (
    Quadrature,
    clenshaw_curtis,
    combination_coefficients,
    gauss_tensor,
    gram_error,
    monte_carlo_rule,
    smolyak,
    sparse_rule,
)
from uqmbd.randomness.space import GermBox, GermSpace, located
from uqmbd.randomness.variable import RandomVariable, random_vector, uniform_variable

__all__ = [
    "Germ",
    "GermBox",
    "GermSpace",
    "JointInput",
    "Quadrature",
    "RandomVariable",
    "clenshaw_curtis",
    "combination_coefficients",
    "gauss_tensor",
    "gram_error",
    "index_set",
    "located",
    "monte_carlo_rule",
    "random_vector",
    "smolyak",
    "sparse_rule",
    "truncated",
    "uniform_variable",
]
