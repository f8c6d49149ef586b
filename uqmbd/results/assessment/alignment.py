"""Restrict results of different runs to their common outputs and times, without interpolation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.schema import node_parts

__all__ = ["align"]

SAME_TIME = 1e-9
"""Difference of times, relative to the whole duration, below which times count as equal."""

_TIMELESS = "scalars"


@typechecked
def align(nodes: Mapping[str, xr.DataTree]) -> tuple[dict[str, xr.DataTree], tuple[str, ...]]:
    """Restrict results of different runs to their common outputs and times, including common scalar outputs.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label; at least one.

    Returns
    -------
    aligned : dict of str to xarray.DataTree
        Nodes at the common times and outputs, in the order of the first node. Other contents remain. The child
        ``scalars`` contains the scalar outputs that are common to all methods with scalar outputs.
    notes : tuple of str
        Sentences about omitted checks; may be empty.

    Raises
    ------
    StudyError
        If there are no nodes, no common outputs, or no common times.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> def node(times):
    ...     statistics = statistics_dataset(labels(["x"], [], times), mean=[times], std=[times])
    ...     return propagator_node("a", statistics, propagator="p", realisations=1, wall_time=0.0)
    >>> aligned, notes = align({"a": node([0.0, 1.0, 2.0]), "b": node([0.0, 0.5, 1.0])})
    >>> aligned["b"]["statistics"]["time"].values.tolist(), notes
    ([0.0, 1.0], ('Only 2 times are common to all results (a has 3, b has 3). Nothing was interpolated.',))
    """
    if not nodes:
        raise StudyError("A comparison needs the result of at least one propagator; no result is given.")
    statistics = _statistics(nodes)
    timeless = _statistics(
        {label: node.children[_TIMELESS] for label, node in nodes.items() if _TIMELESS in node.children}
    )
    outputs, notes = _common_outputs(statistics)
    scalars, more = _common_outputs(timeless)
    notes += more
    if not outputs and not scalars:
        text = "; ".join(
            f"{label}: {', '.join(_names(data) + (_names(timeless[label]) if label in timeless else []))}"
            for label, data in statistics.items()
        )
        raise StudyError(f"No output occurs in all of these results with the same name and units: {text}.")
    where, more = _common_times(statistics)
    aligned = {label: _restricted(node, label, outputs, scalars, where[label]) for label, node in nodes.items()}
    return aligned, (*notes, *more)


def _statistics(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.Dataset]:
    return {label: node.children["statistics"].to_dataset() for label, node in nodes.items()}


def _names(data: xr.Dataset) -> list[str]:
    return [str(name) for name in data["output"].values]


def _common_outputs(statistics: Mapping[str, xr.Dataset]) -> tuple[list[str], list[str]]:
    if not statistics:
        return [], []
    first = next(iter(statistics.values()))
    names = {label: _names(data) for label, data in statistics.items()}
    shared = [name for name in _names(first) if all(name in other for other in names.values())]
    units = {
        label: dict(zip(names[label], map(str, data["output_units"].values), strict=True))
        for label, data in statistics.items()
    }
    notes = []
    for name in list(shared):
        given = {label: units[label][name] for label in statistics}
        if len(set(given.values())) > 1:
            text = ", ".join(f"{unit or 'none'} in {label}" for label, unit in given.items())
            notes.append(f"The comparison omits output {name}, because its units differ ({text}).")
            shared.remove(name)
    left = list(dict.fromkeys(n for other in names.values() for n in other if any(n not in o for o in names.values())))
    if left:
        notes.append(f"The comparison omits outputs that are not in all results: {', '.join(left)}.")
    return shared, notes


def _common_times(
    statistics: Mapping[str, xr.Dataset],
) -> tuple[dict[str, NDArray[np.intp] | None], list[str]]:
    timed = ["time" in data["mean"].dims for data in statistics.values()]
    if not any(timed):
        return dict.fromkeys(statistics), []
    if not all(timed):
        raise StudyError(
            "Some of these results are over time and others are not, so a comparison is not possible. Compare "
            "results of one kind."
        )
    times = {label: np.asarray(data["time"].values, dtype=float) for label, data in statistics.items()}
    first = next(iter(times.values()))
    near = SAME_TIME * max(float(max(t[-1] for t in times.values()) - min(t[0] for t in times.values())), 1e-300)
    common = first
    for other in times.values():
        common = common[np.abs(common[:, None] - other[None, :]).min(axis=1) <= near]
    if not len(common):
        text = ", ".join(f"{label} from {t[0]:g} s to {t[-1]:g} s ({len(t)})" for label, t in times.items())
        raise StudyError(f"These results have no time in common: {text}. Use the same times in both studies.")
    where = {label: np.abs(t[None, :] - common[:, None]).argmin(axis=1) for label, t in times.items()}
    if all(len(t) == len(common) for t in times.values()):
        return dict(where), []
    text = ", ".join(f"{label} has {len(t)}" for label, t in times.items())
    count = f"{len(common)} times are" if len(common) > 1 else "1 time is"
    return dict(where), [f"Only {count} common to all results ({text}). Nothing was interpolated."]


def _restricted(
    node: xr.DataTree, label: str, outputs: list[str], scalars: list[str], where: NDArray[np.intp] | None
) -> xr.DataTree:
    times = node.children["statistics"].sizes.get("time", 0)
    datasets: dict[str, xr.Dataset] = {}
    for path, data in node_parts(node).items():
        timeless = path.split("/")[0] == _TIMELESS
        if timeless and not scalars:
            continue
        if "output" in data.dims and "output" in data.coords:
            data = _only(data, scalars if timeless else outputs)
        if where is not None and data.sizes.get("time") == times and not timeless:
            data = data.isel(time=where)
        datasets[path] = data
    datasets["/"] = datasets["/"].assign_attrs(label=label)
    if _TIMELESS in datasets:
        datasets[_TIMELESS] = datasets[_TIMELESS].assign_attrs(label=label)
    made = xr.DataTree.from_dict(datasets, name=label)
    return _at_common_times(made, where)


def _only(data: xr.Dataset, outputs: list[str]) -> xr.Dataset:
    """Select the outputs that the dataset contains; the dataset of a child may lack some of them."""
    known = _names(data)
    return data.isel(output=[known.index(output) for output in outputs if output in known])


def _at_common_times(node: xr.DataTree, where: NDArray[np.intp] | None) -> xr.DataTree:
    """Update the attribute ``ends_at``, the last time with results, after a selection of times."""
    if where is not None and "ends_at" in node.attrs:
        statistics = node.children["statistics"].to_dataset()
        known = np.isfinite(statistics["mean"].values).all(axis=0)
        if known.all():
            del node.attrs["ends_at"]
        elif known.any():
            node.attrs["ends_at"] = float(statistics["time"].values[known].max())
    return node
