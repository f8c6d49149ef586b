"""What the report shows of calibrations."""

from __future__ import annotations

from uqmbd_calibration.reporting.section import CalibrationSection

__all__ = ["CalibrationSection"]
