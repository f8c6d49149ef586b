"""The result of a study: the nodes of its methods, their outputs without a time, and the comparison of both.

Outputs without a time are the child ``scalars`` of a propagator's node.  It has the form of the node itself, without
the dimension ``time``: ``scalars/statistics``, ``scalars/samples`` or ``scalars/chaos``, and attributes that say how
these numbers came about.

Length: every function is public, and has an example.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.comparison import DIFFERS, UNDER_RESOLVED, compare, overall
from uqmbd.results.requirements import compare_requirements
from uqmbd.results.schema import (
    EVERY,
    Labels,
    as_text,
    comparable,
    join_nodes,
    node_parts,
    reasons_of,
    statistics_dataset,
    united,
    with_reasons,
)
from uqmbd.status import Status

__all__ = [
    "compare_both",
    "happening",
    "joined_outputs",
    "scalar_nodes",
    "study_tree",
    "with_requirements",
    "with_scalars",
]


def study_tree(
    nodes: Iterable[xr.DataTree],
    *,
    study: str,
    mechanism: str,
    reference: str | None = None,
    attrs: Mapping[str, Any] | None = None,
) -> xr.DataTree:
    """Join the nodes of several propagators to the result of a study, and compare them.

    Parameters
    ----------
    nodes : iterable of xarray.DataTree
        From :func:`uqmbd.results.propagator_node`; their labels must differ.
    study, mechanism : str
        Names.
    reference : str, optional
        Label of the method that the others are compared with; default :func:`uqmbd.results.choose_reference`.
    attrs : mapping, optional
        Further attributes of the root, as ``rtol``, ``integrator``, ``command``.

    Returns
    -------
    xarray.DataTree

    Raises
    ------
    StudyError
        If there is no node, or two have the same label.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset
    >>> axes = labels(["x"], [], [0.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[1.0]], std=[[0.0]]),
    ...                        propagator="perturbation", realisations=1, wall_time=0.1)
    >>> sorted(study_tree([node], study="s", mechanism="m").children)
    ['comparison', 'mine']
    """
    found = list(nodes)
    tree = join_nodes(found, study=study, mechanism=mechanism, attrs=attrs)
    by_label = {str(node.name): node for node in found}
    tree["comparison"] = xr.DataTree(
        as_text(united(compare_both(by_label, reference, float((attrs or {}).get("rtol", 0.0)))))
    )
    return tree


def scalar_nodes(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return the nodes of outputs without a time, by the label of the method; methods without are left out.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label.

    Examples
    --------
    >>> scalar_nodes({})
    {}
    """
    return {label: node.children["scalars"] for label, node in nodes.items() if "scalars" in node.children}


def with_scalars(node: xr.DataTree | None, found: xr.DataTree, label: str, labels: Labels) -> xr.DataTree:
    """Make the node of a propagator whose study has outputs without a time.

    Parameters
    ----------
    node : xarray.DataTree, optional
        What the propagator gave for the outputs over time; None: there are none.
    found : xarray.DataTree
        What it gave for the outputs without a time, as if at one time.
    label : str
        Of the propagator.
    labels : Labels
        Times and inputs of the study; its outputs are not looked at.

    Returns
    -------
    xarray.DataTree
        With the child ``scalars``.  Without outputs over time its ``statistics`` are empty: they have times, but no
        outputs.

    Examples
    --------
    A method that found the mean of an output over time, and of one without a time:

    >>> import numpy as np
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset, with_scalars
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


def joined_outputs(
    nodes: Sequence[xr.DataTree],
    label: str,
    shares: Sequence[float],
    bounds: Sequence[float],
    refused: Mapping[str, str],
    names: Sequence[str],
) -> xr.DataTree:
    """Join nodes of one method that are about some outputs each.

    Parameters
    ----------
    nodes : sequence of xarray.DataTree
        Further children than ``statistics`` and ``samples`` are those of the first that is not refused.  Samples are
        those of all: NaN where an output does not happen in one, which has not failed.
    label : str
    shares : sequence of float
        Of each output, the share of realisations in which it does not happen: ``censored`` (output,).
    bounds : sequence of float
        How large that share may be, with 95 % confidence: ``censored_bound`` (output,).
    refused : mapping of str to str
        Outputs without statistics, and why: the attribute ``refused``.
    names : sequence of str
        Outputs in order.

    Returns
    -------
    xarray.DataTree
        Statistics of all outputs, those without any NaN.

    Examples
    --------
    Two outputs, each computed by itself; the second does not happen in a tenth of the realisations:

    >>> import numpy as np
    >>> from uqmbd.results import joined_outputs, labels, propagator_node, statistics_dataset
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
    about = {"long_name": "share of realisations in which it does not happen until the last time"}
    statistics["censored"] = ("output", np.array(shares), about)
    about = {"long_name": "largest share in which it may not happen", "comment": "with 95 % confidence"}
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
    """Join the samples of nodes about some outputs each; `first` are those of one of them."""
    held = [node.children["samples"].to_dataset(inherit=False) for node in nodes if "samples" in node.children]
    response = np.full((first.sizes["sample"], len(names), *first["response"].shape[2:]), np.nan)
    units = [""] * len(names)
    for data in (data for data in held if data.sizes["sample"] == len(response)):
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
    """Give statistics the variables of others, unknown where they have none."""
    found = data.drop_vars([name for name in data.data_vars if name not in like.data_vars])
    for name, other in like.data_vars.items():
        if name in found or "output" not in other.dims:
            continue
        sizes = {dim: found.sizes["output"] if dim == "output" else other.sizes[dim] for dim in other.dims}
        found[name] = (other.dims, np.full(tuple(sizes.values()), np.nan), other.attrs)
        found[name] = with_reasons(found[name], {EVERY: "the method does not state it"})
    return found


