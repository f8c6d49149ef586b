"""Densities of outputs without a time."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Views, paper
from uqmbd.report.figures.density import DensityCurve, densities, density_chart
from uqmbd.report.figures.distributions import SURROGATE_SAMPLES
from uqmbd.report.figures.selection import Results, nodes_of
from uqmbd.report.view import Method
from uqmbd.results import scalar_nodes, surrogate
from uqmbd.results.assessment import COARSE
from uqmbd.status import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["MOST_SCALARS", "ScalarPanel", "scalar_densities", "scalar_panels", "scalars_chart"]

MOST_SCALARS = 12
"""Outputs whose densities are drawn."""

METHODS = 6
"""Most methods whose densities are drawn in one figure."""


class ScalarPanel(NamedTuple):
    """How an output without a time is distributed.

    Attributes
    ----------
    name, units : str
    bars : array, shape (S,), optional
        Samples whose histogram is drawn: of the first method with any.
    barred : str
        The label of that method; empty without one.
    curves : list of DensityCurve
    """

    name: str
    units: str
    bars: NDArray[np.float64] | None
    barred: str
    curves: list[DensityCurve]


def scalar_panels(results: Results) -> tuple[list[str], list[ScalarPanel]] | None:
    """Return the methods, which have the styles 0, 1, ..., and the outputs without a time; None if nothing is known."""
    inner = {label: Method(label, node) for label, node in scalar_nodes(nodes_of(results)).items()}
    units = {name: method.units(name) for method in inner.values() for name in method.names}
    names = list(dict.fromkeys(name for method in inner.values() for name in method.names))[:MOST_SCALARS]
    responses = {label: found for label, method in inner.items() if (found := _responses(method))}
    responses = dict(list(responses.items())[:METHODS])
    if not names or not responses:
        return None
    barred = next((label for label in responses if inner[label].samples is not None), "")
    panels = []
    for name in names:
        curves = [
            DensityCurve(values[name], method, _error(inner[label], name) <= COARSE)
            for method, (label, values) in enumerate(responses.items())
            if name in values
        ]
        panels.append(ScalarPanel(name, units[name], responses[barred].get(name) if barred else None, barred, curves))
    return list(responses), panels


def scalars_chart(results: Results, first: str = "") -> Views | None:
    """Chart the densities of outputs without a time by each method; ``first``: the output that is seen first.

    None if no method has samples of such outputs, or a surrogate.
    """
    found = scalar_panels(results)
    if found is None:
        return None
    labels, panels = found
    names = [one.name for one in panels]
    charts = []
    for one in panels:
        if one.curves or one.bars is not None:
            shown, barred = densities(one.bars, one.curves), f"histogram of {one.barred}"
            charts.append(density_chart(one.name, one.name, one.units, shown, labels, barred))
    return Views(charts, "Output", names.index(first) if first in names else 0)


@typechecked
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
    found = scalars_chart(results)
    if found is None:
        raise StudyError("There are no samples of outputs without a time, and no chaos of them.")
    return paper(found)


def _error(method: Method, name: str) -> float:
    """Return the stated error of an output, over its standard deviation; 0 where none is stated."""
    data = method.of(name) if name in method.names else {}
    return float(data["verification_error"]) if "verification_error" in data else 0.0


def _responses(method: Method) -> dict[str, NDArray[np.float64]]:
    """Return samples of each output of a method, or of its surrogate; nothing where it has neither.

    Those in which an output does not happen are left out, and an output that does not happen in two of them.
    """
    if method.samples is not None:
        data = method.samples.isel(sample=np.flatnonzero(method.samples["status"].values == Status.OK))
        known = zip(data["output"].values.tolist(), data["response"].values.T, strict=True)
        return {name: some for name, values in known if len(some := values[np.isfinite(values)]) > 1}
    if "chaos" in method.node.children:
        # a general joint distribution cannot be sampled without its mechanism
        with contextlib.suppress(StudyError):
            chaos = surrogate(method.node)
            _, values = chaos.sample(SURROGATE_SAMPLES, seed=0)
            return dict(zip((output.name for output in chaos.labels.outputs), values.T, strict=True))
    return {}
