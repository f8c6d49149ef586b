"""Random variables, their joint distribution, and the bases and quadratures of polynomial chaos.

No other package of uqmbd imports chaospy.
"""

from __future__ import annotations

from uqmbd.randomness.designs import Design, SamplingDesign, Seed, design_problem, sampling_design, sampling_designs
from uqmbd.randomness.distributions import (
    AffineDistribution,
    adopt_distribution,
    distribution_about,
    is_distribution,
    leaves_range,
    tabulated,
)
from uqmbd.randomness.existence import exists, moment_orders
from uqmbd.randomness.germs import Germ, cumulated, truncate_germ
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput, why_not_drawn
from uqmbd.randomness.keys import combined_paths, path_key, path_terms
from uqmbd.randomness.monomials import as_numpoly
from uqmbd.randomness.numpy_reductions import install as install_in_numpy
from uqmbd.randomness.quadrature import (
    Quadrature,
    TailMixture,
    clenshaw_curtis,
    combination_coefficients,
    gauss_tensor,
    gram_error,
    monte_carlo_rule,
    smolyak,
    sparse_rule,
)
from uqmbd.randomness.random_matrix import random_factor, random_root
from uqmbd.randomness.space import GermBox, GermSpace, located
from uqmbd.randomness.symbolic import Symbol, Symbolic
from uqmbd.randomness.tolerances import Toleranced, iso286, stated_tolerance, tolerance
from uqmbd.randomness.variable import RandomVariable, random_vector, uniform_variable

__all__ = [
    "Design",
    "Germ",
    "GermBox",
    "GermSpace",
    "JointInput",
    "AffineDistribution",
    "Quadrature",
    "RandomVariable",
    "SamplingDesign",
    "Seed",
    "Symbol",
    "Symbolic",
    "TailMixture",
    "Toleranced",
    "adopt_distribution",
    "as_numpoly",
    "clenshaw_curtis",
    "clenshaw_curtis",
    "combination_coefficients",
    "combination_coefficients",
    "cumulated",
    "design_problem",
    "distribution_about",
    "exists",
    "gauss_tensor",
    "gram_error",
    "index_set",
    "is_distribution",
    "iso286",
    "located",
    "moment_orders",
    "monte_carlo_rule",
    "random_factor",
    "random_root",
    "combined_paths",
    "path_key",
    "path_terms",
    "random_vector",
    "sampling_design",
    "sampling_designs",
    "smolyak",
    "sparse_rule",
    "stated_tolerance",
    "leaves_range",
    "tabulated",
    "tolerance",
    "truncate_germ",
    "uniform_variable",
    "why_not_drawn",
]

install_in_numpy()
