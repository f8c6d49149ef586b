"""Records of mechanisms: outputs that were measured, their times, their units and their noise."""

from __future__ import annotations

from uqmbd_calibration.records.record import Record
from uqmbd_calibration.records.series import Series
from uqmbd_calibration.records.several import checked_records

__all__ = ["Record", "Series", "checked_records"]
