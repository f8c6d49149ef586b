"""Records of one study, one or several."""

from __future__ import annotations

from collections.abc import Sequence

import uqmbd
from uqmbd_calibration.records.record import Record

__all__ = ["checked_records"]


def checked_records(records: Record | Sequence[Record], study: uqmbd.Study) -> tuple[Record, ...]:
    """Return one record or several as a tuple, all checked against a study.

    Raise StudyError if there is none, one is no record, two have one name, or one is not of the study.
    """
    if isinstance(records, Record):
        records = (records,)
    if not isinstance(records, Sequence) or not records or not all(isinstance(one, Record) for one in records):
        raise uqmbd.StudyError(
            f"the records are {records!r}; expected a uqmbd_calibration.Record, or a list of them, as Record.read "
            "makes them."
        )
    names = [one.name for one in records]
    for name in names:
        if names.count(name) > 1:
            raise uqmbd.StudyError(
                f"two records are called {name!r}; give each a different name: Record.read(..., name='run 2')."
            )
    return tuple(one.checked_against(study) for one in records)
