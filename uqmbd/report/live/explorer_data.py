"""Surrogates of outputs behind the sliders of a page, as data for JSON: `explorer.js` reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.names import ANY
from uqmbd.report.charts import packed
from uqmbd.report.live.surrogates import NO_SURROGATE, live_method, live_surrogate
from uqmbd.results import answers, propagator_nodes
from uqmbd.results.chaos import absent_surrogate, surrogate_parts

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["collect_explorer_data"]


def collect_explorer_data(tree: xr.DataTree, limits: Sequence[Mapping[str, object]] = ()) -> dict[str, Any]:
    """Return the surrogate of a page's method, or ``{"reason": ...}``, which says why there is none.

    `tree`: the result of a study; `limits`: requirements that are limits of outputs: ``requirement``, ``output``,
    ``limit`` and ``end``, "highest" or "lowest"; others are left out. Return ``method``, its label; ``histories`` and
    ``scalars``, outputs with and without a time: None where there are none, else ``surrogate`` as of
    `live_surrogate`, and ``mean`` and ``std`` (O, T); ``limits``, those of these outputs; ``margins``, of other
    requirements: None, or the ``surrogate`` of margins of the whole motion and ``requirements``, the ``name`` and
    ``meaning`` of each that is not among the limits; ``missing``, why outputs are not there; ``still``, the names of
    requirements that are not; ``order``, the numbers of the inputs, that which matters most first.
    """
    label = live_method(tree)
    if not label:
        absent = [why for node in propagator_nodes(tree).values() if (why := absent_surrogate(node))]
        return {"reason": absent[0] if absent else NO_SURROGATE}
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
    # outputs that are equal have the same limit
    known: dict[object, dict[str, object]] = {}
    for one in limits:
        if one["output"] in names and one.get("end") in ("highest", "lowest"):
            known.setdefault(one["requirement"], dict(one))
    said = answers(propagator_nodes(tree))
    meanings = {name: next(iter(one.values())).meaning for name, one in said.items() if name != ANY}
    others = {name: meaning for name, meaning in meanings.items() if name not in known}
    margins = _margins(node, others)
    surrogates = [one["surrogate"] for one in (*found.values(), margins) if one]
    if not surrogates:
        return {"reason": " ".join(missing) or "The surrogate of the margins is not in these results."}
    told = {one["name"] for one in margins["requirements"]} if margins else set()
    return {
        "method": label,
        **found,
        "limits": list(known.values()),
        "margins": margins,
        "missing": missing,
        "still": [name for name in others if name not in told],
        "order": _order(node, [one["name"] for one in surrogates[0]["inputs"]]),
    }


def _margins(node: xr.DataTree, wanted: Mapping[str, str]) -> dict[str, Any] | None:
    """Return the surrogate of the margins of a method, of requirements that are wanted; None if it has none."""
    part = node.children.get("requirements")
    if part is None or not wanted or not surrogate_parts(part):
        return None
    data = live_surrogate(part, at_the_end=True)
    if "reason" in data or not data["inputs"]:
        return None
    names = [o["name"] for o in data["outputs"]]
    listed = [{"name": name, "meaning": meaning} for name, meaning in wanted.items() if name in names]
    return {"surrogate": data, "requirements": listed} if listed else None


def _order(node: xr.DataTree, inputs: list[str]) -> list[int]:
    """Return the numbers of inputs, that with the largest share in an output first; as they are where none is known."""
    largest = dict.fromkeys(inputs, 0.0)
    for part in (node, node.children.get("scalars"), node.children.get("requirements")):
        data = part.children["statistics"].to_dataset() if part is not None and "statistics" in part.children else None
        if data is None or "sobol_total" not in data:
            continue
        if part is node.children.get("requirements") and "time" in data.dims:  # running margins: of the whole motion
            data = data.isel(time=-1)
        total, variance = data["sobol_total"], data["std"] ** 2
        if "time" in total.dims:
            total = (total * variance).sum("time") / variance.sum("time")
        shares = total.max([dim for dim in total.dims if dim != "input"])
        for name, share in zip(shares["input"].values.tolist(), shares.values.tolist(), strict=True):
            if share > largest.get(str(name), share):  # of what does not vary it is not a number
                largest[str(name)] = share
    return sorted(range(len(inputs)), key=lambda k: -largest[inputs[k]])


def _statistics(node: xr.DataTree, outputs: list[str]) -> dict[str, Any]:
    data = node.children["statistics"].to_dataset().sel(output=outputs)
    dims = [dim for dim in ("output", "time") if dim in data["mean"].dims]
    return {
        name: packed(np.asarray(data[name].transpose(*dims).values, dtype=float), "float64") for name in ("mean", "std")
    }
