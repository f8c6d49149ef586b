"""What a comparison tells besides mean and standard deviation: quantiles, distributions, and solver counters."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.results.comparison.distances import distances, ks_by_chance, realisations_at
from uqmbd.results.comparison.own_error import OwnError
from uqmbd.typing import Array

__all__ = ["counters", "distributions", "quantiles"]


def quantiles(found: xr.Dataset, base: xr.Dataset) -> Array:
    """Return the largest difference of quantiles (O,) at probabilities and times of both; NaN where there is none."""
    unknown = np.full(base.sizes["output"], np.nan)
    if "quantile" not in found or "quantile" not in base:
        return unknown
    shared = np.intersect1d(found["probability"].values, base["probability"].values)
    if not len(shared):
        return unknown
    one, other = (d["quantile"].sel(probability=shared).transpose("output", ...).values for d in (found, base))
    difference = np.abs(one - other).reshape(len(unknown), -1)
    known = np.isfinite(difference)
    return np.where(known.any(axis=1), np.where(known, difference, -np.inf).max(axis=1, initial=-np.inf), np.nan)


def counters(attributes: list[dict[Any, Any]]) -> dict[str, Any]:
    """Return the solver counters of all methods, NaN where a method does not count."""
    rows: list[dict[str, float]] = []
    for attrs in attributes:
        try:
            counted = dict(json.loads(attrs.get("solver_counters", "{}")))
        except (TypeError, ValueError):
            counted = {}
        rows.append({str(k): float(v) for k, v in counted.items() if isinstance(v, (int, float))})
    names = list(dict.fromkeys(name for row in rows for name in row))
    if not names:
        return {}
    values = np.array([[row.get(name, np.nan) for name in names] for row in rows])
    coordinate = xr.DataArray(np.array(names, dtype=np.str_), dims="counter")
    return {"counter": coordinate, "solver_counters": (("method", "counter"), values)}


def distributions(
    nodes: Mapping[str, xr.DataTree], chosen: str, times: Array, base: OwnError, level: float
) -> dict[str, Any]:
    """Return distances of distributions to those of a reference, at up to four times; nothing where it has none."""
    fine = np.flatnonzero(np.isfinite(base.std).all(axis=0))
    expected = realisations_at(nodes[chosen], _some(times, base, fine)) if len(fine) and len(base.std) else None
    if expected is None:
        return {}
    where = _some(times, base, fine)
    outputs = len(base.std)
    wasserstein, ks = (np.full((len(nodes), outputs, len(where)), np.nan) for _ in range(2))
    chance = np.full(len(nodes), np.nan)
    for m, node in enumerate(nodes.values()):
        found = realisations_at(node, where)
        if found is None:
            continue
        counts = [expected[1], found[1]]
        chance[m] = ks_by_chance(counts, level / (outputs * len(where) * max(len(nodes) - 1, 1)))
        for o in range(outputs):
            for k in range(len(where)):
                pair = [values[0][:, o, k] for values in (found, expected)]
                if all(np.isfinite(p).all() for p in pair):
                    wasserstein[m, o, k], ks[m, o, k] = distances(*pair)
    dims = ("method", "output", "comparison_time")
    return {
        "comparison_time": xr.DataArray(times[where], dims="comparison_time", attrs={"units": "s"}),
        "wasserstein": (dims, wasserstein, {"long_name": "Wasserstein distance"}),
        "ks": (dims, ks, {"long_name": "Kolmogorov-Smirnov distance"}),
        "ks_by_chance": ("method", chance, {"long_name": "distance that equal distributions exceed at the level"}),
    }


def _some(times: Array, base: OwnError, fine: NDArray[np.intp]) -> list[int]:
    """Choose up to four times: a third, two thirds, the largest standard deviation of the first output, and the end."""
    wanted = {int(fine[-1]), int(fine[base.std[0, fine].argmax()])}
    for share in (1 / 3, 2 / 3):
        wanted.add(int(fine[round(share * (len(fine) - 1))]))
    return sorted(wanted)
