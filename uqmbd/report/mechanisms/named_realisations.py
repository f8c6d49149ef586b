"""Realisations with a pose in the report: most likely violations, and realisations with the smallest margins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.names import ANY
from uqmbd.results import propagator_nodes
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.propagation import Study

__all__ = ["NamedRealisation", "most_likely_violations", "worst_realisations"]

MOST_NAMED = 3
"""Maximum number of named realisations of each kind with a pose in the report."""


@dataclass(frozen=True, eq=False)
class NamedRealisation:
    """Realisation with a pose in the report: name, inputs (input,) and time, s.

    `pictured`: whether the first screen may contain a picture of the pose.
    """

    name: str
    inputs: Array
    time: float
    pictured: bool = True


def most_likely_violations(tree: xr.DataTree, study: Study) -> list[NamedRealisation]:
    """Return inputs and time of the most likely violation of each requirement, of which at most `MOST_NAMED`.

    The requirement with the largest probability of violation is first. The most likely violation is the design point
    nearest to the origin of the standard normal space. Methods may store ``design_points`` and ``design_times`` in
    their dataset ``requirements``.
    """
    found: dict[str, tuple[float, NamedRealisation]] = {}
    inputs = list(study.mechanism.inputs.names)
    for node in propagator_nodes(tree).values():
        data = _requirements_of(node, "design_points", "design_times", inputs=inputs)
        if data is None or not data.sizes["point"]:
            continue
        for name in (str(one) for one in data["requirement"].values if str(one) != ANY):
            one = data.sel(requirement=name, input=inputs).isel(point=0)
            values, time = np.asarray(one["design_points"].values, dtype=float), float(one["design_times"])
            if np.isfinite(values).all() and np.isfinite(time) and name not in found:
                probability = float(one["violation_probability"])
                found[name] = (probability, NamedRealisation(f"most likely violation of {name}", values, time))
    return [one for _, one in sorted(found.values(), key=lambda pair: -pair[0])[:MOST_NAMED]]


def worst_realisations(tree: xr.DataTree, study: Study) -> list[NamedRealisation]:
    """Return the realisation with the smallest margin of each requirement, at most `MOST_NAMED`; violations are first.

    A method may store ``worst_inputs``, ``worst_time`` and ``worst_margin`` in its dataset ``requirements``. Of several
    methods, the method with the smallest margin is used.
    """
    found: dict[str, tuple[float, float, NamedRealisation]] = {}
    inputs = list(study.mechanism.inputs.names)
    for label, node in propagator_nodes(tree).items():
        data = _requirements_of(node, "worst_inputs", "worst_time", "worst_margin", inputs=inputs)
        if data is None:
            continue
        for name in (str(one) for one in data["requirement"].values if str(one) != ANY):
            one = data.sel(requirement=name, input=inputs)
            values, time = np.asarray(one["worst_inputs"].values, dtype=float), float(one["worst_time"])
            margin, share = float(one["worst_margin"]), float(one["violation_probability"])
            if np.isfinite([*values, time, margin]).all() and (name not in found or margin < found[name][1]):
                words = f"realisation of {label} with the smallest margin of {name}"
                found[name] = (share, margin, NamedRealisation(words, values, time, pictured=False))
    return [one for *_, one in sorted(found.values(), key=lambda each: -each[0])[:MOST_NAMED]]


def _requirements_of(node: xr.DataTree, *variables: str, inputs: Sequence[str]) -> xr.Dataset | None:
    """Return the dataset ``requirements`` of a method if it contains the variables and the inputs; otherwise None.

    Results of a file may belong to a study whose inputs had other names.
    """
    part = node.children.get("requirements")
    if part is None or not {*variables, "violation_probability"} <= set(part.data_vars) or "input" not in part.coords:
        return None
    data = part.to_dataset()
    return data if set(inputs) <= {str(name) for name in data["input"].values} else None
