"""Records as xarray datasets and netCDF files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import uqmbd
from uqmbd_calibration.records.columns import OutputColumn
from uqmbd_calibration.records.series import Series
from uqmbd_calibration.records.units import seconds
from uqmbd_calibration.records.wording import check_name, short

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["dataset_attributes", "dataset_columns", "dataset_of", "read_dataset"]

REPETITION = "repetition"
"""Dimension of a scalar output; its coordinate, if present, is not a time."""


def read_dataset(path: Path) -> xr.Dataset:
    """Read a netCDF file into memory; times are not decoded to dates."""
    from uqmbd.extend import read_root

    try:
        return read_root(path)
    except uqmbd.StudyError as error:
        reason = " ".join(str(error.__cause__ or error).split())
        raise uqmbd.StudyError(f"{path} is not a readable netCDF file: {reason[:300]}") from error


def dataset_columns(dataset: xr.Dataset, where: str) -> list[OutputColumn]:
    """Return the variables of a dataset, each with the times of its dimension if it has times."""
    columns = []
    for key, variable in dataset.data_vars.items():
        name = check_name(key, f"{where}: a variable")
        if variable.ndim > 1:
            raise uqmbd.StudyError(
                f"{where}: variable {name!r} has the dimensions {', '.join(map(str, variable.dims))}; expected one "
                "dimension, the times."
            )
        times: Any = ()
        for dimension in variable.dims:
            if dimension in variable.coords and dimension != REPETITION:
                times = variable.coords[dimension]
                stated = times.attrs.get("units", "s")
                if not isinstance(stated, str) or not seconds(stated):
                    raise uqmbd.StudyError(
                        f"{where}: the coordinate {str(dimension)!r} of variable {name!r} has the units "
                        f"{short(stated)}; expected 's'. Convert the times, and set the attribute units = 's'."
                    )
                times = times.values
        units = variable.attrs.get("units")
        if units is not None and not isinstance(units, str):
            raise uqmbd.StudyError(
                f"{where}: the attribute units of variable {name!r} is {short(units)}; expected a string."
            )
        columns.append(OutputColumn(name, times, np.atleast_1d(variable.values), units, variable.attrs.get("noise")))
    if not columns:
        raise uqmbd.StudyError(
            f"{where}: the dataset has no variables; expected one variable for each measured output."
        )
    return columns


def dataset_attributes(dataset: xr.Dataset, where: str) -> dict[str, Any]:
    """Return the attributes of a dataset for the whole record: ``name``, ``machine``, ``known``."""
    found = {key: dataset.attrs[key] for key in ("name", "machine", "known") if key in dataset.attrs}
    known = found.get("known", {})
    if isinstance(known, str):
        try:
            known = json.loads(known)
        except ValueError:
            known = None
    if not isinstance(known, dict):
        raise uqmbd.StudyError(
            f"{where}: the attribute known is {short(found['known'])}; expected a JSON object such as "
            '{"speed": 10.0}, from inputs to their values.'
        )
    return {**found, "known": known}


def dataset_of(name: str, machine: str, known: Mapping[str, float], series: Sequence[Series]) -> xr.Dataset:
    """Return the dataset of a record; outputs with equal times share a dimension."""
    import xarray as xr

    taken = {one.output for one in series}
    dimensions: dict[bytes, str] = {}
    made = xr.Dataset(attrs={"name": name, "machine": machine, "known": json.dumps(dict(known))})
    for one in series:
        key = b"repetition %d" % one.values.size if one.timeless else one.times.tobytes()
        if key not in dimensions:
            dimensions[key] = _free("time" if not one.timeless else REPETITION, one, taken)
            taken.add(dimensions[key])
        dimension = dimensions[key]
        attributes = {"units": one.units} | ({} if one.noise is None else {"noise": one.noise})
        times = {} if one.timeless else {dimension: (dimension, one.times, {"units": "s"})}
        made = made.assign_coords(times).assign({one.output: (dimension, one.values, attributes)})
    return made


def _free(wanted: str, series: Series, taken: set[str]) -> str:
    """Return an unused name for a dimension."""
    name = wanted if wanted not in taken else f"{wanted} of {series.output}"
    while name in taken:
        name += "'"
    return name
