"""Charts of scalar outputs, and of event times."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.plugins import method_with_option
from uqmbd.report.charts import Views, draw_on_paper
from uqmbd.report.figures.distributions import SURROGATE_SAMPLES
from uqmbd.report.figures.kernel_density import DensityCurve, densities, density_chart
from uqmbd.report.figures.selection import Results, nodes_of
from uqmbd.report.figures.series import in_series
from uqmbd.report.view import Method
from uqmbd.results import AlignedChaos, scalar_nodes, surrogate
from uqmbd.results.assessment import COARSE
from uqmbd.results.chaos import surrogate_parts
from uqmbd.status import Status
from uqmbd.wording import format_quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "NumberedEvent",
    "MOST_SCALARS",
    "ScalarPanel",
    "earliest_events",
    "event_times",
    "events_chart",
    "events_in_words",
    "has_events",
    "scalar_densities",
    "scalar_panels",
    "scalars_chart",
]


MOST_SCALARS = 12
"""Maximum number of outputs with densities in a figure."""

METHODS = 6
"""Maximum number of methods with densities in one figure."""


class ScalarPanel(NamedTuple):
    """Distribution of a scalar output."""

    name: str
    units: str
    bars: NDArray[np.float64] | None  # (S,): samples of the histogram, from the first method with samples
    barred: str  # label of the method of the histogram; empty without samples
    curves: list[DensityCurve]


def scalar_panels(results: Results) -> tuple[list[str], list[ScalarPanel]] | None:
    """Return the labels of methods, in the order of their line styles, and the distributions of scalar outputs.

    Return None if there are no scalar outputs, or no samples of them.
    """
    inner = {label: Method(label, node) for label, node in scalar_nodes(nodes_of(results)).items()}
    units = {name: method.units(name) for method in inner.values() for name in method.names}
    every = list(dict.fromkeys(name for method in inner.values() for name in method.names))
    together = in_series({label: method.statistics for label, method in inner.items()})
    names = ([name for name in every if name not in together] or every)[:MOST_SCALARS]
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
    """Chart the densities of scalar outputs for each method; ``first`` is the initially visible output.

    Return None if no method has samples or a surrogate of such outputs.
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
    """Draw the density of each scalar output.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        Result of a study, or nodes of methods.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes for each of the first twelve outputs.

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
        raise StudyError(
            "scalar_densities: the results have neither samples nor a polynomial chaos of scalar outputs; expected a "
            "study with a scalar output, such as a natural frequency or a maximum."
        )
    return draw_on_paper(found)


def _error(method: Method, name: str) -> float:
    """Return the stated error of an output, relative to its standard deviation; 0 if no error is stated."""
    data = method.of(name) if name in method.names else {}
    return float(data["verification_error"]) if "verification_error" in data else 0.0


def _responses(method: Method) -> dict[str, NDArray[np.float64]]:
    """Return samples of each scalar output from a method or its surrogate; empty if it has neither.

    The arrays contain only the samples in which the output occurs. Outputs that occur in fewer than two samples are
    omitted.
    """
    if method.samples is not None:
        data = method.samples.isel(sample=np.flatnonzero(method.samples["status"].values == Status.OK))
        known = zip(data["output"].values.tolist(), data["response"].values.T, strict=True)
        return {name: some for name, values in known if len(some := values[np.isfinite(values)]) > 1}
    if "chaos" in method.node.children:
        # StudyError: sampling a general joint distribution requires its mechanism
        with contextlib.suppress(StudyError):
            chaos = surrogate(method.node)
            _, values = chaos.sample(SURROGATE_SAMPLES, seed=0)
            return dict(zip((output.name for output in chaos.labels.outputs), values.T, strict=True))
    return {}


MOST = 8
"""Maximum number of events in a figure; the earliest are drawn."""


@dataclass(frozen=True, eq=False)
class NumberedEvent:
    """N-th event of a kind."""

    name: str  # name of the event, such as ``floor: impact``
    number: int  # 1 for the first event of this name
    # (K,): times of the event in the sampled realisations in which it occurs before the end of the study, s
    times: NDArray[np.float64]
    share: float  # share of realisations in which the event occurs before the end of the study

    @property
    def title(self) -> str:
        """Return the name of the event, and the share of realisations with this event if it is below one."""
        share = "" if self.share > 0.9995 else f" ({100 * self.share:.2g} % of realisations)"
        return f"{self.name}, no. {self.number}{share}"


def has_events(node: xr.DataTree) -> bool:
    """Return whether a method followed events, and at least one occurred."""
    return bool(_followed(node))


def _followed(node: xr.DataTree) -> list[xr.DataTree]:
    """Return the aligned chaoses of a method that follow events."""
    found = [data for kind, data in surrogate_parts(node).values() if kind == "aligned" and "event" in data.data_vars]
    return [data for data in found if bool(np.any(data.to_dataset()["event"].values != ""))]


def earliest_events(node: xr.DataTree) -> list[NumberedEvent]:
    """Return the first eight events, in order of time, that occur in at least one realisation within the study."""
    from uqmbd.randomness import located
    from uqmbd.results.chaos import random_germs

    chaos = AlignedChaos.from_dataset(_followed(node)[0])
    germs = random_germs(chaos.space, SURROGATE_SAMPLES, 0)
    edges = chaos.edges_at_germs(germs)
    where = located([element.box for element in chaos.elements], germs)
    assert chaos.labels.times is not None
    end = float(chaos.labels.times[-1])
    found: dict[tuple[str, int], list[NDArray[np.float64]]] = {}
    for k, element in enumerate(chaos.elements):
        seen: Counter[str] = Counter()
        for segment, name in enumerate(element.events):
            if name:
                seen[name] += 1
                found.setdefault((name, seen[name]), []).append(edges[where == k, segment + 1])
    events = []
    for (name, number), parts in found.items():
        times = np.concatenate(parts)
        times = times[times <= end]
        share = len(times) / len(germs)
        if share > 0:
            events.append(NumberedEvent(name, number, times, share))
    return sorted(events, key=lambda event: float(np.median(event.times)))[:MOST]


def events_chart(events: Sequence[NumberedEvent]) -> Views:
    """Chart the densities of event times."""
    charts = []
    for event in events:
        shown = densities(event.times, [DensityCurve(event.times)])
        named = ["kernel density estimate"]
        charts.append(density_chart(event.title, "time", "s", shown, named, "histogram", heading=event.title))
    return Views(charts, "Event")


@typechecked
def event_times(results: Results) -> Figure:
    """Draw the densities of event times, one pair of axes for each event.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        Results with a method that follows events, such as ``Collocation(alignment="events")``; if there are several,
        the first one is used.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with axes for each of the first eight events.

    Raises
    ------
    StudyError
        If no method followed events, or no event occurs.

    Examples
    --------
    >>> event_times([])
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: A figure needs the result of at least one propagator; no result is given.
    """
    node = next((n for n in nodes_of(results).values() if has_events(n)), None)
    events = [] if node is None else earliest_events(node)
    if not events:
        method = method_with_option("alignment", "a method with alignments")
        raise StudyError(f"None of these results is aligned with events; use {method}(alignment='events').")
    return draw_on_paper(events_chart(events))


def events_in_words(node: xr.DataTree) -> str:
    """State the mean and standard deviation of the time of each event, and its share of realisations."""
    parts = []
    for event in earliest_events(node):
        parts.append(f"{event.title} at {format_quantity(float(event.times.mean()), 's', float(event.times.std()))}")
    return f"{'; '.join(parts)} (mean ± standard deviation)."
