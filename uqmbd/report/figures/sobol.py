"""Which inputs matter: Sobol' indices over time, with the standard deviation that they are shares of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.report.drawing import arrange, axes_grid, limit_times, style, with_units, wrapped
from uqmbd.report.figures.selection import Results, label_of, nodes_of, of_output, thinned
from uqmbd.report.figures.surrogates import finest, stated_error_of, surrogate_nodes, times_of, varies_over_time
from uqmbd.results import varies
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Indices", "has_indices", "indices_of", "node_with_indices", "shown_inputs", "sobol_indices"]


NEGLIGIBLE = 0.02
"""Inputs whose total index never exceeds this, where the output spreads, are not shown one by one."""
TOO_LARGE = 0.1
"""Stated error of a chaos above which another one tells better what matters."""
OF_GERMS = "“b | a” is what b adds once a is known"
_OTHERS, _INTERACTIONS, _QUIET = "0.45", "0.8", "#ECECEC"


@dataclass(frozen=True, eq=False)
class Indices:
    """Sobol' indices of one output.

    Attributes
    ----------
    names : tuple of str, length G
        Of the inputs, or of the germs where inputs depend on one another.
    of_germs : bool
    first, total : array, shape (G, T)
    times, std, mean : array, shape (T,)
    meaningful : array of bool, shape (T,)
        Where there is a spread to share.
    units : str
        Of the standard deviation.
    """

    names: tuple[str, ...]
    of_germs: bool
    first: Array
    total: Array
    times: Array
    std: Array
    meaningful: NDArray[np.bool_]
    units: str

    @property
    def weighted(self) -> tuple[Array, Array]:
        """First-order and total indices (G,), averaged over time with the variance as weight; NaN without spread."""
        weight = np.where(self.meaningful, self.std / (self.std.max() or 1.0), 0.0) ** 2
        if len(self.times) > 1:
            weight = weight * np.gradient(self.times)
        if not weight.sum() > 0:
            return np.full(len(self.names), np.nan), np.full(len(self.names), np.nan)
        return self.first @ weight / weight.sum(), self.total @ weight / weight.sum()


def has_indices(node: xr.DataTree) -> bool:
    """Tell whether a method has Sobol' indices over time, of inputs or of germs."""
    return _kind(node) is not None and "time" in node.children["statistics"].sizes


def _kind(node: xr.DataTree) -> str | None:
    known = set(map(str, node.children["statistics"].data_vars))
    return next((end for end in ("", "_germ") if {f"sobol_first{end}", f"sobol_total{end}"} <= known), None)


def node_with_indices(results: Results) -> xr.DataTree:
    """Return the method whose indices to show: the one with the finest chaos, else the first that has any.

    Where that chaos states an error of more than 10 %, the one that states the least.
    """
    nodes = nodes_of(results)
    holders = {label: node for label, node in nodes.items() if has_indices(node)}
    if not holders:
        raise StudyError(f"There are no Sobol' indices over time in {', '.join(map(repr, nodes))}.")
    if not surrogate_nodes(holders):
        return next(iter(holders.values()))
    chosen, errors = finest(holders), {label: _typical_error(node) for label, node in holders.items()}
    # a high order that misses a jump says less than a lower one that follows it
    wrong = np.isfinite(errors[chosen]) and errors[chosen] > TOO_LARGE
    return holders[min(errors, key=lambda label: errors[label]) if wrong else chosen]


def _typical_error(node: xr.DataTree) -> float:
    """Return the stated error of the output that has the largest, a root mean square over time; infinite: unknown."""
    stated = stated_error_of(node)
    if stated is None or not np.isfinite(stated.values).all():
        return np.inf
    return float(np.sqrt((stated.values**2).mean(axis=-1)).max(initial=0.0))


