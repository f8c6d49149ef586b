"""Build the result of a study, and compare its methods in outputs over time, scalar outputs and requirements."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.assessment import DIFFERS, UNDER_RESOLVED, choose_reference, compare, judgements_of, worst
from uqmbd.results.requirements import compare_requirements
from uqmbd.results.schema import (
    as_text,
    comparable,
    join_nodes,
    node_parts,
    united,
)

__all__ = ["compare_both", "happening", "scalar_nodes", "study_tree"]


@typechecked
def scalar_nodes(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return the nodes of scalar outputs by label of the method; methods without scalar outputs are omitted.

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


Reference = str | Sequence[str] | None
"""Label of the reference, several labels to choose from, or None to choose from all labels."""


def compare_both(nodes: Mapping[str, xr.DataTree], reference: Reference = None, rtol: float = 0.0) -> xr.Dataset:
    """Compare every method with a reference, in outputs over time, scalar outputs and requirements.

    `nodes`: propagator nodes by label; `reference`: label of the reference, or several labels. Of these labels, or of
    all, :func:`uqmbd.results.choose_reference` chooses one reference for outputs over time, and one for scalar outputs;
    `rtol`: relative tolerance of the integration. The result for outputs over time is the return value of
    :func:`uqmbd.results.compare`. With scalar outputs, it also contains ``scalar_mean_difference`` and
    ``scalar_std_difference (method, scalar)``, absolute, in the units of the outputs, NaN for methods without them. The
    scale of these differences is ``scalar_reference_std (scalar)``. ``scalar_verdict`` and ``scalar_verdict_kind
    (method, scalar)`` are the verdicts. Without outputs over time, the recommendation is for scalar outputs. With
    requirements, the result also contains ``violation_probability (method, requirement)``, the ends of the intervals,
    and ``violation_verdict``. Methods whose inputs have other distributions (`comparable`) are excluded.
    """
    nodes = comparable(nodes)
    found = _compared_outputs(nodes, reference, rtol)
    if not any("requirements" in node.children for node in nodes.values()):
        return found
    limits = compare_requirements(nodes, str(found.attrs.get("reference", "")))
    return found if limits is None else found.merge(limits, join="left").assign_attrs(found.attrs)


def _compare(nodes: Mapping[str, xr.DataTree], reference: Reference, rtol: float) -> xr.Dataset:
    """Compare methods in one kind of outputs; several labels in `reference` are candidates."""
    if reference is None or isinstance(reference, str):
        return compare(nodes, reference=reference, rtol=rtol)
    some = {label: nodes[label] for label in reference if label in nodes}
    return compare(nodes, reference=choose_reference(some, rtol=rtol) if some else None, rtol=rtol)


def _compared_outputs(nodes: Mapping[str, xr.DataTree], reference: Reference, rtol: float) -> xr.Dataset:
    """Compare outputs over time and scalar outputs; without any outputs, return only the methods."""
    inner, left_out = happening(scalar_nodes(nodes))
    over_time = any(node.children["statistics"].sizes["output"] for node in nodes.values())
    if not (over_time or inner) and (margins := _margin_nodes(nodes)):
        # no outputs: methods are compared by the margins of requirements
        return _compare(margins, reference, rtol).isel(output=slice(0, 0))
    if left_out and not (over_time or inner):
        raise StudyError(
            f"there are no outputs to compare: {', '.join(left_out)} do not occur in all realisations, so the "
            "statistics of the methods are based on different realisations."
        )
    compared = _compare(nodes, reference, rtol) if over_time or not inner else None
    if not inner:
        return xr.Dataset() if compared is None else _without_censored(compared, nodes, left_out)
    # choose a separate reference, because the other one may have too few samples for scalar outputs
    whole = _compare(inner, None if isinstance(reference, str) and reference not in inner else reference, rtol)
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
        # select no outputs, so that only the data on the methods remain
        compared = whole.isel(output=slice(0, 0))
    elif "recommendation" in compared.attrs:
        compared = compared.assign_attrs(recommendation=_with_reservations(compared, whole))
    compared = _without_censored(compared, nodes, left_out)
    blank = {name: "" if found[name].dtype.kind == "U" else np.nan for name in found.data_vars}
    every = np.array([str(label) for label in compared["method"].values], dtype=np.str_)
    if every.tolist() != found["method"].values.tolist():
        found = found.reindex({"method": every}, fill_value=blank)
    differs = whole.attrs["reference"] != compared.attrs["reference"]
    return compared.assign(found).assign_attrs({"scalar_reference": whole.attrs["reference"]} if differs else {})


def _without_censored(compared: xr.Dataset, nodes: Mapping[str, xr.DataTree], left_out: Sequence[str]) -> xr.Dataset:
    """Add the names of censored outputs, and the methods with their statistics, to a comparison."""
    if not left_out:
        return compared
    compared = compared.assign_attrs(censored=", ".join(left_out))
    sentence = _missing_statistics(nodes, left_out, str(compared.attrs.get("recommended", "[]")))
    if sentence and "recommendation" in compared.attrs:
        lead, *others = str(compared.attrs["recommendation"]).split("\n")
        compared = compared.assign_attrs(recommendation="\n".join((f"{lead} {sentence}", *others)))
    return compared


def _missing_statistics(nodes: Mapping[str, xr.DataTree], left_out: Sequence[str], chosen: str) -> str:
    """Return a sentence on the statistics of censored outputs that recommended methods lack; empty if none.

    `chosen`: labels of the recommended methods, JSON.
    """
    known: dict[str, list[str]] = {name: [] for name in left_out}
    for label, node in scalar_nodes(nodes).items():
        statistics = node.children["statistics"].to_dataset()
        for name, mean in zip(statistics["output"].values, statistics["mean"].values, strict=True):
            if str(name) in known and np.isfinite(mean):
                known[str(name)].append(label)
    found = []
    for label in json.loads(chosen):
        missing = [name for name, labels in known.items() if label not in labels]
        if missing:
            others = dict.fromkeys(other for name in missing for other in known[name])
            which, these = ("does", "this output") if len(missing) == 1 else ("do", "these outputs")
            instead = f"; use {' or '.join(others)} for {these}" if others else ""
            names = ", ".join(missing)
            found.append(f"{label} has no statistics of {names}, which {which} not occur in all realisations{instead}.")
    return " ".join(found)


def _with_reservations(compared: xr.Dataset, whole: xr.Dataset) -> str:
    """Return the recommendation with a list of unreliable scalar outputs."""
    lead, *others = str(compared.attrs["recommendation"]).split("\n")
    over_time = judgements_of(compared)
    for label, found in judgements_of(whole).items():
        one, which = worst(found)
        if one.kind not in (DIFFERS, UNDER_RESOLVED):
            continue
        names = which or ", ".join(map(str, whole["output"].values))
        words = f"Scalar outputs: do not rely on {names} of {label}: {one.text}."
        known = over_time.get(label)
        if not known or worst(known)[0].kind in (DIFFERS, UNDER_RESOLVED):
            others.append(words)
        else:  # no other sentence warns of this method, which may be recommended
            lead += f" {words}"
    return "\n".join((lead, *others))


@typechecked
def happening(nodes: Mapping[str, xr.DataTree]) -> tuple[dict[str, xr.DataTree], list[str]]:
    """Return nodes with the outputs that occur in all realisations of all methods, and the names of other outputs.

    Statistics of the other outputs belong to different realisations in each method, and cannot be compared.

    `nodes`: propagator nodes by label.

    The second output does not occur in a tenth of the realisations:

    >>> import numpy as np
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> from uqmbd.results.tree import happening, joined_outputs
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
                chosen = [k for k, name in enumerate(data["output"].values) if str(name) not in left_out]
                parts[path] = data.isel(output=chosen)
        if parts["statistics"].sizes["output"]:
            found[label] = xr.DataTree.from_dict(parts, name=node.name)
    return found, left_out


