"""Checks of one or several records of one study."""

from __future__ import annotations

from collections.abc import Sequence

import uqmbd
from uqmbd_calibration.records.record import Record

__all__ = ["checked_records"]


def checked_records(records: Record | Sequence[Record], study: uqmbd.Study) -> tuple[Record, ...]:
    """Return one record or several records as a tuple, after checks against a study.

    Raise StudyError if there is no record, an element is not a record, two names are equal, or a record does not agree.
    """
    if isinstance(records, Record):
        records = (records,)
    if not isinstance(records, Sequence) or not records or not all(isinstance(one, Record) for one in records):
        raise uqmbd.StudyError(
            f"the argument 'records' is {records!r}; expected a uqmbd_calibration.Record from Record.read, or a list "
            "of such records."
        )
    names = [one.name for one in records]
    for name in names:
        if names.count(name) > 1:
            raise uqmbd.StudyError(
                f"two records have the name {name!r}; give each a different name, e.g. Record.read(..., name='run 2')."
            )
    return tuple(one.checked_against(study) for one in records)
