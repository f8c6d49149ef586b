"""Computation, storage and recording of the realisations of a problem."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from uqmbd.progress import Progress, Silent
from uqmbd.propagation.execution import (
    Arrays,
    Checkpoint,
    Chunk,
    ChunkStore,
    CostClock,
    Ledger,
    Observed,
    Realisations,
    Spending,
    StoredChunks,
    compute_chunk,
    executor_for,
    log_realisations,
    lost_chunk,
    run_in_order,
    run_tasks,
    threads_of,
)
from uqmbd.propagation.problem_data import ProblemData
from uqmbd.typing import Array

__all__ = ["Runner"]


@dataclass(frozen=True)
class Runner:
    """Executor, checkpoint, ledger, clock and cache of a problem: what computes it, and what is recorded."""

    executor: Executor | None = None
    """Computes chunks and tasks; None: this process."""
    progress: Progress = field(default_factory=Silent)
    checkpoint: Checkpoint | None = None
    """Where finished chunks are stored."""
    ledger: Ledger | None = None
    """What a run with a budget may compute, and what it has computed for other sizes of the method."""
    clock: CostClock = field(default_factory=CostClock)
    """Called, it returns seconds; it counts what an interrupted run has spent on what need not be computed again."""
    spending: Spending = field(default_factory=Spending)
    """What the method spends, in parts."""
    observed: Observed = field(default_factory=Observed)
    """Realisations from which the error of the integration is measured."""
    known: StoredChunks = field(default_factory=dict)
    """Outputs without a time, and margins, that were computed with the others, by inputs: or where they are stored."""
    again: dict[str, StoredChunks] = field(default_factory=dict)
    """The same, of realisations that are integrated once more, by purpose."""

    @property
    def folder(self) -> Path | None:
        """Folder of the run's files, if it has one."""
        return self.checkpoint.folder if self.checkpoint else None

    def of(self, label: str) -> Runner:
        """Return the runner of a part of the work: its chunks are stored under a label, and it observes its own."""
        checkpoint = self.checkpoint and replace(self.checkpoint, label=label)
        return replace(self, checkpoint=checkpoint, observed=Observed())

    def each(self, function: Callable[[Any], Any], pieces: Sequence[Any]) -> Iterator[Any]:
        """Apply a function to pieces in order, like `map`, in threads where the study has workers.

        For arithmetic of NumPy on large arrays, as statistics are; the results do not depend on the executor.
        """
        threads = threads_of(self.executor) if len(pieces) > 1 else None
        return map(function, pieces) if threads is None else threads.map(function, pieces)

    def stream(self, problem: ProblemData, values: Array) -> Iterator[Realisations]:
        """Compute the response to each row of inputs; see :meth:`uqmbd.extend.Problem.stream`."""
        self.progress.start(problem.label, len(values))
        begin = asked = self.clock()
        size = problem.chunk_of(len(values))
        parts = [np.ascontiguousarray(values[k : k + size]) for k in range(0, len(values), size)]
        store, model = self.chunk_store(problem), problem.model if self.executor is None else problem.packed
        about = (problem.rtol, problem.integrator, problem.kind)

        def task(part: Array) -> tuple[Callable[..., Chunk], tuple[Any, ...]]:
            return compute_chunk, (model, part, problem.whole_times, *about)

        def lost(part: Array, reason: str) -> Chunk:
            # it is not stored: a run that goes on tries it again
            chunk = lost_chunk(problem.model, len(part), problem.whole_times, reason, problem.kind)
            return store.note(part, chunk, lost=True)

        chunks = run_in_order(parts, self.workers(problem), store.find, task, store.keep, lost)
        for part, chunk in zip(parts, chunks, strict=True):
            now = self.clock()
            self.spending.realised(now - asked)
            found = Realisations.of(part, chunk, now - begin)
            if problem.chosen is not None:
                found = found.choosing(problem.model.scalars, problem.chosen)
            self.observed.add(found)
            log_realisations(problem.label, problem.kind, found)
            yield found
            begin, asked = now, self.clock()
            self.progress.advance(problem.label, len(chunk.status))
            if self.ledger is not None and part is not parts[-1]:
                self.ledger.begin()
        self.progress.finish(problem.label)

    def run(
        self, problem: ProblemData, function: Callable[..., Arrays], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[Arrays]:
        """Compute tasks that are no realisations; see :meth:`uqmbd.extend.Problem.run`."""
        work = (problem.label, problem.packed, problem.identity, self.executor, self.checkpoint, self.clock)
        asked = self.clock()
        for done, found in enumerate(run_tasks(*work, function, tasks), 1):
            self.spending.realised(self.clock() - asked)
            yield found
            asked = self.clock()
            if self.ledger is not None and done < len(tasks):
                self.ledger.begin()

    def workers(self, problem: ProblemData) -> Executor | None:
        """Return the executor for realisations: threads where they are computed without the interpreter."""
        return executor_for(self.executor, unlocked=problem.unlocked)

    def chunk_store(self, problem: ProblemData) -> ChunkStore:
        """Return the store of the computed chunks of a problem."""
        return ChunkStore(
            kind=problem.kind,
            partial=problem.chosen is not None,
            margins=not problem.answers_requirements,
            fingerprint=problem.identity,
            joins=problem.joins,
            known=self.known,
            checkpoint=self.checkpoint,
            ledger=self.ledger,
            clock=self.clock,
        )
