"""Formats of record files, and readers of CSV files."""

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
    """Return the columns of a CSV file; the header contains names with optional units, such as ``angle [rad]``.

    A column ``time`` or ``time [s]`` contains the times of all other columns. Without this column, all outputs are
    scalar outputs. The separator is the first of tab, semicolon and comma that the header contains. Lines that begin
    with ``#`` are ignored. Empty cells and ``nan`` are gaps.
    """
    lines = _lines(path)
    if not lines:
        raise uqmbd.StudyError(f"{path}: the file has no header; expected a line such as 'time [s],angle [rad]'.")
    number, header = lines[0]
    mark = next((mark for mark in "\t;" if mark in header), ",")
    heads = [_name_and_units(cell, f"{path}, line {number}") for cell in _cells(header, mark, path, number)]
    names = [name for name, _ in heads]
    for name in names:
        if names.count(name) > 1:
            raise uqmbd.StudyError(
                f"{path}, line {number}: the header has {names.count(name)} columns {name!r}; expected one."
            )
    rows = [(line, _numbers(text, mark, names, path, line)) for line, text in lines[1:]]
    if not rows:
        raise uqmbd.StudyError(f"{path}: the file has a header, but no lines with values; expected at least one.")
    columns = dict(zip(names, zip(*(values for _, values in rows), strict=True), strict=True))
    times: tuple[float, ...] = ()
    if "time" in columns:
        units = dict(heads)["time"]
        if units is not None and not seconds(units):
            raise uqmbd.StudyError(
                f"{path}, line {number}: the units of the times are {units!r}; expected seconds. Convert the times, "
                "and write 'time [s]' in the header."
            )
        times = columns.pop("time")
        for (line, _), time in zip(rows, times, strict=True):
            if time != time:
                raise uqmbd.StudyError(f"{path}, line {line}: the time is missing; expected a time in every line.")
    if not columns:
        raise uqmbd.StudyError(
            f"{path}, line {number}: the file has only a column of times; expected a column for at least one output."
        )
    stated = dict(heads)
    return [OutputColumn(name, times, values, stated[name]) for name, values in columns.items()]


def _lines(path: Path) -> list[tuple[int, str]]:
    """Return the non-empty lines with their numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise uqmbd.StudyError(f"{path} is not UTF-8 text (byte {error.start}); save it as CSV in UTF-8.") from None
    if "\0" in text:
        raise uqmbd.StudyError(
            f"{path} is not a text file, because it contains null characters; save it as CSV in UTF-8."
        )
    # count only the line ends that editors count, not all line ends of Unicode
    lines = enumerate(re.split("\r\n|\r|\n", text), 1)
    return [(number, line) for number, line in lines if line.strip(" \t,;") and not line.lstrip().startswith("#")]


def _cells(line: str, mark: str, path: Path, number: int) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True, strict=True))]
    except (csv.Error, StopIteration) as error:
        raise uqmbd.StudyError(f"{path}, line {number} is not valid CSV: {error}.") from None


def _name_and_units(cell: str, where: str) -> tuple[str, str | None]:
    """Return the name and the units of a column."""
    found = _HEAD.fullmatch(cell)
    name, units = (found["name"], found["units"]) if found else (cell, None)
    if name.lower() == "time":
        return "time", None if units is None else units.strip()
    if _number(cell) is not None:
        raise uqmbd.StudyError(
            f"{where}: the column name is {short(cell)}; expected a header such as 'time [s],angle "
            "[rad]' before the values."
        )
    return check_name(name, f"{where}: a column"), None if units is None else units.strip()


def _numbers(text: str, mark: str, names: list[str], path: Path, line: int) -> list[float]:
    """Return the numbers of a line; gaps are nan."""
    # fast path: nine of ten lines contain plain numbers, and a file may have a million lines
    if '"' not in text and "_" not in text and text.count(mark) == len(names) - 1:
        with contextlib.suppress(ValueError):
            return list(map(float, text.split(mark)))
    cells = _cells(text, mark, path, line)
    if len(cells) != len(names):
        raise uqmbd.StudyError(
            f"{path}, line {line}: the line has {len(cells)} entries, but the header has {len(names)} columns. "
            "Expected one entry in each column, empty for a missing value."
        )
    values = []
    for name, cell in zip(names, cells, strict=True):
        value = float("nan") if not cell else _number(cell)
        if value is None:
            comma = " with a decimal point" if "," in cell else ""
            raise uqmbd.StudyError(
                f"{path}, line {line}: {name!r} is {short(cell)}; expected a number{comma}, or an empty entry for a "
                "missing value."
            )
        values.append(value)
    return values


def _number(cell: str) -> float | None:
    """Return the number in a cell, or None; numbers with underscores, as in Python, are not accepted."""
    if "_" in cell:
        return None
    try:
        return float(cell)
    except ValueError:
        return None


TABLES = (".csv", ".tsv", ".txt")
NETCDF = (".nc", ".nc4")


def read_columns(path: str | os.PathLike[str]) -> tuple[Path, list[OutputColumn], dict[str, Any]]:
    """Return the path, the columns of a file, and its attributes for the whole record.

    Raise StudyError if the file cannot be read.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise uqmbd.StudyError(f"Record.read: the path is {short(path)}; expected the path of a file.")
    source = Path(path)
    if source.suffix.lower() not in (*TABLES, *NETCDF):
        raise uqmbd.StudyError(
            f"{source}: the suffix is {source.suffix!r}; expected .csv (or .tsv, .txt) or .nc for a record."
        )
    if not source.is_file():
        raise uqmbd.StudyError(f"{source}: the file does not exist.")
    try:
        if source.suffix.lower() in TABLES:
            return source, csv_columns(source), {}
        dataset = read_dataset(source)
    except OSError as error:
        raise uqmbd.StudyError(f"{source}: the file cannot be read: {error.strerror or error}.") from error
    return source, dataset_columns(dataset, str(source)), dataset_attributes(dataset, str(source))


def outputs_in(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the names of the outputs in a file.

    Raise StudyError if the file cannot be read.
    """
    return tuple(column.output for column in read_columns(path)[1])
