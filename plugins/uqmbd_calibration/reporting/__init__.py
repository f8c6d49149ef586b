"""Calibrations in the report."""

from __future__ import annotations

from uqmbd_calibration.reporting.section import CalibrationSection

__all__ = ["CalibrationSection"]