def indices_of(node: xr.DataTree, output: str) -> Indices:
    """Return the Sobol' indices of one output of a method; a method without is an error."""
    end = _kind(node)
    if end is None:
        raise StudyError(f"The propagator {label_of(node)!r} has no Sobol' indices.")
    data = of_output(node.children["statistics"], output)
    times = times_of(data)
    names = data["germ" if end else "input"].values
    first, total = (np.asarray(data[f"sobol_{kind}{end}"].values, dtype=float) for kind in ("first", "total"))
    std = np.asarray(data["std"].values, dtype=float)
    meaningful = varies_over_time(std, data["mean"].values) & varies(node, output)
    return Indices(
        tuple(map(str, names)), bool(end), first, total, times, std, meaningful, str(data["output_units"].item())
    )


def sobol_indices(results: Results, output: str, *, most: int = 5) -> Figure:
    r"""Draw over time which input causes which share of the variance, and how large the spread is at all.

    Above, stacked: the first-order indices, what each input explains alone, and what is left for interactions. Then
    the total indices: the share in which each input takes part. Beneath: the standard deviation; where it is below 1 %
    of its maximum, the indices are greyed out, for they are shares of next to nothing.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        A study's result, or nodes. Of several methods with indices the one with the finest chaos is drawn.
    output : str
        Name of the output.
    most : int
        How many inputs are drawn by name. Further ones, and several of which none ever exceeds 2 %, are "others": the
        sum of their first-order indices, and of their total indices (an upper bound of what they do together).

    Returns
    -------
    matplotlib.figure.Figure
        Axes: first-order indices, total indices, standard deviation.

    Raises
    ------
    StudyError
        If no method has Sobol' indices, or no such output exists.

    Examples
    --------
    >>> from uqmbd.results import labels, propagator_node, statistics_dataset
    >>> axes = labels([("x", "m")], ["k", "c"], [0.0, 1.0])
    >>> index = [[[0.9, 0.4]], [[0.1, 0.5]]]
    >>> statistics = statistics_dataset(axes, mean=[[0, 1]], std=[[0.1, 0.2]], sobol_first=index, sobol_total=index)
    >>> figure = sobol_indices(propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0), "x")
    >>> [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]
    ['share of variance', 'total index', 'std [m]']
    """
    found = indices_of(node_with_indices(results), output)
    named = shown_inputs(found, most)
    rest = [k for k in range(len(found.names)) if k not in named]
    chosen = _chosen_times(found, named)
    times, std, meaningful = found.times[chosen], found.std[chosen], found.meaningful[chosen]
    first, total = found.first[:, chosen], found.total[:, chosen]
    if len(times) == 1:
        times = times[0] + np.array([-0.5, 0.5])
        first, total = np.repeat(first, 2, axis=1), np.repeat(total, 2, axis=1)
        std, meaningful = np.repeat(std, 2), np.repeat(meaningful, 2)

    figure, grid = axes_grid(3, 1.5, 1)
    shares, totals, spread = grid
    handles: dict[str, Any] = {}
    base = np.zeros(len(times))
    layers = [(found.names[k], first[k], total[k], *_look(found, named, k)) for k in named]
    if rest:
        name = f"{len(rest)} others" if len(rest) > 1 else found.names[rest[0]]
        layers.append((name, first[rest].sum(axis=0), total[rest].sum(axis=0), _OTHERS, (0, (1, 1))))
    for name, alone, shared, colour, line in layers:
        top = base + np.maximum(alone, 0.0)
        handles[name] = shares.fill_between(times, base, top, color=colour, alpha=0.75, lw=0)
        shares.plot(times, top, color="white", lw=0.6)
        totals.plot(times, shared, color=colour, ls=line, lw=1.6)
        base = top
    left = np.where(meaningful, 1.0 - base, 0.0)
    if np.any(left > 0.002):
        upper = np.maximum(1.0, base)
        handles["interactions"] = shares.fill_between(times, base, upper, color=_INTERACTIONS, alpha=0.8, lw=0)
    spread.plot(times, std, color="0.2", lw=1.3)
    spread.set_ylim(*((0, 1.08 * float(std.max())) if std.max() > 0 else (-0.5, 0.5)))
    for axes in grid:
        limit_times(axes, times)
        axes.grid(color="0.9", lw=0.7)
        quiet = _grey_out(axes, times, meaningful)
        if quiet is not None:
            handles["hardly any spread"] = quiet
    # shares of next to nothing are any number, and do not decide how high the axes reach
    shares.set_ylim(0, max(1.0, 1.02 * float(base.max(where=meaningful, initial=0.0))))
    together = np.array([t for _, _, t, _, _ in layers])
    totals.set_ylim(
        min(0.0, 1.02 * float(together.min(where=meaningful, initial=0.0))),
        max(1.0, 1.02 * float(together.max(where=meaningful, initial=0.0))),
    )
    _label(found, grid)
    arrange(figure, grid, legend=handles, heights=(1.35, 1.1, 0.65))
    return figure


