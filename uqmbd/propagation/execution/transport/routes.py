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
    def names_the_dead(self) -> bool:
        """Whether a death is reported for the piece that the worker was running only; else for other pieces, too."""

    @property
    def apart(self) -> bool:
        """Whether one worker may be slow, or stop, while others continue."""

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        """Send a call, with packed arguments entirely (`whole`) or in the usual form.

        `late`: futures of the same call that are overdue. Their workers may have stopped, and so may workers that
        store packed objects: the call goes to other workers, and does not depend on any.
        """

    def renew(self) -> None:
        """Assume that no worker stores packed objects: the worker that had them may have died."""

    def refused(self, worker: Worker) -> None:
        """Send pieces that this worker refused to others, if the executor allows that choice."""


@dataclass(frozen=True)
class _DirectRoute:
    """Threads, and `Processes`, which pack arguments themselves: arguments pass unchanged."""

    executor: Executor
    apart: bool
    names_the_dead: bool = True
    asked: CallTerms = field(default_factory=terms)

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        return self.executor.submit(answer, self.asked, function, *arguments)

    def renew(self) -> None:
        pass

    def refused(self, worker: Worker) -> None:
        pass


@dataclass(frozen=True)
class _HashRoute:
    """Any other executor: the hash is sent, and the bytes go to workers that request them."""

    executor: Executor
    names_the_dead: bool = False
    apart: bool = True
    asked: CallTerms = field(default_factory=terms)

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        sent = [_shown(x) if isinstance(x, Packed) and not whole else x for x in arguments]
        return self.executor.submit(answer, self.asked, function, *sent)

    def renew(self) -> None:
        pass

    def refused(self, worker: Worker) -> None:
        pass


def _shown(packed: Packed) -> Packed:
    """Return the hash, and store the object here: workers that run in this process then find it."""
    packed.value()
    return packed.ticket


@dataclass(frozen=True)
class _DaskRoute:
    """Workers of a Dask cluster, which send packed objects to each other on request.

    Packed objects are results of tasks, not scattered: the scheduler recomputes those that are lost with a worker.
    """

    executor: Executor
    client: Any
    held: dict[str, Any] = field(default_factory=dict)
    generation: Any = field(default_factory=count)
    avoided: set[str] = field(default_factory=set)
    keys: WeakKeyDictionary[Future[Any], str] = field(default_factory=WeakKeyDictionary)
    """Dask's names of running tasks."""
    names_the_dead: bool = False
    apart: bool = True
    asked: CallTerms = field(default_factory=terms)

    def send(
        self, function: Callable[..., Any], arguments: tuple[Any, ...], *, whole: bool, late: Sequence[Future[Any]] = ()
    ) -> Future[Reply]:
        if late:
            self.renew()
            sent = list(arguments)
        else:
            sent = [(self._held(x) if whole else x.ticket) if isinstance(x, Packed) else x for x in arguments]
        key = f"uqmbd-{uuid4()}"  # the same call once more is another task
        more: Any = {"key": key, "pure": False}
        away = self.avoided | self._doing({self.keys[future] for future in late if future in self.keys})
        if away and (others := sorted(self.client.nthreads().keys() - away)):
            # if all these workers leave, any new worker may run it
            more |= {"workers": others, "allow_other_workers": True}
        future = self.executor.submit(answer, self.asked, function, *sent, **more)
        self.keys[future] = key
        return future

    def _doing(self, keys: set[str]) -> set[str]:
        """Return the addresses of the workers that have some tasks."""
        if not keys:
            return set()
        return {where for where, tasks in self.client.processing().items() if not keys.isdisjoint(tasks)}

    def renew(self) -> None:
        self.held.clear()

    def refused(self, worker: Worker) -> None:
        # a worker that refuses is free, so that the scheduler would choose it again and again
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
        return "Dask has seen its workers die while they ran it; their logs may say why"
    return str(error) or type(error).__name__ if isinstance(error, BrokenExecutor) else ""
