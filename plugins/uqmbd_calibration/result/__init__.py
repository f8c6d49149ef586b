"""Results of a calibration: ArviZ groups, tables, checks, and the posterior as random variables."""

from __future__ import annotations

from uqmbd_calibration.result.calibration import Calibration, reduction_in_words
from uqmbd_calibration.result.checks import checks_of, outliers_in_words, several_maxima, warn_of
from uqmbd_calibration.result.groups import tree_of

__all__ = [
    "Calibration",
    "checks_of",
    "reduction_in_words",
    "outliers_in_words",
    "several_maxima",
    "tree_of",
    "warn_of",
]
