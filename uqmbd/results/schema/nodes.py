"""Build the nodes of a result, one per propagator with its provenance, and join them to a tree."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.arguments import NotNegative, Seed, Size, typechecked
from uqmbd.errors import StudyError
from uqmbd.names import check_label
from uqmbd.results.schema.datasets import KIND, SCHEMA_VERSION, check_kind
from uqmbd.results.schema.units import as_text, united
from uqmbd.results.schema.values import with_default_reasons
from uqmbd.status import Status

__all__ = [
    "comparable",
    "failed_methods",
    "join_nodes",
    "methods",
    "node_parts",
    "propagator_node",
    "propagator_nodes",
    "total_realisations",
    "tree_of",
]

NOT_METHODS = ("comparison", "convergence", "motion", "pose_surrogate")
"""Children of the results of a study that belong to no propagator."""

_RECORDED_PACKAGES = ("numpy", "scipy", "xarray", "sympy", "symengine", "llvmlite", "scikit-sundae", "chaospy")


@typechecked
def propagator_node(
    label: str,
    statistics: xr.Dataset,
    samples: xr.Dataset | None = None,
    *,
    nodes: xr.Dataset | None = None,
    propagator: str,
    realisations: Size,
    wall_time: NotNegative,
    failures: Size | None = None,
    seed: Seed | None = None,
    options: Mapping[str, Any] | None = None,
    solver_counters: Mapping[str, Any] | None = None,
    children: Mapping[str, xr.Dataset] | None = None,
    attrs: Mapping[str, Any] | None = None,
) -> xr.DataTree:
    """Build the node of one propagator, with its provenance.

    Parameters
    ----------
    label : str
        Label of the node, without ``/``; names of the schema are not allowed.
    statistics : xarray.Dataset
        Statistics from :func:`uqmbd.extend.statistics_dataset`.
    samples : xarray.Dataset, optional
        Samples from :func:`uqmbd.extend.sample_dataset`: draws from the joint distribution of the inputs.
    nodes : xarray.Dataset, optional
        Training points or quadrature nodes, from :func:`uqmbd.extend.sample_dataset` with ``kind="nodes"``.
    propagator : str
        Registered name of the method, such as ``monte-carlo``.
    realisations : int
        Number of computed realisations, including failed realisations.
    wall_time : float
        Wall-clock time, s.
    failures : int, optional
        Number of failed realisations. Default: counted in ``samples`` and ``nodes``; 0 without these.
    seed : int, optional
        Seed of the random numbers. Default: no seed, for methods without random numbers.
    options, solver_counters : mapping, optional
        Options of the method and counters of the solver. Values that JSON cannot represent are stored as text.
    children : mapping of str to xarray.Dataset, optional
        Further children, such as ``chaos`` or ``scalars/statistics``.
    attrs : mapping, optional
        Further attributes of the node.

    Returns
    -------
    xarray.DataTree
        Node of the propagator.

    Raises
    ------
    StudyError
        If the label is invalid, or a dataset states that its rows are of another kind.

    Examples
    --------
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0])
    >>> node = propagator_node("mine", statistics_dataset(axes, mean=[[1.0]], std=[[0.0]]),
    ...                        propagator="perturbation", realisations=1, wall_time=0.1, options={"order": 1})
    >>> node.name, node.attrs["options"]
    ('mine', '{"order": 1}')
    """
    check_label(label)
    stored = {name: data for name, data in (("samples", samples), ("nodes", nodes)) if data is not None}
    for name, data in stored.items():
        if KIND in data.attrs:
            check_kind(data, name, f"propagator_node of {label!r}")
    if failures is None:
        status = [np.asarray(data.variables["status"].values) for data in stored.values()]
        failures = sum(int(np.count_nonzero((x != Status.OK) & (x != Status.CENSORED))) for x in status)
    provenance: dict[str, Any] = {
        "propagator": propagator,
        "label": label,
        "uqmbd_version": _version("uqmbd"),
        "versions": json.dumps({"python": platform.python_version()} | {p: _version(p) for p in _RECORDED_PACKAGES}),
        "options": json.dumps(dict(options or {}), default=_plain),
        "wall_time": float(wall_time),
        "realisations": int(realisations),
        "failures": int(failures),
        "solver_counters": json.dumps(dict(solver_counters or {}), default=_plain),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    if seed is not None:
        provenance["seed"] = int(seed)
    datasets = {"/": xr.Dataset(attrs=provenance | dict(attrs or {})), "statistics": statistics}
    return tree_of(datasets | stored | dict(children or {}), name=label)


def tree_of(datasets: Mapping[str, xr.Dataset], name: str | None = None) -> xr.DataTree:
    """Return a tree of datasets by path, ``/`` for the root, as `xarray.DataTree.from_dict` with fewer copies.

    >>> list(tree_of({"/": xr.Dataset(), "scalars/statistics": xr.Dataset()}).to_dict())
    ['/', '/scalars', '/scalars/statistics']
    """
    nodes = {path.strip("/"): data for path, data in datasets.items()}
    for path in list(nodes):
        while path := path.rpartition("/")[0]:
            nodes.setdefault(path, xr.Dataset())
    made = {"": xr.DataTree(nodes.pop("", None), name=name)}
    made |= {path: xr.DataTree(data) for path, data in nodes.items()}
    below: dict[str, dict[str, xr.DataTree]] = {}
    for path in nodes:
        parent, _, child = path.rpartition("/")
        below.setdefault(parent, {})[child] = made[path]
    for path in sorted(below, key=lambda path: path.count("/") + bool(path)):
        made[path].children = below[path]
    return made[""]


@typechecked
def join_nodes(
    nodes: Iterable[xr.DataTree],
    *,
    study: str,
    mechanism: str,
    attrs: Mapping[str, Any] | None = None,
    further: Mapping[str, xr.Dataset] | None = None,
) -> xr.DataTree:
    """Join the nodes of several propagators without comparing them; see :func:`uqmbd.results.study_tree`.

    `nodes`: propagator nodes from `propagator_node`, with unique names; `study`, `mechanism`: names of study and
    mechanism; `attrs`: further attributes of the root; `further`: further datasets by path.
    The result contains a child for each node, and the version of the schema. Raise StudyError if two nodes have the
    same name.

    >>> import numpy as np
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.results.schema import join_nodes, labels, statistics_dataset
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> tree = join_nodes([node(["height"], [0.0], [[3.0]])], study="throw", mechanism="stone")
    >>> list(tree.children), tree.attrs["study"]
    (['mine'], 'throw')
    """
    created = datetime.now(UTC).isoformat(timespec="seconds")
    root: dict[str, Any] = {
        "Conventions": f"uqmbd-{SCHEMA_VERSION}",
        "schema_version": SCHEMA_VERSION,
        "study": study,
        "mechanism": mechanism,
    }
    root |= {"created": created, "uqmbd_version": _version("uqmbd")}
    datasets = {"/": xr.Dataset(attrs=root | dict(attrs or {}))}
    for node in nodes:
        label = str(node.name)
        if label in datasets:
            raise StudyError(f"Two propagators have the label {label!r}; give one of them another with label=.")
        end = node.attrs.get("ends_at", np.inf)
        for path, data in node_parts(node).items():
            if path.split("/")[-1] in ("statistics", "requirements"):
                # nodes of earlier versions, or without a run, may lack reasons
                data, _ = with_default_reasons(data, end=end)
            datasets[f"{label}/{path}".rstrip("/")] = as_text(united(data)) if data.data_vars else data
    return tree_of(datasets | dict(further or {}))


@typechecked
def methods(tree: xr.DataTree) -> dict[str, xr.DataTree]:
    """Return the nodes of the methods of a result by label.

    Other children, such as ``comparison``, ``convergence``, the drawing ``motion`` and ``pose_surrogate`` of a report,
    are not methods. Sections of a report and other readers of results list the methods by this function.

    Parameters
    ----------
    tree : xarray.DataTree
        Result of a study, or node of one method, which is then the only entry.

    Returns
    -------
    dict of str to xarray.DataTree
        Nodes of the methods by label.

    Examples
    --------
    >>> import xarray
    >>> tree = xarray.DataTree.from_dict({"monte-carlo/statistics": None, "comparison": None, "pose_surrogate": None})
    >>> list(methods(tree))
    ['monte-carlo']
    """
    if "statistics" in tree.children:
        return {str(tree.attrs.get("label", tree.name)): tree}
    return {str(name): node for name, node in tree.children.items() if name not in NOT_METHODS}


propagator_nodes = methods
"""Earlier name of `methods`; modules of the core use this name."""


def total_realisations(node: xr.DataTree) -> int:
    """Return the number of realisations that a method computed for all its outputs and requirements.

    The number includes realisations for scalar outputs or requirements only. Costs of methods are compared by it.

    >>> total_realisations(xr.DataTree(xr.Dataset(attrs={"realisations": 20, "further_realisations": 5})))
    25
    """
    own = sum(int(node.attrs.get(name, 0)) for name in ("realisations", "further_realisations"))
    return int(node.attrs.get("method_realisations", own))


@typechecked
def comparable(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return the nodes whose inputs have the distributions of the study.

    If there are no such nodes, return the nodes whose inputs have the distributions of the first node.

    If a method uses other distributions than the study, the attribute ``population`` of its node states the origin of
    the distributions.

    `nodes`: propagator nodes by label.

    >>> one, other = xr.DataTree(), xr.DataTree(xr.Dataset(attrs={"population": "posterior of run 3"}))
    >>> list(comparable({"after": other, "before": one}))
    ['before']
    """
    kinds = {label: str(node.attrs.get("population", "")) for label, node in nodes.items()}
    if not kinds:
        return {}
    population = "" if "" in kinds.values() else next(iter(kinds.values()))
    return {label: node for label, node in nodes.items() if kinds[label] == population}


