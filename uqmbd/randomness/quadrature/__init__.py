"""Quadrature rules over germs: Gauss rules, nested rules, Smolyak's sparse grids, and samples."""

from __future__ import annotations

from uqmbd.randomness.quadrature.importance import TailMixture
from uqmbd.randomness.quadrature.rules import Quadrature, clenshaw_curtis, gauss_tensor, gram_error, monte_carlo_rule
from uqmbd.randomness.quadrature.sparse_rules import combination_coefficients, smolyak, sparse_rule

__all__ = [
    "Quadrature",
    "TailMixture",
    "clenshaw_curtis",
    "combination_coefficients",
    "gauss_tensor",
    "gram_error",
    "monte_carlo_rule",
    "smolyak",
    "sparse_rule",
]
