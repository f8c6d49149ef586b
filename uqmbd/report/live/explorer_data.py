"""Data for the sliders of a page, as JSON: surrogates for `explorer.js`, or stored realisations for `nearest.js`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.names import ANY
from uqmbd.report.charts import Kind, packed, packed_relative, packed_within
from uqmbd.report.live.surrogates import live_method, live_surrogate, no_surrogate
from uqmbd.results import answers, propagator_nodes
from uqmbd.results.chaos import absent_surrogate, surrogate_parts
from uqmbd.status import Status
from uqmbd.typing import Array, Index
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["collect_explorer_data", "collect_nearest_data"]

DIGITS = 5e-4
"""Allowed error of a number in a page, relative to the standard deviation; the page shows at most a hundredth of it."""

RELATIVE = 4e-5
"""Allowed relative error of a standard deviation; a page shows four digits."""


def collect_explorer_data(tree: xr.DataTree, limits: Sequence[Mapping[str, object]] = ()) -> dict[str, Any]:
    """Return the surrogate of the method of a page, or ``{"reason": ...}`` with the reason why it is missing.

    `tree` is the result of a study. `limits` are requirements that limit outputs, with ``requirement``, ``output``,
    ``limit`` and ``end`` ("highest" or "lowest"); other limits are omitted. The result has these keys:

    ``method``: label of the method. ``histories``, ``scalars``: outputs with and without a time, or None; they contain
    ``surrogate`` (see `live_surrogate`), ``mean`` and ``std`` (O, T). ``limits``: limits of these outputs.
    ``margins``: other requirements, or None; it contains the ``surrogate`` of margins of the whole motion, and
    ``requirements`` with ``name`` and ``meaning``, which is the relation. ``missing``: reasons for missing outputs.
    ``still``: names of requirements that the page cannot evaluate. ``order``: indices of the inputs, the most important
    input first.
    """
    label = live_method(tree)
    if not label:
        absent = [why for node in propagator_nodes(tree).values() if (why := absent_surrogate(node))]
        return {"reason": absent[0]} if absent else {"reason": no_surrogate(), "samples_only": True}
    node = tree.children[label]
    found: dict[str, Any] = {"histories": None, "scalars": None}
    missing = []
    for kind, part in (("histories", node), ("scalars", node.children.get("scalars"))):
        if part is None or not surrogate_parts(part):
            continue
        data = live_surrogate(part)
        if "reason" in data:
            missing.append(data["reason"])
        elif not data["inputs"]:
            missing.append("There are no random inputs.")
        else:
            found[kind] = {"surrogate": data, **_statistics(part, [o["name"] for o in data["outputs"]])}
    names = {o["name"] for one in found.values() if one for o in one["surrogate"]["outputs"]}
    # equal outputs have the same limit
    known: dict[object, dict[str, object]] = {}
    for one in limits:
        if one["output"] in names and one.get("end") in ("highest", "lowest"):
            known.setdefault(one["requirement"], dict(one))
    found_answers = answers(propagator_nodes(tree))
    firsts = {name: next(iter(one.values())) for name, one in found_answers.items() if name != ANY}
    meanings = {name: one.relation or one.meaning for name, one in firsts.items()}
    others = {name: meaning for name, meaning in meanings.items() if name not in known}
    margins = _margins(node, others)
    surrogates = [one["surrogate"] for one in (*found.values(), margins) if one]
    if not surrogates:
        return {"reason": " ".join(missing) or "The surrogate of the margins is not in these results."}
    evaluated = {one["name"] for one in margins["requirements"]} if margins else set()
    return {
        "method": label,
        **found,
        "limits": list(known.values()),
        "margins": margins,
        "missing": missing,
        "still": [name for name in others if name not in evaluated],
        "order": _order(node, [one["name"] for one in surrogates[0]["inputs"]]),
    }


def _margins(node: xr.DataTree, meanings: Mapping[str, str]) -> dict[str, Any] | None:
    """Return the surrogate of the margins of requirements; None if it is missing.

    `meanings` contains the relations of these requirements by name.
    """
    part = node.children.get("requirements")
    if part is None or not meanings or not surrogate_parts(part):
        return None
    data = live_surrogate(part, at_the_end=True)
    if "reason" in data or not data["inputs"]:
        return None
    names = [o["name"] for o in data["outputs"]]
    listed = [{"name": name, "meaning": meaning} for name, meaning in meanings.items() if name in names]
    return {"surrogate": data, "requirements": listed} if listed else None


def _order(node: xr.DataTree, inputs: list[str]) -> list[int]:
    """Return the indices of inputs, sorted by their largest share of the variance of any output.

    Inputs without a known share remain in the order of the study.
    """
    largest = dict.fromkeys(inputs, 0.0)
    for part in (node, node.children.get("scalars"), node.children.get("requirements")):
        data = part.children["statistics"].to_dataset() if part is not None and "statistics" in part.children else None
        if data is None or "sobol_total" not in data:
            continue
        if part is node.children.get("requirements") and "time" in data.dims:  # the last margin is that of the motion
            data = data.isel(time=-1)
        total, variance = data["sobol_total"], data["std"] ** 2
        if "time" in total.dims:
            total = (total * variance).sum("time") / variance.sum("time")
        shares = total.max([dim for dim in total.dims if dim != "input"])
        for name, share in zip(shares["input"].values.tolist(), shares.values.tolist(), strict=True):
            if share > largest.get(str(name), share):  # False for NaN, the share in outputs that do not vary
                largest[str(name)] = share
    return sorted(range(len(inputs)), key=lambda k: -largest[inputs[k]])


def packed_statistics(mean: Array, std: Array) -> dict[str, Any]:
    """Pack means and standard deviations (O, T) with the digits that a page shows."""
    known = np.abs(mean).max(initial=0.0, where=np.isfinite(mean))
    allowed = DIGITS * np.where(std > 0, std, known or 1.0)
    flat = packed_within(mean.ravel(), allowed.ravel()) | {"shape": list(mean.shape)}
    return {"mean": flat, "std": packed_relative(std, RELATIVE)}


def _statistics(node: xr.DataTree, outputs: list[str]) -> dict[str, Any]:
    data = node.children["statistics"].to_dataset().sel(output=outputs)
    dims = [dim for dim in ("output", "time") if dim in data["mean"].dims]
    mean, std = (np.asarray(data[name].transpose(*dims).values, dtype=float) for name in ("mean", "std"))
    return packed_statistics(mean, std)


MOST_BYTES = 220_000
"""Maximum size of the stored responses, bytes; base64 in the page takes one third more."""

MOST_ROWS, FEWEST_ROWS = 200, 20
"""Maximum and minimum number of realisations in a page; for long responses, fewer times are stored."""

FEW_TIMES = 201
"""Minimum number of stored times before the number of realisations is reduced."""

MOST_OUTPUTS = 6
"""Maximum number of outputs over time; further outputs are omitted."""

KNOTS = 17
"""Number of quantiles of an input, between which its distribution function is linear."""

FEW_VALUES = 20
"""Maximum number of different values of a discrete input."""


def collect_nearest_data(
    node: xr.DataTree, label: str, outputs: Sequence[str], limits: Sequence[Mapping[str, object]]
) -> dict[str, Any] | None:
    """Return stored realisations as data of `explorer.js`; None if the method has no samples of inputs.

    `node` is the node of the method; `outputs` are names of outputs over time, the most important first. `limits` and
    the result are as for `collect_explorer_data`, with realisations (`nearest`) instead of surrogates.
    """
    inner = node.children.get("scalars")
    parts = {"histories": node} | ({} if inner is None else {"scalars": inner})
    samples = {
        kind: part.children["samples"].to_dataset() for kind, part in parts.items() if "samples" in part.children
    }
    # omit keys of sampled paths, because realisations with neighbouring keys have independent paths
    samples = {
        kind: data.isel(input=~data["input_key"].values) if "input_key" in data.coords else data
        for kind, data in samples.items()
    }
    samples = {kind: data for kind, data in samples.items() if data.sizes.get("output") and data.sizes.get("input")}
    if not outputs:
        samples.pop("histories", None)
    if not samples or len({data.sizes["sample"] for data in samples.values()}) > 1:
        return None
    whole = np.all([data["status"].values == Status.OK for data in samples.values()], axis=0)
    rows = np.flatnonzero(whole)[:MOST_ROWS]
    names = {"histories": list(outputs)[:MOST_OUTPUTS]}
    if "histories" in samples:
        times = min(samples["histories"].sizes["time"], FEW_TIMES)
        rows = rows[: max(MOST_BYTES // (4 * len(names["histories"]) * times), FEWEST_ROWS)]
    if len(rows) < 2:
        return None
    found: dict[str, Any] = {"histories": None, "scalars": None}
    for kind, data in samples.items():
        chosen = data.sel(output=names[kind]) if kind in names else data
        places = _places(chosen, len(rows))
        statistics = parts[kind].children["statistics"].to_dataset().sel(output=chosen["output"].values)
        about = packed_statistics(*(_along(statistics[name], places) for name in ("mean", "std")))
        found[kind] = {"surrogate": _part(chosen, rows, places)} | about
    stored = {str(one["name"]) for part in found.values() if part for one in part["surrogate"]["outputs"]}
    shown = [dict(one) for one in limits if one["output"] in stored and one.get("end") in ("highest", "lowest")]
    return {
        "method": label, **found, "limits": list({str(one["requirement"]): one for one in shown}.values()),
        "margins": None, "missing": [], "still": [], "nearest": len(rows),
    }  # fmt: skip


def _places(data: xr.Dataset, rows: int) -> Index | None:
    """Return the indices of the stored times; None for scalar outputs."""
    if "time" not in data["response"].dims:
        return None
    count = data.sizes["time"]
    most = max(MOST_BYTES // (4 * rows * data.sizes["output"]), 2)
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))


def _along(values: xr.DataArray, places: Index | None) -> Array:
    """Return statistics (O, T) at the stored times."""
    if places is None:
        return np.asarray(values.values, dtype=float)
    return np.asarray(values.transpose("output", "time").values[:, places], dtype=float)


def _part(data: xr.Dataset, rows: Index, places: Index | None) -> dict[str, Any]:
    """Return responses (N, O, T) as differences from the first row, and the inputs of every realisation."""
    dims = ["sample", "output", "time"] if places is not None else ["sample", "output"]
    response = np.asarray(data["response"].isel(sample=rows).transpose(*dims).values, dtype=float)
    response = response if places is None else response[:, :, places]
    every = np.asarray(data["inputs"].values, dtype=float)
    origin = response[0]
    with np.errstate(over="ignore"):
        distance = response - origin
        spread = distance.std(axis=0).ravel()
    kind: Kind = "float32" if np.abs(distance).max(initial=0.0) < np.finfo(np.float32).max else "float64"
    # a page shows numbers with a resolution of one hundredth to one thousandth of their spread
    flat = packed_within(distance.reshape(len(rows), -1), DIGITS * np.where(spread > 0, spread, 1.0), kind)
    columns = zip(*(_texts(data, name) for name in ("input", "input_units", "input_description")), strict=True)
    return {
        "nearest": True,
        "outputs": [
            {"name": name, "units": typeset_units(units)}
            for name, units in zip(_texts(data, "output"), _texts(data, "output_units"), strict=True)
        ],
        "times": None if places is None else packed(data["time"].values[places]),
        "inputs": [
            {
                "name": name, "units": typeset_units(units), "description": text, "sum": [[k, 1.0]], "reason": "",
                "map": {"kind": "affine", "bounds": [None, None], "shift": 0.0, "scale": 1.0},
                "mean": float(every[:, k].mean()),
            }
            for k, (name, units, text) in enumerate(columns)
        ],
        "germs": [_range(name, column) for name, column in zip(_texts(data, "input"), every.T, strict=True)],
        "numbers": packed(rows, "int32"),
        "points": packed(every[rows]),
        "scales": [float(column.std()) for column in every.T],
        "origin": packed(origin),
        "responses": flat | {"shape": list(distance.shape)},
    }  # fmt: skip


def _texts(data: xr.Dataset, name: str) -> list[str]:
    """Return a coordinate as texts; empty texts if it is missing."""
    along = name.partition("_")[0]
    return list(map(str, data[name].values)) if name in data.coords else [""] * data.sizes[along]


def _range(name: str, values: Array) -> dict[str, Any]:
    """Describe the values (N,) of an input in the form of `tables.germ_data`, with the value as germ."""
    low, high, different = float(values.min()), float(values.max()), np.unique(values)
    found: dict[str, Any] = {
        "name": name, "support": [low, high], "reach": [low, high], "range": [low, high],
        "start": float(np.quantile(values, 0.5, method="inverted_cdf")), "verified": None,
        "values": None, "levels": None, "knots": None,
    }  # fmt: skip
    if len(different) <= FEW_VALUES:
        levels = np.searchsorted(np.sort(values), different, side="right") / len(values)
        return found | {"values": packed(different), "levels": packed(levels)}
    return found | {"knots": packed(np.quantile(values, np.linspace(0, 1, KNOTS)))}
