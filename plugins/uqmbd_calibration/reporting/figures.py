"""Figures of a calibration: records against predictions, residuals, pairs of inputs, and what was learned."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.report import arrange, axes_grid, style, with_units, wrapped
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_learned", "draw_pairs", "draw_record", "inputs_of"]


MOST_INPUTS = 5
"""Inputs of which pairs are drawn."""

POINTS = 600
"""Draws in a scatter of a pair."""

OUTER = 4.0
"""Residuals, over the noise, from which on they are drawn at the edge."""

REACH = 4.0
"""Standard deviations about the mean that are drawn of each input."""

WIDE = 10.0
"""Standard deviation over the reach of an axis from which on a density is level there."""

PRIOR, POSTERIOR, MEASURED = style(3)[0], style(0)[0], "0.15"


def inputs_of(tree: xr.DataTree) -> list[str]:
    """Names of the inputs that were found, those of which most was learned first."""
    data = tree["summary"].to_dataset()
    chosen = data.isel(input=np.flatnonzero(~data["noise"].values))
    order = np.argsort(-chosen["learned"].values, kind="stable")
    return [str(name) for name in chosen["input"].values[order]]


def _of(tree: xr.DataTree, group: str, name: str) -> xr.DataArray:
    return tree[group].to_dataset()[name]


def draw_record(tree: xr.DataTree, name: str) -> Figure:
    """Draw what was measured of an output, bands of predictions before and after, and residuals beneath.

    Parameters
    ----------
    tree : xarray.DataTree
        Of a calibration.
    name : str
        Of a variable of the observed data.
    """
    values = _of(tree, "observed_data", name)
    (along,) = values.dims
    timeless = str(along).endswith("_repetition")
    at = np.arange(1.0, values.size + 1) if timeless else np.asarray(values[along].values, dtype=float)
    figure, (upper, lower) = axes_grid(2, 2.0, 1)
    handles: dict[str, Any] = {}
    for group, colour, label in (
        ("prior_predictive", PRIOR, "before: 95 %"),
        ("posterior_predictive", POSTERIOR, "after: 95 %"),
    ):
        draws = _of(tree, group, name).values.reshape(-1, values.size)
        low, high = np.nanquantile(draws, [0.025, 0.975], axis=0)
        handles[label] = _band(upper, at, low, high, colour, timeless=timeless)
    (fit,) = upper.plot(at, _of(tree, "fit", name).values, color=POSTERIOR, lw=1.0)
    size = 3.5 if values.size <= 60 else 1.8
    (dots,) = upper.plot(at, values.values, ls="", marker="o", ms=size, color=MEASURED, mew=0)
    handles |= {"after: fit": fit, "measured": dots}
    upper.set_ylabel(wrapped(with_units(name, str(values.attrs.get("units", ""))), 30))
    residuals = _of(tree, "residuals", name).values
    shown = np.clip(residuals, -OUTER, OUTER)
    lower.axhspan(-1.96, 1.96, color="0.9", lw=0)
    lower.axhline(0, color="0.5", lw=0.8)
    outside = np.abs(residuals) > OUTER
    lower.plot(at[~outside], shown[~outside], ls="", marker="o", ms=size, color=MEASURED, mew=0)
    if outside.any():
        (far,) = lower.plot(at[outside], shown[outside], ls="", marker="D", ms=3.5, color=style(1)[0], mew=0)
        handles[f"beyond {OUTER:g}"] = far
    lower.set_ylim(-OUTER - 0.4, OUTER + 0.4)
    lower.set_ylabel("residual\nover noise")
    for axes in (upper, lower):
        axes.set_xlim(at[0] - (0.5 if timeless else 0.0), at[-1] + (0.5 if timeless else 0.0))
        axes.grid(color="0.92", lw=0.6)
    upper.tick_params(labelbottom=False)
    lower.set_xlabel("measurement" if timeless else "time [s]")
    arrange(figure, [upper, lower], legend=handles, heights=[2.0, 1.1])
    return figure


def _band(axes: Axes, at: Array, low: Array, high: Array, colour: str, *, timeless: bool) -> Any:
    """Fill between the edges of a band; over repetitions there is no line between them."""
    if timeless:
        low, high = np.full(len(at), low.mean()), np.full(len(at), high.mean())
        at = np.linspace(at[0] - 0.5, at[-1] + 0.5, len(at))
    return axes.fill_between(at, low, high, color=colour, alpha=0.22, lw=0)


def draw_learned(tree: xr.DataTree) -> Figure:
    """Draw the width of the posterior over that of the prior, for each input and noise level that was found."""
    data = tree["summary"].to_dataset()
    names = inputs_of(tree)
    left = 1 - data["learned"].sel(input=names).values
    figure, (axes,) = axes_grid(1, 0.75 + 0.3 * len(names), 1)
    places = np.arange(len(names))[::-1]
    floor = 10 ** np.floor(np.log10(max(min(left.min(), 0.5), 1e-9)) - 0.3)
    axes.hlines(places, floor, np.maximum(left, floor), color=POSTERIOR, lw=5, alpha=0.75)
    axes.axvline(1.0, color=PRIOR, lw=1.6)
    axes.set_xscale("log")
    axes.set_xlim(floor, max(2.0, 1.3 * left.max()))
    axes.set_ylim(-0.7, len(names) - 0.3)
    axes.set_yticks(places, [f"  {name}" for name in names])
    axes.set_xlabel("standard deviation after over before")
    axes.grid(axis="x", color="0.9", lw=0.6)
    arrange(figure, [axes])
    return figure


def draw_pairs(tree: xr.DataTree) -> Figure:
    """Draw the posterior of each input beside its prior, and draws of each pair of inputs."""
    names = inputs_of(tree)[:MOST_INPUTS]
    posterior, prior = tree["posterior"].to_dataset(), tree["prior"].to_dataset()
    about = {name: (float(posterior[name].mean()), float(posterior[name].std()) or 1.0) for name in names}
    draws, before = (
        {name: (group[name].values.ravel() - about[name][0]) / about[name][1] for name in names}
        for group in (posterior, prior)
    )
    count = len(names)
    figure, grid = axes_grid(count * count, 5.2 / count, count)
    handles: dict[str, Any] = {}
    chosen = np.linspace(0, len(draws[names[0]]) - 1, min(POINTS, len(draws[names[0]]))).astype(int)
    for row, one in enumerate(names):
        for column, other in enumerate(names):
            axes = grid[row * count + column]
            axes.tick_params(labelsize=8)
            axes.set_xticks([-2, 0, 2])
            axes.set_yticks([])
            if column > row:
                axes.set_visible(False)
                continue
            axes.set_xlim(-REACH, REACH)
            if row == column:
                _density(axes, before[one], PRIOR, "before", handles)
                _density(axes, draws[one], POSTERIOR, "after", handles)
                axes.set_ylim(bottom=0)
            else:
                about_pair: dict[str, Any] = {"ls": "", "marker": ".", "ms": 2, "alpha": 0.35, "color": POSTERIOR}
                axes.plot(draws[other][chosen], draws[one][chosen], **about_pair)
                axes.set_ylim(-REACH, REACH)
                axes.set_yticks([-2, 0, 2])
                correlation = float(np.corrcoef(draws[other], draws[one])[0, 1])
                axes.set_title(f"correlation {correlation:.2f}", fontsize=8, y=1.0)
            axes.tick_params(labelbottom=row == count - 1, labelleft=column == 0)
            axes.set_xlabel(wrapped(other, 64 // count) if row == count - 1 else "", fontsize=8)
            axes.set_ylabel(wrapped(one, 64 // count) if column == 0 and row else "", fontsize=8)
    arrange(figure, grid, count, legend=handles)
    return figure


def _density(axes: Axes, values: Array, colour: str, label: str, handles: dict[str, Any]) -> None:
    """Draw a density by a histogram; one that is far wider than the axis is level there."""
    edges = np.linspace(-REACH, REACH, 41)
    heights = np.histogram(values, edges)[0] / (len(values) * (edges[1] - edges[0]))
    if float(values.std()) > WIDE * REACH:
        # too few draws are inside
        near = np.abs(values) < WIDE * REACH / 2
        heights = np.full(40, np.count_nonzero(near) / (len(values) * WIDE * REACH))
    handles.setdefault(label, axes.stairs(heights, edges, color=colour, fill=label == "after", alpha=0.75, lw=1.4))
