"""Command `uqmbd calibrate`; the entry point of commands is this module, so it has no slow imports."""

from __future__ import annotations

import uqmbd
from uqmbd_calibration.command.calibrate import Calibrate

__all__ = ["Calibrate"]


@uqmbd.hookimpl
def uqmbd_commands() -> list[type[uqmbd.extend.Command]]:
    """Return the command of this package."""
    return [Calibrate]
