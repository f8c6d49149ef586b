"""When the events of a motion happen, as an event-aligned chaos knows it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.report.charts import Views, paper
from uqmbd.report.figures.density import DensityCurve, densities, density_chart
from uqmbd.report.figures.distributions import SURROGATE_SAMPLES
from uqmbd.report.figures.selection import Results, nodes_of
from uqmbd.results import AlignedChaos
from uqmbd.results.chaos import surrogate_parts
from uqmbd.wording import format_quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["EventTime", "earliest_events", "event_times", "events_chart", "events_in_words", "has_events"]

MOST = 8
"""Events that are drawn, the earliest."""


@dataclass(frozen=True, eq=False)
class EventTime:
    """One event: the n-th of its kind.

    Attributes
    ----------
    name : str
        What happens, as ``floor: impact``.
    number : int
        1 for the first of this name.
    times : array, shape (K,)
        Its times in those of the sampled realisations that reach it until the end of the study, s.
    share : float
        Share of realisations in which it happens until the end of the study.
    """

    name: str
    number: int
    times: NDArray[np.float64]
    share: float

    @property
    def title(self) -> str:
        """What it is called, and in how many realisations it happens if not in all."""
        share = "" if self.share > 0.9995 else f" ({100 * self.share:.2g} % reach it)"
        return f"{self.name}, no. {self.number}{share}"


def has_events(node: xr.DataTree) -> bool:
    """Tell whether a method followed events, and there were any."""
    return bool(_followed(node))


def _followed(node: xr.DataTree) -> list[xr.DataTree]:
    """Return the aligned chaoses of a method that follow events."""
    found = [data for kind, data in surrogate_parts(node).values() if kind == "aligned" and "event" in data.data_vars]
    return [data for data in found if bool(np.any(data.to_dataset()["event"].values != ""))]


def earliest_events(node: xr.DataTree) -> list[EventTime]:
    """Return the first eight events that some realisation reaches before the end of the study, the earliest first."""
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
            events.append(EventTime(name, number, times, share))
    return sorted(events, key=lambda event: float(np.median(event.times)))[:MOST]


def events_chart(events: Sequence[EventTime]) -> Views:
    """Chart the densities of the times of events."""
    charts = []
    for event in events:
        shown = densities(event.times, [DensityCurve(event.times)])
        named = ["smooth estimate"]
        charts.append(density_chart(event.title, "time", "s", shown, named, "histogram", heading=event.title))
    return Views(charts, "Event")


@typechecked
def event_times(results: Results) -> Figure:
    """Draw how the times of events are distributed, each event in axes of its own.

    Parameters
    ----------
    results : xarray.DataTree, mapping or iterable of nodes
        With a method that follows events, as ``Collocation(alignment="events")``; of several the first.

    Returns
    -------
    matplotlib.figure.Figure
        Axes for each event, the first eight.

    Raises
    ------
    StudyError
        If no method followed events, or none happens.

    Examples
    --------
    >>> event_times([])
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: A figure needs the result of at least one propagator; there is none.
    """
    node = next((n for n in nodes_of(results).values() if has_events(n)), None)
    events = [] if node is None else earliest_events(node)
    if not events:
        raise StudyError("None of these results follows events; use Collocation(alignment='events').")
    return paper(events_chart(events))


def events_in_words(node: xr.DataTree) -> str:
    """Say when each event happens until the end: mean and standard deviation of its time, in how many realisations."""
    parts = []
    for event in earliest_events(node):
        parts.append(f"{event.title} at {format_quantity(float(event.times.mean()), 's', float(event.times.std()))}")
    return f"{'; '.join(parts)} (mean ± standard deviation)."
