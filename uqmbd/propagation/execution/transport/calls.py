"""A call as a worker sees it, and what it answers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from uqmbd.propagation.execution.transport.identity import Versions, Worker, this_worker
from uqmbd.propagation.execution.transport.packed import Missing, Packed

__all__ = ["Answer", "answer"]


@dataclass(frozen=True)
class Answer:
    """What a worker says to a call.

    Attributes
    ----------
    worker : Worker
        Who it is.
    kind : {"done", "missing", "refused"}
        Whether it has done it, does not have a packed object that it needs, or is of another version.
    result : object
        Where it is done.
    seconds : float
        Wall time that it took.
    """

    worker: Worker
    kind: Literal["done", "missing", "refused"]
    result: Any = None
    seconds: float = 0.0


def answer(versions: Versions, function: Callable[..., Any], *arguments: Any) -> Answer:
    """Call a function of some arguments, which may be packed, if this worker has the versions that are expected."""
    worker = this_worker()
    if versions != worker.versions:
        return Answer(worker, "refused")
    begin = time.perf_counter()
    try:
        for argument in arguments:
            if isinstance(argument, Packed):  # it is here from now on, whatever the function does
                argument.value()
        result = function(*arguments)
    except Missing:
        return Answer(worker, "missing")
    return Answer(worker, "done", result, time.perf_counter() - begin)
