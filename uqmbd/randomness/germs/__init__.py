"""Standard variables with orthonormal polynomials, recurrences, discretised measures and tables of quantiles."""

from __future__ import annotations

from uqmbd.randomness.germs.germ import Germ
from uqmbd.randomness.germs.quantile_tables import KNOTS, LARGEST, interpolate, invert, slope_at
from uqmbd.randomness.germs.stieltjes import COUNT, Discretised, discretise, discretise_quantiles, lanczos
from uqmbd.randomness.germs.truncated import cumulated, median, truncate_germ

__all__ = [
    "COUNT",
    "KNOTS",
    "LARGEST",
    "Discretised",
    "Germ",
    "cumulated",
    "discretise",
    "discretise_quantiles",
    "interpolate",
    "invert",
    "lanczos",
    "median",
    "slope_at",
    "truncate_germ",
]
