"""Compute tasks other than chunks of realisations.

Results are returned in order, and stored so that an interrupted run can continue.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from typing import Any

from numpy.typing import NDArray

from uqmbd.dynamics import Model, compute_code_key
from uqmbd.errors import IntegrationError
from uqmbd.propagation.execution.checkpoints import Checkpoint
from uqmbd.propagation.execution.cost import CostClock
from uqmbd.propagation.execution.in_order import run_in_order
from uqmbd.propagation.execution.transport import Packed
from uqmbd.threads import one_thread

__all__ = ["Arrays", "run_tasks"]

Arrays = dict[str, NDArray[Any]]


def run_tasks(
    label: str,
    packed: Packed,
    fingerprint: bytes,
    executor: Executor | None,
    checkpoint: Checkpoint | None,
    clock: CostClock,
    function: Callable[..., Arrays],
    tasks: Sequence[tuple[Any, ...]],
) -> Iterator[Arrays]:
    """Yield ``function(model, *task)`` for each task, in the order of the tasks; see `uqmbd.extend.Problem.run`."""
    names = [_name(fingerprint, function, task) for task in tasks]

    def known(piece: tuple[str, tuple[Any, ...]]) -> Arrays | None:
        stored = None if checkpoint is None else checkpoint.load_arrays(piece[0])
        if stored is None:
            return None
        found, about = stored
        clock.recover(piece[0], about["seconds"])
        return found

    def work(piece: tuple[str, tuple[Any, ...]]) -> tuple[Callable[..., Arrays], tuple[Any, ...]]:
        return _call, (function, packed, piece[1])

    def keep(piece: tuple[str, tuple[Any, ...]], found: Arrays, seconds: float) -> Arrays:
        if checkpoint is not None:
            checkpoint.save_arrays(piece[0], found, {"seconds": seconds})
            clock.done(piece[0])
        return found

    def lost(piece: tuple[str, tuple[Any, ...]], reason: str) -> Arrays:
        number, name = names.index(piece[0]) + 1, f"{function.__module__}.{function.__qualname__}"
        raise IntegrationError(
            f"{label}: task {number} of {len(tasks)} of {name} was lost: {reason}. Run with workers=1 to see the "
            "error and its place."
        )

    return run_in_order(list(zip(names, tasks, strict=True)), executor, known, work, keep, lost)


def _call(function: Callable[..., Arrays], packed: Packed, task: tuple[Any, ...]) -> Arrays:
    model: Model = packed.value()
    with one_thread():
        return function(model, *task)


NAMED = {"uqmbd.propagation.execution.histories": "uqmbd.propagation.histories"}
"""Former names of modules: earlier runs stored the tasks of functions under these names."""


def _name(fingerprint: bytes, function: Callable[..., Arrays], task: tuple[Any, ...]) -> str:
    module = NAMED.get(function.__module__, function.__module__)
    text = hashlib.sha256(f"{module}.{function.__qualname__}".encode())
    text.update(pickle.dumps(task))
    text.update(fingerprint)
    text.update(compute_code_key(function).encode())
    return f"{text.hexdigest()[:32]}.task.npz"
