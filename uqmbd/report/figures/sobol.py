"""Charts of Sobol' indices over time, with the standard deviation to which they refer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Count, typechecked
from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.report.charts import Band, Chart, Column, Curve, Look, Span, Views, draw_on_paper
from uqmbd.report.figures.selection import Results, label_of, nodes_of, of_output
from uqmbd.report.figures.surrogates import finest, stated_error_of, surrogate_nodes, times_of, varies_over_time
from uqmbd.results import varies
from uqmbd.typing import Array
from uqmbd.wording import format_index

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "Indices",
    "has_indices",
    "indices_chart",
    "indices_charts",
    "indices_of",
    "node_with_indices",
    "shown_inputs",
    "sobol_indices",
]


NEGLIGIBLE = 0.02
"""Largest total index over time (times with spread) up to which an input has no separate curve."""
TOO_LARGE = 0.1
"""Stated error of a chaos above which the indices of another chaos are preferred."""
OF_GERMS = "“b | a” is the contribution of b, given a"
INTERACTING = 0.002
"""Minimum share of the variance for which interactions are drawn."""


@dataclass(frozen=True, eq=False)
class Indices:
    """Sobol' indices of one output.

    `names` are names of the inputs, or of the germs if inputs are dependent. `first` and `total` have the shape (G, T),
    `times`, `std` and `mean` the shape (T,). `meaningful` (T,) is false for times without spread. `units` are the units
    of the standard deviation.
    """

    names: tuple[str, ...]
    of_germs: bool
    first: Array
    total: Array
    times: Array
    std: Array
    meaningful: NDArray[np.bool_]
    units: str
    first_interval: Array | None = None  # (2, G, T): 95 % intervals of estimates from samples
    total_interval: Array | None = None

    @property
    def weighted(self) -> tuple[Array, Array]:
        """First-order and total indices (G,), averaged over time with the variance as weight; NaN without spread."""
        return self._averaged(self.first), self._averaged(self.total)

    @property
    def averaged_interval(self) -> Array | None:
        """Time averages (G, 2) of the ends of the 95 % intervals of total indices; None if there are no intervals.

        This interval contains the 95 % interval of the averaged index.
        """
        if self.total_interval is None:
            return None
        return np.stack([self._averaged(end) for end in self.total_interval], axis=1)

    @property
    def written(self) -> list[tuple[str, str]]:
        """First-order and total index of each input as text, averaged over time.

        The texts include the time averages of the ends of 95 % intervals, if there are intervals.
        """
        found = [(self.first, self.first_interval), (self.total, self.total_interval)]
        columns = []
        for values, ends in found:
            low, high = np.full((2, len(self.names)), np.nan) if ends is None else map(self._averaged, ends)
            columns.append([format_index(*x) for x in zip(self._averaged(values), low, high, strict=True)])
        return list(zip(*columns, strict=True))

    def _averaged(self, values: Array) -> Array:
        """Average values (G, T) over time with the variance as weight; NaN without spread."""
        weight = np.where(self.meaningful, self.std / (self.std.max() or 1.0), 0.0) ** 2
        if len(self.times) > 1:
            weight = weight * np.gradient(self.times)
        if not weight.sum() > 0:
            return np.full(len(self.names), np.nan)
        return np.asarray(values @ weight / weight.sum())


def has_indices(node: xr.DataTree) -> bool:
    """Return whether a method has Sobol' indices over time, of inputs or of germs."""
    return _kind(node) is not None and "time" in node.children["statistics"].sizes


def _kind(node: xr.DataTree) -> str | None:
    known = set(map(str, node.children["statistics"].data_vars))
    return next((end for end in ("", "_germ") if {f"sobol_first{end}", f"sobol_total{end}"} <= known), None)


