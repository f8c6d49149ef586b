"""Reduced chunks of realisations: a worker applies a function to a chunk and returns only its result."""

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

__all__ = ["ReductionOrder", "Reduced", "Reduction", "compute_reduced", "reduce_chunk", "store_chunk", "WorkerResult"]

Reduction = Callable[..., Arrays]
"""Function that maps realisations, the index of the first realisation, and further arguments to arrays by name."""


@dataclass(frozen=True)
class Reduced:
    """Reduced realisations of a chunk.

    Attributes
    ----------
    first : int
        Index of the first realisation of the chunk.
    values : array, shape (K, input)
        Inputs of the realisations.
    result : dict of str to array
        Return value of the function.
    status : array of int, shape (K,)
        Status of each realisation; 0: success. `uqmbd.results.STATUS_MEANINGS` names the other values.
    messages : tuple of str
        Reason of each failure; empty for successful realisations.
    good : array of bool, shape (K,)
        Whether each realisation succeeded, with finite outputs.
    response : array, shape (W, output, time)
        Responses of the first W realisations, where W is the requested number.
    counters : dict
        Solver counters, summed over the realisations.
    wall_time : float
        Wall-clock time, s.

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
        """Return the number of realisations without a requested output; they do not count as failures."""
        return int(np.count_nonzero(self.status == Status.CENSORED))

    @property
    def realisations(self) -> Realisations:
        """Return the realisations with their failures and reasons, but without responses that were not requested."""
        response = np.zeros((len(self.status), 0, 0))
        return Realisations(self.values, response, self.status, self.messages, self.counters, self.wall_time)


@dataclass(frozen=True)
class ReductionOrder:
    """Instructions to a worker for the reduction of a chunk."""

    first: int  # index of the first realisation of the chunk
    function: Reduction  # function that reduces the chunk, with `arguments`
    arguments: tuple[Any, ...]
    chosen: tuple[str, ...] | None  # requested outputs without a time
    response_count: int  # number of realisations whose responses are returned
    shelves: Mapping[Kind, ResponseFile]  # stores of responses, by kind
    margins: bool  # whether margins of requirements are also requested
    stored: Chunk | None = None  # stored chunk without its response, if it exists
    known: bool = False  # whether the result of the function for the stored chunk is known
    here: bool = False
    """Whether the process that reduces the chunk certainly has access to the same folder."""


@dataclass(frozen=True)
class WorkerResult:
    """Result of a worker for a chunk."""

    chunk: Chunk  # chunk without its response
    response: Array  # (W, output, time), requested responses
    status: Index
    messages: tuple[str, ...]  # a realisation without a requested output is censored
    good: Mask  # (K,)
    missing: Index  # (output,) number of realisations without the output
    seen: Index  # indices of some successful realisations
    responses: Array  # responses of `seen`, for the measurement of the integration error
    result: Arrays | None  # result of the function
    computed: bool = False  # whether the chunk was computed instead of read
    unread: bool = False  # whether the worker cannot read the stored chunk; then the other fields are empty
    companions: dict[Kind, Chunk] = field(default_factory=dict)
    """Chunks of other kinds, without responses that are stored."""
    files: dict[Kind, tuple[int, bytes | None]] = field(default_factory=dict)
    """Checksum of the file of the responses, and its content if it could not be written, by kind."""


def compute_reduced(
    packed: Packed, values: Array, times: Array, rtol: float, integrator: str, kind: Kind, order: ReductionOrder
) -> WorkerResult:
    """Compute realisations, or read stored realisations, and reduce them.

    `compute_chunk` documents the arguments. Requested responses are written once.
    """
    if order.stored is not None:
        if not (order.here or order.shelves[kind].shared):
            none = np.zeros(0, dtype=np.int64)
            nothing = np.zeros((0, 0, 0))
            return WorkerResult(
                order.stored, nothing, none, (), none.astype(bool), none, none, nothing, None, unread=True
            )
        response = order.shelves[kind].load(len(values))
        if response is not None:
            return reduce_chunk(packed, values, replace(order.stored, response=response), order, known=order.known)
    return store_chunk(packed, values, compute_chunk(packed, values, times, rtol, integrator, kind), kind, order)


def store_chunk(packed: Packed, values: Array, full: Chunk, kind: Kind, order: ReductionOrder) -> WorkerResult:
    """Reduce a computed chunk, and write its responses."""
    answer = reduce_chunk(packed, values, full, order)
    companions = full.companions(kind, margins=order.margins)
    files = {}
    for name, shelf in order.shelves.items():
        if (stored := full if name == kind else companions.get(name)) is not None:
            files[name] = shelf.put(stored.response)
            companions |= {name: _bare(stored)} if name != kind else {}
    if order.chosen is not None and not order.shelves:  # other outputs may be requested next
        companions[kind] = replace(full, counters={})
    return replace(answer, computed=True, companions=companions, files=files)


def reduce_chunk(
    packed: Packed, values: Array, chunk: Chunk, order: ReductionOrder, *, known: bool = False
) -> WorkerResult:
    """Reduce an available chunk; the result of the function may already be known."""
    part = Realisations.of(values, chunk, 0.0)
    if order.chosen is not None:
        part = part.choosing(packed.value().scalars, order.chosen)
    seen, result = offered(part.status), None
    if not known:
        with one_thread():
            result = order.function(part, order.first, *order.arguments)
    few = part.response[: order.response_count].copy()
    about = (part.status, part.messages, part.good, late_outputs(part), seen, part.response[seen])
    return WorkerResult(_bare(chunk), few, *about, result)


def _bare(chunk: Chunk) -> Chunk:
    return replace(chunk, response=np.zeros((len(chunk.status), 0, 0)), scalars=None, margins=None)
