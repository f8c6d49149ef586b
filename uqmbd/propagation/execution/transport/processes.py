"""Processes of our own, each of which may die: what it was doing is known, and the others go on.

A `concurrent.futures.ProcessPoolExecutor` of several processes breaks as a whole when one of them dies, and does not
say what it was doing.  Here each process is the only one of its pool, and is given one call at a time.

`pebble.ProcessPool` also confines a death to its own call, and cancelling ends a running process.  It takes the place
of this module only (200 lines): Dask, MPI and executors of users need all that is next to it.  It does not choose, or
tell, the process that takes a call, so that an object as large as a model would be sent with calls that do not need it.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from uqmbd.errors import StudyError
from uqmbd.propagation.execution.transport.calls import Answer
from uqmbd.propagation.execution.transport.packed import KEPT, Packed

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

__all__ = ["Processes", "WorkerDied"]

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

Hire = Callable[[], "tuple[ProcessPoolExecutor, Any]"]
"""Makes a pool of one process, and a shared integer that becomes the number of that process when it has started."""


class WorkerDied(BrokenExecutor):
    """The process that did a piece of work has ended; there are others."""


class Processes(Executor):
    """Executor of at most `count` processes that start when there is work, and are replaced when they die.

    The future of the call that a process was running when it died raises `WorkerDied`. Cancelling a running future ends
    its process, which is replaced. Packed arguments are sent to each process once. `hire` makes a pool of one process,
    and a shared integer that becomes the number of that process when it has started.
    """

    def __init__(self, count: int, hire: Hire) -> None:
        self._count, self._hire = count, hire
        self._lock = threading.RLock()
        self._desks: list[_Desk] = []
        self._waiting: deque[_Order] = deque()
        self._closed = False
        self._idle = threading.Condition(self._lock)
        self.started = False
        """Whether any of them has ever started."""

    def submit(
        self, fn: Callable[Arguments, Result], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Result]:
        """Give work to the next process that has none."""
        with self._lock:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            order = _Order(fn, args, kwargs)
            order.end = partial(self._end, order)
            self._waiting.append(order)
        self._give()
        return order

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all; what has begun is finished, and so is what waits unless it is cancelled."""
        with self._lock:
            self._closed = True
            waiting = list(self._waiting) if cancel_futures else []
        for order in waiting:
            order.cancel()
        if not wait:
            threading.Thread(target=self._close, name="uqmbd: end of processes", daemon=True).start()
            return
        self._close()

    def _close(self) -> None:
        with self._idle:
            self._idle.wait_for(lambda: not self._waiting and not any(desk.order for desk in self._desks))
            desks, self._desks = self._desks, []
        if desks:
            with ThreadPoolExecutor(len(desks), "uqmbd: end of processes") as threads:
                list(threads.map(lambda desk: desk.pool.shutdown(wait=True), desks))

    def _give(self) -> None:
        """Give what waits to those who have nothing to do."""
        while True:
            with self._lock:
                desk = self._free()
                if desk is None or not self._waiting:
                    self._idle.notify_all()
                    return
                order = self._waiting.popleft()
                if not order.set_running_or_notify_cancel():
                    continue
                desk.order = order
                arguments = tuple(desk.packed(argument) for argument in order.arguments)
            try:
                inner = desk.pool.submit(order.function, *arguments, **order.named)
            except BrokenProcessPool as error:
                self._done(desk, order, error, None)
                continue
            inner.add_done_callback(partial(self._heard, desk, order))

    def _free(self) -> _Desk | None:
        for desk in self._desks:
            if desk.order is None:
                return desk
        if len(self._desks) < self._count and self._waiting:
            self._desks.append(_Desk(*self._hire()))
            return self._desks[-1]
        return None

    def _heard(self, desk: _Desk, order: _Order, inner: Future[Any]) -> None:
        error = inner.exception()
        self._done(desk, order, error, None if error else inner.result())
        self._give()

    def _done(self, desk: _Desk, order: _Order, error: BaseException | None, result: Any) -> None:
        """Pass on what became of work; whoever died is replaced when there is more."""
        began = desk.process() > 0
        with self._lock:
            self.started |= began
            desk.order = None
            if isinstance(result, Answer) and result.kind == "missing":
                desk.forget()
            if isinstance(error, BrokenProcessPool):
                self._desks = [other for other in self._desks if other is not desk]
            self._idle.notify_all()
        if isinstance(error, BrokenProcessPool):
            desk.pool.shutdown(wait=False)
            if self.started:
                error = WorkerDied("a worker process ended unexpectedly; perhaps it ran out of memory or was killed")
            else:
                error = StudyError(
                    "The worker processes cannot start: what they say is above. With workers=1 this process does the "
                    "work."
                )
        if error is not None:
            order.set_exception(error)
        else:
            order.set_result(result)

    def _end(self, order: _Order) -> None:
        """End the process that does some work."""
        with self._lock:
            for desk in self._desks:
                if desk.order is order:
                    desk.kill()


class _Order(Future[Any]):
    """Work, whose result is to come."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> None:
        super().__init__()
        self.function, self.arguments, self.named = function, arguments, named
        self.end: Callable[[], None] = lambda: None

    def cancel(self) -> bool:
        """Cancel it; where it has begun, end the process that does it."""
        if super().cancel():
            return True
        if not self.done():
            self.end()
        return False


class _Desk:
    """One process, and what it does."""

    def __init__(self, pool: ProcessPoolExecutor, started: Any) -> None:
        self.pool, self._started = pool, started
        self.order: _Order | None = None
        self._has: deque[str] = deque(maxlen=KEPT)

    def packed(self, argument: Any) -> Any:
        """Return what is sent for an argument: of an object that it has, the hash."""
        if not isinstance(argument, Packed):
            return argument
        if argument.digest in self._has:
            self._has.remove(argument.digest)
            self._has.append(argument.digest)
            return argument.ticket
        self._has.append(argument.digest)
        return argument

    def forget(self) -> None:
        """Send everything again."""
        self._has.clear()

    def process(self) -> int:
        """Return the number of the process, 0 before it has started."""
        return int(self._started.value)

    def kill(self) -> None:
        """End the process, whatever it does."""
        if process := self.process():
            with suppress(OSError):
                os.kill(process, getattr(signal, "SIGKILL", signal.SIGTERM))
