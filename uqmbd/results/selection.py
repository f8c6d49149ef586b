"""Select one output of results with its unit, or convert results to one variable for each output."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, overload

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean
from uqmbd.results.schema import CF, output_places, propagator_nodes, united

__all__ = ["by_output", "output"]

RESPONSE = "response"
"""Name of the variable that contains values of the outputs instead of statistics."""

_OF_OUTPUTS = (
    "output_units",
    "output_angle",
    "output_series",
    "output_position",
    "output_axis",
    "output_axis_units",
)


@overload
def output(data: xr.DataArray, name: str, *, input: str | None = None) -> xr.DataArray: ...


@overload
def output(data: xr.Dataset | xr.DataTree, name: str, *, input: str | None = None) -> xr.Dataset: ...


@typechecked
def output(
    data: xr.Dataset | xr.DataTree | xr.DataArray, name: str, *, input: str | None = None
) -> xr.Dataset | xr.DataArray:
    """Return one output of results, with its unit in the attributes of each variable.

    Parameters
    ----------
    data : xarray.DataTree, xarray.Dataset or xarray.DataArray
        Result of a study, node of a method, one of its datasets, return value of :func:`uqmbd.simulate`, or variable
        along ``output``. For the result of a study, the statistics of all methods are used, with a dimension
        ``propagator`` (labels). For a node, its ``statistics`` are used, including the statistics of scalar outputs.
    name : str
        Name of the output, or of a series of scalar outputs, such as spectral densities. A series has its axis as a
        dimension, such as ``frequency``.
    input : str, optional
        Name of the input to select in variables along ``input``, such as Sobol' indices and derivatives.

    Returns
    -------
    xarray.Dataset, or xarray.DataArray of one
        The output, without the dimension ``output``; a DataArray if `data` is one. Each variable has ``long_name`` and,
        if known, ``units``, with which ``.plot()`` labels its axes. Derivatives have units if `input` is given.

    Raises
    ------
    StudyError
        If there is no such output or input.

    Examples
    --------
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> data = statistics_dataset(labels([("x", "m"), ("F", "N")], [], [0.0]), mean=[[0.0], [1.0]], std=[[1.0], [2.0]])
    >>> found = output(data, "F")
    >>> found["std"].item(), found["std"].attrs["long_name"], found["std"].attrs["units"]
    (2.0, 'F: standard deviation', 'N')
    >>> found["variance"].attrs["units"], data["variance"].attrs.get("units", "several")
    ('N^2', 'several')
    """
    if isinstance(data, xr.DataArray):
        variable = str(data.name or RESPONSE)
        chosen = _chosen(data.to_dataset(name=variable), name, input)[variable]
        return chosen.rename(name) if variable == RESPONSE else chosen
    if isinstance(data, xr.Dataset):
        return _chosen(data, name, input)
    if "statistics" in data.children:
        return _chosen(_with_output(data, name), name, input)
    nodes = propagator_nodes(data)
    if data.data_vars or not all("statistics" in node.children for node in nodes.values()):
        return _chosen(data.to_dataset(), name, input)
    having = {label: one for label, node in nodes.items() if (one := _having(node, name)) is not None}
    if not having:
        raise _unknown("output", name, (x for node in nodes.values() for one in _statistics(node) for x in _names(one)))
    known = [x for one in having.values() for x in _names(one, "input")]
    if input is not None and input not in known:
        raise _unknown("input", input, known)
    found = {label: _chosen(one, name, input if "input" in one.coords else None) for label, one in having.items()}
    methods = xr.DataArray(np.array(list(found), dtype=np.str_), dims="propagator", name="propagator")
    joined: xr.Dataset = xr.concat(
        list(found.values()),
        dim=methods,
        data_vars="all",
        coords="minimal",
        compat="override",
        join="outer",
        combine_attrs="drop_conflicts",
    )
    return joined


@typechecked
def by_output(data: xr.Dataset | xr.DataTree | xr.DataArray, variable: str = "mean") -> xr.Dataset:
    """Return a variable of results as one variable for each output, in the form of :func:`uqmbd.simulate`.

    Parameters
    ----------
    data : xarray.DataTree, xarray.Dataset or xarray.DataArray
        Node of a method, one of its datasets, or a variable along ``output``. A node also gives its scalar outputs,
        without the dimension ``time``.
    variable : str
        Name of a variable of the statistics or the dataset, such as ``mean`` or ``response``. Not needed for a
        DataArray.

    Returns
    -------
    xarray.Dataset
        One variable for each output, with the attribute ``units`` of the CF conventions, which pint-xarray reads. A
        dimension with the name of an output gets an underscore.

    Raises
    ------
    StudyError
        If there is no such variable along ``output``.

    Examples
    --------
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> data = statistics_dataset(labels([("x", "m"), ("F", "N")], [], [0.0]), mean=[[0.0], [1.0]], std=[[1.0], [2.0]])
    >>> {name: (one.dims, one.attrs["units"]) for name, one in by_output(data, "std").items()}
    {'x': (('time',), 'm'), 'F': (('time',), 'N')}
    """
    if isinstance(data, xr.DataArray):
        parts = [data]
    elif isinstance(data, xr.DataTree) and "statistics" in data.children:
        parts = [one[variable] for one in _statistics(data) if variable in one]
    else:
        dataset = data.to_dataset() if isinstance(data, xr.DataTree) else data
        parts = [dataset[variable]] if variable in dataset.variables else []
    parts = [part for part in parts if "output" in part.dims]
    if not parts:
        raise StudyError(
            f"The dataset has no variable {variable!r} with the dimension 'output'; expected e.g. 'mean' of statistics."
        )
    names = [name for part in parts for name in _names(part)]
    taken = {str(dim): f"{dim}_" for part in parts for dim in part.dims if str(dim) in names}
    found = {}
    for part in parts:
        for name in _names(part):
            one = output(part, name).drop_vars("output")
            found[name] = one.rename({x: new for x, new in taken.items() if x in one.dims}).rename(name)
    return xr.Dataset(found, attrs={"Conventions": CF})


def _statistics(node: xr.DataTree) -> list[xr.Dataset]:
    """Return the statistics of a method, for outputs over time and for scalar outputs."""
    inner = [node, *([node.children["scalars"]] if "scalars" in node.children else [])]
    return [one.children["statistics"].to_dataset() for one in inner if "statistics" in one.children]


def _having(node: xr.DataTree, name: str) -> xr.Dataset | None:
    return next((one for one in _statistics(node) if name in _names(one) or name in _series(one)), None)


def _series(data: xr.Dataset) -> list[str]:
    """Return the names of the series of outputs."""
    return (
        list(dict.fromkeys(place.series for place in output_places(data) if place)) if "output" in data.coords else []
    )


def _with_output(node: xr.DataTree, name: str) -> xr.Dataset:
    found = _having(node, name)
    if found is None:
        raise _unknown("output", name, (x for one in _statistics(node) for x in _names(one)))
    return found


def _names(data: xr.Dataset | xr.DataArray, kind: str = "output") -> list[str]:
    return [str(x) for x in np.atleast_1d(data[kind].values)] if kind in data.coords else []


def _unknown(kind: str, name: str, known: Iterable[str]) -> StudyError:
    listed = list(dict.fromkeys(known))
    there = ", ".join(map(repr, listed)) or "none"
    return StudyError(f"There is no {kind} {name!r}; there are: {there}{did_you_mean(str(name), listed)}.")


def _chosen(data: xr.Dataset, name: str, input: str | None) -> xr.Dataset:
    """Select an output, and add its name and unit to each variable."""
    if name in data.data_vars and "output" not in data[name].dims:  # one variable for each output
        return _motion(data, name)
    if name in _series(data) and "output" in data.dims:
        return _chosen_series(data, name, input)
    if name not in _names(data):
        raise _unknown("output", name, [*_names(data), *_series(data)])
    of_output = [str(key) for key, one in data.data_vars.items() if "output" in one.dims or "output" not in data.dims]
    found = data.sel(output=name) if "output" in data.dims else data
    if input is not None:
        if input not in _names(data, "input"):
            raise _unknown("input", input, _names(data, "input"))
        found = found.sel(input=input) if "input" in found.dims else found
    found = united(found)
    for key in of_output:
        one = found[key]
        words = str(one.attrs.get("long_name", key))
        one.attrs |= {"long_name": name if key == RESPONSE else f"{name}: {words}"}
    turn = found.coords.get("output_angle")
    if turn is not None and float(turn) and RESPONSE in found:
        found[RESPONSE].attrs["turn"] = float(turn)
    attributes: dict[str, Any] = {"Conventions": CF} if all(_has_unit(one) for one in found.data_vars.values()) else {}
    return found.drop_vars([x for x in _OF_OUTPUTS if x in found.coords]).assign_attrs(attributes)


def _chosen_series(data: xr.Dataset, name: str, input: str | None) -> xr.Dataset:
    """Select a series of outputs, and join its outputs along its axis."""
    places = {str(x): place for x, place in zip(data["output"].values, output_places(data), strict=True)}
    own = {x: place for x, place in places.items() if place and place.series == name}
    axis, units = next((place.axis, place.units) for place in own.values())
    positions = xr.DataArray([place.position for place in own.values()], dims=axis, name=axis, attrs={"units": units})
    parts = [_chosen(data, x, input).drop_vars("output") for x in own]
    found: xr.Dataset = xr.concat(parts, dim=positions, combine_attrs="override")
    first = next(iter(own))
    for one in found.data_vars.values():
        one.attrs["long_name"] = str(one.attrs.get("long_name", "")).replace(first, name)
    return found


def _motion(data: xr.Dataset, name: str) -> xr.Dataset:
    """Select an output, with its integration error, from a dataset with one variable for each output."""
    kind = next((dim for dim in ("output", "scalar") if dim in data.coords and name in data[dim].values), None)
    if kind is None:
        return data[[name]]
    found = data.sel({kind: name})[[name]].drop_vars([kind, f"{kind}_units"], errors="ignore")
    for key, coord in found.coords.items():
        if kind in data[key].dims and "units" in found[name].attrs:
            coord.attrs = {**coord.attrs, "units": found[name].attrs["units"]}
    return found


def _has_unit(variable: xr.DataArray) -> bool:
    """Return whether a variable has a unit or needs none, because it contains texts, integers or truth values."""
    return variable.dtype.kind != "f" or "units" in variable.attrs
