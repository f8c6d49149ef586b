"""Select the nodes, samples and times of a result for a figure; ends of axes in per cent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeAlias, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.report.drawing import decades
from uqmbd.results import propagator_nodes
from uqmbd.status import Status

__all__ = [
    "Results",
    "Samples",
    "automatic_times",
    "label_of",
    "nodes_of",
    "of_output",
    "percent_ends",
    "runs_of",
    "samples_of",
    "succeeded",
]


def percent_ends(ends: tuple[float, float]) -> tuple[float, float]:
    """Return the powers of ten around two values, in per cent."""
    first, last = decades(*(100 * end for end in ends))
    return float(f"1e{first}"), float(f"1e{last}")


Results: TypeAlias = xr.DataTree | Mapping[str, xr.DataTree] | Iterable[xr.DataTree]
"""Result of a study, node of one propagator, or several such nodes."""

Samples: TypeAlias = xr.DataTree | xr.Dataset
"""Node of one propagator with stored samples, or the dataset of the samples."""


def nodes_of(results: Results) -> dict[str, xr.DataTree]:
    """Return the propagator nodes by label; raise StudyError if there are none."""
    if isinstance(results, xr.DataTree):
        nodes = propagator_nodes(results)
    elif isinstance(results, Mapping):
        nodes = dict(cast(Mapping[str, xr.DataTree], results))
    else:
        nodes = {label_of(node): node for node in results}
    if not nodes:
        raise StudyError("A figure needs the result of at least one propagator; no result is given.")
    return nodes


def label_of(node: Samples) -> str:
    """Return the label of a method."""
    return str(node.attrs.get("label", getattr(node, "name", None) or "samples"))


def samples_of(node: Samples) -> xr.Dataset:
    """Return the samples of a method; raise StudyError if it stored none."""
    if isinstance(node, xr.Dataset):
        if {"response", "status"} <= set(node.data_vars):
            return node
        raise StudyError("This figure shows samples: the dataset has no 'response' or no 'status'; expected both.")
    if "samples" not in node.children:
        raise StudyError(f"The propagator {node.name!r} stored no samples, which this figure shows.")
    return node.children["samples"].to_dataset()


def runs_of(node: Samples) -> xr.Dataset | None:
    """Return inputs, status and message of the samples or of the nodes of a method, along ``sample``.

    Return None if a method stored neither samples nor nodes.
    """
    if isinstance(node, xr.Dataset) or "samples" in node.children:
        return samples_of(node)
    known = node.children["nodes"].data_vars if "nodes" in node.children else ()
    if not {"inputs", "status", "message"} <= set(known):
        return None
    return node.children["nodes"].to_dataset().rename(node="sample")


def of_output(source: xr.DataTree | xr.Dataset, output: str) -> xr.Dataset:
    """Return the data of one output; raise StudyError, with the known names, for an unknown name."""
    data = source.to_dataset() if isinstance(source, xr.DataTree) else source
    found = np.flatnonzero(data["output"].values == output)
    if not found.size:
        known = ", ".join(repr(str(name)) for name in data["output"].values)
        raise StudyError(f"The results have no output {output!r}; the outputs are {known}.")
    return data.isel(output=int(found[0]))


def succeeded(node: Samples, output: str) -> xr.DataArray:
    """Return the responses (sample, time) of the successful samples; raise StudyError if there are none."""
    samples = samples_of(node)
    fine = np.flatnonzero(samples["status"].values == Status.OK)
    if not len(fine):
        raise StudyError(f"All samples of {label_of(node)!r} failed, so there is nothing to draw.")
    response = of_output(samples, output)["response"]
    return response if len(fine) == response.sizes["sample"] else response.isel(sample=fine)


def automatic_times(times: NDArray[np.float64], std: NDArray[np.float64]) -> list[int]:
    """Choose up to four time indices: the end, the largest standard deviation, a third, two thirds, or the middle."""
    last = len(times) - 1
    chosen = {last, int(np.argmax(np.nan_to_num(std, nan=-1.0)))}
    for share in (1 / 3, 2 / 3, 1 / 2):
        candidate = int(np.abs(times - (times[0] + share * (times[-1] - times[0]))).argmin())
        # omit similar times, at which two panels would show almost the same data
        if len(chosen) < 4 and all(abs(candidate - k) > last / 12 for k in chosen):
            chosen.add(candidate)
    return sorted(chosen)