def node_with_indices(results: Results) -> xr.DataTree:
    """Return the method whose indices are displayed: the finest chaos with indices, or else the first method with them.

    If this chaos states an error of more than 10 %, return the method with the smallest stated error.
    """
    nodes = nodes_of(results)
    candidates = {label: node for label, node in nodes.items() if has_indices(node)}
    if not candidates:
        names = ", ".join(map(repr, nodes))
        raise StudyError(
            f"The results of {names} contain no Sobol' indices over time. Use outputs over time, and a method that "
            f"computes indices{such_as(InputTreatment.INTERPOLATE)}."
        )
    if not surrogate_nodes(candidates):
        return next(iter(candidates.values()))
    chosen, errors = finest(candidates), {label: _typical_error(node) for label, node in candidates.items()}
    # a chaos of high order that misses a jump is less accurate than a chaos of lower order that represents the jump
    wrong = np.isfinite(errors[chosen]) and errors[chosen] > TOO_LARGE
    return candidates[min(errors, key=lambda label: errors[label]) if wrong else chosen]


def _typical_error(node: xr.DataTree) -> float:
    """Return the stated error of a method: root mean square over time, largest over outputs; infinite if unknown."""
    stated = stated_error_of(node)
    if stated is None or not np.isfinite(stated.values).all():
        return np.inf
    return float(np.sqrt((stated.values**2).mean(axis=-1)).max(initial=0.0))


def indices_of(node: xr.DataTree, output: str) -> Indices:
    """Return the Sobol' indices of one output of a method; raise StudyError if they are missing."""
    end = _kind(node)
    if end is None:
        raise StudyError(f"The propagator {label_of(node)!r} has no Sobol' indices.")
    data = of_output(node.children["statistics"], output)
    times = times_of(data)
    names = data["germ" if end else "input"].values
    first, total = (np.asarray(data[f"sobol_{kind}{end}"].values, dtype=float) for kind in ("first", "total"))
    std = np.asarray(data["std"].values, dtype=float)
    meaningful = varies_over_time(std, data["mean"].values) & varies(node, output)
    units, row = str(data["output_units"].item()), tuple(map(str, names))
    ends = [data.get(f"sobol_{kind}_interval") for kind in ("first", "total")] if not end else [None, None]
    intervals = [None if one is None else np.asarray(one.values, dtype=float) for one in ends]
    return Indices(row, bool(end), first, total, times, std, meaningful, units, *intervals)


def indices_chart(found: Indices, output: str, most: int = 5) -> Chart:
    """Chart first-order and total shares of the variance of an output for each input over time."""
    named = shown_inputs(found, most)
    quiet = np.where(found.meaningful, 0.0, np.nan)
    curves = [
        Curve(
            found.names[k],
            found.total[k] + quiet,
            (),
            "total index",
            columns=(Column("first-order index", found.first[k] + quiet),),
        )
        for k in named
    ]
    start = int(np.nan_to_num(np.where(found.meaningful, found.std, -1.0), nan=-1.0).argmax())
    return Chart(f"share of the variance of {output}", found.times, curves, decimals=3, start=start)


def indices_charts(found: Indices, output: str, most: int = 5) -> Views:
    """Chart stacked first-order indices, total indices, and the standard deviation (Matplotlib)."""
    named = shown_inputs(found, most)
    rest = [k for k in range(len(found.names)) if k not in named]
    times, first, total, std = found.times, found.first, found.total, found.std
    layers = [(found.names[k], first[k], total[k], _look(found, named, k)) for k in named]
    if rest:
        name = f"{len(rest)} others" if len(rest) > 1 else found.names[rest[0]]
        layers.append((name, first[rest].sum(axis=0), total[rest].sum(axis=0), Look("soft", (1.0, 1.0))))
    base = np.zeros(len(times))
    shares = []
    for name, alone, _, look in layers:
        top = base + np.maximum(alone, 0.0)
        shares.append(Curve(name, top, (Band(name, base, top),), look=look))
        base = top
    if np.any(np.where(found.meaningful, 1.0 - base, 0.0) > INTERACTING):
        whole = np.maximum(1.0, base)
        shares.append(Curve("interactions", whole, (Band("interactions", base, whole),), look=Look("quiet")))
    totals = [Curve(name, shared, look=look) for name, _, shared, look in layers]
    # shares of a negligible variance have no meaning, and do not affect the height of the axes
    reach = np.where(found.meaningful, [one for _, _, one, _ in layers], 0.0)
    over = float(base.max(where=found.meaningful, initial=0.0))
    spans = tuple(
        Span("small standard deviation", runs) for runs in [_quiet_runs(times, found.meaningful)] if len(runs)
    )
    heading = f"of germs, because the inputs are dependent: {OF_GERMS}" if found.of_germs else ""
    ends = min(0.0, 1.02 * float(reach.min())), max(1.0, 1.02 * float(reach.max()))
    highest = 1.08 * float(std.max())
    spread = [Curve("", std, quantity="", look=Look("ink", (), 1.3))]
    charts = [
        Chart(
            f"share of variance of {output}",
            times,
            shares,
            ends=(0.0, max(1.0, 1.02 * over)),
            stacked=True,
            heading=heading,
        ),
        Chart("total index", times, totals, ends=ends),
        Chart("std", times, spread, units=found.units, ends=(0.0, highest) if highest > 0 else None),
    ]
    charts = [
        replace(one, spans=spans, axis=axis)
        for one, axis in zip(charts, ("share of variance", "total index", "std"), strict=True)
    ]
    return Views(charts, columns=1, shared=True, heights=(1.35, 1.1, 0.65))


