"""Who computes: this process, threads or processes of our own, or whoever the user brings.

Threads start at once, share compiled code and return results without a copy. However, only one of them at a time can
run Python: they do what is computed outside of it, and processes the rest.
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
    """Executor of `count` threads and `count` processes, of which each kind starts when there is work for it.

    As an executor it submits to processes; `executor_for` chooses.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._threads: ThreadPoolExecutor | None = None
        self._processes: Processes | None = None

    @property
    def started(self) -> bool:
        """Whether any of the processes has started."""
        return self._processes is not None and self._processes.started

    @property
    def threads(self) -> Executor:
        """Threads of this process."""
        if self._threads is None:
            self._threads = ThreadPoolExecutor(self._count, "uqmbd")
        return self._threads

    @property
    def processes(self) -> Executor:
        """Separate processes."""
        if self._processes is None:
            self._processes = Processes(self._count, _start_process)
        return self._processes

    def submit(
        self, fn: Callable[Arguments, Result], /, *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Result]:
        """Give work to a process."""
        return self.processes.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all; what has begun is finished."""
        for executor in (self._threads, self._processes):
            if executor is not None:
                executor.shutdown(wait=wait, cancel_futures=cancel_futures)
        self._threads = self._processes = None


def executor_for(given: Executor | None, *, unlocked: bool) -> Executor | None:
    """Return the executor for a call: threads of a `WorkerPool` if `unlocked`, else its processes; or the given one.

    Unlocked calls compute without the interpreter lock.
    """
    if not isinstance(given, WorkerPool):
        return given
    return given.threads if unlocked else given.processes


def threads_of(given: Executor | None) -> Executor | None:
    """Return the threads of a `WorkerPool`, which share the memory of this process; None for other executors."""
    return given.threads if isinstance(given, WorkerPool) else None


@contextmanager
def opened(workers: int | Executor) -> Iterator[Executor | None]:
    """Yield the executor for consecutive pieces of work: None (this process), a `WorkerPool`, or the given one.

    The context ends the threads and processes of a `WorkerPool`; a given executor stays open. Raise StudyError for
    anything else than a number of workers or an executor.
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
    """Raise IntegrationError, with what to try, if a process dies or the executor of a user gives up."""
    try:
        yield
    except Exception as error:
        if executor is None or not _has_ended(executor, error):
            raise
        if isinstance(executor, WorkerPool):
            raise IntegrationError(
                "A worker process ended unexpectedly; perhaps it ran out of memory or was killed. "
                "Try fewer workers; with workers=1 an error shows where it happens."
            ) from error
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        raise IntegrationError(
            f"The executor has ended ({reason}); perhaps its scheduler or its workers have stopped. Finished results "
            "are kept if the run has a folder: start the workers again, and go on with --resume (in "
            "Python: resume=True)."
        ) from error


def _has_ended(executor: Executor, error: Exception) -> bool:
    """Whether an error says that an executor has ended: those of Python's executors, and of the executor's package."""
    if isinstance(error, BrokenExecutor):
        return True
    package = type(executor).__module__.partition(".")[0]
    own = type(error).__module__.partition(".")[0] == package and package not in ("uqmbd", "builtins", "__main__")
    return own or (isinstance(error, CancelledError) and not isinstance(executor, WorkerPool))


@contextmanager
@typechecked
def pool(workers: int | Executor) -> Iterator[Executor | None]:
    """Yield who does one piece of work: what `Study.problem` takes as its executor.

    Parameters
    ----------
    workers : int or concurrent.futures.Executor
        Number of workers, threads or processes, which end with the context; or an executor, which is left open.

    Yields
    ------
    concurrent.futures.Executor or None
        None where this process does the work alone.

    Raises
    ------
    uqmbd.StudyError
        If `workers` is neither, or the processes cannot start.
    uqmbd.IntegrationError
        If a process dies, or the executor gives up.

    Examples
    --------
    >>> with pool(1) as executor:
    ...     print(executor)
    None
    """
    with opened(workers) as executor, explained(executor):
        yield executor


def _start_process() -> tuple[ProcessPoolExecutor, Any]:
    """Make a pool of one process, and a shared integer: its number, when it has started."""
    from concurrent.futures import ProcessPoolExecutor

    # OpenMP runtimes do not survive a fork; threads on small blocks cost more than they give
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    context = spawning()
    started = context.Value("q", 0)
    start = (started, find_main_script())
    return ProcessPoolExecutor(1, mp_context=context, initializer=_start, initargs=start), started


MOST_WORKERS = 10_000
"""More processes no computer starts."""


def _count(workers: object) -> int:
    try:
        count = operator.index(workers)  # type: ignore[arg-type]  # that is the question
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
    """Begin the life of a worker: Ctrl-C is the parent's business, which ends its workers in order, or leaves them."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    adopt(script)
    started.value = os.getpid()
