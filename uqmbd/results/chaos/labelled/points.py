"""Convert data with names of inputs to points at which a surrogate is evaluated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean
from uqmbd.results.schema import InputInfo
from uqmbd.typing import Array

__all__ = ["TableLike", "Named", "Points", "points_of"]

POINT = "point"
"""Name of the dimension of points if the data have none."""

_TAKEN = frozenset({"output", "output_units", "output_angle", "time", "input", "input_units", "input_description"})
"""Names of dimensions and coordinates that results use."""


class TableLike(Protocol):
    """Table with named columns, such as a data frame of pandas."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    @property
    def index(self) -> Any:
        """Labels of the rows."""

    def __getitem__(self, key: Any, /) -> Any: ...


Named: TypeAlias = Mapping[Any, Any] | TableLike
"""Inputs by name, in a mapping such as `xarray.Dataset`, or in a table."""


@dataclass(frozen=True)
class Points:
    """Points with named dimensions."""

    values: Array  # (K, d) inputs, in their order and units
    sizes: Mapping[str, int]  # sizes of the dimensions of the points; their product is K
    coords: Mapping[str, Any]  # coordinates of `xarray.DataArray` along the dimensions, and values of the inputs


def points_of(
    inputs: ArrayLike | Named | xr.DataArray | None, values: Mapping[str, Any], infos: Sequence[InputInfo]
) -> Points | None:
    """Return points from inputs by name, or None for a plain array.

    `inputs`: None if keywords are given; `values`: keywords with numbers, lists of equal length, or xarray arrays with
    separate dimensions; `infos`: inputs of the surrogate. Raise StudyError if an input is missing, unknown, given twice
    or has another unit, or if shapes do not match.

    >>> infos = (InputInfo("k", "N/m"), InputInfo("c"))
    >>> points = points_of(None, {"c": 0.5, "k": [1.0, 2.0]}, infos)
    >>> points.values.tolist(), points.sizes
    ([[1.0, 0.5], [2.0, 0.5]], {'point': 2})
    """
    if inputs is not None and values:
        raise StudyError(
            f"Inputs are given twice, as an array and by name ({', '.join(values)}); expected only one "
            "of the two forms."
        )
    names = [info.name for info in infos]
    given: dict[str, Any]
    coordinates: dict[str, Any] = {}
    if inputs is None:
        given = dict(values)
    elif isinstance(inputs, xr.DataArray):
        if "input" not in inputs.dims:
            return None
        given = _columns(inputs, names)
    elif isinstance(inputs, xr.Dataset):
        given = {name: inputs[name] for name in names if name in inputs.coords}
        given |= {str(name): one for name, one in inputs.data_vars.items()}
    elif isinstance(inputs, Mapping):
        given = {str(name): value for name, value in inputs.items()}
    elif hasattr(inputs, "columns") and hasattr(inputs, "index"):
        given, coordinates = _of_frame(inputs)
    else:
        return None
    _check_names(given, names)
    arrays = [_array(given[info.name], info) for info in infos]
    return _together(arrays, infos, coordinates)


def _check_names(given: Iterable[str], names: Sequence[str]) -> None:
    for name in given:
        if name not in names:
            raise StudyError(
                f"The surrogate has no input {name!r}; the inputs are: "
                f"{', '.join(names)}{did_you_mean(str(name), names)}."
            )
    if missing := [name for name in names if name not in set(given)]:
        raise StudyError(
            f"Values of {', '.join(missing)} are missing; expected one for each input: {', '.join(names)}. Inputs "
            "have no default value; to fix an input, pass a value such as its mean."
        )


def _columns(inputs: xr.DataArray, names: Sequence[str]) -> dict[str, Any]:
    """Split an array along its dimension ``input``; entries without names are in the order of the inputs."""
    if "input" not in inputs.coords:
        if inputs.sizes["input"] != len(names):
            raise StudyError(
                f"The dimension 'input' has {inputs.sizes['input']} entries without names; expected {len(names)}: "
                f"{', '.join(names)}."
            )
        inputs = inputs.assign_coords(input=list(names))
    known = [str(name) for name in inputs["input"].values]
    if twice := _duplicates(known):
        raise StudyError(f"The coordinate 'input' contains {twice} more than once; expected each input once.")
    found = {}
    for k, name in enumerate(known):
        one = inputs.isel(input=k)
        units = one.coords.get("input_units")
        one = one.drop_vars([x for x in one.coords if "input" in inputs[x].dims])
        one.attrs = {} if units is None else {"units": str(units.values)}
        found[name] = one
    return found


