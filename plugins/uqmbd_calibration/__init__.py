"""Calibration: the posterior distribution of the inputs of a mechanism, from measured records.

The names of this package are loaded at their first use, because `uqmbd --help` lists its command and must start fast.
"""

from __future__ import annotations

import lazy_loader

import uqmbd

# do not take `__dir__` from the stub: pluggy finds the hooks below with `dir`
__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)


@uqmbd.hookimpl
def uqmbd_report_sections() -> list[type]:
    """Return the report sections of this package."""
    from uqmbd_calibration.reporting import CalibrationSection

    return [CalibrationSection]
