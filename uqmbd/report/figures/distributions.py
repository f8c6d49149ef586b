"""Densities of outputs at chosen times, and histograms of the sampled inputs."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Views, draw_on_paper
from uqmbd.report.drawing import constant
from uqmbd.report.figures.kernel_density import DensityCurve, densities, density_chart, known_densities
from uqmbd.report.figures.selection import Results, Samples, automatic_times, label_of, nodes_of, samples_of, succeeded
from uqmbd.report.figures.surrogates import drawable_nodes, stated_error_of, surrogate_of
from uqmbd.results.assessment import COARSE
from uqmbd.status import Status

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from uqmbd.randomness import GermSpace

__all__ = [
    "DensityPanel",
    "InputPanel",
    "OutputDensities",
    "densities_chart",
    "histograms",
    "input_densities",
    "inputs",
    "inputs_chart",
    "of_surrogate",
    "output_densities",
]

INPUT = 2
"""Index of the colour of inputs."""

SURROGATE_SAMPLES = 4096
"""Number of samples of a chaos for its density."""


class DensityPanel(NamedTuple):
    """Densities of one quantity, one for each method."""

    time: float  # time, s
    bars: NDArray[np.float64] | None  # (S,): values of the histogram
    curves: list[DensityCurve]  # density of each method
    span: tuple[float, float] | None  # ends of the axis, if they differ from the ends of the data


class OutputDensities(NamedTuple):
    """Densities of an output: labels of the methods, units, and one panel for each time."""

    labels: list[str]
    units: str
    panels: list[DensityPanel]


def output_densities(results: Results | Samples, output: str, times: Sequence[float] | None = None) -> OutputDensities:
    """Return the data of `histograms`.

    Raise StudyError if no method has samples or a chaos, none of the samples succeeded, or no such output exists.
    """
    import xarray as xr

    responses, chosen = _responses(results, output, times)
    first = next(iter(responses.values()))
    bars = isinstance(results, xr.Dataset) or "samples" in nodes_of(results)[next(iter(responses))].children
    errors = {} if isinstance(results, xr.Dataset) else _errors(nodes_of(results), output)
    panels = []
    for k in chosen:
        time = float(first["time"].values[k])
        curves = [
            DensityCurve(
                response.values[:, int(np.abs(response["time"].values - time).argmin())],
                method,
                label not in errors or float(errors[label].sel(time=time, method="nearest")) <= COARSE,
            )
            for method, (label, response) in enumerate(responses.items())
        ]
        low, high = float(first.values[:, k].min()), float(first.values[:, k].max())
        # limit the axis, because the far tails of a surrogate would hide the relevant range
        cut = len(responses) > 1 and not constant(low, high)
        span = (low - 0.2 * (high - low), high + 0.2 * (high - low)) if cut else None
        panels.append(DensityPanel(time, first.values[:, k] if bars else None, curves, span))
    return OutputDensities(list(responses), str(first["output_units"].item()), panels)


def densities_chart(results: Results | Samples, output: str, times: Sequence[float] | None = None) -> Views:
    """Chart the densities of an output by each method at chosen times, with the content of `histograms`.

    Raise StudyError if there is nothing to draw.
    """
    labels, units, panels = output_densities(results, output, times)
    spreads = [float(np.std(panel.curves[0].values)) for panel in panels]
    charts = []
    for one in panels:
        shown, title = densities(one.bars, one.curves), f"t = {one.time:.4g} s"
        barred = f"histogram of {labels[0]}"
        charts.append(density_chart(title, output, units, shown, labels, barred, span=one.span, heading=title))
    return Views(charts, "Time of the densities", int(np.argmax(spreads)))


@typechecked
def histograms(results: Results | Samples, output: str, times: Sequence[float] | None = None) -> Figure:
    """Draw the distribution of an output at chosen times: histograms as densities, and kernel density estimates.

    If there are several methods, the first has bars and a curve, and each other method has a curve. The curve of a
    method with a polynomial chaos and without samples is drawn from samples of the chaos.

    Parameters
    ----------
    results : xarray.DataTree, xarray.Dataset, mapping or iterable of nodes
        Result of a study, nodes, or the samples of one method. Methods with neither samples nor a polynomial chaos are
        omitted.
    output : str
        Name of the output.
    times : sequence of float, optional
        Times, s; the nearest stored times are used. Default: up to four times, including the end, the time of the
        largest standard deviation, and times in between.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If no method has samples or a chaos, none of the samples succeeded, or no such output exists.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, sample_dataset
    >>> from uqmbd.extend import statistics_of_samples
    >>> samples = sample_dataset([[[0.0]], [[1.0]]], [[1.0], [2.0]], labels([("x", "m")], ["k"], [0.5]))
    >>> node = propagator_node("mine", statistics_of_samples(samples), samples,
    ...                        propagator="p", realisations=2, wall_time=0.0)
    >>> axes = histograms(node, "x").axes[0]
    >>> axes.get_title("right"), axes.get_ylabel()
    ('t = 0.5 s', 'density [1/m]')
    """
    return draw_on_paper(densities_chart(results, output, times))


def _errors(nodes: Mapping[str, xr.DataTree], output: str) -> dict[str, xr.DataArray]:
    """Return the stated errors of an output over time for each surrogate with stated errors."""
    stated = {label: stated_error_of(node) for label, node in nodes.items()}
    return {k: one.sel(output=output) for k, one in stated.items() if one is not None and output in one["output"]}


def _responses(
    results: Results | Samples, output: str, times: Sequence[float] | None
) -> tuple[dict[str, xr.DataArray], list[int]]:
    """Return responses (sample, time) by method, and the indices of displayed times in the first response.

    The responses of other methods may have only the displayed times.
    """
    import xarray as xr

    if isinstance(results, xr.Dataset):
        first = succeeded(results, output)
        return {"samples": first}, _chosen(first, times)
    nodes = nodes_of(results)
    sampled = {label: node for label, node in nodes.items() if "samples" in node.children}
    surrogates = {label: node for label, node in drawable_nodes(nodes).items() if label not in sampled}
    # if no method has samples or a surrogate, use the first method, so that the error message names it
    drawn = sampled if sampled or surrogates else dict(list(nodes.items())[:1])
    failed = [label for label, node in drawn.items() if not np.any(samples_of(node)["status"].values == Status.OK)]
    usable = {label: node for label, node in drawn.items() if label not in failed} or drawn
    found = {label: succeeded(node, output) for label, node in usable.items()}
    chosen: list[int] = []
    for label, node in surrogates.items():
        shown = None
        if found:
            leading = next(iter(found.values()))
            chosen = chosen or _chosen(leading, times)
            shown = leading["time"].values[chosen]
        # StudyError: sampling a general joint distribution requires its mechanism
        with contextlib.suppress(StudyError):
            found[label] = of_surrogate(node, output, shown)
    first = next(iter(found.values()))
    return found, chosen or _chosen(first, times)


def _chosen(response: xr.DataArray, times: Sequence[float] | None) -> list[int]:
    there = response["time"].values
    if times is None:
        return automatic_times(there, response.values.std(axis=0))
    if not len(times):
        raise StudyError("histograms: times is empty; expected at least one time, s.")
    return sorted({int(np.abs(there - t).argmin()) for t in times})


def of_surrogate(node: xr.DataTree, output: str, times: NDArray[np.float64] | None = None) -> xr.DataArray:
    """Return samples (sample, time) of a surrogate at the stored times nearest to given times, or at all times."""
    import xarray as xr

    chaos = surrogate_of(node, output, times)
    _, values = chaos.sample(SURROGATE_SAMPLES, seed=0)
    units = chaos.labels.outputs[0].units
    return xr.DataArray(
        values[:, 0],
        dims=("sample", "time"),
        coords={"time": chaos.labels.times, "output_units": units},
    )


class InputPanel(NamedTuple):
    """Sampled values of an input."""

    name: str
    units: str
    values: NDArray[np.float64]  # (S,)
    curve: DensityCurve  # density of the distribution if known, otherwise an estimate
    failed: NDArray[np.float64]  # values of failed samples, at most 2000


def input_densities(node: Samples, space: GermSpace | None = None) -> list[InputPanel]:
    """Return the data of `inputs`.

    Raise StudyError if the node has no samples or no inputs.
    """
    samples = samples_of(node)
    names = [str(name) for name in samples["input"].values]
    if not names:
        raise StudyError(f"The study of {label_of(node)!r} has no random inputs.")
    failed = samples["status"].values != Status.OK
    known = {} if space is None else known_densities(space)
    panels = []
    for name in names:
        chosen = samples.sel(input=name)
        values = chosen["inputs"].values
        units = str(chosen["input_units"].item()) if "input_units" in chosen.coords else ""
        curve = DensityCurve(values, known=known.get(name))
        panels.append(InputPanel(name, units, values, curve, values[failed][:2000]))
    return panels


def inputs_chart(node: Samples, space: GermSpace | None = None) -> Views:
    """Chart histograms of sampled inputs with their densities; dots mark failed samples.

    Raise StudyError if the node has no samples or no inputs.
    """
    charts = []
    for one in input_densities(node, space):
        line = ["kernel density estimate" if one.curve.known is None else "distribution"]
        shown = densities(one.values, [one.curve])
        looks: dict[str, Any] = {"colour": INPUT, "failed": one.failed}
        charts.append(density_chart(one.name, one.name, one.units, shown, line, "histogram of the samples", **looks))
    return Views(charts, "Input")


@typechecked
def inputs(node: Samples, space: GermSpace | None = None) -> Figure:
    """Draw histograms of the sampled inputs with their densities; red points mark failed samples.

    Parameters
    ----------
    node : xarray.DataTree or xarray.Dataset
        Node of a propagator that has ``samples``, or its samples.
    space : GermSpace, optional
        Germ space of these inputs from a surrogate of the same study. With it, curves are the sampled distributions if
        they are known; otherwise curves are kernel density estimates.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StudyError
        If the node has no samples or no inputs.

    Examples
    --------
    >>> from uqmbd.extend import labels, sample_dataset
    >>> samples = sample_dataset([[[0.0]], [[1.0]]], [[1.0], [2.0]], labels(["x"], [("k", "N/m")], [0.5]))
    >>> inputs(samples).axes[0].get_xlabel()
    'k [N/m]'
    """
    return draw_on_paper(inputs_chart(node, space))
