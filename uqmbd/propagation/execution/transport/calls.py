"""A call as a worker sees it, and what it answers."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

from uqmbd.propagation.execution.transport.identity import Versions, Worker, this_worker, versions
from uqmbd.propagation.execution.transport.packed import Missing, Packed
from uqmbd.propagation.execution.transport.said import Listener, collected, listener

__all__ = ["Reply", "CallTerms", "answer", "said_before", "terms"]


@dataclass(frozen=True)
class CallTerms:
    """Data that accompany every call to a worker."""

    versions: Versions  # required of the worker
    listener: Listener | None  # process that receives log records of the worker; None: no process


def terms() -> CallTerms:
    """Return those of calls of this process."""
    return CallTerms(versions(), listener())


@dataclass(frozen=True)
class Reply:
    """Answer of a worker to a call."""

    worker: Worker
    kind: Literal["done", "missing", "refused"]
    """Of the answer: missing: a packed object is not there; refused: the worker has other versions."""
    result: Any = None  # if the kind is "done"
    seconds: float = 0.0  # wall time of the call
    said: tuple[logging.LogRecord, ...] = ()  # log records, where the worker is another process


def answer(asked: CallTerms, function: Callable[..., Any], *arguments: Any) -> Reply:
    """Call a function of some arguments, which may be packed, if this worker has the versions that are expected."""
    worker = this_worker()
    if asked.versions != worker.versions:
        return Reply(worker, "refused")
    begin = time.perf_counter()
    with collected(asked.listener) as said:
        try:
            for argument in arguments:
                if isinstance(argument, Packed):  # it is here from now on, whatever the function does
                    argument.value()
            result = function(*arguments)
        except Missing:
            return Reply(worker, "missing", said=tuple(said))
        except Exception as error:
            if said:
                with suppress(AttributeError):  # of an error that has no attributes
                    setattr(error, _SAID, tuple(said))
            raise
    return Reply(worker, "done", result, time.perf_counter() - begin, tuple(said))


def said_before(error: BaseException) -> tuple[logging.LogRecord, ...]:
    """Return what the loggers of a worker said before it raised an error."""
    found: tuple[logging.LogRecord, ...] = getattr(error, _SAID, ())
    return found


_SAID = "_uqmbd_said"
