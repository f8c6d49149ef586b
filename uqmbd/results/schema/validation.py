"""Check a result against the schema, with messages for the author of a propagator."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.schema.datasets import CHILDREN, KIND, check_kind, check_version
from uqmbd.results.schema.nodes import comparable, propagator_nodes
from uqmbd.results.schema.values import INTEGRATION_ERRORS, check_probabilities, check_values, place_of
from uqmbd.status import Status
from uqmbd.typing import Array

__all__ = ["validate"]

_OVER_TIME = ("output", "time")
_PLAIN = ("mean", "std", "variance", "skewness", "kurtosis")
_OPTIONAL = ("std_error_mean", "std_error_std", "variance_reduction", "variance_reduction_std")
_EXTREMES = ("smallest", "largest")
_CIRCULAR = ("circular_mean", "circular_std")
_BY_INPUT = ("sobol_first", "sobol_total")
_INTERVALS = {"sobol_first_interval": "input", "sobol_total_interval": "input", "quantile_interval": "probability"}
_REASONS = 2
"""First version of the schema in which each NaN has a reason."""
_COMPARED = ("mean_difference_max", "std_difference_max", "mean_difference_l2", "std_difference_l2")
_TIMELESS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "statistics": {name: ("output",) for name in (*_PLAIN, *INTEGRATION_ERRORS)}
    | {"quantile": ("probability", "output")},
    "samples": {"response": ("sample", "output"), "inputs": ("sample", "input"), "status": ("sample",)},
    "chaos": {"multi_index": ("term", "input")},
}
_OF_TERM = ("element", "term", "output")
_WITHOUT_TIME: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "aligned": {
        "edge_coefficients": ("element", "term", "edge"),
        "segment_coefficients": ("element", "term", "segment", "output", "power"),
        "segments": ("element",),
    },
    "quasi_periodic": {
        "frequency_coefficients": ("element", "term", "base"),
        "constant_coefficients": _OF_TERM,
        "drift_coefficients": _OF_TERM,
        "cosine_coefficients": (*_OF_TERM, "harmonic"),
        "sine_coefficients": (*_OF_TERM, "harmonic"),
        "harmonics": ("harmonic", "base"),
    },
}
"""Variables of surrogates with coefficients that do not belong to outputs at times."""
_TEXT_ATTRS = ("propagator", "label", "uqmbd_version", "versions", "options", "solver_counters", "created")
_JSON_ATTRS = ("versions", "options", "solver_counters")


@typechecked
def validate(tree: xr.DataTree) -> None:
    """Check that a result, or the node of one propagator, follows the schema.

    Children and variables outside the schema are allowed.

    Parameters
    ----------
    tree : xarray.DataTree
        Result of a study, or node of one propagator (recognised by its child ``statistics``).

    Raises
    ------
    StudyError
        At the first violation. The message states its path in the tree, the value, and the expected value.

    Examples
    --------
    >>> import xarray
    >>> validate(xarray.DataTree.from_dict({"monte-carlo/statistics": xarray.Dataset()}))
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: /: attribute 'study' is missing; expected a text.
    """
    if "statistics" in tree.children:
        _validate_node(tree, tree.attrs.get("label"), before=tree.root.attrs.get("schema_version", _REASONS) < _REASONS)
        return
    check_version(tree.attrs, tree.path)
    before = tree.attrs.get("schema_version", 0) < _REASONS
    _text_attrs(tree, ("study", "mechanism"))
    nodes = propagator_nodes(tree)
    _require(bool(nodes), tree.path, "no propagator's node", "at least one")
    for label, node in nodes.items():
        _require("statistics" in node.children, node.path, "no child 'statistics'", "one")
        _validate_node(node, label, before=before)
    _require("comparison" in tree.children, tree.path, "no child 'comparison'", "one")
    if "failed" in tree.attrs:
        _require(
            _is_object(tree.attrs["failed"]), "/", f"attribute 'failed' = {tree.attrs['failed']!r}", "a JSON object"
        )
    if "problem" not in tree.children["comparison"].attrs:
        _validate_comparison(tree.children["comparison"], list(comparable(nodes)))


def _require(condition: bool | np.bool, path: str, found: str, expected: str) -> None:
    if not condition:
        raise StudyError(f"{path}: found {found}; expected {expected}.")


def _text_attrs(node: xr.DataTree, names: tuple[str, ...]) -> None:
    for name in names:
        value = node.attrs.get(name)
        if not isinstance(value, str):
            found = "is missing" if value is None else f"is {value!r}"
            raise StudyError(f"{node.path}: attribute {name!r} {found}; expected a text.")


def _is_object(text: object) -> bool:
    try:
        return isinstance(text, str) and isinstance(json.loads(text), dict)
    except ValueError:
        return False


def _validate_node(node: xr.DataTree, label: object, *, before: bool) -> None:
    """Check the node of a propagator; `before`: whether the schema is before version 2, without reasons for NaN."""
    _text_attrs(node, _TEXT_ATTRS)
    _require(node.attrs["label"] == label, node.path, f"attribute 'label' = {node.attrs['label']!r}", f"{label!r}")
    for name in _JSON_ATTRS:
        _require(_is_object(node.attrs[name]), node.path, f"attribute {name!r} = {node.attrs[name]!r}", "a JSON object")
    for name in ("realisations", "failures"):
        value = node.attrs.get(name)
        usable = isinstance(value, (int, np.integer)) and not isinstance(value, bool) and value >= 0
        _require(usable, node.path, f"attribute {name!r} = {value!r}", "a whole number, not negative")
    seconds = node.attrs.get("wall_time")
    usable = isinstance(seconds, (int, float, np.number)) and float(seconds) >= 0
    _require(usable, node.path, f"attribute 'wall_time' = {seconds!r}", "seconds, not negative")

    statistics = node.children["statistics"]
    end = _end(node, statistics)
    _validate_statistics(statistics, end, before)
    children = [name for name in CHILDREN if name in node.children]
    # methods may store children ``nodes`` of another layout, which have no kind
    children = [name for name in children if name == "samples" or KIND in node.children[name].attrs]
    for name in children:
        if KIND in node.children[name].attrs:
            check_kind(node.children[name].to_dataset(), name, node.path)
        _validate_samples(node.children[name], statistics, "sample" if name == "samples" else "node")
    if children and "samples_kept" not in node.attrs:
        count = sum(_failed(node.children[name]) for name in children)
        _require(
            count == node.attrs["failures"],
            node.path,
            f"attribute 'failures' = {node.attrs['failures']}",
            f"{count}, the number of {' and '.join(children)} that failed by their status",
        )
    names = statistics.coords["output"].values
    _validate_surrogates(node, statistics, end, names)
    if "composed" in node.children:
        _validate_composed(node.children["composed"], statistics, end, names)
    for name, check in (("scalars", _validate_timeless), ("requirements", _validate_requirements)):
        if name in node.children:
            check(node.children[name], before)


def _end(node: xr.DataTree, statistics: xr.DataTree) -> float:
    """Return the time (s) up to which there are results: attribute ``ends_at``, else infinity."""
    end = node.attrs.get("ends_at", np.inf)
    usable = isinstance(end, (int, float, np.number)) and not isinstance(end, bool) and not np.isnan(end)
    _require(usable, node.path, f"attribute 'ends_at' = {end!r}", "the last time with results, s")
    if "ends_at" in node.attrs:
        known = "time" in statistics.coords and float(end) in statistics.coords["time"].values
        _require(known, node.path, f"attribute 'ends_at' = {end!r}", "one of the times")
    return float(end)


def _dims(node: xr.DataTree, name: str, dims: tuple[str, ...]) -> None:
    shown = f"({', '.join(dims)})"
    _require(name in node.data_vars, node.path, f"no variable {name!r}", f"one with the dimensions {shown}")
    found = tuple(map(str, node[name].dims))
    _require(found == dims, f"{node.path}/{name}", f"the dimensions ({', '.join(found)})", shown)


def _text_coord(node: xr.DataTree, name: str, dim: str) -> None:
    _require(name in node.coords, node.path, f"no coordinate {name!r}", f"one of texts along {dim!r}")
    coord = node.coords[name]
    _require(coord.dims == (dim,), f"{node.path}/{name}", f"the dimensions {coord.dims}", f"({dim!r},)")
    is_text = all(isinstance(value, str) for value in coord.values.tolist())
    _require(is_text, f"{node.path}/{name}", f"the type {coord.dtype}", "texts")


def _angles(node: xr.DataTree) -> None:
    """Check the coordinate of angles; a result without angles may lack it."""
    if "output_angle" not in node.coords:
        return
    coord = node.coords["output_angle"]
    _require(coord.dims == ("output",), f"{node.path}/output_angle", f"the dimensions {coord.dims}", "('output',)")
    usable = coord.dtype.kind in "fiu" and bool(np.all(np.isfinite(coord.values) & (coord.values >= 0)))
    _require(usable, f"{node.path}/output_angle", f"{coord.values}", "lengths of a turn, or 0 if it is no angle")


def _increasing(node: xr.DataTree, name: str) -> None:
    _require(name in node.coords, node.path, f"no coordinate {name!r}", "one")
    values = node.coords[name].values
    usable = values.dtype.kind in "fiu" and bool(np.all(np.isfinite(values)) and np.all(np.diff(values) > 0))
    _require(
        usable, f"{node.path}/{name}", "values that are not all finite and increasing", "finite, increasing numbers"
    )


def _not_finite(values: xr.DataArray) -> xr.DataArray:
    return values.copy(data=~np.isfinite(values.values))


def _values(node: xr.DataTree, name: str, bad: xr.DataArray, found: str, expected: str) -> None:
    if bool(bad.any()):
        raise StudyError(f"{node.path}/{name}: found {found} at {place_of(bad)}; expected {expected}.")


def _validate_statistics(node: xr.DataTree, end: float, before: bool) -> None:
    for name in _PLAIN:
        _dims(node, name, _OVER_TIME)
    for name in (n for n in ("quantile", "quantile_error") if n == "quantile" or n in node.data_vars):
        _dims(node, name, ("probability", *_OVER_TIME))
    for name in (n for n in (*_OPTIONAL, *_EXTREMES, *_CIRCULAR, *INTEGRATION_ERRORS) if n in node.data_vars):
        _dims(node, name, _OVER_TIME)
    for name in (n for n in _BY_INPUT if n in node.data_vars):
        _dims(node, name, ("input", *_OVER_TIME))
        _text_coord(node, "input", "input")
    for name in (n for n in _INTERVALS if n in node.data_vars):
        _validate_interval(node, name)
    _text_coord(node, "output", "output")
    _text_coord(node, "output_units", "output")
    _angles(node)
    _increasing(node, "time")
    _increasing(node, "probability")
    levels = node.coords["probability"].values
    _require(
        bool(np.all((levels >= 0) & (levels <= 1))), f"{node.path}/probability", f"{levels}", "numbers from 0 to 1"
    )

    whole = node.to_dataset()
    later = whole.sel(time=whole["time"] > end)
    for name in (*_PLAIN, *(n for n in (*_OPTIONAL, *INTEGRATION_ERRORS) if n in later)):
        _values(node, name, later[name].notnull(), "a number after the end of the results", "NaN after 'ends_at'")
    check_values(whole, node.path, end=end, before=before)


def _validate_interval(node: xr.DataTree, name: str) -> None:
    _dims(node, name, ("bound", _INTERVALS[name], "output", "time"))
    ends = node.coords["bound"].values.tolist() if "bound" in node.coords else []
    _require(ends == ["lower", "upper"], f"{node.path}/bound", f"{ends}", "['lower', 'upper']")


def _failed(node: xr.DataTree) -> int:
    """Return the number of failed realisations; a realisation without an event has not failed."""
    return int((~node.to_dataset()["status"].isin([Status.OK, Status.CENSORED])).sum())


def _validate_samples(node: xr.DataTree, statistics: xr.DataTree, row: str) -> None:
    _dims(node, "response", (row, "output", "time"))
    _dims(node, "inputs", (row, "input"))
    _dims(node, "status", (row,))
    _dims(node, "message", (row,))
    for name, dim in {"output": "output", "output_units": "output", "input": "input", "input_units": "input"}.items():
        _text_coord(node, name, dim)
    _angles(node)
    for name in ("output", "time"):
        same = np.array_equal(node.coords[name].values, statistics.coords[name].values)
        _require(same, f"{node.path}/{name}", "a coordinate other than that of 'statistics'", "the same")
    status = node.to_dataset()["status"]
    _require(status.dtype.kind in "iu", f"{node.path}/status", f"the type {status.dtype}", "whole numbers")
    known = np.atleast_1d(status.attrs.get("flag_values", [0]))
    _values(
        node, "status", ~status.isin(known), "a number that 'flag_values' does not list", f"one of {known.tolist()}"
    )
    is_text = all(isinstance(value, str) for value in node.to_dataset()["message"].values.tolist())
    _require(is_text, f"{node.path}/message", f"the type {node['message'].dtype}", "texts")
    response, failed = node.to_dataset()["response"], status != Status.OK
    fine = _not_finite(response) & ~failed
    _values(
        node, "response", fine.transpose(*response.dims), "a value that is not finite in a sample of status 0", "none"
    )
    filled = response.notnull() & failed
    _values(node, "response", filled.transpose(*response.dims), "a number in a failed sample", "NaN")


def _validate_surrogates(node: xr.DataTree, statistics: xr.DataTree, end: float, names: Array) -> None:
    """Check the surrogates of the outputs `names` in a node, or in a part of a composed surrogate."""
    times = statistics.coords["time"].values
    times = times[times <= end]
    if "chaos" in node.children:
        _validate_chaos(node.children["chaos"], names, times, end)
    if "surrogate" in node.children:  # a model of a plugin, which defines its own arrays
        _dims(node.children["surrogate"], "row_of_output", ("output",))
        _validate_axes(node.children["surrogate"], names, times, end)
    for kind in (name for name in _WITHOUT_TIME if name in node.children):
        part = node.children[kind]
        for name, dims in _WITHOUT_TIME[kind].items():
            _dims(part, name, dims)
        _validate_axes(part, names, times, end)
        _validate_degrees(part)
        data = part.to_dataset()
        for name in (str(n) for n in data.data_vars if str(n).endswith("_coefficients")):
            values = data[name]
            if name == "edge_coefficients":
                # elements of fewer segments have fewer edges
                values = values.where(
                    xr.DataArray(np.arange(values.sizes["edge"]), dims="edge") <= data["segments"], 0.0
                )
            _values(part, name, _not_finite(values), "a value that is not finite", "a number")
        for name in ("lower", "upper"):
            _dims(part, name, ("element", "input"))
        _values(part, "lower", ~(data["lower"] < data["upper"]), "a lower end that is not below 'upper'", "a box")
        for name in (x for x in ("verification_response", "verification_weights") if x in data):
            _dims(part, name, ("verification", *(_OVER_TIME if name == "verification_response" else ())))


def _validate_composed(node: xr.DataTree, statistics: xr.DataTree, end: float, names: Array) -> None:
    """Check the parts of a composed surrogate: each output is in one part at each time."""
    seen: dict[int, Array | int] = dict.fromkeys(range(len(names)), 0)  # parts of each output, over time
    for part in node.children.values():
        kinds = [name for name in ("chaos", "surrogate", *_WITHOUT_TIME) if name in part.children]
        _require(len(kinds) == 1, part.path, f"the surrogates {kinds}", "one")
        data = part.children[kinds[0]]
        _dims(data, "place", ("output",))
        place = data.to_dataset()["place"].values
        known = place.dtype.kind in "iu" and bool(np.all((place >= 0) & (place < len(names))))
        _require(known, f"{data.path}/place", f"{place}", "numbers of outputs of 'statistics'")
        _validate_surrogates(part, statistics, end, names[place])
        used = data.to_dataset().get("used")
        if used is not None:
            _dims(data, "used", _OVER_TIME)
            known = used.dtype.kind in "iu" and bool(np.isin(used.values, (0, 1)).all())
            _require(known, f"{data.path}/used", "other values", "0 or 1")
        for k, row in enumerate(place.tolist()):
            seen[row] = seen[row] + (1 if used is None else used.values[k])
    wrong = [names[row] for row, count in seen.items() if np.any(count != 1)]
    _require(not wrong, node.path, f"the outputs {wrong} in no part or in several", "one part at each time")


def _validate_axes(node: xr.DataTree, names: Array, times: Array, end: float) -> None:
    for name, dim in {"output": "output", "input": "input"}.items():
        if name in node.coords:
            _text_coord(node, name, dim)
    for name, expected in {"output": names, "time": times}.items():
        same = name not in node.coords or np.array_equal(node.coords[name].values, expected)
        condition = "the same" if name == "output" or np.isinf(end) else "the same up to 'ends_at'"
        _require(same, f"{node.path}/{name}", "a coordinate other than that of 'statistics'", condition)


def _validate_degrees(node: xr.DataTree) -> None:
    _dims(node, "multi_index", ("term", "input"))
    degrees = node.to_dataset()["multi_index"]
    _require(degrees.dtype.kind in "iu", f"{node.path}/multi_index", f"the type {degrees.dtype}", "whole numbers")
    _values(node, "multi_index", degrees < 0, "a negative degree", "none")


def _validate_chaos(node: xr.DataTree, names: Array, times: Array, end: float) -> None:
    # the first dimension of a chaos of elements is that of elements
    elements = ("element",) if "coefficients" in node.data_vars and "element" in node["coefficients"].dims else ()
    _dims(node, "coefficients", (*elements, "term", "output", "time"))
    _validate_axes(node, names, times, end)
    data = node.to_dataset()
    _values(node, "coefficients", _not_finite(data["coefficients"]), "a value that is not finite", "a number")
    _validate_degrees(node)
    if "verification_error" in data:
        _dims(node, "verification_error", (*elements, "output", "time"))
        _values(node, "verification_error", ~(data["verification_error"] >= 0), "no error", "a number, not negative")


def _validate_timeless(node: xr.DataTree, before: bool) -> None:
    _require("statistics" in node.children, node.path, "no child 'statistics'", "one")
    for child, variables in _TIMELESS.items():
        if child not in node.children:
            continue
        data = node.children[child].to_dataset()
        for name in (n for n in variables if n in data):
            same = data[name].dims == variables[name]
            _require(same, f"{node.path}/{child}/{name}", f"the dimensions {data[name].dims}", f"{variables[name]}")
        _require("time" not in data.dims, f"{node.path}/{child}", "a dimension 'time'", "none")
    statistics = node.children["statistics"].to_dataset()
    refused = node.attrs.get("refused", "{}")
    _require(_is_object(refused), node.path, f"attribute 'refused' = {refused!r}", "a JSON object")
    names = statistics["output"].values.tolist() if "output" in statistics.coords else []
    given = [name for name in names if name not in json.loads(refused)]
    # a surrogate contains the outputs with statistics
    for child, expected in {"samples": names, "chaos": given}.items():
        if names and child in node.children and "output" in (data := node.children[child].to_dataset()).coords:
            same = data["output"].values.tolist() == expected
            _require(same, f"{node.path}/{child}/output", "other outputs than have statistics", ", ".join(expected))
    if names:
        given_up = json.loads(refused).keys()
        check_values(statistics, f"{node.path}/statistics", refused=given_up, before=before)


def _validate_requirements(node: xr.DataTree, before: bool) -> None:
    for name, dims in {"violation_probability": (), "std_error": (), "interval": ("bound",)}.items():
        _dims(node, name, ("requirement", *dims))
    check_probabilities(node.to_dataset(), node.path, before=before)


def _validate_comparison(node: xr.DataTree, methods: list[str]) -> None:
    for name in _COMPARED:
        _dims(node, name, ("method", "output"))
    for name in ("wall_time", "realisations", "failures"):
        _dims(node, name, ("method",))
    found = node.coords["method"].values.tolist() if "method" in node.coords else []
    _require(sorted(found) == sorted(methods), f"{node.path}/method", f"{found}", f"the labels {methods}")
    reference = node.attrs.get("reference")
    _require(reference in methods, node.path, f"attribute 'reference' = {reference!r}", f"one of {methods}")