def _margin_nodes(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return nodes whose outputs are margins, by the label of the method; empty unless all methods have margins."""
    found: dict[str, xr.DataTree] = {}
    for label, node in nodes.items():
        inner = node.children.get("requirements")
        if inner is None or "statistics" not in inner.children:
            return {}
        # datasets with inherited coordinates, because the times are in the dataset of the parent
        parts = {"/": xr.Dataset(attrs=node.attrs)} | {str(k): one.to_dataset() for k, one in inner.children.items()}
        found[label] = xr.DataTree.from_dict(parts, name=label)
    return found


@typechecked
def study_tree(
    nodes: Iterable[xr.DataTree],
    *,
    study: str,
    mechanism: str,
    reference: str | Sequence[str] | None = None,
    attrs: Mapping[str, Any] | None = None,
) -> xr.DataTree:
    """Join the nodes of several propagators to the result of a study, and compare them.

    Parameters
    ----------
    nodes : iterable of xarray.DataTree
        Nodes from :func:`uqmbd.results.propagator_node`, with different labels.
    study, mechanism : str
        Names of the study and of the mechanism.
    reference : str or sequence of str, optional
        Label of the reference method, or several labels. :func:`uqmbd.results.choose_reference` chooses from these.
        Default: from all labels. It chooses twice: for outputs over time, and for scalar outputs.
    attrs : mapping, optional
        Further attributes of the root, such as ``rtol``, ``integrator`` or ``command``.

    Returns
    -------
    xarray.DataTree
        Result of the study.

    Raises
    ------
    StudyError
        If there are no nodes, or two have the same label.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[1.0]], std=[[0.0]]),
    ...                        propagator="perturbation", realisations=1, wall_time=0.1)
    >>> sorted(study_tree([node], study="s", mechanism="m").children)
    ['comparison', 'mine']
    """
    found = list(nodes)
    by_label = {str(node.name): node for node in found}
    if len(by_label) < len(found):
        return join_nodes(found, study=study, mechanism=mechanism)  # raises the error of equal labels
    compared = compare_both(by_label, reference, float((attrs or {}).get("rtol", 0.0)))
    further = {"comparison": as_text(united(compared, copy=False), copy=False)}
    return join_nodes(found, study=study, mechanism=mechanism, attrs=attrs, further=further)