def shown_inputs(found: Indices, most: int) -> list[int]:
    """Return which inputs are drawn by name, in the order of the study."""
    share = np.where(found.meaningful, found.total, 0.0).max(axis=1, initial=0.0)
    ranked = sorted(range(len(share)), key=lambda k: (-share[k], k))
    matter = [k for k in ranked if share[k] > NEGLIGIBLE] or ranked[:1]
    if len(ranked) <= most and len(ranked) - len(matter) < 2:
        return sorted(ranked)  # a single small one is itself, not "others"
    return sorted(matter[:most])


def _look(found: Indices, named: list[int], k: int) -> tuple[str, Any]:
    """Return an input's colour and line: the same in all figures of a study with few inputs."""
    return style(k if len(found.names) <= 6 else named.index(k))


def _chosen_times(found: Indices, named: list[int]) -> NDArray[np.intp]:
    curves = [found.std, *found.first[named], *found.total[named]]
    most = max(600 // len(curves), 24)
    if len(found.times) <= 600:
        return np.arange(len(found.times))
    return np.unique(np.concatenate([thinned(curve, curve, most) for curve in curves]))


def _grey_out(axes: Axes, times: Array, meaningful: NDArray[np.bool_]) -> Any:
    """Cover the times at which nothing spreads, each up to half the way to its neighbours; return the cover."""
    quiet = np.concatenate([[False], ~meaningful, [False]])
    starts, ends = np.flatnonzero(quiet[1:] & ~quiet[:-1]), np.flatnonzero(quiet[:-1] & ~quiet[1:])
    if not len(starts):
        return None
    edges = np.concatenate([times[:1], (times[:-1] + times[1:]) / 2, times[-1:]])
    runs = [(edges[a], edges[b] - edges[a]) for a, b in zip(starts, ends, strict=True)]
    return axes.broken_barh(
        runs, (0, 1), transform=axes.get_xaxis_transform(), color=_QUIET, alpha=0.93, lw=0, zorder=4
    )


def _label(found: Indices, grid: list[Axes]) -> None:
    from matplotlib.ticker import FixedLocator, MaxNLocator

    shares, totals, spread = grid
    if found.of_germs:
        shares.set_title(f"of germs, as inputs are dependent: {OF_GERMS}", fontsize=9, y=1.0, loc="left")
    shares.set_ylabel("share of\nvariance")
    totals.set_ylabel("total index")
    spread.set_ylabel(wrapped(with_units("std", found.units), 14))
    for axes in (shares, totals):
        axes.yaxis.set_major_locator(FixedLocator([0, 0.25, 0.5, 0.75, 1]))
        axes.tick_params(labelbottom=False)
    spread.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    spread.set_xlabel("time [s]")
    if len(found.times) == 1:
        for axes in grid:
            axes.xaxis.set_major_locator(FixedLocator([float(found.times[0])]))
