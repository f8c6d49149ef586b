"""Work that is not a chunk of realisations: done on all workers, in order, and kept while a run is unfinished."""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import Model
from uqmbd.propagation.checkpoint import Checkpoint
from uqmbd.propagation.chunks import model_of

__all__ = ["Arrays", "run_tasks"]

Arrays = dict[str, NDArray[Any]]


def run_tasks(
    data: bytes,
    fingerprint: bytes,
    executor: Executor | None,
    checkpoint: Checkpoint | None,
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
    function : callable
        Of a module.
    tasks : sequence of tuple
        Further arguments.
    """
    places = [None if checkpoint is None else _place(checkpoint, fingerprint, function, task) for task in tasks]
    running: dict[int, Future[Arrays]] = {}
    try:
        stored = [_load(place) for place in places]
        if executor is not None:
            for k, task in enumerate(tasks):
                if stored[k] is None:
                    running[k] = executor.submit(_call, function, data, task)
        for k, task in enumerate(tasks):
            found = stored[k]
            if found is None:
                found = running.pop(k).result() if k in running else _call(function, data, task)
                _save(places[k], found)
            yield found
    finally:
        for future in running.values():
            future.cancel()


def _call(function: Callable[..., Arrays], data: bytes, task: tuple[Any, ...]) -> Arrays:
    from threadpoolctl import threadpool_limits

    model: Model = model_of(data)
    with threadpool_limits(limits=1):
        return function(model, *task)


def _place(checkpoint: Checkpoint, fingerprint: bytes, function: Callable[..., Arrays], task: tuple[Any, ...]) -> Path:
    text = hashlib.sha256(f"{function.__module__}.{function.__qualname__}".encode())
    text.update(pickle.dumps(task))
    text.update(fingerprint)
    return checkpoint.place / f"{text.hexdigest()[:32]}.task.npz"


def _load(place: Path | None) -> Arrays | None:
    """Return what a task gave, or nothing (also where the file is damaged)."""
    if place is None or not place.exists():
        return None
    try:
        with np.load(place, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    except Exception:  # noqa: BLE001 - whatever is wrong with the file, the task is done again
        return None


def _save(place: Path | None, found: Arrays) -> None:
    if place is None:
        return
    place.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=place.parent, suffix=".part", delete=False) as file:
        np.savez(file, **found)  # type: ignore[arg-type]  # its stub takes the name for an option
    with contextlib.suppress(FileNotFoundError):
        os.replace(file.name, place)
