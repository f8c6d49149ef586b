"""Convergence of the mean and the standard deviation with the number of samples, and their confidence intervals."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Axis, Band, Chart, Curve, Views, draw_on_paper
from uqmbd.report.drawing import constant
from uqmbd.report.figures.selection import Samples, label_of, of_output, samples_of
from uqmbd.results.statistics import replicate_statistics, running_statistics
from uqmbd.status import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ESTIMATED", "SamplingPlan", "Settling", "convergence", "design_of", "settling", "settling_chart"]

NORMAL_95 = 1.96
_POINTS = 120
ESTIMATED = {"mean": "mean", "std": "standard deviation"}
"""Estimated statistics, with their names in texts."""


@dataclass(frozen=True)
class SamplingPlan:
    """Sampling plan: independent samples, or consecutive replicates of a named design."""

    name: str = "random"
    replicates: int = 1

    @property
    def independent(self) -> bool:
        """Return whether all samples are mutually independent."""
        return self.name == "random"


def design_of(attrs: Mapping[Any, Any]) -> SamplingPlan:
    """Return the sampling plan from the attributes of the node of a method; samples are independent by default.

    >>> design_of({"options": '{"sampling": "sobol", "replicates": 8}'})
    SamplingPlan(name='sobol', replicates=8)
    >>> design_of({}).independent
    True
    """
    try:
        options = json.loads(attrs.get("options", "{}"))
        name, replicates = str(options.get("sampling", "random")), int(options.get("replicates", 1))
    except (AttributeError, TypeError, ValueError):
        return SamplingPlan()
    independent = name == "random" or "independent_samples" in attrs or replicates < 2
    return SamplingPlan() if independent else SamplingPlan(name, replicates)


class Settling(NamedTuple):
    """Estimates of an output at one time from a growing number of samples or replicates."""

    counts: NDArray[np.float64]  # (C,): numbers of samples or replicates
    estimates: dict[str, NDArray[np.float64]]  # (C,): statistics and their standard errors, by name
    time: float
    units: str  # units of the output
    counted: str  # name of the counted objects
    independent: bool  # whether independent samples are counted instead of replicates

    def band(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return an estimate and the ends of its 95 % confidence interval."""
        centre, error = self.estimates[name], NORMAL_95 * self.estimates[f"std_error_{name}"]
        return centre, centre - error if name == "mean" else np.maximum(centre - error, 0.0), centre + error

    def ends(self, name: str) -> tuple[float, float] | None:
        """Return the ends of an axis that shows all estimates, and all intervals except the first, widest intervals.

        Return None if the estimates are constant.
        """
        centre, error = self.estimates[name], NORMAL_95 * self.estimates[f"std_error_{name}"]
        if constant(float(centre.min()), float(centre.max())) and not np.any(error > 1e-9 * np.abs(centre).max()):
            return None
        late = self.counts >= self.counts[-1] ** 0.6
        reach = np.nan_to_num(error[late], nan=0.0)
        low = min(float(centre.min()), float((centre[late] - reach).min()))
        high = max(float(centre.max()), float((centre[late] + reach).max()))
        margin = 0.06 * (high - low)
        return low - margin, high + margin


def settling(node: Samples, output: str, time: float | None = None) -> Settling:
    """Return the data of `convergence`.

    Raise StudyError if the node has no samples, fewer than two succeeded, or no such output exists.
    """
    samples = samples_of(node)
    response = of_output(samples, output)["response"]
    fine = samples["status"].values == Status.OK
    if fine.sum() < 2:
        raise StudyError(f"Fewer than two samples of {label_of(node)!r} succeeded: a convergence chart needs two.")
    if time is None:
        with np.errstate(invalid="ignore"):
            chosen = int(np.std(response.values[fine], axis=0).argmax())
    else:
        chosen = int(np.abs(response["time"].values - time).argmin())
    values = response.values[:, chosen]
    design = design_of(node.attrs)
    total = max(int(node.attrs.get("realisations", 0)), len(values))
    counts, found = _estimates(values, fine, design, total)
    if total > len(values) and isinstance(node, xr.DataTree):
        # only the first samples are stored; the last estimate comes from the statistics of all samples
        last = of_output(node.children["statistics"], output).isel(time=chosen)
        number = total - int(node.attrs.get("failures", 0)) if design.independent else design.replicates
        counts = np.append(counts, number)
        found = {name: np.append(part, float(last[name]) if name in last else np.nan) for name, part in found.items()}
    each = f"number of replicates (of {total / design.replicates:.4g} samples each)"
    return Settling(
        np.asarray(counts, dtype=float),
        found,
        float(response["time"][chosen]),
        str(response["output_units"].item()),
        "number of samples" if design.independent else each,
        design.independent,
    )


