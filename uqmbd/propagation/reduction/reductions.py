"""Reduction of realisations by workers, with storage if the run has a folder."""

from __future__ import annotations

import hashlib
import pickle
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqmbd.propagation.execution import (
    Chunk,
    Kind,
    Packed,
    executor_for,
    log_realisations,
    lost_chunk,
    run_in_order,
)
from uqmbd.propagation.reduction.reduced import (
    Reduced,
    Reduction,
    ReductionOrder,
    WorkerResult,
    compute_reduced,
    reduce_chunk,
    store_chunk,
)
from uqmbd.propagation.runner import ProblemData, Runner
from uqmbd.results import SampleStore
from uqmbd.results.storage import Record, UnfinishedStore
from uqmbd.typing import Array

__all__ = ["Reductions", "store_name"]


def store_name(label: str) -> str:
    """Return the name of the store of samples next to the results.

    >>> store_name("monte-carlo")
    'monte-carlo-samples.zarr'
    """
    return f"{re.sub(r'[<>:|?*]+', '-', label)}-samples.zarr"  # Windows does not allow these characters


@dataclass(frozen=True)
class Piece:
    """A chunk of rows, with its index."""

    number: int
    first: int
    values: Array


class Pieces(Sequence[Piece]):
    """Rows in chunks of equal size; each chunk is made on access."""

    def __init__(self, values: Array, size: int) -> None:
        self.values, self.size = values, size

    def __len__(self) -> int:
        return -(-len(self.values) // self.size)

    def __getitem__(self, number: Any) -> Any:
        if not 0 <= number < len(self):
            raise IndexError(number)
        first = number * self.size
        return Piece(number, first, np.ascontiguousarray(self.values[first : first + self.size]))


class Reductions:
    """Results of a function of realisations, chunk by chunk, in the order of the rows.

    The object can be iterated once. Afterwards `store` contains the responses, if the run has a folder.

    Parameters
    ----------
    problem : Problem
        Problem whose runner computes the realisations.
    values : array, shape (K, input)
        Inputs of the realisations.
    function, arguments : callable, tuple
        Function of the realisations, and its further arguments, as for `Problem.reduce`.
    runner : Runner
        Executor, progress, checkpoint, ledger, clock and cache.
    keep : int
        Number of first realisations whose responses are returned.

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
    >>> found = problem.reduce(np.array([[6.0], [7.0]]), largest)
    >>> [part.result["largest"].round(4).tolist() for part in found]
    [[[12.0], [14.0]]]
    >>> found.store is None  # the run has no folder
    True
    """

    def __init__(
        self,
        problem: ProblemData,
        runner: Runner,
        values: Array,
        function: Reduction,
        arguments: tuple[Any, ...],
        keep: int,
    ) -> None:
        self._problem, self._runner, self._values, self._keep = problem, runner, values, keep
        self._method, self._known_chunks = problem.method_label or problem.label, runner.chunk_store(problem)
        self._function, self._arguments = function, arguments
        text = hashlib.sha256(f"{function.__module__}.{function.__qualname__}".encode())
        text.update(pickle.dumps((arguments, problem.chosen)))
        self._function_key = text.hexdigest()[:32]
        self._stores: dict[Kind, UnfinishedStore] = {}
        self.store: SampleStore | None = None

    def __iter__(self) -> Iterator[Reduced]:
        problem, runner, values = self._problem, self._runner, self._values
        if not len(values):
            return
        size = problem.chunk_of(len(values))
        identity = self._identity(problem.kind, size)
        self._stores = self._open_stores(size)
        own = self._stores.get(problem.kind)
        again = runner.clock.knows(identity)
        runner.progress.start(problem.label, len(values))
        begin, recovered = runner.clock(), 0.0
        began = begin
        pieces = Pieces(values, size)
        workers = executor_for(runner.executor, unlocked=problem.unlocked)
        answers = run_in_order(pieces, workers, self._find_stored, self._task, self._store_finished, self._lost_answer)
        # if a budget ends the run, finished chunks of workers are stored immediately
        with closing(answers):
            for piece, answer in zip(pieces, answers, strict=True):
                now = runner.clock()
                spent = 0.0 if answer.computed or again else answer.chunk.seconds
                recovered += spent
                runner.spending.realised(now - began + spent, answer.chunk.counters)
                found = Reduced(
                    piece.first,
                    piece.values,
                    answer.result or {},
                    answer.status,
                    answer.messages,
                    answer.good,
                    answer.response,
                    dict(answer.chunk.counters),
                    now - begin + spent,
                )
                runner.observed.count(found.realisations, answer.missing)
                log_realisations(problem.label, problem.kind, found.realisations)
                runner.observed.take(piece.values[answer.seen], answer.responses)
                if own is not None:
                    own.fill(piece.values, answer.chunk.status, answer.chunk.messages)
                yield found
                begin, began = now, runner.clock()
                runner.progress.advance(problem.label, len(found.status))
                if runner.ledger is not None and piece.number + 1 < len(pieces):
                    runner.ledger.begin()
        if own is not None:
            self.store = own.finish()
        runner.clock.recover(identity, recovered)
        runner.progress.finish(problem.label)

    def _open_stores(self, size: int) -> dict[Kind, UnfinishedStore]:
        """Open the stores of the requested kind of outputs, and of kinds that are requested later."""
        problem, runner = self._problem, self._runner
        if runner.checkpoint is None:
            return {}
        kinds: list[Kind] = [problem.kind]
        if problem.kind == "outputs" and problem.model.scalars is not None:
            kinds.append("scalars")
        if self._margins:
            kinds.append("requirements")
        found: dict[Kind, UnfinishedStore] = {}
        checkpoint = replace(runner.checkpoint, label=self._method)
        for kind in kinds:
            name = store_name(problem.label) if kind == problem.kind else None
            times = problem.whole_times[:1] if kind == "scalars" else problem.whole_times
            axes = replace(problem, kind=kind, times=times, chosen=None).labels
            about = (name, self._identity(kind, size), len(self._values), size, axes)
            found[kind] = UnfinishedStore(checkpoint.folder, checkpoint.place, *about)
        return found

    @property
    def _margins(self) -> bool:
        """Return whether a later problem uses the margins, so that they must be stored."""
        problem = self._problem
        first = problem.kind == "outputs" or (problem.kind == "scalars" and not problem.model.outputs.names)
        return first and problem.model.margins is not None and not problem.answers_requirements

    def _identity(self, kind: Kind, size: int) -> str:
        """Return the name of a store; a larger sample that begins with the same rows continues this store."""
        text = hashlib.sha256(self._values[0].tobytes())
        text.update(self._problem.common_identity)
        text.update(self._method.encode())
        text.update(f"{kind} {self._values.shape[1]} {size}".encode())
        return text.hexdigest()[:32]

    def _order(self, piece: Piece, record: Record | None, stored: Chunk | None) -> ReductionOrder:
        problem = self._problem
        known = record is not None and self._is_of(record)
        checksum = None if record is None else int(record[0]["checksum"])
        shelves = {
            kind: store.shelf(piece.number, checksum if kind == problem.kind else None)
            for kind, store in self._stores.items()
        }
        about = (problem.chosen, max(0, self._keep - piece.first), shelves, self._margins, stored, known)
        return ReductionOrder(piece.first, self._function, self._arguments, *about)

    def _is_of(self, record: Record) -> bool:
        """Return whether the result of a record comes from the same function with the same arguments."""
        return bool(record[0].get("asked") == self._function_key)

    def _find_stored(self, piece: Piece) -> WorkerResult | None:
        """Reduce a stored chunk, from another kind of outputs or another size of the method."""
        problem, runner, known = self._problem, self._runner, self._known_chunks
        if not self._stores and (chunk := known.find_companion(piece.values)) is not None:
            return reduce_chunk(problem.packed, piece.values, chunk, self._order(piece, None, None))
        if runner.ledger is None:
            return None
        if self._stored(piece) is not None and self._stores[problem.kind].shelf(piece.number).path.exists():
            runner.ledger.reuse(len(piece.values))
        elif (found := runner.ledger.find(piece.values, known.key, join=known.joinable)) is not None:
            runner.ledger.reuse(len(piece.values))
            answer = store_chunk(problem.packed, piece.values, found, problem.kind, self._order(piece, None, None))
            return self._store(piece, answer, found.seconds)
        else:
            runner.ledger.begin(len(piece.values))
        return None

    def _stored(self, piece: Piece) -> tuple[Record, Chunk] | None:
        """Return the record and the content of a stored chunk that can be reused; None if there is none."""
        problem = self._problem
        own = self._stores.get(problem.kind)
        record = None if own is None else own.record(piece.number)
        # margins are not stored: a run uses the stored result of the function, or computes the margins again
        if record is None or (problem.answers_requirements and not self._is_of(record)):
            return None
        if record[0].get("inputs") != _digest(piece.values):
            return None
        return record, _chunk(record, len(piece.values))

    def _lost_answer(self, piece: Piece, reason: str) -> WorkerResult:
        """Return the answer for a chunk whose workers died; a resumed run computes the chunk again."""
        problem = self._problem
        full = lost_chunk(problem.model, len(piece.values), problem.whole_times, reason, problem.kind)
        answer = store_chunk(problem.packed, piece.values, full, problem.kind, self._order(piece, None, None))
        return self._store(piece, answer, 0.0, lost=True)

    def _task(self, piece: Piece) -> tuple[Callable[..., WorkerResult], tuple[Any, ...]]:
        order = self._order(piece, *(self._stored(piece) or (None, None)))
        return compute_reduced, (*self._computed(piece), order)

    def _computed(self, piece: Piece) -> tuple[Packed, Array, Array, float, str, Kind]:
        """Return the arguments of `compute_chunk`."""
        problem = self._problem
        about = (problem.rtol, problem.integrator, problem.kind)
        return problem.packed, piece.values, problem.whole_times, *about

    def _store_finished(self, piece: Piece, answer: WorkerResult, seconds: float) -> WorkerResult:
        """Store a chunk that a worker has computed or read."""
        if self._runner.ledger is not None and answer.computed:
            self._runner.ledger.finish(len(piece.values))
        return self._store(piece, answer, seconds)

    def _store(self, piece: Piece, answer: WorkerResult, seconds: float, *, lost: bool = False) -> WorkerResult:
        """Store a computed chunk and its companions; a chunk that was read is already stored."""
        problem = self._problem
        if answer.unread:
            order = self._order(piece, *(self._stored(piece) or (None, None)))
            answer = compute_reduced(*self._computed(piece), replace(order, here=True))
        if not answer.computed:
            own = self._stores[problem.kind]
            record = own.record(piece.number) if answer.result is None else None
            return answer if record is None else replace(answer, result=record[1])
        for kind, (checksum, content) in answer.files.items():
            is_requested = kind == problem.kind
            chunk = answer.chunk if is_requested else answer.companions[kind]
            about = _about(chunk, checksum, seconds if is_requested else 0.0) | (
                {"asked": self._function_key} if is_requested else {}
            )
            about |= {"inputs": _digest(piece.values)} | ({"lost": True} if lost else {})
            self._stores[kind].keep(piece.number, content, about, answer.result or {} if is_requested else {})
        if not self._stores:
            self._known_chunks.store_companions(piece.values, answer.companions)
        return replace(answer, companions={}, files={})


def _about(chunk: Chunk, checksum: int, seconds: float) -> dict[str, Any]:
    failed = [[k, int(chunk.status[k]), chunk.messages[k]] for k in np.flatnonzero(chunk.status).tolist()]
    return {"checksum": checksum, "seconds": seconds, "counters": chunk.counters, "failed": failed}


def _chunk(record: Record, count: int) -> Chunk:
    """Return a chunk of a record, without its response."""
    about = record[0]
    status, messages = np.zeros(count, dtype=np.int64), [""] * count
    for k, number, message in about["failed"]:
        status[k], messages[k] = number, message
    return Chunk(np.zeros((count, 0, 0)), status, tuple(messages), about["counters"], seconds=about["seconds"])


def _digest(values: Array) -> str:
    return hashlib.sha256(values.tobytes()).hexdigest()[:32]
