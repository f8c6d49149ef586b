"""Select the methods of a result with a polynomial chaos, and read the content of the chaos."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.report.figures.selection import Results, nodes_of, of_output
from uqmbd.results import (
    ComposedChaos,
    PiecewiseChaos,
    PolynomialChaos,
    surrogate,
    varying,
)
from uqmbd.results.chaos import Part, chaos_from_dataset, surrogate_parts
from uqmbd.results.statistics import rtol_of

__all__ = [
    "chaos_nodes",
    "drawable_nodes",
    "chaos_of",
    "finest",
    "one_node",
    "order_of",
    "series",
    "shown_methods",
    "stated_error_of",
    "surrogate_nodes",
    "surrogate_of",
    "times_of",
    "varies_over_time",
]


def chaos_nodes(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return the methods with a chaos at fixed times, which has a coefficient for each term, output and time."""
    return {label: node for label, node in nodes.items() if _has_chaos(node)}


def surrogate_nodes(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return the methods with a chaos of outputs over time: at fixed times, aligned, or composed of both kinds."""
    return {label: node for label, node in nodes.items() if _has_chaos(node) or _is_aligned(node)}


def drawable_nodes(nodes: Mapping[str, xr.DataTree]) -> dict[str, xr.DataTree]:
    """Return the methods with a surrogate over time that can be sampled, including models of plugins."""
    return {label: node for label, node in nodes.items() if surrogate_nodes({label: node}) or _is_custom(node)}


def surrogate_of(
    node: xr.DataTree, output: str | None = None, times: NDArray[np.float64] | None = None
) -> Part | ComposedChaos:
    """Return the surrogate of a method over time, optionally of one output.

    A chaos at fixed times, or a model of a plugin, is restricted to the times nearest to `times`.
    """
    if _is_aligned(node):
        return surrogate(node, output)
    if _is_custom(node):
        known = node.children["surrogate"].to_dataset()["time"].values
        rows = None if times is None else np.unique(np.abs(np.subtract.outer(times, known)).argmin(axis=1)).tolist()
        return surrogate(node, output, rows)
    return chaos_of(node, output, times)


def _is_aligned(node: xr.DataTree) -> bool:
    # models of plugins have no coefficients
    return "chaos" not in node.children and any(kind != "surrogate" for kind, _ in surrogate_parts(node).values())


def _is_custom(node: xr.DataTree) -> bool:
    kinds = [kind for kind, _ in surrogate_parts(node).values()]
    return kinds == ["surrogate"] and "time" in node.children["surrogate"].coords


def _has_chaos(node: xr.DataTree) -> bool:
    if "chaos" not in node.children:
        return False
    chaos = node.children["chaos"]
    found = [tuple(map(str, chaos[n].dims)) if n in chaos.data_vars else () for n in ("coefficients", "multi_index")]
    plain = ("term", "output", "time")
    return found[0] in (plain, ("element", *plain)) and found[1] == ("term", "input")


def chaos_of(
    node: xr.DataTree, output: str | None = None, times: NDArray[np.float64] | None = None
) -> PolynomialChaos | PiecewiseChaos:
    """Return the chaos of a method, optionally for one output or at given times; raise StudyError without a chaos."""
    if not _has_chaos(node):
        raise StudyError(
            f"The propagator {node.name!r} has no polynomial chaos of outputs over time, which this figure shows. "
            f"Use the node of a propagator that computes one{such_as(InputTreatment.INTERPOLATE)}."
        )
    data = node.children["chaos"].to_dataset()
    if output is not None:
        of_output(data, output)  # raises StudyError for an unknown name
        data = data.isel(output=[str(name) for name in data["output"].values].index(output) + np.arange(1))
    if times is not None:
        data = data.isel(time=np.unique(np.abs(np.subtract.outer(times, data["time"].values)).argmin(axis=1)))
    return chaos_from_dataset(data)


def order_of(node: xr.DataTree) -> int:
    """Return the order of the surrogate of a method: the largest degree of any input."""
    degrees = [data.to_dataset()["multi_index"].values for _, data in surrogate_parts(node).values()]
    return max(int(np.max(one, initial=0)) for one in degrees)


def finest(nodes: Mapping[str, xr.DataTree]) -> str:
    """Return the label of the chaos of the highest order; of several, the chaos with the most realisations.

    Chaoses at fixed times have priority over other chaoses, such as aligned chaoses.
    """
    found = chaos_nodes(nodes) or surrogate_nodes(nodes)
    if not found:
        raise StudyError(
            "None of these results contains a polynomial chaos of outputs over time. Use a method that computes one"
            f"{such_as(InputTreatment.INTERPOLATE)}."
        )
    return max(found, key=lambda label: (order_of(found[label]), int(found[label].attrs.get("realisations", 0))))


def one_node(results: Results) -> xr.DataTree:
    """Return the node to draw: the only node, or the node with the finest chaos."""
    nodes = nodes_of(results)
    return next(iter(nodes.values())) if len(nodes) == 1 else nodes[finest(nodes)]


def stated_error_of(node: xr.DataTree) -> xr.DataArray | None:
    """Return the stated error (output, time) of the surrogate of a method; None if no error is stated.

    The error of an output that does not vary is 0, because there is no spread.
    """
    for child in ("statistics", "chaos"):  # an aligned chaos states the error with its statistics
        if child in node.children and "verification_error" in node.children[child].data_vars:
            found = node.children[child].to_dataset()["verification_error"]
            if "time" not in found.dims:
                return None
            statistics = node.children["statistics"].to_dataset()
            moves = statistics["output"].copy(data=varying(statistics, rtol_of(node)))
            return found.where(moves.sel(output=found["output"].values), 0.0)
    return None


def times_of(data: xr.Dataset) -> NDArray[np.float64]:
    """Return the times; raise StudyError for outputs without times."""
    if "time" not in data.sizes:
        raise StudyError("This figure is drawn over time, and these outputs have no time.")
    return np.asarray(data["time"].values, dtype=float)


def varies_over_time(std: NDArray[np.float64], mean: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a mask (T,) of times at which the std of an output exceeds 1 % of its maximum, and the rounding error.

    At other times, the spread is negligible and its shares are meaningless. Stated errors use the same limit of 1 %.

    >>> import numpy as np
    >>> varies_over_time(np.array([0.0, 1e-4, 0.5]), np.ones(3)).tolist()
    [False, False, True]
    """
    from uqmbd.results.chaos import SPREAD_FLOOR

    rounding = 1e-13 * float(np.abs(mean).max(initial=0.0))
    return np.asarray(std > max(SPREAD_FLOOR * float(std.max(initial=0.0)), rounding))


def series(nodes: Mapping[str, xr.DataTree]) -> dict[str, list[str]]:
    """Group methods with surrogates that differ only in their order, and sort each group by ascending order.

    Methods belong to one group if their propagator and all text options agree, such as a rule or a kind of fit.

    Return labels by the name of the group, which is the common beginning of its labels, or its propagator.
    """
    groups: dict[tuple[str, ...], list[str]] = {}
    found = surrogate_nodes(nodes)
    for label, node in found.items():
        try:
            options = dict(json.loads(node.attrs.get("options", "{}")))
        except (TypeError, ValueError):
            options = {}
        texts = sorted(f"{k}={v}" for k, v in options.items() if isinstance(v, str) and k != "label")
        if options.get("elements") is not None:
            texts.append("with elements")  # methods with different numbers of elements belong to one group
        groups.setdefault((str(node.attrs.get("propagator", "")), *texts), []).append(label)
    named: dict[str, list[str]] = {}
    for (propagator, *_), members in groups.items():
        members.sort(key=lambda label: (order_of(found[label]), int(found[label].attrs.get("realisations", 0))))
        name = os.path.commonprefix(members).rstrip(" -_0123456789") or propagator
        while name in named:
            name += "'"
        named[members[0] if len(members) == 1 else name] = members
    return named


def shown_methods(nodes: Mapping[str, xr.DataTree], most: int = 4) -> dict[str, xr.DataTree]:
    """Return the methods for a common figure.

    If there are more than ``most`` methods, only the highest order of each series of chaoses is included, with all
    methods without a chaos.
    """
    lower = {label for members in series(nodes).values() for label in members[:-1]} if len(nodes) > most else set()
    return {label: node for label, node in nodes.items() if label not in lower}