def with_requirements(
    node: xr.DataTree | None, found: xr.DataTree, label: str, labels: Labels, answers: xr.Dataset
) -> xr.DataTree:
    """Make the node of a propagator whose study has requirements.

    Parameters
    ----------
    node : xarray.DataTree, optional
        What the propagator gave for outputs, with or without a time; None: there are none.
    found : xarray.DataTree
        What it gave for the margins of the requirements as outputs; it is the child ``requirements``, too.
    label : str
        Of the propagator.
    labels : Labels
        Times and inputs of the study; its outputs are not looked at.
    answers : xarray.Dataset
        The dataset ``requirements``.

    Returns
    -------
    xarray.DataTree
        With the child ``requirements``.  Without outputs its ``statistics`` are empty.

    Examples
    --------
    A study of one requirement and nothing else, of which one in 50 realisations violates it:

    >>> import numpy as np
    >>> from uqmbd.results import Violations, labels, propagator_node, statistics_dataset, with_requirements
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


def compare_both(nodes: Mapping[str, xr.DataTree], reference: str | None = None, rtol: float = 0.0) -> xr.Dataset:
    """Compare every method with a reference, in the outputs over time, in those without, and in requirements.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label.
    reference : str, optional
        Label of the reference; where it has no outputs without a time, another is chosen for them.
    rtol : float
        Of the integration.

    Returns
    -------
    xarray.Dataset
        Of :func:`uqmbd.results.compare`, for the outputs over time.  With outputs that have none also
        ``scalar_mean_difference`` and ``scalar_std_difference (method, scalar)``, absolute, in the units of the
        outputs, NaN for methods without; ``scalar_reference_std (scalar)``, a scale for them; and ``scalar_verdict``
        with ``scalar_verdict_kind (method, scalar)``.  Where there are no others, the recommendation is for these.
        With requirements also ``violation_probability (method, requirement)``, the ends of the intervals, and
        ``violation_verdict``.  Methods whose inputs are distributed otherwise (`comparable`) are left out.
    """
    nodes = comparable(nodes)
    found = _compared_outputs(nodes, reference, rtol)
    limits = compare_requirements(nodes, str(found.attrs.get("reference", reference)))
    return found if limits is None else found.merge(limits, join="left").assign_attrs(found.attrs)


def _compared_outputs(nodes: Mapping[str, xr.DataTree], reference: str | None, rtol: float) -> xr.Dataset:
    """Compare outputs over time and those without; where there are neither, nothing but the methods."""
    inner, left_out = happening(scalar_nodes(nodes))
    over_time = any(node.children["statistics"].sizes["output"] for node in nodes.values())
    if not (over_time or inner) and (margins := _margin_nodes(nodes)):
        # no outputs: methods are compared by the margins of requirements
        return compare(margins, reference=reference, rtol=rtol).isel(output=slice(0, 0))
    if left_out and not (over_time or inner):
        raise StudyError(
            f"there is nothing else than {', '.join(left_out)}, which does not happen in all realisations: statistics "
            "are those of other realisations in each method."
        )
    compared = compare(nodes, reference=reference, rtol=rtol) if over_time or not inner else None
    if left_out and compared is not None:
        compared = compared.assign_attrs(censored=", ".join(left_out))
    if not inner:
        return compared if compared is not None else xr.Dataset()
    wanted = reference if compared is None else str(compared.attrs["reference"])
    whole = compare(inner, reference=wanted if wanted in inner else None, rtol=rtol)
    names = {
        "mean_difference_max": "scalar_mean_difference",
        "std_difference_max": "scalar_std_difference",
        "reference_std_max": "scalar_reference_std",
        "verdict": "scalar_verdict",
        "verdict_kind": "scalar_verdict_kind",
    }
    found = whole[list(names)].rename(names).rename(output="scalar", output_units="scalar_units")
    for name in names.values():
        found[name].attrs = {"comment": "of outputs without a time"}
    if compared is None:
        # no outputs, but all that is said of the methods
        compared = whole.isel(output=slice(0, 0))
    elif "recommendation" in compared.attrs:
        compared = compared.assign_attrs(recommendation=_with_doubts(compared, whole))
    blank = {name: "" if found[name].dtype.kind == "U" else np.nan for name in found.data_vars}
    every = np.array([str(label) for label in compared["method"].values], dtype=np.str_)
    if every.tolist() != found["method"].values.tolist():
        found = found.reindex({"method": every}, fill_value=blank)
    differs = whole.attrs["reference"] != compared.attrs["reference"]
    return compared.assign(found).assign_attrs({"scalar_reference": whole.attrs["reference"]} if differs else {})


def _with_doubts(compared: xr.Dataset, whole: xr.Dataset) -> str:
    """Return the recommendation, with what cannot be relied on among outputs without a time."""
    lead, *others = str(compared.attrs["recommendation"]).split("\n")
    for label in (str(method) for method in whole["method"].values):
        kind, text, which = overall(whole, label)
        if kind not in (DIFFERS, UNDER_RESOLVED):
            continue
        names = which or ", ".join(map(str, whole["output"].values))
        said = f"Of outputs without a time, do not rely on {names} of {label}: {text}."
        known = label in compared["method"].values and compared.sizes["output"]
        if not known or overall(compared, label)[0] in (DIFFERS, UNDER_RESOLVED):
            others.append(said)
        else:  # it may be the one that is recommended
            lead += f" {said}"
    return "\n".join((lead, *others))


def happening(nodes: Mapping[str, xr.DataTree]) -> tuple[dict[str, xr.DataTree], list[str]]:
    """Return nodes about the outputs that happen in all realisations of all methods, and the names of the others.

    Statistics of the others are those of other realisations in each method, and nothing to be compared.

    Parameters
    ----------
    nodes : mapping of str to xarray.DataTree
        Propagator nodes by label.

    Examples
    --------
    The second output does not happen in a tenth of the realisations:

    >>> import numpy as np
    >>> from uqmbd.results import happening, joined_outputs, labels, propagator_node, statistics_dataset
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> nodes = [node(["highest"], [0.0], [[3.5]]), node(["first"], [0.0], [[0.7]])]
    >>> joined = joined_outputs(nodes, "mine", [0.0, 0.1], [0.03, 0.15], {}, ["highest", "first"])
    >>> compared, left_out = happening(dict(mine=joined))
    >>> compared["mine"]["statistics/output"].values.tolist(), left_out
    (['highest'], ['first'])
    """
    left_out: list[str] = []
    for node in nodes.values():
        statistics = node.children["statistics"].to_dataset()
        if "censored" in statistics:
            missing = ~(statistics["censored"].values == 0)
            left_out += [str(name) for name in statistics["output"].values[missing] if str(name) not in left_out]
    if not left_out:
        return dict(nodes), []
    found: dict[str, xr.DataTree] = {}
    for label, node in nodes.items():
        parts = node_parts(node)
        for path, data in parts.items():
            if "output" in data.dims and "output" in data.coords:
                kept = [k for k, name in enumerate(data["output"].values) if str(name) not in left_out]
                parts[path] = data.isel(output=kept)
        if parts["statistics"].sizes["output"]:
            found[label] = xr.DataTree.from_dict(parts, name=node.name)
    return found, left_out


def _margin_nodes(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return nodes whose outputs are margins, by the label of the method, where all methods have them."""
    found: dict[str, xr.DataTree] = {}
    for label, node in nodes.items():
        inner = node.children.get("requirements")
        if inner is None or "statistics" not in inner.children:
            return {}
        # with the times, which they share with the dataset above them
        parts = {"/": xr.Dataset(attrs=node.attrs)} | {str(k): one.to_dataset() for k, one in inner.children.items()}
        found[label] = xr.DataTree.from_dict(parts, name=label)
    return found


def _empty(labels: Labels, like: xr.Dataset) -> xr.Dataset:
    """Statistics at all times, of no outputs."""
    none = Labels((), labels.inputs, labels.times)
    blank: Any = np.zeros(none.shape)
    errors = {name: blank for name in ("std_error_mean", "std_error_std") if name in like}
    levels = like["probability"].values
    quantile = np.zeros((len(levels), *none.shape))
    found = statistics_dataset(none, mean=blank, std=blank, quantile=quantile, probability=levels, **errors)
    return found.assign_coords(labels.input_coords())
