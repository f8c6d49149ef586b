"""Join the nodes of one method for outputs over time, scalar outputs, censored outputs and requirements."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.arguments import OrNaN, typechecked
from uqmbd.results.schema import (
    EVERY,
    Labels,
    node_parts,
    reasons_of,
    statistics_dataset,
    with_reasons,
)
from uqmbd.status import Status

__all__ = ["joined_outputs", "with_requirements", "with_scalars"]


@typechecked
def with_scalars(node: xr.DataTree | None, found: xr.DataTree, label: str, labels: Labels) -> xr.DataTree:
    """Return the node of a propagator with scalar outputs as the child ``scalars``.

    `node`: node of the outputs over time, or None without such outputs; `found`: node of the scalar outputs, as outputs
    at a single time; `label`: label of the propagator; `labels`: times and inputs of the study; outputs are
    ignored. Without outputs over time, the child ``statistics`` has times, but no outputs.

    A method with the means of an output over time and of a scalar output:

    >>> import numpy as np
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> from uqmbd.results.tree import with_scalars
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> over_time = node(["height"], [0.0, 1.0], [[0.0, 3.0]])
    >>> timeless = node(["highest"], [0.0], [[3.5]])
    >>> both = with_scalars(over_time, timeless, "mine", labels(["height"], [], [0.0, 1.0]))
    >>> both["statistics/mean"].dims, both["scalars/statistics/mean"].dims, both["scalars/statistics/mean"].item()
    (('output', 'time'), ('output',), 3.5)
    """
    datasets: dict[str, xr.Dataset] = {}
    if node is None:
        datasets["/"] = xr.Dataset(attrs={**found.attrs, "label": label})
        datasets["statistics"] = _empty(labels, found.children["statistics"].to_dataset())
    else:
        datasets |= node_parts(node)
    inner = node_parts(found)
    inner["/"] = inner["/"].assign_attrs(label=label)
    for path, data in inner.items():
        timeless = data.isel(time=0, drop=True) if "time" in data.dims else data
        datasets["scalars" if path == "/" else f"scalars/{path}"] = timeless
    return xr.DataTree.from_dict(datasets, name=label)


@typechecked
def joined_outputs(
    nodes: Sequence[xr.DataTree],
    label: str,
    shares: Sequence[OrNaN],
    bounds: Sequence[OrNaN],
    refused: Mapping[str, str],
    names: Sequence[str],
) -> xr.DataTree:
    """Join nodes of one method for different outputs.

    `nodes`: nodes to join; `shares`: share of realisations in which each output does not occur, stored as ``censored``
    (output,); `bounds`: upper bound of this share with 95 % confidence, stored as ``censored_bound`` (output,);
    `refused`: reasons by output without statistics, stored in the attribute ``refused``; `names`: outputs in order.
    The result contains statistics of all outputs, NaN for outputs without statistics, and samples of all outputs. An
    output that does not occur in a sample is NaN in this sample, which has not failed. Other children are those of the
    first node without refused outputs.

    Two outputs, computed separately; the second does not occur in a tenth of the realisations:

    >>> import numpy as np
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> from uqmbd.results.tree import joined_outputs
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> nodes = [node(["highest"], [0.0], [[3.5]]), node(["first"], [0.0], [[0.7]])]
    >>> joined = joined_outputs(nodes, "mine", [0.0, 0.1], [0.03, 0.15], {}, ["highest", "first"])
    >>> joined["statistics/mean"].values.ravel().tolist(), joined["statistics/censored"].values.tolist()
    ([3.5, 0.7], [0.0, 0.1])
    """
    main = next(
        (node for node in nodes if not refused.keys() & set(_statistics(node)["output"].values.tolist())), nodes[0]
    )
    first = _statistics(main)
    filled = [_filled(_statistics(node), first) for node in nodes]
    statistics: xr.Dataset = xr.concat(
        filled, dim="output", data_vars="minimal", coords="minimal", compat="override", join="override"
    )
    order = [statistics["output"].values.tolist().index(name) for name in names]
    statistics = statistics.isel(output=order).assign_attrs(first.attrs)
    for name in statistics.data_vars:
        reasons: dict[str, str] = {}
        for data in filled:
            own = reasons_of(data[name]) if name in data else {}
            outputs = data["output"].values.tolist()
            reasons |= {x: own.get(x, own.get(EVERY, "")) for x in outputs if x in own or EVERY in own}
        statistics[name].attrs.pop("unknown", None)
        statistics[name] = with_reasons(statistics[name], reasons)
    about = {"long_name": "share of realisations in which the event does not occur by the last time"}
    statistics["censored"] = ("output", np.array(shares), about)
    about = {
        "long_name": "upper limit of the share of realisations without the event",
        "comment": "with 95 % confidence",
    }
    statistics["censored_bound"] = ("output", np.array(bounds), about)
    parts = node_parts(main)
    parts["statistics"] = statistics
    if "samples" in parts:
        parts["samples"] = _joined_samples(nodes, parts["samples"], names)
    if refused:
        parts["/"] = parts["/"].assign_attrs(refused=json.dumps(refused))
    parts["/"] = parts["/"].assign_attrs(label=label)
    return xr.DataTree.from_dict(parts, name=label)


def _joined_samples(nodes: Sequence[xr.DataTree], first: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Join the samples of nodes for different outputs; `first` are the samples of one of these nodes."""
    samples = [node.children["samples"].to_dataset(inherit=False) for node in nodes if "samples" in node.children]
    response = np.full((first.sizes["sample"], len(names), *first["response"].shape[2:]), np.nan)
    units = [""] * len(names)
    for data in (data for data in samples if data.sizes["sample"] == len(response)):
        for column, name in enumerate(data["output"].values.tolist()):
            response[:, names.index(name)] = data["response"].values[:, column]
            units[names.index(name)] = str(data["output_units"].values[column])
    status = first["status"].values.copy()
    happens = np.isfinite(response).any(axis=tuple(range(1, response.ndim)))
    status[happens & (status == Status.CENSORED)] = Status.OK
    messages = np.where(status == Status.OK, "", first["message"].values)
    found = first.drop_dims("output").drop_vars(["status", "message"])
    coords = {"output": np.array(names, dtype=np.str_), "output_units": ("output", np.array(units, dtype=np.str_))}
    return found.assign_coords(coords).assign(
        response=(first["response"].dims, response, first["response"].attrs),
        status=("sample", status, first["status"].attrs),
        message=("sample", messages, first["message"].attrs),
    )


