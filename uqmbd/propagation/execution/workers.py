"""Executors: this process, its threads or child processes, or an executor of the user.

Threads start at once, share compiled code and return results without a copy. However, only one thread at a time can run
Python. Threads therefore run compiled code, and processes run tasks that require Python.
"""

from __future__ import annotations

import operator
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import IntegrationError, StudyError
from uqmbd.propagation.execution.main_script import Script, adopt, find_main_script, refuse_workers_of_workers, spawning
from uqmbd.propagation.execution.parent import end_with_parent
from uqmbd.propagation.execution.transport import Processes

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

__all__ = ["WorkerPool", "executor_for", "explained", "opened", "pool", "threads_of"]

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class WorkerPool(Executor):
    """Executor of `count` threads and `count` processes; each kind starts at its first task.

    The method `submit` uses processes; the function `executor_for` chooses between threads and processes.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._threads: ThreadPoolExecutor | None = None
        self._processes: Processes | None = None

    @property
    def started(self) -> bool:
        """Return whether any of the processes has started."""
        return self._processes is not None and self._processes.started

    @property
    def threads(self) -> Executor:
        """Return the executor of threads."""
        if self._threads is None:
            self._threads = ThreadPoolExecutor(self._count, "uqmbd")
        return self._threads

    @property
    def processes(self) -> Executor:
        """Return the executor of processes."""
        if self._processes is None:
            self._processes = Processes(self._count, _start_process)
        return self._processes

    def submit(
        self, fn: Callable[Arguments, Result], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Result]:
        """Submit a call to a process."""
        return self.processes.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all threads and processes after their running tasks."""
        for executor in (self._threads, self._processes):
            if executor is not None:
                executor.shutdown(wait=wait, cancel_futures=cancel_futures)
        self._threads = self._processes = None


def executor_for(given: Executor | None, *, unlocked: bool) -> Executor | None:
    """Return threads of a `WorkerPool` if `unlocked`, otherwise its processes; return any other executor unchanged.

    Unlocked calls release the interpreter lock during the computation.
    """
    if not isinstance(given, WorkerPool):
        return given
    return given.threads if unlocked else given.processes


def threads_of(given: Executor | None) -> Executor | None:
    """Return the threads of a `WorkerPool`, which share the memory of this process; None for other executors."""
    return given.threads if isinstance(given, WorkerPool) else None


@contextmanager
def opened(workers: int | Executor) -> Iterator[Executor | None]:
    """Yield the executor for consecutive tasks: None (this process), a `WorkerPool`, or the given executor.

    The context ends the threads and processes of a `WorkerPool`; a given executor stays open. Raise StudyError if
    `workers` is neither a number of workers nor an executor.
    """
    if isinstance(workers, Executor):
        yield workers
        return
    count = _count(workers)
    if count == 1:
        yield None
        return
    refuse_workers_of_workers()
    made = WorkerPool(count)
    try:
        yield made
    finally:
        made.shutdown(wait=True, cancel_futures=True)


@contextmanager
def explained(executor: Executor | None) -> Iterator[None]:
    """Raise IntegrationError with advice if a process dies or the executor of a user fails."""
    try:
        yield
    except Exception as error:
        if executor is None or not _has_ended(executor, error):
            raise
        if isinstance(executor, WorkerPool):
            raise IntegrationError(
                "A worker process ended unexpectedly; it may have run out of memory or been killed. Try fewer "
                "workers, or run with workers=1 to see the error and its place."
            ) from error
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        raise IntegrationError(
            f"The executor has ended ({reason}); its scheduler or its workers may have stopped. If the "
            "run has a folder, it contains the finished results. Restart the workers, and continue "
            "with --resume (in Python: resume=True)."
        ) from error


def _has_ended(executor: Executor, error: Exception) -> bool:
    """Return whether an error, from Python or from the executor's package, reports that an executor has ended."""
    if isinstance(error, BrokenExecutor):
        return True
    package = type(executor).__module__.partition(".")[0]
    own = type(error).__module__.partition(".")[0] == package and package not in ("uqmbd", "builtins", "__main__")
    return own or (isinstance(error, CancelledError) and not isinstance(executor, WorkerPool))


@contextmanager
@typechecked
def pool(workers: int | Executor) -> Iterator[Executor | None]:
    """Yield the executor of one run: the argument `executor` of `Study.problem`.

    Parameters
    ----------
    workers : int or concurrent.futures.Executor
        Number of workers (threads or processes), which end with the context; or an executor, which stays open.

    Yields
    ------
    concurrent.futures.Executor or None
        Executor of the run; None if the calling process computes everything.

    Raises
    ------
    uqmbd.StudyError
        If `workers` is neither a number nor an executor, or the processes cannot start.
    uqmbd.IntegrationError
        If a process ends unexpectedly, or the executor fails.

    Examples
    --------
    >>> with pool(1) as executor:
    ...     print(executor)
    None
    """
    with opened(workers) as executor, explained(executor):
        yield executor


def _start_process() -> tuple[ProcessPoolExecutor, Any]:
    """Start a pool of one process; return the pool and a shared integer, the process number after the start."""
    from concurrent.futures import ProcessPoolExecutor

    # OpenMP runtimes do not survive a fork; on small blocks several threads are slower than one
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    context = spawning()
    started = context.Value("q", 0)
    start = (started, find_main_script())
    return ProcessPoolExecutor(1, mp_context=context, initializer=_start, initargs=start), started


MOST_WORKERS = 10_000
"""Maximum number of processes: no computer starts more."""


def _count(workers: object) -> int:
    try:
        count = operator.index(workers)  # type: ignore[arg-type]  # this line tests the type of `workers`
    except TypeError:
        count = 0
    if not 1 <= count <= MOST_WORKERS or isinstance(workers, bool):
        most = f"; at most {MOST_WORKERS} processes" if count > MOST_WORKERS else ""
        raise StudyError(
            f"workers is {shown(workers)}; expected a number of workers, 1 or more, or a "
            f"concurrent.futures.Executor{most}."
        )
    return count


def _start(started: Any, script: Script | None) -> None:
    """Initialise a worker; the worker ignores Ctrl-C, because the parent process ends its workers in an orderly way."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    adopt(script)
    started.value = os.getpid()
