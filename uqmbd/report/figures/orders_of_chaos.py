"""Chart of the differences between chaoses of several orders and the finest one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Axis, Chart, Curve, Look, Views, draw_on_paper
from uqmbd.report.drawing import line_width
from uqmbd.report.figures.selection import Results, nodes_of, of_output, percent_ends
from uqmbd.report.figures.surrogates import chaos_nodes, finest, order_of, series, times_of
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Convergence", "order_convergence", "orders_chart", "orders_of", "sampling_errors"]

SMALLEST = 1e-16
"""Size of rounding errors, which a logarithmic axis does not show."""


@dataclass(frozen=True, eq=False)
class Convergence:
    """Largest differences over time between a series of chaoses and a reference, relative to its largest std."""

    name: str  # name of the series
    orders: NDArray[np.int64]  # (N,)
    realisations: NDArray[np.int64]  # (N,), cost of each order
    mean: Array  # (N,), difference of the mean over the largest std of the reference
    std: Array  # (N,), difference of the std over the largest std of the reference


def orders_of(results: Results, output: str, reference: str | None = None) -> tuple[str, list[Convergence]]:
    """Return the label of the reference, and the differences of each series of chaoses from the reference.

    The default reference is the finest chaos: the differences from Monte Carlo would not fall below its standard error.
    Raise StudyError if the reference is unknown, or no other chaos can be compared with it.
    """
    nodes = {label: node for label, node in nodes_of(results).items() if _has(node, output)}
    chosen = finest(nodes) if reference is None else reference
    base = _statistics(nodes, chosen, output)
    scale = float(base["std"].max()) or 1.0
    found = []
    for name, members in series(nodes).items():
        rows = [
            (order_of(nodes[m]), int(nodes[m].attrs.get("realisations", 0)), *_off(nodes[m], output, base, scale))
            for m in members
            if m != chosen
        ]
        if rows:
            orders, realisations, mean, std = (np.array(column) for column in zip(*rows, strict=True))
            found.append(Convergence(name, orders, realisations, mean, std))
    if not found:
        raise StudyError(
            f"There is no other chaos to compare {chosen!r} with. Run the propagator at several orders, with labels "
            "such as 'order-1', 'order-2'."
        )
    return chosen, found


def _has(node: xr.DataTree, output: str) -> bool:
    return output in [str(n) for n in node.children["statistics"].coords["output"].values]


def _off(node: xr.DataTree, output: str, base: xr.Dataset, scale: float) -> tuple[float, float]:
    other = of_output(node.children["statistics"], output)
    if not np.array_equal(times_of(other), times_of(base)):
        raise StudyError(
            f"Only methods with the same times can be compared. The times of {node.name!r} differ from those of the "
            "reference."
        )
    mean, std = (float(np.abs(other[name].values - base[name].values).max()) / scale for name in ("mean", "std"))
    return mean, std


def orders_chart(results: Results, output: str, reference: str | None = None) -> Views:
    """Chart the difference of chaoses of several orders from the finest chaos, in per cent of its largest std.

    One view is over the order. Another view, if the numbers are known, is over the number of realisations; it includes
    the standard errors of sampling methods.

    Raise StudyError if no surrogate is left to compare with the finest, or times differ.
    """
    nodes = nodes_of(results)
    reference, found = orders_of(nodes, output, reference)
    sampled = sampling_errors(nodes, reference, output)
    sizes = np.unique(
        np.concatenate([row.realisations for row in found] + [np.array([size]) for _, size, _ in sampled])
    )
    orders = np.unique(np.concatenate([row.orders for row in found]))
    known = [values for row in found for values in (row.mean, row.std)] + [np.array([error]) for *_, error in sampled]
    seen = np.concatenate(known)
    seen = seen[seen > SMALLEST]
    ends = percent_ends((float(seen.min()), float(seen.max())) if len(seen) else (1e-3, 1.0))
    charts = []
    for word, counts, places in (("order", "orders", orders), ("realisations", "realisations", sizes)):
        cost = counts == "realisations"
        if cost and places[0] < 1:  # a number of realisations is unknown
            continue
        curves = []
        for k, row in enumerate(found):
            at = np.searchsorted(places, getattr(row, counts))
            for name, values, dash in (("mean", row.mean, ()), ("standard deviation", row.std, (4.0, 2.0))):
                look = Look(k, dash, 1.6)
                shown = _placed(places, at, values)
                curves.append(Curve(f"{row.name}: {name}", shown, (), "difference", "dotted", look))
        if cost:
            for k, (label, size, error) in enumerate(sampled, len(found)):
                shown = _placed(places, np.searchsorted(places, [size]), np.array([error]))
                look = Look(k, (), line_width(k, len(found)))
                curves.append(Curve(f"{label}: standard error", shown, (), "difference", "dotted", look))
        charts.append(
            Chart(
                f"difference of {output} to {reference}",
                places.astype(float),
                curves,
                f"by {word}",
                "%",
                axis="difference / largest std",
                along=Axis(
                    word, whole=True, log=cost, place_units=word if cost else "", before="" if cost else f"{word} "
                ),
                ends=ends,
                log=True,
                start=len(places) - 1,
                heading="" if cost else f"reference: {reference}",
            )
        )
    return Views(charts, "Orders or realisations")


def _placed(places: NDArray[np.int64], at: NDArray[np.intp], values: Array) -> Array:
    """Return values in per cent at their positions; NaN at other positions, and for values that count as zero."""
    shown = np.full(len(places), np.nan)
    shown[at] = np.where(values > SMALLEST, 100 * values, np.nan)
    return shown


@typechecked
def order_convergence(results: Results, output: str, *, reference: str | None = None) -> Figure:
    """Draw the error of a chaos over its order, and over the number of realisations.

    The figure shows the differences of mean (full lines) and standard deviation (dashed) to a reference. The values are
    the largest differences over time, relative to the largest standard deviation. The scale over the order is
    logarithmic, so exponential convergence is a straight line. Points show the largest standard errors of Monte Carlo.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        Results with several chaoses that differ in their order.
    output : str
        Name of the output.
    reference : str, optional
        Label of the reference; default: the chaos of the highest order.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no output or reference of these names exists, or there are fewer than two chaoses.

    Examples
    --------
    >>> order_convergence([], "x")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: A figure needs the result of at least one propagator; no result is given.
    """
    return draw_on_paper(orders_chart(results, output, reference))


def _statistics(nodes: Mapping[str, xr.DataTree], label: str, output: str) -> xr.Dataset:
    if label not in nodes:
        raise StudyError(f"The reference is {label!r}; expected one of the methods {', '.join(map(repr, nodes))}.")
    return of_output(nodes[label].children["statistics"], output)


def sampling_errors(nodes: Mapping[str, xr.DataTree], chosen: str, output: str) -> list[tuple[str, int, float]]:
    """Return label, realisations, and relative standard error of each method without a chaos.

    The error is the largest standard error of the std over time, relative to the largest std of the reference `chosen`.
    """
    scale = float(_statistics(nodes, chosen, output)["std"].max()) or 1.0
    found = []
    for label, node in nodes.items():
        if label in chaos_nodes(nodes) or not _has(node, output):
            continue
        data = _statistics(nodes, label, output)
        error = float(np.nanmax(data["std_error_std"].values, initial=0.0)) / scale if "std_error_std" in data else 0.0
        size = int(node.attrs.get("realisations", 0))
        if error > 0 and size > 0:
            found.append((label, size, error))
    return found
