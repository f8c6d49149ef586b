"""Executor and progress receiver for checks of propagators."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

__all__ = ["Interrupter", "Interruption", "RecordingExecutor"]


class RecordingExecutor(Executor):
    """Executor that computes here on pickled copies, as another process would, and counts chunks and realisations."""

    def __init__(self) -> None:
        self.chunks = self.realisations = 0
        self.reasons: list[str] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Compute at once."""
        future: Future[Any] = Future()
        work, arguments, keywords = pickle.loads(pickle.dumps((fn, args, kwargs)))  # noqa: S301 - made by ourselves
        try:
            found = work(*arguments, **keywords)
        except Exception as error:  # noqa: BLE001 - passed to the receiver of the result
            future.set_exception(error)
            return future
        # the result is an attribute if the return value also identifies its worker
        computed = getattr(found, "result", found)
        status = getattr(computed, "status", ())
        self.chunks += 1
        self.realisations += len(status)
        self.reasons += [m for m, s in zip(getattr(computed, "messages", ()), status, strict=True) if s]
        future.set_result(pickle.loads(pickle.dumps(found)))  # noqa: S301
        return future


class Interruption(BaseException):
    """Exception that ends a run like Ctrl-C."""


class Interrupter:
    """Progress receiver that ends the run at the first finished chunk."""

    def start(self, label: str, total: int) -> None:
        """Accept the start."""

    def advance(self, label: str, count: int = 1) -> None:
        """Raise Interruption."""
        raise Interruption

    def finish(self, label: str) -> None:
        """Accept the end."""