def _duplicates(names: Sequence[str]) -> str:
    """Return the names that occur more than once, as text."""
    return ", ".join(repr(name) for name, count in Counter(names).items() if count > 1)


def _of_frame(frame: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split a table into columns; rows are points, and a named index becomes a coordinate."""
    columns = [str(name) for name in frame.columns]
    if twice := _duplicates(columns):
        raise StudyError(f"The table contains {twice} more than once; expected each column once.")
    index = frame.index
    named = getattr(index, "nlevels", 1) == 1 and index.name is not None
    dim = str(index.name) if named else POINT
    values = {
        name: xr.DataArray(np.asarray(frame[key], dtype=float), dims=dim)
        for name, key in zip(columns, frame.columns, strict=True)
    }
    return values, {dim: (dim, np.asarray(index))} if named else {}


def _array(value: Any, info: InputInfo) -> xr.DataArray:
    if isinstance(value, (xr.DataArray, xr.Variable)):
        found = value if isinstance(value, xr.DataArray) else xr.DataArray(value)
        units = str(found.attrs.get("units", ""))
        if units and info.units and units.strip() != info.units.strip():
            raise StudyError(
                f"Input {info.name!r} has the units {units!r}; expected {info.units!r}. Convert its values, or "
                "delete the attribute 'units'."
            )
        for dim in map(str, found.dims):
            if dim in _TAKEN:
                raise StudyError(
                    f"Input {info.name!r} has the dimension {dim!r}, whose name is reserved for "
                    "results; rename the dimension."
                )
        try:
            return found.astype(float)
        except (TypeError, ValueError):
            raise StudyError(f"Input {info.name!r} has values of the type {found.dtype}; expected numbers.") from None
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise StudyError(f"Input {info.name!r} is {value!r}; expected a number, or a list of numbers.") from None
    if numbers.ndim > 1:
        raise StudyError(
            f"Input {info.name!r} has the shape {numbers.shape}; expected a number, a list, or an xarray.DataArray "
            "with named dimensions."
        )
    return xr.DataArray(numbers, dims=(POINT,)[: numbers.ndim])


def _together(arrays: Sequence[xr.DataArray], infos: Sequence[InputInfo], coordinates: Mapping[str, Any]) -> Points:
    """Broadcast inputs to common dimensions, and merge their coordinates."""
    for dim in dict.fromkeys(str(dim) for one in arrays for dim in one.dims):
        sizes = {info.name: one.sizes[dim] for one, info in zip(arrays, infos, strict=True) if dim in one.dims}
        if len(set(sizes.values())) > 1:
            text = ", ".join(f"{name}: {size}" for name, size in sizes.items())
            raise StudyError(
                f"Inputs have different numbers of values along {dim!r} ({text}). Expected equal numbers, single "
                "values, or xarray arrays with different dimensions, whose combinations are evaluated."
            )
    try:
        aligned = xr.align(*arrays, join="exact")
    except ValueError as error:
        raise StudyError(f"Coordinates of the inputs differ: {error}.") from error
    wide = xr.broadcast(*aligned)
    sizes = {str(dim): size for dim, size in wide[0].sizes.items()}
    values = np.stack([one.values.ravel() for one in wide], axis=1) if infos else np.zeros((1, 0))
    coords: dict[str, Any] = dict(coordinates)
    for one in aligned:
        coords |= {
            str(key): coord.variable
            for key, coord in one.coords.items()
            if key not in _TAKEN and key not in coords and key not in {info.name for info in infos}
        }
    for one, info in zip(aligned, infos, strict=True):
        attrs = {"long_name": info.name, **({"units": info.units} if info.units else {})}
        name, own = info.name, one.dims == (info.name,)
        if own and name in one.coords and not np.array_equal(one.coords[name].values, one.values):
            coords[name], own = one.coords[name].variable, False
        while not own and (name in coords or name in sizes or name in _TAKEN):
            name += "_"
        coords[name] = (tuple(map(str, one.dims)), one.values, attrs)
    return Points(values, sizes, coords)
