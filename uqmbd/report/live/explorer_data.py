"""Surrogates of outputs behind the sliders of a page, as data for JSON: `explorer.js` reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uqmbd.report.live.packing import packed
from uqmbd.report.live.surrogates import NO_SURROGATE, live_method, live_surrogate
from uqmbd.results import surrogate_parts

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["explorer_data"]


def explorer_data(tree: xr.DataTree, limits: Sequence[Mapping[str, object]] = ()) -> dict[str, Any]:
    """Return the surrogate of a page's method, or ``{"reason": ...}``, which says why there is none.

    Parameters
    ----------
    tree : xarray.DataTree
        The result of a study.
    limits : sequence of mapping
        Requirements that are limits of outputs: ``requirement``, ``output``, ``limit`` and ``end``, "highest" or
        "lowest"; others are left out.

    Returns
    -------
    dict
        ``method``, its label; ``histories`` and ``scalars``, outputs with and without a time: None where there are
        none, else ``surrogate`` as of `live_surrogate`, and ``mean`` and ``std`` (O, T); ``limits``, those of
        these outputs; ``missing``, why one of them is not there; ``order``, the numbers of the inputs, that which
        matters most first.
    """
    label = live_method(tree)
    if not label:
        return {"reason": NO_SURROGATE}
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
    if not any(found.values()):
        return {"reason": " ".join(missing)}
    names = {o["name"] for one in found.values() if one for o in one["surrogate"]["outputs"]}
    known = [dict(one) for one in limits if one["output"] in names and one.get("end") in ("highest", "lowest")]
    surrogates = [one["surrogate"] for one in found.values() if one]
    order = _order(node, [one["name"] for one in surrogates[0]["inputs"]])
    return {"method": label, **found, "limits": known, "missing": missing, "order": order}


def _order(node: xr.DataTree, inputs: list[str]) -> list[int]:
    """Return the numbers of inputs, that with the largest share in an output first; as they are where none is known."""
    largest = dict.fromkeys(inputs, 0.0)
    for part in (node, node.children.get("scalars")):
        data = part.children["statistics"].to_dataset() if part is not None and "statistics" in part.children else None
        if data is None or "sobol_total" not in data:
            continue
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
