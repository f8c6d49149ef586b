"""Files of records: which kind they are, and what they hold."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import uqmbd
from uqmbd_calibration.records.columns import Column
from uqmbd_calibration.records.csv_files import csv_columns
from uqmbd_calibration.records.datasets import dataset_attributes, dataset_columns, read_dataset
from uqmbd_calibration.records.wording import short

__all__ = ["outputs_in", "read_columns"]

TABLES = (".csv", ".tsv", ".txt")
NETCDF = (".nc", ".nc4")


def read_columns(path: str | os.PathLike[str]) -> tuple[Path, list[Column], dict[str, Any]]:
    """Read the columns of a file, and what it says of the record as a whole.

    Raises
    ------
    uqmbd.StudyError
        If it cannot be read.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise uqmbd.StudyError(f"Record.read: the path is {short(path)}; expected that of a file.")
    source = Path(path)
    if source.suffix.lower() not in (*TABLES, *NETCDF):
        raise uqmbd.StudyError(
            f"{source}: its suffix {source.suffix!r} is not that of a record; expected .csv (or .tsv, .txt) or .nc."
        )
    if not source.is_file():
        raise uqmbd.StudyError(f"{source}: there is no such file.")
    try:
        if source.suffix.lower() in TABLES:
            return source, csv_columns(source), {}
        dataset = read_dataset(source)
    except OSError as error:
        raise uqmbd.StudyError(f"{source}: the file cannot be read: {error.strerror or error}.") from error
    return source, dataset_columns(dataset, str(source)), dataset_attributes(dataset, str(source))


def outputs_in(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Name the outputs that a file holds.

    Raises
    ------
    uqmbd.StudyError
        If it cannot be read.
    """
    return tuple(column.output for column in read_columns(path)[1])
