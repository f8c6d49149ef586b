"""Forward log records of worker processes to the process that started the run."""

from __future__ import annotations

import copy
import logging
import os
import pickle
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from uqmbd.logs import ROOT

__all__ = ["Listener", "collect_records", "forward", "listener"]

_PLAIN = (str, int, float, bool, type(None))


@dataclass(frozen=True)
class Listener:
    """Process that receives the records of the loggers below `uqmbd`, and the levels of these loggers."""

    host: str  # name of the machine of this process
    process: int  # process number
    levels: tuple[tuple[str, int], ...]  # names and levels of the loggers with a separate level


def listener() -> Listener | None:
    """Return this process as the listener; None if no handler of the process shows or stores records.

    >>> listener() is None or dict(listener().levels)["uqmbd"] >= logging.NOTSET
    True
    """
    below = f"{ROOT.name}."
    own = {
        name: one
        for name, one in [(ROOT.name, ROOT), *ROOT.manager.loggerDict.copy().items()]
        if (one is ROOT or name.startswith(below)) and isinstance(one, logging.Logger)
    }
    if not any(_has_handler(one) for one in own.values()):
        return None
    return Listener(
        socket.gethostname(), os.getpid(), tuple((name, one.level) for name, one in own.items() if one.level)
    )


def _has_handler(logger: logging.Logger) -> bool:
    """Return whether a logger, or one of its ancestors, has a handler that shows or stores records."""
    at: logging.Logger | None = logger
    while at is not None:
        if any(not _discards(handler) for handler in at.handlers):
            return True
        at = at.parent if at.propagate else None
    return False


def _discards(handler: logging.Handler) -> bool:
    """Return whether a handler discards records, like the handler that chaospy adds on import."""
    nowhere = isinstance(handler, logging.FileHandler) and handler.baseFilename == os.path.abspath(os.devnull)
    return nowhere or isinstance(handler, logging.NullHandler)


@contextmanager
def collect_records(listener: Listener | None) -> Iterator[list[logging.LogRecord]]:
    """Collect log records of this thread at the levels of the listener.

    The list stays empty if the listener is None or this process. Handlers of this process do not receive the records:
    MPI processes also run the script that adds handlers, and would show all records twice.
    """
    found: list[logging.LogRecord] = []
    if listener is None or (listener.host, listener.process) == (socket.gethostname(), os.getpid()):
        yield found
        return
    collector = _Collector(found)
    with _lock:
        _now.append(collector)
        if len(_now) == 1:
            _before.update({name: logging.getLogger(name).level for name, _ in listener.levels})
        for name, level in listener.levels:
            _set_level(name, level)
        ROOT.propagate = False
        ROOT.addHandler(collector)
    try:
        yield found
    finally:
        with _lock:
            ROOT.removeHandler(collector)
            _now.remove(collector)
            if not _now:
                ROOT.propagate = True
                for name, level in _before.items():
                    _set_level(name, level)
                _before.clear()


# Loggers belong to the process. The threads of a worker therefore share the loggers and the record of changed levels.
_lock = threading.Lock()
_now: list[_Collector] = []
_before: dict[str, int] = {}


def _set_level(name: str, level: int) -> None:
    logger = logging.getLogger(name)
    if logger.level != level:  # setting a level clears the caches of all loggers
        logger.setLevel(level)


class _Collector(logging.Handler):
    """Stores the log records of one thread, in a form that can be pickled."""

    def __init__(self, found: list[logging.LogRecord]) -> None:
        super().__init__()
        self._found, self._thread = found, threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        if record.thread == self._thread:
            self._found.append(_movable(self, record))


def _movable(handler: logging.Handler, record: logging.LogRecord) -> logging.LogRecord:
    """Return a record without objects that cannot be pickled; its text includes the traceback."""
    found = copy.copy(record)
    found.msg, found.args = handler.format(record), None
    found.exc_info = found.exc_text = found.stack_info = None
    try:
        pickle.dumps(vars(found))
    except Exception:  # objects of users may raise any error
        found.__dict__ = {name: value for name, value in vars(found).items() if isinstance(value, _PLAIN)}
    return found


def forward(records: Sequence[logging.LogRecord]) -> None:
    """Pass log records of a worker to the loggers of this process."""
    for record in records:
        logger = logging.getLogger(record.name)
        if logger.isEnabledFor(record.levelno):
            logger.handle(record)
