"""Report section and first screen of calibrations."""

from __future__ import annotations

from uqmbd_calibration.reporting.section import CalibrationSection

__all__ = ["CalibrationSection"]
