"""The report's section on outputs without a time: their statistics side by side, and their densities."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.report.drawing import (
    COLOURS,
    arrange,
    axes_grid,
    draw_histogram,
    few_ticks,
    image,
    style,
    with_units,
    wrapped,
)
from uqmbd.report.figures.distributions import SURROGATE_SAMPLES, density
from uqmbd.report.figures.selection import Results, nodes_of
from uqmbd.results import scalar_nodes, surrogate, worst_integration_share
from uqmbd.status import Status
from uqmbd.wording import format_count, format_number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["scalar_densities", "scalar_differences", "scalar_names", "scalars"]

MOST = 12
"""Outputs whose densities are drawn."""

METHODS = 6
"""Most methods whose densities are drawn in one figure."""


def scalar_names(nodes: Mapping[str, xr.DataTree]) -> list[str]:
    """Return the names of all outputs without a time, in the order of the study."""
    names: dict[str, None] = {}
    for node in scalar_nodes(nodes).values():
        names |= dict.fromkeys(map(str, node.children["statistics"].coords["output"].values))
    return list(names)


def scalars(nodes: Mapping[str, xr.DataTree]) -> dict[str, Any] | None:
    """Return what the section on outputs without a time says and shows; None if there are none."""
    inner = scalar_nodes(nodes)
    names = scalar_names(nodes)
    if not names:
        return None
    rows = [_row(label, node, name) for name in names for label, node in inner.items() if name in _names(node)]
    drawn = (
        [
            image(
                lambda: scalar_densities(nodes),
                f"Probability densities of {', '.join(names[:MOST])}.",
                "How they are distributed: bars are the histogram of the first method with samples, curves a smooth "
                "estimate of the density (of a surrogate, from samples of it); the area under each is 1.",
                "outputs-without-time",
            )
        ]
        if any({"samples", "chaos"} & set(node.children) for node in inner.values())
        else []
    )
    return {
        "words": [sentence for label, node in inner.items() for sentence in _words(label, node)],
        "rows": rows,
        "influence": any(row["influence"] for row in rows),
        "stated": any(row["error"] for row in rows),
        "figures": drawn,
    }


def scalar_differences(data: xr.Dataset) -> list[dict[str, str]]:
    """Return rows for the table of differences between methods, from the dataset ``comparison``."""
    if "scalar_mean_difference" not in data:
        return []
    reference = str(data.attrs.get("scalar_reference", data.attrs["reference"]))
    rows = []
    for o, name in enumerate(data["scalar"].values):
        scale, units = float(data["scalar_reference_std"][o]), str(data["scalar_units"].values[o])
        for m, method in enumerate(data["method"].values):
            if str(method) == reference:
                continue
            row = {"output": str(name), "method": str(method), "mean_difference_l2": "–", "std_difference_l2": "–"}
            for key in ("mean", "std"):
                value = float(data[f"scalar_{key}_difference"].values[m, o])
                share = f" ({100 * value / scale:.2g} %)" if scale > 0 and math.isfinite(value) else ""
                text = format_number(value)
                row[f"{key}_difference_max"] = (f"{text} {units}" if units else text) + share
            rows.append(row)
    return rows


def scalar_densities(results: Results) -> Figure:
    """Draw how each output without a time is distributed.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        A study's result, or nodes of methods.

    Returns
    -------
    matplotlib.figure.Figure
        Axes for each output, the first twelve.

    Raises
    ------
    StudyError
        If there are no such outputs.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    >>> mass = mechanism.body("mass", mass=2, position=(1, 0))
    >>> k = uqmbd.RandomVariable("k", chaospy.Uniform(7, 9), units="N/m")
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=k))
    >>> mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    >>> study = uqmbd.Study("oscillator", mechanism, [0, 1])
    >>> scalar_densities(study.propagate(Collocation(order=2))).axes[0].get_xlabel()
    'frequency [Hz]'
    """
    from matplotlib.lines import Line2D

    inner = scalar_nodes(nodes_of(results))
    names = scalar_names(nodes_of(results))[:MOST]
    responses = {label: found for label, node in inner.items() if (found := _responses(node))}
    responses = dict(list(responses.items())[:METHODS])
    if not names or not responses:
        raise StudyError("There are no samples of outputs without a time, and no chaos of them.")
    units = {name: unit for node in inner.values() for name, unit in _units(node).items()}
    barred = next((label for label in responses if "samples" in inner[label].children), None)
    figure, grid = axes_grid(len(names), 1.75)
    for place, (axes, name) in enumerate(zip(grid, names, strict=True)):
        if barred is not None and name in responses[barred]:
            draw_histogram(axes, responses[barred][name], COLOURS[0], density=True)
        for method, values in enumerate(responses.values()):
            curve = density(values[name]) if name in values else None
            if curve is not None:
                colour, line = style(method)
                axes.plot(*curve, color=colour, ls=line, lw=1.5)
                axes.set_ylim(0, max(axes.get_ylim()[1], 1.05 * float(curve[1].max())))
        few_ticks(axes)
        axes.set_ylabel("density" if place % 2 == 0 else "")
        axes.set_xlabel(wrapped(with_units(name, units.get(name, "")), 24))
    handles: dict[str, Any] = {}
    if len(responses) > 1:
        styles = [style(k) for k in range(len(responses))]
        handles = {
            name: Line2D([], [], color=c, ls=ls, lw=1.5) for name, (c, ls) in zip(responses, styles, strict=True)
        }
    arrange(figure, grid, min(2, len(names)), legend=handles)
    return figure


def _names(node: xr.DataTree) -> list[str]:
    return [str(name) for name in node.children["statistics"].coords["output"].values]


def _units(node: xr.DataTree) -> dict[str, str]:
    units = node.children["statistics"].coords["output_units"].values
    return dict(zip(_names(node), map(str, units), strict=True))


def _responses(node: xr.DataTree) -> dict[str, NDArray[np.float64]]:
    """Return samples of each output of a method, or of its surrogate; nothing where it has neither."""
    if "samples" in node.children:
        data = node.children["samples"].to_dataset()
        values = data["response"].values[data["status"].values == Status.OK]
        return dict(zip(_names(node), values.T, strict=True)) if len(values) else {}
    if "chaos" in node.children:
        # a general joint distribution cannot be sampled without its mechanism
        with contextlib.suppress(StudyError):
            _, values = surrogate(node).sample(SURROGATE_SAMPLES, seed=0)
            return dict(zip(_names(node), values.T, strict=True))
    return {}


def _row(label: str, node: xr.DataTree, name: str) -> dict[str, str]:
    statistics = node.children["statistics"].to_dataset()
    data = statistics.isel(output=_names(node).index(name))
    units = _units(node)[name]

    def shown(value: float, error: str = "") -> str:
        text = format_number(value, float(data[error]) if error in data else None)
        return f"{text} {units}" if units and text != "unknown" else text

    found = {"output": name, "method": label}
    for value in ("mean", "std"):
        found[value] = shown(float(data[value]), f"std_error_{value}")
    for level in (0.05, 0.95):
        at = data["quantile"].sel(probability=level, method="nearest")
        known = abs(float(at["probability"]) - level) < 1e-6
        found[f"q{level}"] = shown(float(at)) if known else "unknown"
    return found | {"influence": _influence(data), "error": _error(data)}


def _influence(data: xr.Dataset) -> str:
    """Say which input takes part in most of the variance."""
    for name, dim in (("sobol_total", "input"), ("sobol_total_germ", "germ")):
        if name in data and float(data["std"]) > 0:
            values = data[name].values
            top = int(np.argmax(values))
            return f"{data[dim].values[top]!s} ({100 * min(max(float(values[top]), 0.0), 1.0):.0f} %)"
    return ""


def _error(data: xr.Dataset) -> str:
    """Say the stated error of a surrogate."""
    if "verification_error" not in data or not math.isfinite(float(data["verification_error"])):
        return ""
    share = float(data["verification_error"])
    return "below 0.0001 %" if share < 1e-6 else f"{100 * share:.2g} %"


def _words(label: str, node: xr.DataTree) -> list[str]:
    total, failed = (int(node.attrs.get(key, 0)) for key in ("realisations", "failures"))
    words = []
    worst = worst_integration_share(node.children["statistics"].to_dataset())
    if worst is not None and math.isfinite(worst.share):
        words.append(f"With {label}, the error of the time integration is {worst.words()} ({worst.output}), or less.")
    if node.attrs.get("fit") and failed:
        words.append(f"With {label}: {node.attrs['fit']}.")
    if failed:
        reason = ""
        if "samples" in node.children:
            messages = [str(m) for m in node.children["samples"].to_dataset()["message"].values if str(m)]
            reason = f" The first reason: {messages[0]}" if messages else ""
        words.append(
            f"With {label}, {failed} of {format_count(total, 'realisation')} have no such values and do not enter the "
            f"statistics.{reason}"
        )
    return words
