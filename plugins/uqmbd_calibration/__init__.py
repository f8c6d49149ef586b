"""From records of a mechanism back to its inputs: what a record says of them, and how sure that is."""

from __future__ import annotations

import uqmbd
from uqmbd_calibration.records import Record, Series

__all__ = ["Record", "Series"]


@uqmbd.hookimpl
def uqmbd_report_sections() -> list[type]:
    """Return the report sections of this package."""
    return []
