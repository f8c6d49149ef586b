"""Results of a calibration: ArviZ groups, tables, checks, and the posterior as random variables."""

from __future__ import annotations

from uqmbd_calibration.result.calibration import Calibration, learned
from uqmbd_calibration.result.checks import checks_of, named_strays, several_maxima, warn_of
from uqmbd_calibration.result.groups import tree_of

__all__ = ["Calibration", "checks_of", "learned", "named_strays", "several_maxima", "tree_of", "warn_of"]