@typechecked
def sobol_indices(results: Results, output: str, *, most: Count = 5) -> Figure:
    r"""Draw the share of each input in the variance over time, and the standard deviation.

    The top axes show the stacked first-order indices (the share that each input alone explains), and the remaining
    share of interactions. The middle axes show the total indices (the share in which each input takes part). The bottom
    axes show the standard deviation. Below 1 % of its maximum, the indices are grey, because the variance is
    negligible.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of these
        Result of a study, or nodes. If several methods have indices, the method with the finest chaos is drawn.
    output : str
        Name of the output.
    most : int
        Maximum number of inputs with separate names. Further inputs, and several inputs that never exceed 2 %, are
        "others": the sum of their first-order indices, and of their total indices (an upper bound of their joint
        share).

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes for first-order indices, total indices, and standard deviation.

    Raises
    ------
    StudyError
        If no method has Sobol' indices, or no such output exists.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels([("x", "m")], ["k", "c"], [0.0, 1.0])
    >>> index = [[[0.9, 0.4]], [[0.1, 0.5]]]
    >>> statistics = statistics_dataset(axes, mean=[[0, 1]], std=[[0.1, 0.2]], sobol_first=index, sobol_total=index)
    >>> figure = sobol_indices(propagator_node("mine", statistics, propagator="p", realisations=1, wall_time=0), "x")
    >>> [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]
    ['share of variance', 'total index', 'std [m]']
    """
    return draw_on_paper(indices_charts(indices_of(node_with_indices(results), output), output, most))


def shown_inputs(found: Indices, most: int) -> list[int]:
    """Return the indices of inputs with separate names, in the order of the study."""
    share = np.where(found.meaningful, found.total, 0.0).max(axis=1, initial=0.0)
    ranked = sorted(range(len(share)), key=lambda k: (-share[k], k))
    matter = [k for k in ranked if share[k] > NEGLIGIBLE] or ranked[:1]
    if len(ranked) <= most and len(ranked) - len(matter) < 2:
        return sorted(ranked)  # show a single small input by its name, not as "others"
    return sorted(matter[:most])


def _look(found: Indices, named: list[int], k: int) -> Look:
    """Return the line style of the k-th input; in studies with few inputs, it is the same in all figures."""
    return Look(k if len(found.names) <= 6 else named.index(k))


def _quiet_runs(times: Array, meaningful: NDArray[np.bool_]) -> Array:
    """Return the time intervals (R, 2) without spread, extended by half a step at both ends."""
    quiet = np.concatenate([[False], ~meaningful, [False]])
    starts, ends = np.flatnonzero(quiet[1:] & ~quiet[:-1]), np.flatnonzero(quiet[:-1] & ~quiet[1:])
    edges = np.concatenate([times[:1], (times[:-1] + times[1:]) / 2, times[-1:]])
    if len(times) == 1:
        edges = times[0] + np.array([-0.5, 0.5])
    return np.stack([edges[starts], edges[ends]], axis=1)
