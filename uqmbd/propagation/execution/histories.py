"""Motions from event to event: what methods need that follow events instead of times."""

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
"""Further segments that a realisation is followed for: others may have more of them within the output times."""

LONGEST = 8.0
"""How much longer than the output times a realisation is followed for its next events."""


@typechecked
@dataclass(frozen=True)
class History:
    """The motion of one realisation from event to event.

    Attributes
    ----------
    labels : tuple of str, length S
        What ends each segment ("floor: impact"; a force that switches: "break"); empty where it ends without an event.
    edges : array, shape (S + 1,)
        Times at which segments begin and end, s.
    response : array, shape (S, output, P)
        Outputs at `uqmbd.extend.AlignedElement.points` of each segment; at its ends right after and right before the
        events.
    message : str
        Reason of failure, or empty.
    inside : int
        Segments that begin before the last output time.
    final : bool
        No further event happens for long after the last output time.

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
    """Integrate each row of inputs (K, input) from event to event, on all workers.

    `run` executes tasks like `uqmbd.extend.Problem.run`; `times` are first and last, s; `points` is the number in a
    segment. Motions are continued beyond the last output time until they have `least` segments. A last segment that no
    event ends continues until `longer` times the range of the output times; both at most to eight times this range. The
    integrator declares ``segments``.
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
    """Follow one realisation; the arrays are those of a `History`."""
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
        run = cls().integrate_segments(ensemble, np.array([begin, begin + span * (end - begin)]), rtol)
        inside = sum(segment.begin < end for segment in run.segments)
        complete = len(run.segments) - 1  # the last one was ended by no event
        if run.message or complete >= max(least, inside + MARGIN) or span >= LONGEST:
            break
        span = min(2 * span, LONGEST)
    if run.message:
        return {**none, "response": empty, "message": np.array([run.message])}
    final = complete < max(least, inside + MARGIN)
    pieces = run.segments if final else run.segments[:-1]
    # where nothing ends a motion, the output times do, or what is asked for behind them
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
