"""Work that is not a chunk of realisations: done on all workers, in order, and kept while a run is unfinished."""

from __future__ import annotations

import contextlib
import hashlib
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from typing import Any

from numpy.typing import NDArray

from uqmbd.dynamics import Model
from uqmbd.errors import StudyError
from uqmbd.propagation.execution.checkpoint import Checkpoint
from uqmbd.propagation.execution.chunks import model_of
from uqmbd.propagation.execution.cost import Clock, Laps
from uqmbd.threads import one_thread

__all__ = ["Arrays", "failed", "run_tasks"]

Arrays = dict[str, NDArray[Any]]


def run_tasks(
    data: bytes,
    fingerprint: bytes,
    executor: Executor | None,
    checkpoint: Checkpoint | None,
    clock: Clock,
    function: Callable[..., Arrays],
    tasks: Sequence[tuple[Any, ...]],
) -> Iterator[Arrays]:
    """Yield ``function(model, *task)`` for each task, in their order; see `uqmbd.Problem.run`.

    Parameters
    ----------
    data : bytes
        The pickled model.
    fingerprint : bytes
        What results depend on besides the tasks.
    executor : concurrent.futures.Executor, optional
        Who does the work; None: this process.
    checkpoint : Checkpoint, optional
        Where finished tasks are kept.
    clock : Clock
        That counts what is not done again.
    function : callable
        Of a module.
    tasks : sequence of tuple
        Further arguments.
    """
    names = [_name(fingerprint, function, task) for task in tasks]
    running: dict[int, Future[Arrays]] = {}
    laps = Laps()

    def keep(k: int, found: Arrays) -> None:
        if checkpoint is not None:
            checkpoint.save_arrays(names[k], found, {"seconds": laps()})
            clock.done(names[k])

    try:
        stored = [None if checkpoint is None else checkpoint.load_arrays(name) for name in names]
        if executor is not None:
            for k, task in enumerate(tasks):
                if stored[k] is None:
                    running[k] = executor.submit(_call, function, data, task)
        for k, task in enumerate(tasks):
            known = stored[k]
            if known is not None:
                found, about = known
                clock.recover(names[k], about["seconds"])
            else:
                found = running.pop(k).result() if k in running else _call(function, data, task)
                keep(k, found)
            yield found
    finally:
        for k, future in running.items():
            if not future.cancel() and future.done() and not failed(future):
                with contextlib.suppress(StudyError):  # whatever ended the run is said instead
                    keep(k, future.result())


def failed(future: Future[Any]) -> bool:
    """Whether a future that is done has no result."""
    return future.cancelled() or future.exception() is not None


def _call(function: Callable[..., Arrays], data: bytes, task: tuple[Any, ...]) -> Arrays:
    model: Model = model_of(data)
    with one_thread():
        return function(model, *task)


def _name(fingerprint: bytes, function: Callable[..., Arrays], task: tuple[Any, ...]) -> str:
    text = hashlib.sha256(f"{function.__module__}.{function.__qualname__}".encode())
    text.update(pickle.dumps(task))
    text.update(fingerprint)
    return f"{text.hexdigest()[:32]}.task.npz"
