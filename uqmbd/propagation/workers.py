"""Who computes: this process, processes of our own, or whoever the user brings."""

from __future__ import annotations

import operator
import os
import signal
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

from uqmbd.errors import IntegrationError, StudyError
from uqmbd.propagation.mainscript import Script, adopt, main_script, refuse_workers_of_workers, spawning

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

__all__ = ["Crew", "pool"]


class Crew:
    """Who computes, for several pieces of work one after another: processes that died are replaced for the next one.

    A context: processes that it started end with it.

    Parameters
    ----------
    workers : int or concurrent.futures.Executor
        Number of processes, or an executor, which is left open.

    Raises
    ------
    uqmbd.StudyError
        If it is neither.

    Examples
    --------
    >>> with Crew(1) as crew, crew.at_work() as executor:
    ...     print(executor)
    None
    """

    def __init__(self, workers: int | Executor) -> None:
        self._given = workers if isinstance(workers, Executor) else None
        self._count = 1 if self._given is not None else _count(workers)
        if self._count > 1:
            refuse_workers_of_workers()
        self._processes: ProcessPoolExecutor | None = None
        self._started: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._dismiss()

    @contextmanager
    def at_work(self) -> Iterator[Executor | None]:
        """Yield who does the work: nobody (this process), a pool of processes, or the executor that was given.

        Raises
        ------
        uqmbd.StudyError
            If the processes cannot start.
        uqmbd.IntegrationError
            If a process dies.
        """
        if self._given is not None or self._count == 1:
            yield self._given
            return
        if self._processes is None:
            self._processes, self._started = _hired(self._count)
        try:
            yield self._processes
        except BrokenExecutor as error:
            started = self._started.is_set()
            self._dismiss()
            if started:
                raise IntegrationError(
                    "A worker process ended unexpectedly; perhaps it ran out of memory or was killed. "
                    "Try fewer workers; with workers=1 an error shows where it happens."
                ) from error
            raise StudyError(
                "The worker processes cannot start: what they say is above. With workers=1 this process does the work."
            ) from error

    def _dismiss(self) -> None:
        if self._processes is not None:
            self._processes.shutdown(wait=True, cancel_futures=True)
            self._processes = None


@contextmanager
def pool(workers: int | Executor) -> Iterator[Executor | None]:
    """Yield who does one piece of work; see `Crew`."""
    with Crew(workers) as crew, crew.at_work() as executor:
        yield executor


def _hired(count: int) -> tuple[ProcessPoolExecutor, Any]:
    """Make a pool of processes, and an event that tells whether any of them has started."""
    from concurrent.futures import ProcessPoolExecutor

    # OpenMP runtimes do not survive a fork; threads on small blocks cost more than they give
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    context = spawning()
    started = context.Event()
    start = (started, main_script())
    return ProcessPoolExecutor(count, mp_context=context, initializer=_start, initargs=start), started


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


def _start(started: Any, script: Script | None) -> None:
    """Begin the life of a worker: Ctrl-C is the parent's business, which ends its workers in order."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    adopt(script)
    started.set()