def settling_chart(node: Samples, output: str, time: float | None = None) -> Views:
    """Chart the convergence of the mean and the standard deviation with the number of samples.

    The horizontal axis is the number of samples, or of replicates of a design.

    Raise StudyError if there are fewer than two samples.
    """
    found = settling(node, output, time)
    unit = "samples" if found.independent else "replicates"
    along = Axis(found.counted, log=found.independent, whole=True, place_units=unit)
    charts = []
    for name, title in ESTIMATED.items():
        centre, low, high = found.band(name)
        drawn: Literal["line", "dotted"] = "line" if found.independent else "dotted"
        charts.append(
            Chart(
                f"{title} of {output}",
                found.counts,
                [Curve("estimate so far", centre, (Band("95 % band", low, high),), title, drawn)],
                f"{title} at {found.time:.4g} s",
                found.units,
                axis=title,
                along=along,
                ends=found.ends(name),
                references={"final value": float(centre[-1])},
                start=len(found.counts) - 1,
                heading=f"t = {found.time:.4g} s" if name == "mean" else "",
            )
        )
    return Views(charts, "Statistic", columns=1, shared=True)


@typechecked
def convergence(node: Samples, output: str, time: float | None = None) -> Figure:
    """Draw mean and standard deviation over the number of samples, with 95 % confidence intervals.

    Points of a Latin hypercube or Sobol' design are not independent, so they give no confidence interval. For these
    designs, the horizontal axis is the number of independent replicates.

    Parameters
    ----------
    node : xarray.DataTree or xarray.Dataset
        Node of a propagator that has ``samples``, or its samples (which then count as independent).
    output : str
        Name of the output.
    time : float, optional
        Time, s; the nearest stored time is used. Default: the time of the largest standard deviation.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If the node has no samples, fewer than two succeeded, or no such output exists.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import labels, sample_dataset
    >>> x = np.arange(50.0).reshape(50, 1, 1)
    >>> figure = convergence(sample_dataset(x, np.zeros((50, 0)), labels([("x", "m")], [], [0.5])), "x")
    >>> float(figure.axes[0].lines[-1].get_ydata()[-1]), figure.axes[1].get_xlabel()
    (24.5, 'number of samples')
    """
    return draw_on_paper(settling_chart(node, output, time))


def _estimates(
    values: NDArray[np.float64], fine: NDArray[np.bool_], design: SamplingPlan, planned: int
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Return growing numbers of samples or replicates, and the estimates for each number."""
    if design.independent:
        total = int(fine.sum())
        start = max(2, min(10, total // 4))
        numbers = np.unique(np.geomspace(start, total, _POINTS).round().astype(int)) if total > start else [total]
        return np.asarray(numbers, dtype=float), running_statistics(values[fine], numbers)
    edges = np.cumsum([0, *(len(part) for part in np.array_split(np.arange(planned), design.replicates))])
    # if not all samples are stored, use the complete replicates
    edges = edges[edges <= len(values)] if edges[1] <= len(values) else np.array([0, len(values)])
    parts = [values[a:b][fine[a:b]] for a, b in zip(edges[:-1], edges[1:], strict=True)]
    usable = [part for part in parts if len(part)]
    if len(usable[0]) < 2:
        usable = [np.concatenate(usable)]
    return np.arange(1.0, len(usable) + 1), replicate_statistics(usable)
