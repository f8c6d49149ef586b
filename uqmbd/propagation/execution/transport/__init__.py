"""Transport of calls to workers of any executor, and of return values."""

from __future__ import annotations

from uqmbd.propagation.execution.transport.calls import Reply, records_before
from uqmbd.propagation.execution.transport.identity import Worker, machine_type, versions
from uqmbd.propagation.execution.transport.log_records import forward
from uqmbd.propagation.execution.transport.packed import Packed
from uqmbd.propagation.execution.transport.processes import Processes, WorkerDied
from uqmbd.propagation.execution.transport.routes import Route, death, route_to
from uqmbd.propagation.execution.transport.worker_registry import WorkerRegistry

__all__ = [
    "Reply",
    "Packed",
    "Processes",
    "Route",
    "WorkerRegistry",
    "Worker",
    "WorkerDied",
    "death",
    "forward",
    "machine_type",
    "route_to",
    "records_before",
    "versions",
]
