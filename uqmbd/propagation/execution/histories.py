"""Motions from event to event, for methods that use events instead of output times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.arguments import Size, typechecked
from uqmbd.dynamics import Ensemble, Model, integrator_class, off_constraints, position_jumps
from uqmbd.propagation.execution.tasks import Arrays
from uqmbd.results.chaos import AlignedElement
from uqmbd.typing import Array

__all__ = ["History", "event_histories"]


MARGIN = 1
"""Number of additional segments of a realisation, because others may have more segments within the output times."""

LONGEST = 8.0
"""Maximum length of the integration for further events, relative to the range of the output times."""


@typechecked
@dataclass(frozen=True)
class History:
    """The motion of one realisation from event to event.

    Attributes
    ----------
    labels : tuple of str, length S
        Event that ends each segment, such as ``floor: impact``, or ``break`` for a force that switches. The label is
        empty for a segment without a final event.
    edges : array, shape (S + 1,)
        Times at which segments begin and end, s.
    response : array, shape (S, output, P)
        Outputs at `uqmbd.extend.AlignedElement.points` of each segment. The first value of a segment is the value right
        after an event; the last value is the value right before an event.
    message : str
        Reason of a failure; otherwise empty.
    inside : int
        Number of segments that begin before the last output time.
    final : bool
        Whether no further event occurs until long after the last output time.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> edges = np.array([0.0, 0.45, 1.0])
    >>> fall = uqmbd.extend.History(("floor: impact", ""), edges, response=np.zeros((2, 1, 3)), inside=2)
    >>> np.diff(fall.edges).round(2).tolist(), fall.final
    ([0.45, 0.55], False)
    """

    labels: tuple[str, ...]
    edges: Array
    response: Array
    message: str = ""
    inside: Size = 0
    final: bool = False


def event_histories(
    run: Callable[[Callable[..., Arrays], Sequence[tuple[Any, ...]]], Iterator[Arrays]],
    values: Array,
    times: tuple[float, float],
    rtol: float,
    points: int,
    least: int = 1,
    integrator: str = "auto",
    longer: float = 1.0,
) -> list[History]:
    """Integrate each row of inputs (K, input) from event to event on all workers.

    `run` executes tasks like `uqmbd.extend.Problem.run`. `times` are the first and last output time, s; `points` is the
    number of points in a segment. Motions continue beyond the last output time until they have `least` segments. A last
    segment without a final event continues until `longer` times the range of the output times. Motions continue until
    at most eight times this range. The integrator must declare ``segments``.
    """
    tasks = [(row, times, rtol, points, least, integrator, longer) for row in np.ascontiguousarray(values, dtype=float)]
    found = []
    for arrays in run(followed, tasks):
        labels = tuple(arrays["labels"].tolist())
        message = str(arrays["message"][0])
        inside, final = int(arrays["inside"][0]), bool(arrays["final"][0])
        found.append(History(labels, arrays["edges"], arrays["response"], message, inside, final))
    return found


def followed(
    model: Model,
    values: Array,
    times: tuple[float, float],
    rtol: float,
    points: int,
    least: int,
    integrator: str,
    longer: float,
) -> dict[str, NDArray[Any]]:
    """Integrate one realisation from event to event; return the arrays of a `History`."""
    cls: Any = integrator_class(integrator)
    ensemble = Ensemble(model, values[None, :])
    begin, end = times
    none = {
        "labels": np.zeros(0, dtype="U1"),
        "edges": np.zeros(1),
        "inside": np.zeros(1, dtype=np.int64),
        "final": np.ones(1, dtype=bool),
    }
    empty = np.zeros((0, len(model.outputs.names), points))
    if not ensemble.start.ok[0]:
        return {**none, "response": empty, "message": np.array([ensemble.start.messages[0]])}
    if ensemble.model.rheonomic and (jumps := position_jumps(ensemble, np.array(times), rtol)):
        return {**none, "response": empty, "message": np.array([jumps[0]])}
    span = 1.0
    while True:
        if ensemble.paths is not None:
            ensemble.paths.reach(begin, begin + span * (end - begin))
        run = cls().integrate_segments(ensemble, np.array([begin, begin + span * (end - begin)]), rtol)
        inside = sum(segment.begin < end for segment in run.segments)
        complete = len(run.segments) - 1  # the last segment has no final event
        if run.message or complete >= max(least, inside + MARGIN) or span >= LONGEST:
            break
        span = min(2 * span, LONGEST)
    if run.message:
        return {**none, "response": empty, "message": np.array([run.message])}
    final = complete < max(least, inside + MARGIN)
    pieces = run.segments if final else run.segments[:-1]
    # a last segment without a final event ends at the last output time, or at the requested multiple of the range of
    # times
    last_of_all = begin + longer * (end - begin) if longer > 1 else end
    ends = [max(p.begin, min(p.end, last_of_all)) if final and p is pieces[-1] else p.end for p in pieces]
    where = AlignedElement.points(points)
    moments = [p.begin + where * (last - p.begin) for p, last in zip(pieces, ends, strict=True)]
    states = [p.states(at) for p, at in zip(pieces, moments, strict=True)]
    at, every = np.concatenate(moments), np.concatenate(states)[None]
    if off := off_constraints(ensemble, at, every, rtol):
        return {**none, "response": empty, "message": np.array([off[0][1]])}
    response = ensemble.outputs(at, every)[0]
    return {
        "labels": np.array([p.label for p in pieces]),
        "edges": np.array([pieces[0].begin, *ends]),
        "response": np.stack(np.split(response, len(pieces), axis=1)),
        "message": np.array([""]),
        "inside": np.array([inside]),
        "final": np.array([final]),
    }
