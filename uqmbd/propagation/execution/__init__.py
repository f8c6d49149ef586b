"""Execution of realisations: chunks, tasks, workers, checkpoints, progress."""

from __future__ import annotations

from uqmbd.propagation.execution.checkpoints import FOLDER, Checkpoint, ChunkStore, StoredChunks, fingerprint
from uqmbd.propagation.execution.chunks import (
    Chunk,
    Kind,
    chunk_size_of,
    compute_chunk,
    integrated_by,
    lost_chunk,
    needs_motion,
    not_finite_output,
)
from uqmbd.propagation.execution.cost import CostClock, Spending, machine_attribute, solver_counters
from uqmbd.propagation.execution.histories import History, event_histories
from uqmbd.propagation.execution.in_order import run_in_order
from uqmbd.propagation.execution.ledger import LIMIT, BudgetSpent, Ledger
from uqmbd.propagation.execution.realisations import (
    AGAIN,
    Margins,
    Observed,
    Realisations,
    late_outputs,
    log_realisations,
    offered,
)
from uqmbd.propagation.execution.resumed import study_digest, warn_of_changes
from uqmbd.propagation.execution.run_folder import claimed, output_folder, set_aside, writable
from uqmbd.propagation.execution.tasks import Arrays, run_tasks
from uqmbd.propagation.execution.transport import Packed
from uqmbd.propagation.execution.workers import WorkerPool, executor_for, explained, opened, pool, threads_of

__all__ = [
    "AGAIN",
    "FOLDER",
    "LIMIT",
    "Arrays",
    "BudgetSpent",
    "Checkpoint",
    "Chunk",
    "CostClock",
    "History",
    "ChunkStore",
    "Kind",
    "StoredChunks",
    "Ledger",
    "Margins",
    "Observed",
    "Packed",
    "Realisations",
    "Spending",
    "WorkerPool",
    "chunk_size_of",
    "claimed",
    "compute_chunk",
    "event_histories",
    "executor_for",
    "fingerprint",
    "run_in_order",
    "integrated_by",
    "late_outputs",
    "log_realisations",
    "lost_chunk",
    "machine_attribute",
    "needs_motion",
    "not_finite_output",
    "offered",
    "output_folder",
    "explained",
    "opened",
    "pool",
    "run_tasks",
    "set_aside",
    "solver_counters",
    "study_digest",
    "warn_of_changes",
    "threads_of",
    "writable",
]
