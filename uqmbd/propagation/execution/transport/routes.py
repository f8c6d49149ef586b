"""Routes to the workers of an executor: how packed objects are sent, and how deaths are reported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import count
from typing import Any, Protocol
from uuid import uuid4
from weakref import WeakKeyDictionary

from uqmbd.propagation.execution.transport.calls import CallTerms, Reply, answer, terms
from uqmbd.propagation.execution.transport.identity import Worker
from uqmbd.propagation.execution.transport.packed import Packed
from uqmbd.propagation.execution.transport.processes import Processes

__all__ = ["Route", "death", "route_to"]


class Route(Protocol):
    """Route to the workers of an executor."""

    @property
    def identifies_lost_task(self) -> bool:
        """Return whether a death is reported only for the task that the worker was running."""

    @property
    def apart(self) -> bool:
        """Return whether one worker may be slow, or stop, while others continue."""

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        """Send a call, with packed arguments entirely (`whole`) or in the usual form.

        `late` contains overdue futures of the same call. The workers of these futures may have stopped; workers that
        store packed objects may have stopped, too. The call is therefore sent to other workers, and requires no stored
        object.
        """

    def renew(self) -> None:
        """Assume that no worker stores packed objects, because the worker that stored them may have died."""

    def refused(self, worker: Worker) -> None:
        """Send the tasks that `worker` refused to other workers, if the executor allows the choice of workers."""


@dataclass(frozen=True)
class _DirectRoute:
    """Route to threads or `Processes`, with unchanged arguments; `Processes` itself replaces packed arguments."""

    executor: Executor
    apart: bool
    identifies_lost_task: bool = True
    call_terms: CallTerms = field(default_factory=terms)

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        return self.executor.submit(answer, self.call_terms, function, *arguments)

    def renew(self) -> None:
        pass

    def refused(self, worker: Worker) -> None:
        pass


@dataclass(frozen=True)
class _HashRoute:
    """Route to any other executor: calls contain the hash, and workers that lack the object receive its bytes."""

    executor: Executor
    identifies_lost_task: bool = False
    apart: bool = True
    call_terms: CallTerms = field(default_factory=terms)

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        sent = [_shown(x) if isinstance(x, Packed) and not whole else x for x in arguments]
        return self.executor.submit(answer, self.call_terms, function, *sent)

    def renew(self) -> None:
        pass

    def refused(self, worker: Worker) -> None:
        pass


def _shown(packed: Packed) -> Packed:
    """Return the hash, and store the object in this process for workers that are threads of this process."""
    packed.value()
    return packed.ticket


@dataclass(frozen=True)
class _DaskRoute:
    """Route to the workers of a Dask cluster, which send packed objects to each other on request.

    Packed objects are results of tasks instead of scattered data: the scheduler then recomputes lost objects.
    """

    executor: Executor
    client: Any
    held: dict[str, Any] = field(default_factory=dict)
    generation: Any = field(default_factory=count)
    avoided: set[str] = field(default_factory=set)
    keys: WeakKeyDictionary[Future[Any], str] = field(default_factory=WeakKeyDictionary)
    """Names of running tasks in Dask."""
    identifies_lost_task: bool = False
    apart: bool = True
    call_terms: CallTerms = field(default_factory=terms)

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        if late:
            self.renew()
            sent = list(arguments)
        else:
            sent = [(self._held(x) if whole else x.ticket) if isinstance(x, Packed) else x for x in arguments]
        key = f"uqmbd-{uuid4()}"  # a repeated call is another task
        more: Any = {"key": key, "pure": False}
        away = self.avoided | self._doing({self.keys[future] for future in late if future in self.keys})
        if away and (others := sorted(self.client.nthreads().keys() - away)):
            # if all these workers leave, any new worker may run the task
            more |= {"workers": others, "allow_other_workers": True}
        future = self.executor.submit(answer, self.call_terms, function, *sent, **more)
        self.keys[future] = key
        return future

    def _doing(self, keys: set[str]) -> set[str]:
        """Return the addresses of the workers that process at least one of the tasks."""
        if not keys:
            return set()
        return {where for where, tasks in self.client.processing().items() if not keys.isdisjoint(tasks)}

    def renew(self) -> None:
        self.held.clear()

    def refused(self, worker: Worker) -> None:
        # a refusing worker is free, so the scheduler would choose it repeatedly
        self.avoided.add(worker.address)

    def _held(self, packed: Packed) -> Any:
        if packed.digest not in self.held:
            key = f"uqmbd-packed-{packed.digest}-{next(self.generation)}"
            self.held[packed.digest] = self.client.submit(_same, packed, key=key)
        return self.held[packed.digest]


def _same(packed: Packed) -> Packed:
    return packed


def route_to(executor: Executor) -> Route:
    """Return the route to the workers of an executor."""
    if isinstance(executor, (ThreadPoolExecutor, Processes)):
        return _DirectRoute(executor, apart=isinstance(executor, Processes))
    client = getattr(executor, "_client", None)
    if type(executor).__module__.partition(".")[0] == "distributed" and client is not None:
        return _DaskRoute(executor, client)
    return _HashRoute(executor)


def death(error: BaseException) -> str:
    """Return the reason in an error that reports the death of a worker; empty for other errors.

    >>> death(BrokenExecutor("a process has ended")), death(ValueError("no"))
    ('a process has ended', '')
    """
    if type(error).__module__.startswith("distributed.") and type(error).__name__ == "KilledWorker":
        return "Dask lost the workers that ran this task; their logs may state the reason"
    return str(error) or type(error).__name__ if isinstance(error, BrokenExecutor) else ""
