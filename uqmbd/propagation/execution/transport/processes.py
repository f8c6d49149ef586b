"""Worker processes that may die separately: the executor identifies the failed task, and other processes continue.

If one process of a `concurrent.futures.ProcessPoolExecutor` dies, the whole executor breaks, and it does not identify
the task. Here each pool has one process, which runs one call at a time.

With `pebble.ProcessPool`, the death of a process also affects only its own call, and a cancelled call ends its process.
`pebble` could replace only this module (200 lines), because Dask, MPI and executors of users need the neighbouring
modules. `pebble` neither chooses nor reports the process that runs a call. With `pebble`, the parent would therefore
send a large object, such as a model, with every call.
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
from uqmbd.propagation.execution.transport.calls import Reply
from uqmbd.propagation.execution.transport.packed import CAPACITY, Packed

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

__all__ = ["Processes", "WorkerDied"]

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

StartProcess = Callable[[], "tuple[ProcessPoolExecutor, Any]"]
"""Function that makes a pool of one process, and a shared integer: the process number after the start."""


class WorkerDied(BrokenExecutor):
    """Error if the process of a task has ended; other processes continue."""


class Processes(Executor):
    """Executor of at most `count` processes that start when tasks arrive, and are replaced when they die.

    If a process dies, the future of its running call raises `WorkerDied`. Cancelling a running future ends its process,
    and a new process replaces it. Packed arguments are sent to each process once. `start` makes a pool of one process,
    and a shared integer that becomes the number of that process when it has started.
    """

    def __init__(self, count: int, start: StartProcess) -> None:
        self._count, self._start = count, start
        self._lock = threading.RLock()
        self._workers: list[_PoolProcess] = []
        self._waiting: deque[_Task] = deque()
        self._closed = False
        self._changed = threading.Condition(self._lock)
        self.started = False
        """Whether any process has ever started."""

    def submit(
        self, fn: Callable[Arguments, Result], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Result]:
        """Submit a call to the next free process."""
        with self._lock:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            task = _Task(fn, args, kwargs)
            task.end = partial(self._end, task)
            self._waiting.append(task)
        self._dispatch()
        return task

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes after running and waiting tasks have finished; `cancel_futures` cancels waiting tasks."""
        with self._lock:
            self._closed = True
            waiting = list(self._waiting) if cancel_futures else []
        for task in waiting:
            task.cancel()
        if not wait:
            threading.Thread(target=self._close, name="uqmbd: end of processes", daemon=True).start()
            return
        self._close()

    def _close(self) -> None:
        with self._changed:
            self._changed.wait_for(lambda: not self._waiting and not any(worker.task for worker in self._workers))
            workers, self._workers = self._workers, []
        if workers:
            with ThreadPoolExecutor(len(workers), "uqmbd: end of processes") as threads:
                list(threads.map(lambda worker: worker.pool.shutdown(wait=True), workers))

    def _dispatch(self) -> None:
        """Send waiting tasks to free processes."""
        while True:
            with self._lock:
                worker = self._free_worker()
                if worker is None or not self._waiting:
                    self._changed.notify_all()
                    return
                task = self._waiting.popleft()
                if not task.set_running_or_notify_cancel():
                    continue
                worker.task = task
                arguments = tuple(worker.packed(argument) for argument in task.arguments)
            try:
                inner = worker.pool.submit(task.function, *arguments, **task.named)
            except BrokenProcessPool as error:
                self._finish(worker, task, error, None)
                continue
            inner.add_done_callback(partial(self._on_done, worker, task))

    def _free_worker(self) -> _PoolProcess | None:
        for worker in self._workers:
            if worker.task is None:
                return worker
        if len(self._workers) < self._count and self._waiting:
            self._workers.append(_PoolProcess(*self._start()))
            return self._workers[-1]
        return None

    def _on_done(self, worker: _PoolProcess, task: _Task, inner: Future[Any]) -> None:
        error = inner.exception()
        self._finish(worker, task, error, None if error else inner.result())
        self._dispatch()

    def _finish(self, worker: _PoolProcess, task: _Task, error: BaseException | None, result: Any) -> None:
        """Set the result or error of a task; the next task replaces a dead process."""
        began = worker.process() > 0
        with self._lock:
            self.started |= began
            worker.task = None
            if isinstance(result, Reply) and result.kind == "missing":
                worker.clear()
            if isinstance(error, BrokenProcessPool):
                self._workers = [other for other in self._workers if other is not worker]
            self._changed.notify_all()
        if isinstance(error, BrokenProcessPool):
            worker.pool.shutdown(wait=False)
            if self.started:
                error = WorkerDied("a worker process ended unexpectedly; it may have run out of memory or been killed")
            else:
                error = StudyError(
                    "The worker processes cannot start; the output above states the reason. Run with workers=1 to "
                    "compute in this process."
                )
        if error is not None:
            task.set_exception(error)
        else:
            task.set_result(result)

    def _end(self, task: _Task) -> None:
        """End the process that runs a task."""
        with self._lock:
            for worker in self._workers:
                if worker.task is task:
                    worker.kill()


class _Task(Future[Any]):
    """Task whose result is pending."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> None:
        super().__init__()
        self.function, self.arguments, self.named = function, arguments, named
        self.end: Callable[[], None] = lambda: None

    def cancel(self) -> bool:
        """Cancel the task; if it is running, end its process."""
        if super().cancel():
            return True
        if not self.done():
            self.end()
        return False


class _PoolProcess:
    """Process with its running task."""

    def __init__(self, pool: ProcessPoolExecutor, started: Any) -> None:
        self.pool, self._started = pool, started
        self.task: _Task | None = None
        self._has: deque[str] = deque(maxlen=CAPACITY)

    def packed(self, argument: Any) -> Any:
        """Return the wire form of an argument: the hash if the process already has the object."""
        if not isinstance(argument, Packed):
            return argument
        if argument.digest in self._has:
            self._has.remove(argument.digest)
            self._has.append(argument.digest)
            return argument.ticket
        self._has.append(argument.digest)
        return argument

    def clear(self) -> None:
        """Clear the list of sent objects, so that they are sent again."""
        self._has.clear()

    def process(self) -> int:
        """Return the number of the process, 0 before it has started."""
        return int(self._started.value)

    def kill(self) -> None:
        """Kill the process."""
        if process := self.process():
            with suppress(OSError):
                os.kill(process, getattr(signal, "SIGKILL", signal.SIGTERM))
