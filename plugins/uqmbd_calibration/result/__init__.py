"""What a calibration gives back: groups of ArviZ, tables, checks, and the posterior as random variables."""

from __future__ import annotations

from uqmbd_calibration.result.calibration import Calibration
from uqmbd_calibration.result.checks import checks_of, warn_of
from uqmbd_calibration.result.groups import tree_of

__all__ = ["Calibration", "checks_of", "tree_of", "warn_of"]
