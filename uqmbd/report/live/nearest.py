"""Stored realisations behind the sliders of a page without a surrogate: `nearest.js` finds the nearest one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.charts import Kind, packed
from uqmbd.status import Status
from uqmbd.typing import Array, Index
from uqmbd.wording import typeset_units

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["collect_nearest_data"]


MOST_BYTES = 220_000
"""Of the stored responses; in a page they take a third more."""

MOST_ROWS, FEWEST_ROWS = 200, 20
"""Realisations of a page, if their responses are small, and at least: of long ones fewer times are stored."""

FEW_TIMES = 201
"""Times of which as many are stored before there are fewer realisations."""

MOST_OUTPUTS = 6
"""Outputs over time; further ones are omitted."""

KNOTS = 17
"""Quantiles of an input, between which its distribution function is linear."""

FEW_VALUES = 20
"""Different values of an input up to which it is discrete."""


def collect_nearest_data(
    node: xr.DataTree, label: str, outputs: Sequence[str], limits: Sequence[Mapping[str, object]]
) -> dict[str, Any] | None:
    """Return stored realisations of a method as data of `explorer.js`; None if it has no samples of inputs.

    `node`: of the method; `outputs`: names of outputs over time, the most important first; `limits`: as of
    `collect_explorer_data`. Return the same data, with realisations (`nearest`) in place of surrogates.
    """
    inner = node.children.get("scalars")
    parts = {"histories": node} | ({} if inner is None else {"scalars": inner})
    samples = {
        kind: part.children["samples"].to_dataset() for kind, part in parts.items() if "samples" in part.children
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
        found[kind] = {"surrogate": _part(chosen, rows, places)} | {
            name: packed(_along(statistics[name], places)) for name in ("mean", "std")
        }
    held = {str(one["name"]) for part in found.values() if part for one in part["surrogate"]["outputs"]}
    kept = [dict(one) for one in limits if one["output"] in held and one.get("end") in ("highest", "lowest")]
    return {
        "method": label, **found, "limits": list({str(one["requirement"]): one for one in kept}.values()),
        "margins": None, "missing": [], "still": [], "nearest": len(rows),
    }  # fmt: skip


def _places(data: xr.Dataset, rows: int) -> Index | None:
    """Return the times that are stored; None of outputs without a time."""
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
    """Return the responses (N, O, T) of some rows as distances from the first, and the inputs of every realisation."""
    dims = ["sample", "output", "time"] if places is not None else ["sample", "output"]
    response = np.asarray(data["response"].isel(sample=rows).transpose(*dims).values, dtype=float)
    response = response if places is None else response[:, :, places]
    every = np.asarray(data["inputs"].values, dtype=float)
    origin = response[0]
    with np.errstate(over="ignore"):
        distance = response - origin
    kind: Kind = "float32" if np.abs(distance).max(initial=0.0) < np.finfo(np.float32).max else "float64"
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
        "responses": packed(distance, kind),
    }  # fmt: skip


def _texts(data: xr.Dataset, name: str) -> list[str]:
    """Return a coordinate as texts; empty ones if it is missing."""
    along = name.partition("_")[0]
    return list(map(str, data[name].values)) if name in data.coords else [""] * data.sizes[along]


def _range(name: str, values: Array) -> dict[str, Any]:
    """Describe the values (N,) of an input as `tables.germ_data` describes a germ: its value is its own germ."""
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
