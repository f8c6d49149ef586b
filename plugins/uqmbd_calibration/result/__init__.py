"""Results of a calibration: groups of ArviZ, tables, checks, and the posterior as random variables."""

from __future__ import annotations

from uqmbd_calibration.result.calibration import Calibration, learned
from uqmbd_calibration.result.checks import checks_of, named_strays, warn_of
from uqmbd_calibration.result.groups import tree_of

__all__ = ["Calibration", "checks_of", "learned", "named_strays", "tree_of", "warn_of"]
