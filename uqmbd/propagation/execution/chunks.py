"""Chunks of realisations: results do not depend on the worker that computes a chunk, or on the order of chunks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import (
    Ensemble,
    MarginValues,
    Model,
    ScalarValues,
    Trajectories,
    built_in_names,
    capabilities_of,
    integrate,
    integrator_class,
    margins_of,
    numbers_of,
    scalars_of,
    undetermined_contacts,
)
from uqmbd.propagation.execution.cost import machine_counter
from uqmbd.propagation.execution.transport import Packed
from uqmbd.status import Status
from uqmbd.threads import one_thread
from uqmbd.typing import Array

__all__ = [
    "CHUNK",
    "Chunk",
    "Kind",
    "chunk_size",
    "chunk_size_of",
    "compute_chunk",
    "integrated_by",
    "lost_chunk",
    "needs_motion",
    "not_finite_output",
]


CHUNK, LARGEST, LARGEST_AT_REST = 64, 512, 8192
"""Minimum and maximum number of realisations in a chunk, and maximum without a motion, for small mechanisms."""

CHUNKS = 16
"""Minimum number of chunks if a chunk has more than `CHUNK` realisations."""

CHUNKS_CALLED = 8
"""The same, if controllers have functions, whose calls are expensive compared with a realisation."""

NUMBERS = 1 << 21
"""Maximum number of state and output values (8 bytes each) in a chunk of more than `CHUNK` realisations."""


def chunk_size(count: int, numbers: int, largest: int = LARGEST, chunks: int = CHUNKS) -> int:
    """Return the number of realisations in a chunk, a power of two: 64 for few or large realisations.

    `count` is the number of all realisations; `numbers` is the number of state and output values of one realisation
    over all times. Chunks have more than 64 realisations only if there are at least `chunks` of them. Larger chunks
    reduce the overhead of Python per realisation; threads wait for each other during this overhead. Only sample indices
    determine chunks, so results do not depend on the workers or on their number.

    >>> chunk_size(500, 1400), chunk_size(50_000, 1400), chunk_size(50_000, 20_000)
    (64, 512, 64)
    """
    most = min(count // chunks, NUMBERS // max(numbers, 1), largest)
    return max(CHUNK, 1 << (most.bit_length() - 1)) if most else CHUNK


def chunk_size_of(model: Model, means: Array, times: Array, count: int) -> int:
    """Return the number of realisations in a chunk, for `count` realisations over the times (T,), s.

    Without a motion, matrices of all realisations are in memory at once, and chunks of small mechanisms may be larger.
    """
    if model.outputs.names or needs_motion(model, "scalars"):
        called = any(loop.law is None for loop in model.controls)
        return chunk_size(count, numbers_of(model, means, times), chunks=CHUNKS_CALLED if called else CHUNKS)
    matrix = NUMBERS // max(model.layout.unknowns, 1) ** 2
    return chunk_size(count, 1, min(max(matrix, LARGEST), LARGEST_AT_REST))


Kind = Literal["outputs", "scalars", "requirements"]
"""Kind of response: outputs over time, outputs without a time, or margins of requirements."""


@dataclass(frozen=True)
class Chunk:
    """Results of one chunk."""

    response: Array  # (K, output, time); NaN for failed realisations
    status: NDArray[np.int64]  # (K,) of `Status`; 0: successful
    messages: tuple[str, ...]  # reasons of failure
    counters: dict[str, float]  # counters of the solver, and number of realisations by type of machine
    scalars: ScalarValues | None = None  # outputs without a time; None if the mechanism has none
    margins: MarginValues | None = None  # margins of requirements; None if the mechanism has none
    seconds: float = 0.0  # wall time of the chunk in the run, s

    def of(self, kind: Kind) -> Chunk | None:
        """Return the chunk of another kind of response; None if that kind was not computed.

        Outputs without a time have a single time. A margin that is only defined at the end of the motion gets this
        value at all times, so that each value is finite.
        """
        if kind == "scalars" and self.scalars is not None:
            found = self.scalars
            return replace(self, response=found.values[:, :, None], status=found.status, messages=found.messages)
        if kind == "requirements" and self.margins is not None:
            running = self.margins.running
            response = np.where(np.isinf(running), running[:, :, -1:], running)
            return replace(self, response=response, status=self.margins.status, messages=self.margins.messages)
        return self if kind == "outputs" else None

    def companions(self, kind: Kind, *, margins: bool) -> dict[Kind, Chunk]:
        """Return chunks of other kinds that were computed with this chunk; `margins` includes margins of requirements.

        Only this chunk contains the counters of the solver.
        """
        kinds: tuple[Kind, ...] = ("scalars", "requirements") if margins else ("scalars",)
        found = {other: self.of(other) for other in kinds if other != kind}
        return {
            other: replace(one, counters={}, scalars=None, margins=one.margins if other == "requirements" else None)
            for other, one in found.items()
            if one is not None
        }


def integrated_by(counters: Mapping[str, float], requested: str) -> dict[str, str]:
    """Return the attribute with the integrators of realisations, most frequent first; empty without an integrator.

    `requested` is the name of the requested integrator.

    >>> integrated_by({"steps": 100, "by_dop853": 60, "by_ida": 4}, "auto")
    {'integrated_by': 'dop853, ida'}
    """
    if not capabilities_of(integrator_class(requested)).delegates:
        return {"integrated_by": requested}
    counts = {name: counters.get(f"by_{name}", 0) for name in built_in_names()}
    names = sorted((name for name in counts if counts[name]), key=lambda name: -counts[name])
    return {"integrated_by": ", ".join(names)} if names else {}


def not_finite_output(ensemble: Ensemble, member: int, times: Array, states: Array, response: Array) -> str:
    """Return a message on the first non-finite output (output, T) of a realisation, with its time and cause.

    `states` (T, width) are the states of the realisation.
    """
    names, wrong = ensemble.model.outputs.names, ~np.isfinite(response)
    k = int(np.argmax(wrong.any(axis=0)))
    output = int(np.argmax(wrong[:, k]))
    if contacts := undetermined_contacts(ensemble, float(times[k]), states[k], member):
        some = ", ".join(repr(name) for name in contacts)
        only = f"the forces of the contacts {some} are" if len(contacts) > 1 else f"the force of the contact {some} is"
        return (
            f"the output {names[output]!r} is not determined at t = {times[k]:g} s: {only} not unique, because other "
            "forces cause the same motion; use an output that depends only on their resultant, or compliant contacts"
        )
    return (
        f"an output is not finite: {names[output]!r} is {response[output, k]:g} at t = {times[k]:g} s; check its "
        "expression for divisions by zero, and for roots and logarithms outside their domain"
    )


def needs_motion(model: Model, kind: Kind) -> bool:
    """Return whether a kind of outputs, or a kind that is computed with it, requires a motion."""
    companions = [model.margins] if kind == "requirements" else [model.scalars, model.margins]
    return kind == "outputs" or any(one is not None and one.needs_motion for one in companions)


def compute_chunk(
    given: Model | Packed, values: Array, times: Array, rtol: float, integrator: str = "auto", kind: Kind = "outputs"
) -> Chunk:
    """Assemble and integrate realisations at inputs (K, input), and evaluate their outputs.

    The integration is omitted if neither the kind of outputs nor a kind that is computed with it requires a motion.
    """
    model: Model = given.value() if isinstance(given, Packed) else given
    # on blocks of some dozen rows, several threads are slower; their number would also change the last bits
    with one_thread():
        ensemble = Ensemble(model, values, until=float(times[-1]) if needs_motion(model, kind) else None)
        scalars = model.scalars if kind != "requirements" else None
        moves, between = needs_motion(model, kind), model.needs_dense_output
        trajectories = integrate(ensemble, times, rtol, integrator, between=between) if moves else None
        chunk = Chunk(np.zeros((len(values), 0, 0)), np.zeros(len(values), dtype=np.int64), ("",) * len(values), {})
        if kind == "outputs" and trajectories is not None:
            chunk = _observed(ensemble, times, trajectories)
        if scalars is not None:
            chunk = replace(chunk, scalars=scalars_of(ensemble, trajectories))
        if model.margins is not None:
            chunk = replace(chunk, margins=margins_of(ensemble, times, trajectories))
    counters: dict[str, float] = {}
    if trajectories is not None:
        counters = dict(vars(trajectories.counters))
        if not capabilities_of(integrator_class(integrator)).delegates:
            counters[f"by_{integrator}"] = int(np.count_nonzero(ensemble.start.ok))
    counters |= machine_counter(len(values))
    found = replace(chunk, counters=counters).of(kind)
    if found is None:
        raise ValueError(f"no {kind}")
    return found


def lost_chunk(model: Model, count: int, times: Array, reason: str, kind: Kind = "outputs") -> Chunk:
    """Return a chunk of failed realisations whose workers died, with the reason as message."""
    status, messages = np.full(count, int(Status.WORKER_DIED)), (reason,) * count
    scalars, margins = model.scalars, model.margins
    chunk = Chunk(np.full((count, len(model.outputs.names), len(times)), np.nan), status, messages, {})
    if scalars is not None and kind != "requirements":
        unknown = np.full((count, len(scalars.names)), np.nan)
        chunk = replace(chunk, scalars=ScalarValues(unknown, status, messages, np.zeros(unknown.shape, dtype=bool)))
    if margins is not None:
        running = np.full((count, len(margins.requirements), len(times)), np.nan)
        chunk = replace(chunk, margins=MarginValues(running, status, messages))
    found = chunk.of(kind)
    if found is None:
        raise ValueError(f"no {kind}")
    return found


def _observed(ensemble: Ensemble, times: Array, trajectories: Trajectories) -> Chunk:
    """Evaluate the outputs over time of realisations."""
    model, count = ensemble.model, len(ensemble)
    status = np.zeros(count, dtype=np.int64)
    at_start = ensemble.start.status
    for k, message in enumerate(trajectories.messages):
        if message:
            status[k] = at_start[k] or Status.INTEGRATION_FAILED
    good = np.flatnonzero(status == Status.OK)
    if len(good) == count:
        response = ensemble.outputs(times, trajectories.states)
    else:
        response = np.full((count, len(model.outputs.names), len(times)), np.nan)
        if len(good):
            response[good] = ensemble.select(good).outputs(times, trajectories.states[good])
    messages = list(trajectories.messages)
    for k in np.flatnonzero((status == Status.OK) & ~np.isfinite(response).all(axis=(1, 2))).tolist():
        status[k] = Status.NOT_FINITE
        messages[k] = not_finite_output(ensemble, k, times, trajectories.states[k], response[k])
    return Chunk(response, status, tuple(messages), {})
