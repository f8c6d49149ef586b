"""Charts of error against cost of methods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import MARKS, Axis, Chart, Column, Curve, Look, Views, draw_on_paper
from uqmbd.report.figures.selection import percent_ends
from uqmbd.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Spent", "cost_chart", "error_cost", "errors_of", "own_error"]

SMALLEST = 1e-16
"""Size of rounding errors, which a logarithmic axis does not show."""


@dataclass(frozen=True, eq=False)
class Spent:
    """Errors of a method at its levels, and the cost of each level."""

    method: str
    quantity: str
    errors: Array  # (L,): relative errors; NaN: unknown, or too small for the axis
    # realisations, wall_time (s): (L,); NaN if unknown or zero
    realisations: Array
    wall_time: Array
    levels: tuple[str, ...]  # names of the levels

    def along(self, cost: str) -> tuple[Array, Array, tuple[str, ...]]:
        """Return known costs in ascending order, with errors and levels; ``cost`` is the name of an attribute."""
        spent: Array = getattr(self, cost)
        used = np.flatnonzero(np.isfinite(self.errors) & np.isfinite(spent))
        order = used[np.argsort(spent[used], kind="stable")]
        return spent[order], self.errors[order], tuple(self.levels[k] for k in order)


def errors_of(convergence: xr.Dataset, output: str) -> list[Spent]:
    """Return the errors of mean and standard deviation of each method, and their costs.

    Raise StudyError if there is no such output, or no error above zero.
    """
    names = [str(name) for name in convergence["output"].values]
    if output not in names:
        raise StudyError(f"The results have no output {output!r}; the outputs are {', '.join(map(repr, names))}.")
    data = convergence.isel(output=names.index(output))
    found = []
    for m, label in enumerate(str(v) for v in data["method"].values):
        costs = {cost: np.asarray(data[cost].values[m], dtype=float) for cost in ("realisations", "wall_time")}
        runs, seconds = (np.where(one > 0, one, np.nan) for one in costs.values())
        labels = data["level_name"].values[m] if "level_name" in data else range(1, len(runs) + 1)
        levels = tuple(str(text) for text in labels)
        for name in ("mean", "std"):
            errors = np.asarray(data[f"{name}_error_l2"].values[m], dtype=float)
            shown = np.where(errors > SMALLEST, errors, np.nan)
            found.append(Spent(label, name, shown, runs, seconds, levels))
    if not any(len(one.along(cost)[0]) for one in found for cost in ("realisations", "wall_time")):
        raise StudyError(f"All errors of {output!r} are zero, so there is nothing to draw.")
    return found


def own_error(convergence: xr.Dataset, output: str, quantity: str) -> float:
    """Return the stated error of the reference; 0 if no error is stated."""
    place = [str(name) for name in convergence["output"].values].index(output)
    return float(np.nan_to_num(convergence[f"reference_{quantity}_error"].values[place]))


def cost_chart(convergence: xr.Dataset, output: str) -> Views:
    """Chart the errors of mean and standard deviation over the cost, in realisations and in wall time.

    Filled marks and full lines show the mean; hollow marks and dashed lines show the standard deviation. Each method
    has a separate mark. Pale lines are the stated errors of the reference.

    Raise StudyError if there is no such output, or no error above zero.
    """
    found = errors_of(convergence, output)
    shapes = [name for name in MARKS if name != "cross"]
    charts: list[Chart] = []
    for title, cost, plane in (
        ("by realisations", "realisations", Axis("realisations", log=True, whole=True)),
        ("by wall time", "wall_time", Axis("wall time", "s", log=True)),
    ):
        # rows are in the order of levels, so a line turns back if a finer level has a lower cost
        rows = [(k, one, np.where(np.isfinite(one.errors), getattr(one, cost), np.nan)) for k, one in enumerate(found)]
        rows = [row for row in rows if np.isfinite(row[2]).any()]
        if not rows:
            continue
        errors = np.concatenate([one.errors[np.isfinite(costs)] for _, one, costs in rows])
        spent = np.concatenate([costs[np.isfinite(costs)] for *_, costs in rows])
        low, high = percent_ends((float(errors.min()), float(errors.max())))
        count = len(rows[0][2])
        known = np.sum([np.isfinite(one.errors) & np.isfinite(costs) for _, one, costs in rows], axis=0)
        curves = []
        for k, one, costs in rows:
            deviation = one.quantity == "std"
            name = f"{one.method}: {'standard deviation' if deviation else 'mean'}"
            dash = (4.0, 2.0) if deviation else ()
            look = Look(k // 2, dash, 1.6, shapes[k // 2 % len(shapes)], hollow=deviation, joined=True)
            levels = (Column("level", one.levels),)
            curves.append(Curve(name, 100 * one.errors, (), "", look=look, columns=levels, places=costs))
        for quantity, name, dash in (("mean", "mean", ()), ("std", "standard deviation", (4.0, 2.0))):
            own = 100 * own_error(convergence, output, quantity)
            if low < own < high and count > 1:
                look = Look("quiet", dash, 1.0, joined=True, quiet=True)
                places, level = np.geomspace(spent.min(), spent.max(), count), np.full(count, own)
                curves.append(Curve(f"reference error: {name}", level, (), "", look=look, places=places))
        charts.append(
            Chart(
                f"error of {output}",
                np.arange(1.0, count + 1),
                curves,
                title,
                "%",
                axis="relative error",
                along=Axis("level", place_units="", before="level ", whole=True),
                plane=plane,
                ends=(low, high),
                log=True,
                digits=True,
                # start at the finest of the levels that the largest number of curves have
                start=count - 1 - int(known[::-1].argmax()),
                heading=f"reference: {convergence.attrs.get('reference', '')}" if not charts else "",
            )
        )
    return Views(charts, "Cost", heights=(1.85,))


@typechecked
def error_cost(convergence: xr.Dataset, output: str) -> Figure:
    """Draw the errors of mean (full lines) and standard deviation (dashed) against realisations and wall time.

    Parameters
    ----------
    convergence : xarray.Dataset
        Result of `uqmbd.Study.converge`.
    output : str
        Name of the output.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with two logarithmic axes: error against realisations, and against wall time. Grey lines are the stated
        errors of the reference, if any; smaller errors cannot be measured.

    Raises
    ------
    StudyError
        If there is no such output, or no error above zero.

    Examples
    --------
    >>> dims = ("method", "level", "output")
    >>> found = xr.Dataset(
    ...     {"mean_error_l2": (dims, [[[1e-2], [1e-3]]]), "std_error_l2": (dims, [[[1e-1], [1e-2]]]),
    ...      "realisations": (dims[:2], [[4, 9]]), "wall_time": (dims[:2], [[0.1, 0.2]]),
    ...      "reference_mean_error": ("output", [1e-5]), "reference_std_error": ("output", [1e-4])},
    ...     coords={"method": ["collocation"], "output": ["x"]}, attrs={"reference": "finest"})
    >>> figure = error_cost(found, "x")
    >>> figure.axes[0].get_xlabel(), figure.axes[0].lines[0].get_ydata().tolist()
    ('realisations', [1.0, 0.1])
    """
    return draw_on_paper(cost_chart(convergence, output))