@typechecked
def node_parts(node: xr.DataTree) -> dict[str, xr.Dataset]:
    """Return the datasets of a node by their path in the node; the path of its own dataset is ``/``.

    `node`: a propagator's node.

    >>> import numpy as np
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.results.schema import labels, node_parts, statistics_dataset
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> sorted(node_parts(node(["height"], [0.0], [[3.0]])))
    ['/', 'statistics']
    """
    return {
        path if (path := part.relative_to(node)) != "." else "/": part.to_dataset(inherit=False)
        for part in node.subtree
    }


@typechecked
def failed_methods(tree: xr.DataTree) -> dict[str, str]:
    """Return the reasons of failed methods by label, from the attribute ``failed``; empty if all succeeded.

    Parameters
    ----------
    tree : xarray.DataTree
        Result of a study.

    Examples
    --------
    >>> failed_methods(xr.DataTree(xr.Dataset(attrs={"failed": '{"galerkin": "too many nodes"}'})))
    {'galerkin': 'too many nodes'}
    """
    try:
        found = json.loads(str(tree.attrs.get("failed", "{}")))
    except ValueError:
        return {}
    return {str(k): str(v) for k, v in found.items()} if isinstance(found, dict) else {}


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, (set, frozenset)):
        return sorted(str(v) for v in value)
    return str(value)


@cache
def _version(package: str) -> str:
    """Return the version of an installed package; without the cache, this takes a quarter of a small study's time."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