def _statistics(node: xr.DataTree) -> xr.Dataset:
    return node.children["statistics"].to_dataset(inherit=False)


def _filled(data: xr.Dataset, like: xr.Dataset) -> xr.Dataset:
    """Return statistics with the variables of `like`: drop other variables, and add missing ones as NaN."""
    found = data.drop_vars([name for name in data.data_vars if name not in like.data_vars])
    for name, other in like.data_vars.items():
        if name in found or "output" not in other.dims:
            continue
        sizes = {dim: found.sizes["output"] if dim == "output" else other.sizes[dim] for dim in other.dims}
        found[name] = (other.dims, np.full(tuple(sizes.values()), np.nan), other.attrs)
        kind = "standard error" if str(name).startswith("std_error") else str(other.attrs.get("long_name", name))
        found[name] = with_reasons(found[name], {EVERY: f"the method states no {kind} of this output"})
    return found


@typechecked
def with_requirements(
    node: xr.DataTree | None, found: xr.DataTree, label: str, labels: Labels, answers: xr.Dataset
) -> xr.DataTree:
    """Return the node of a propagator with the child ``requirements``.

    `node`: node of the outputs over time and scalar outputs, or None without outputs; `found`: node of the margins of
    the requirements as outputs, which the child ``requirements`` also contains; `label`: label of the propagator;
    `labels`: times and inputs of the study, whose outputs are ignored; `answers`: dataset ``requirements``.
    Without outputs, the child ``statistics`` has no outputs.

    A study with one requirement and no outputs; one in 50 realisations violates the requirement:

    >>> import numpy as np
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import Violations
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> from uqmbd.results.tree import with_requirements
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> margins = np.where(np.arange(50) < 1, -1.0, 1.0)[:, None, None] * np.ones((1, 1, 2))
    >>> answers = Violations.dataset(["clear"], [Violations.of(margins, np.zeros(50, dtype=bool))], [0.0, 1.0])
    >>> found = node(["clear"], [0.0, 1.0], [[0.3, 0.2]])
    >>> whole = with_requirements(None, found, "mine", labels(["none"], [], [0.0, 1.0]), answers)
    >>> whole["requirements/violation_probability"].values.tolist(), sorted(whole.children)
    ([0.02], ['requirements', 'statistics'])
    """
    datasets = {"/": xr.Dataset(attrs={**found.attrs, "label": label})}
    if node is None:
        datasets["statistics"] = _empty(labels, found.children["statistics"].to_dataset())
    else:
        datasets = node_parts(node)
    spent = {
        name: found.attrs[name] for name in ("realisations", "failures", "wall_time", "fit") if name in found.attrs
    }
    datasets["requirements"] = answers.assign_attrs({f"margin_{name}": value for name, value in spent.items()})
    for path, data in node_parts(found).items():
        if path not in ("/", "requirements"):
            datasets[f"requirements/{path}"] = data
    return xr.DataTree.from_dict(datasets, name=label)


def _empty(labels: Labels, like: xr.Dataset) -> xr.Dataset:
    """Return statistics that have all times, but no outputs."""
    none = Labels((), labels.inputs, labels.times)
    blank: Any = np.zeros(none.shape)
    errors = {name: blank for name in ("std_error_mean", "std_error_std") if name in like}
    levels = like["probability"].values
    quantile = np.zeros((len(levels), *none.shape))
    found = statistics_dataset(none, mean=blank, std=blank, quantile=quantile, probability=levels, **errors)
    return found.assign_coords(labels.input_coords())
