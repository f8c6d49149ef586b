"""Who computes: this process, processes of our own, or whoever the user brings."""

from __future__ import annotations

import inspect
import operator
import os
import signal
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from typing import Any

from uqmbd.errors import IntegrationError, StudyError

__all__ = ["pool"]


@contextmanager
def pool(workers: int | Executor) -> Iterator[Executor | None]:
    """Yield who does the work: nobody (this process), a pool of processes, or the executor that was given.

    Parameters
    ----------
    workers : int or concurrent.futures.Executor
        Number of processes, or an executor, which is left open.

    Raises
    ------
    uqmbd.StudyError
        If it is neither, or if the processes cannot start because the script starts them while it is imported.
    uqmbd.IntegrationError
        If a process dies.

    Examples
    --------
    >>> with pool(1) as executor:
    ...     print(executor)
    None
    """
    if isinstance(workers, Executor):
        yield workers
        return
    count = _count(workers)
    if count == 1:
        yield None
        return
    if _imported_by_worker():
        # A worker imports the script and meets the call that made it: it ends, and the parent tells the user.
        raise SystemExit(1)
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    # OpenMP runtimes do not survive a fork; threads on small blocks cost more than they give
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    context = multiprocessing.get_context("spawn")
    started = context.Event()
    executor = ProcessPoolExecutor(count, mp_context=context, initializer=_start, initargs=(started,))
    try:
        yield executor
    except BrokenExecutor as error:
        if started.is_set():
            raise IntegrationError(
                "A worker process ended unexpectedly; perhaps it ran out of memory or was killed. "
                "Try fewer workers; with workers=1 an error shows where it happens."
            ) from error
        raise StudyError(
            "The worker processes cannot start. Each of them imports the script first, so a script must start a study "
            "with workers only when it is run itself:\n"
            '    if __name__ == "__main__":\n'
            "        study.run(workers=2)\n"
            "or leave that call out and use `uqmbd run SCRIPT --workers 2`."
        ) from None
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _count(workers: object) -> int:
    try:
        count = operator.index(workers)  # type: ignore[arg-type]  # that is the question
    except TypeError:
        count = 0
    if count < 1 or isinstance(workers, bool):
        raise StudyError(
            f"workers is {workers!r}; expected a number of processes, 1 or more, or a concurrent.futures.Executor."
        )
    return count


def _start(started: Any) -> None:
    """Begin the life of a worker: Ctrl-C is the parent's business, which ends its workers in order."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    started.set()


def _imported_by_worker() -> bool:
    """Whether this runs while a worker process imports the script, which it does under the name ``__mp_main__``."""
    frame = inspect.currentframe()
    while frame is not None:
        if frame.f_code.co_name == "<module>" and frame.f_globals.get("__name__") == "__mp_main__":
            return True
        frame = frame.f_back
    return False
