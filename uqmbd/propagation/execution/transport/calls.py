"""The execution of a call by a worker, and its reply."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

from uqmbd.propagation.execution.transport.identity import Versions, Worker, this_worker, versions
from uqmbd.propagation.execution.transport.log_records import Listener, collect_records, listener
from uqmbd.propagation.execution.transport.packed import Missing, Packed

__all__ = ["Reply", "CallTerms", "answer", "records_before", "terms"]


@dataclass(frozen=True)
class CallTerms:
    """Data that accompany every call to a worker."""

    versions: Versions  # software versions that the worker must have
    listener: Listener | None  # process that receives log records of the worker; None: no process


def terms() -> CallTerms:
    """Return the data that accompany calls from this process."""
    return CallTerms(versions(), listener())


@dataclass(frozen=True)
class Reply:
    """Reply of a worker to a call."""

    worker: Worker
    kind: Literal["done", "missing", "refused"]
    """Kind of reply; missing: the worker lacks a packed object; refused: it has other versions of software."""
    result: Any = None  # return value if the kind is "done"
    seconds: float = 0.0  # wall time of the call, s
    records: tuple[logging.LogRecord, ...] = ()  # log records if the worker is another process


def answer(expected: CallTerms, function: Callable[..., Any], *arguments: Any) -> Reply:
    """Call a function, whose arguments may be packed, if this worker has the expected versions of software."""
    worker = this_worker()
    if expected.versions != worker.versions:
        return Reply(worker, "refused")
    begin = time.perf_counter()
    with collect_records(expected.listener) as records:
        try:
            for argument in arguments:
                if isinstance(argument, Packed):  # this process now stores the object, even if the function fails
                    argument.value()
            result = function(*arguments)
        except Missing:
            return Reply(worker, "missing", records=tuple(records))
        except Exception as error:
            if records:
                with suppress(AttributeError):  # some errors do not accept new attributes
                    setattr(error, _RECORDS, tuple(records))
            raise
    return Reply(worker, "done", result, time.perf_counter() - begin, tuple(records))


def records_before(error: BaseException) -> tuple[logging.LogRecord, ...]:
    """Return the log records of a worker before it raised an error."""
    found: tuple[logging.LogRecord, ...] = getattr(error, _RECORDS, ())
    return found


_RECORDS = "_uqmbd_log_records"
