"""Records of mechanisms: measured outputs with their times, units and noise."""

from __future__ import annotations

from uqmbd_calibration.records.agreement import check_size
from uqmbd_calibration.records.reading import outputs_in
from uqmbd_calibration.records.record import Record
from uqmbd_calibration.records.series import Series
from uqmbd_calibration.records.several import checked_records
from uqmbd_calibration.records.wording import check_known_names, number, numbers, short

__all__ = [
    "Record",
    "Series",
    "check_known_names",
    "check_size",
    "checked_records",
    "number",
    "numbers",
    "outputs_in",
    "short",
]
