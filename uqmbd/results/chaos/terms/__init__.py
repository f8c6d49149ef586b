"""Compute standard deviation, skewness, kurtosis and variance shares of sums of orthonormal terms."""

from __future__ import annotations

from uqmbd.results.chaos.terms.moments import constant_columns, shape_route, skewness_kurtosis, standard_deviation
from uqmbd.results.chaos.terms.power_sums import REPLICATES, PowerSums
from uqmbd.results.chaos.terms.sobol import (
    closed_variance,
    first_order_masks,
    interaction_mask,
    second_order_masks,
    total_order_masks,
    variance_shares,
)

__all__ = [
    "REPLICATES",
    "PowerSums",
    "closed_variance",
    "constant_columns",
    "first_order_masks",
    "interaction_mask",
    "second_order_masks",
    "shape_route",
    "skewness_kurtosis",
    "standard_deviation",
    "total_order_masks",
    "variance_shares",
]
