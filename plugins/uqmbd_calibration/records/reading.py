"""Files of records: their formats and contents.

CSV files of records.
"""

from __future__ import annotations

import contextlib
import csv
import os
import re
from pathlib import Path
from typing import Any

import uqmbd
from uqmbd_calibration.records.columns import OutputColumn
from uqmbd_calibration.records.datasets import dataset_attributes, dataset_columns, read_dataset
from uqmbd_calibration.records.units import seconds
from uqmbd_calibration.records.wording import check_name, short

__all__ = ["outputs_in", "read_columns"]

_HEAD = re.compile(r"(?P<name>.*?)\s*(?:\[(?P<units>[^\[\]]*)\])?", re.S)


def csv_columns(path: Path) -> list[OutputColumn]:
    """Read the columns of a CSV file: the header contains names and optional units, as in ``angle [rad]``.

    A column ``time`` or ``time [s]`` holds the times of all others; without one, they are outputs without a time.
    Columns are separated by tabs, semicolons or commas: the first of these that the header has.  Lines that begin with
    ``#`` are left out, cells that are empty or ``nan`` are gaps.
    """
    lines = _lines(path)
    if not lines:
        raise uqmbd.StudyError(f"{path}: the file has no header; expected a line such as 'time [s],angle [rad]'.")
    number, header = lines[0]
    mark = next((mark for mark in "\t;" if mark in header), ",")
    heads = [_head(cell, f"{path}, line {number}") for cell in _cells(header, mark, path, number)]
    names = [name for name, _ in heads]
    for name in names:
        if names.count(name) > 1:
            raise uqmbd.StudyError(
                f"{path}, line {number}: there are {names.count(name)} columns {name!r}; expected one."
            )
    rows = [(line, _numbers(text, mark, names, path, line)) for line, text in lines[1:]]
    if not rows:
        raise uqmbd.StudyError(f"{path}: there is a header, and no line of numbers below it.")
    columns = dict(zip(names, zip(*(values for _, values in rows), strict=True), strict=True))
    times: tuple[float, ...] = ()
    if "time" in columns:
        units = dict(heads)["time"]
        if units is not None and not seconds(units):
            raise uqmbd.StudyError(
                f"{path}, line {number}: the times are in {units!r}; expected seconds: convert them, and write "
                "'time [s]'."
            )
        times = columns.pop("time")
        for (line, _), time in zip(rows, times, strict=True):
            if time != time:
                raise uqmbd.StudyError(f"{path}, line {line}: there is no time; every line needs one.")
    if not columns:
        raise uqmbd.StudyError(f"{path}, line {number}: there is no column besides the times.")
    stated = dict(heads)
    return [OutputColumn(name, times, values, stated[name]) for name, values in columns.items()]


def _lines(path: Path) -> list[tuple[int, str]]:
    """Return the non-empty lines with their numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise uqmbd.StudyError(
            f"{path}: this is no text in UTF-8 (byte {error.start}); save it as CSV in UTF-8."
        ) from None
    if "\0" in text:
        raise uqmbd.StudyError(f"{path}: this is no text: it holds null characters; save it as CSV in UTF-8.")
    # lines end as editors count them, not at every character that Unicode takes for an end
    lines = enumerate(re.split("\r\n|\r|\n", text), 1)
    return [(number, line) for number, line in lines if line.strip(" \t,;") and not line.lstrip().startswith("#")]


def _cells(line: str, mark: str, path: Path, number: int) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True, strict=True))]
    except (csv.Error, StopIteration) as error:
        raise uqmbd.StudyError(f"{path}, line {number}: it cannot be read as CSV: {error}.") from None


def _head(cell: str, where: str) -> tuple[str, str | None]:
    """Return the name and the units of a column."""
    found = _HEAD.fullmatch(cell)
    name, units = (found["name"], found["units"]) if found else (cell, None)
    if name.lower() == "time":
        return "time", None if units is None else units.strip()
    if _number(cell) is not None:
        raise uqmbd.StudyError(
            f"{where}: the column is called {short(cell)}; expected a header such as "
            "'time [s],angle [rad]' before the numbers."
        )
    return check_name(name, f"{where}: a column"), None if units is None else units.strip()


def _numbers(text: str, mark: str, names: list[str], path: Path, line: int) -> list[float]:
    """Return the numbers of a line; gaps are nan."""
    # nine lines of ten are plain numbers, and there may be a million of them
    if '"' not in text and "_" not in text and text.count(mark) == len(names) - 1:
        with contextlib.suppress(ValueError):
            return list(map(float, text.split(mark)))
    cells = _cells(text, mark, path, line)
    if len(cells) != len(names):
        raise uqmbd.StudyError(
            f"{path}, line {line}: there are {len(cells)} cells under {len(names)} names; expected one for each, empty "
            "where nothing was measured."
        )
    values = []
    for name, cell in zip(names, cells, strict=True):
        value = float("nan") if not cell else _number(cell)
        if value is None:
            comma = " (decimals are written with a point)" if "," in cell else ""
            raise uqmbd.StudyError(
                f"{path}, line {line}: {name!r} is {short(cell)}; expected a number{comma}, or "
                "nothing where nothing was measured."
            )
        values.append(value)
    return values


def _number(cell: str) -> float | None:
    """Return the number that a cell holds; Python's own underscores are none."""
    if "_" in cell:
        return None
    try:
        return float(cell)
    except ValueError:
        return None


TABLES = (".csv", ".tsv", ".txt")
NETCDF = (".nc", ".nc4")


def read_columns(path: str | os.PathLike[str]) -> tuple[Path, list[OutputColumn], dict[str, Any]]:
    """Read the columns of a file, and its attributes for the whole record.

    Raise StudyError if it cannot be read.
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

    Raise StudyError if it cannot be read.
    """
    return tuple(column.output for column in read_columns(path)[1])
