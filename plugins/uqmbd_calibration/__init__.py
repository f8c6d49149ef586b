"""Calibration: the posterior distribution of the inputs of a mechanism, from measured records.

The names of this package are loaded when they are first used: its command is listed by `uqmbd --help`, which does not
wait for them.
"""

from __future__ import annotations

import lazy_loader

import uqmbd

# not `__dir__`, by which the hooks below are found
__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)


@uqmbd.hookimpl
def uqmbd_report_sections() -> list[type]:
    """Return the report sections of this package."""
    from uqmbd_calibration.reporting import CalibrationSection

    return [CalibrationSection]
