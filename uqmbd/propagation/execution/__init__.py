"""How realisations are computed: chunks, tasks, workers, checkpoints, progress."""

from __future__ import annotations

from uqmbd.propagation.execution.chunks import (
    Chunk,
    Kind,
    chunk_size,
    compute_chunk,
    integrated_by,
    lost_chunk,
    needs_motion,
    not_finite_output,
)
from uqmbd.propagation.execution.cost import Clock, Spending
from uqmbd.propagation.execution.histories import History, event_histories
from uqmbd.propagation.execution.in_order import in_order
from uqmbd.propagation.execution.kept import FOLDER, Checkpoint, Kept, Known, fingerprint
from uqmbd.propagation.execution.ledger import LIMIT, BudgetSpent, Ledger
from uqmbd.propagation.execution.realisations import (
    AGAIN,
    Margins,
    Observed,
    Realisations,
    evenly,
    late_outputs,
    log_realisations,
)
from uqmbd.propagation.execution.resumed import study_digest, tell_resumed
from uqmbd.propagation.execution.run_folder import claimed, output_folder, set_aside, writable
from uqmbd.propagation.execution.tasks import Arrays, run_tasks
from uqmbd.propagation.execution.transport import Packed, machine_attribute, solver_counters
from uqmbd.propagation.execution.workers import Crew, Staff, executor_for, pool, threads_of

__all__ = [
    "AGAIN",
    "Arrays",
    "BudgetSpent",
    "Checkpoint",
    "Chunk",
    "Clock",
    "Crew",
    "FOLDER",
    "History",
    "Kept",
    "Kind",
    "Known",
    "LIMIT",
    "Ledger",
    "Margins",
    "Observed",
    "Packed",
    "Realisations",
    "Spending",
    "Staff",
    "chunk_size",
    "claimed",
    "output_folder",
    "compute_chunk",
    "event_histories",
    "evenly",
    "executor_for",
    "fingerprint",
    "in_order",
    "late_outputs",
    "log_realisations",
    "machine_attribute",
    "needs_motion",
    "integrated_by",
    "lost_chunk",
    "not_finite_output",
    "pool",
    "run_tasks",
    "set_aside",
    "solver_counters",
    "threads_of",
    "study_digest",
    "tell_resumed",
    "writable",
]
