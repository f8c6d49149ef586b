"""Chunks of realisations of which a worker hands over little: what a function makes of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from uqmbd.propagation.execution import (
    Arrays,
    Chunk,
    Kind,
    Packed,
    Realisations,
    compute_chunk,
    late_outputs,
    offered,
)
from uqmbd.results.storage import ResponseFile
from uqmbd.status import Status
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask

__all__ = ["Handover", "ReductionOrder", "Reduced", "Reduction", "compute_reduced", "reduce_chunk", "store_chunk"]

Reduction = Callable[..., Arrays]
"""From realisations, the index of the first of them, and further arguments to arrays by name."""


@dataclass(frozen=True)
class Reduced:
    """What is left of the realisations of a chunk.

    Attributes
    ----------
    first : int
        Index of the first of them.
    values : array, shape (K, input)
        The inputs.
    result : dict of str to array
        What the function gave.
    status : array of int, shape (K,)
        0: fine; `uqmbd.results.STATUS_MEANINGS` names the others.
    messages : tuple of str
        Reason of each failure, else empty.
    good : array of bool, shape (K,)
        Which succeeded, with outputs that are all finite.
    response : array, shape (W, output, time)
        Of the first W of them, as many as were asked for.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> def largest(part, first):
    ...     return dict(largest=part.response.max(axis=-1))
    >>> (part,) = problem.reduce(np.array([[6.0], [7.0]]), largest)
    >>> part.first, part.result["largest"].round(4).tolist(), part.good.tolist()
    (0, [[12.0], [14.0]], [True, True])
    """

    first: int
    values: Array
    result: Arrays
    status: Index
    messages: tuple[str, ...]
    good: Mask
    response: Array
    counters: dict[str, float]
    wall_time: float

    @property
    def censored(self) -> int:
        """In how many of them an output that is asked for does not happen: they have not failed."""
        return int(np.count_nonzero(self.status == Status.CENSORED))

    @property
    def realisations(self) -> Realisations:
        """The realisations without the responses that were not asked for: of what failed, and why."""
        response = np.zeros((len(self.status), 0, 0))
        return Realisations(self.values, response, self.status, self.messages, self.counters, self.wall_time)


@dataclass(frozen=True)
class ReductionOrder:
    """Instructions to a worker for the reduction of a chunk."""

    first: int  # index of its first realisation
    function: Reduction  # that reduces the chunk, with `arguments`
    arguments: tuple[Any, ...]
    chosen: tuple[str, ...] | None  # requested outputs without a time
    wanted: int  # number of realisations whose responses are returned
    shelves: Mapping[Kind, ResponseFile]  # stores of responses, by kind
    margins: bool  # whether margins of requirements are requested in addition
    stored: Chunk | None = None  # the stored chunk without its response, if there is one
    known: bool = False  # whether the result of the function for the stored chunk is known
    here: bool = False
    """Whether the folder is certainly that of who does it."""


@dataclass(frozen=True)
class Handover:
    """Result of a worker for a chunk."""

    chunk: Chunk  # without its response
    response: Array  # (W, output, time), those that are wanted
    status: Index
    messages: tuple[str, ...]  # where a requested output does not occur, the status of the realisation is censored
    good: Mask  # (K,)
    missing: Index  # (output,) number of realisations without the output
    seen: Index  # indices of some successful realisations
    responses: Array  # of `seen`, from which the integration error is measured
    result: Arrays | None  # of the function
    computed: bool = False  # whether the chunk was computed, not read
    unread: bool = False  # whether the worker cannot read the stored chunk; then the other fields are empty
    companions: dict[Kind, Chunk] = field(default_factory=dict)
    """Chunks of other kinds; without a response where it is stored."""
    files: dict[Kind, tuple[int, bytes | None]] = field(default_factory=dict)
    """By kind, checksum of the file of the responses, and its content where it could not be written."""


def compute_reduced(
    packed: Packed, values: Array, times: Array, rtol: float, integrator: str, kind: Kind, order: ReductionOrder
) -> Handover:
    """Compute realisations, or read them where they are stored, and reduce them.

    Arguments are those of `compute_chunk`. Responses are written once, where requested.
    """
    if order.stored is not None:
        if not (order.here or order.shelves[kind].shared):
            none = np.zeros(0, dtype=np.int64)
            nothing = np.zeros((0, 0, 0))
            return Handover(order.stored, nothing, none, (), none.astype(bool), none, none, nothing, None, unread=True)
        response = order.shelves[kind].load(len(values))
        if response is not None:
            return reduce_chunk(packed, values, replace(order.stored, response=response), order, known=order.known)
    return store_chunk(packed, values, compute_chunk(packed, values, times, rtol, integrator, kind), kind, order)


def store_chunk(packed: Packed, values: Array, full: Chunk, kind: Kind, order: ReductionOrder) -> Handover:
    """Reduce a chunk that has been computed, and write its responses."""
    answer = reduce_chunk(packed, values, full, order)
    companions = full.companions(kind, margins=order.margins)
    files = {}
    for name, shelf in order.shelves.items():
        if (stored := full if name == kind else companions.get(name)) is not None:
            files[name] = shelf.put(stored.response)
            companions |= {name: _bare(stored)} if name != kind else {}
    if order.chosen is not None and not order.shelves:  # others of them may be asked for next
        companions[kind] = replace(full, counters={})
    return replace(answer, computed=True, companions=companions, files=files)


def reduce_chunk(
    packed: Packed, values: Array, chunk: Chunk, order: ReductionOrder, *, known: bool = False
) -> Handover:
    """Reduce a chunk that is there; what the function makes of it may be known."""
    part = Realisations.of(values, chunk, 0.0)
    if order.chosen is not None:
        part = part.choosing(packed.value().scalars, order.chosen)
    seen, result = offered(part.status), None
    if not known:
        with one_thread():
            result = order.function(part, order.first, *order.arguments)
    few = part.response[: order.wanted].copy()
    about = (part.status, part.messages, part.good, late_outputs(part), seen, part.response[seen])
    return Handover(_bare(chunk), few, *about, result)


def _bare(chunk: Chunk) -> Chunk:
    return replace(chunk, response=np.zeros((len(chunk.status), 0, 0)), scalars=None, margins=None)
