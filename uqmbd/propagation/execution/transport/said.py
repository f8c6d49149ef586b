"""What loggers say in the process of a worker, on its way to those of the process that started the run."""

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

__all__ = ["Listener", "collected", "forward", "listener"]

_PLAIN = (str, int, float, bool, type(None))


@dataclass(frozen=True)
class Listener:
    """Process that receives log records below `uqmbd`, and their levels."""

    host: str  # name of its machine
    process: int  # number that the system assigned
    levels: tuple[tuple[str, int], ...]  # names of the loggers that have separate levels, and these


def listener() -> Listener | None:
    """Return this process as the listener; None where it has no handlers that would show or store a record.

    >>> listener() is None or dict(listener().levels)["uqmbd"] >= logging.NOTSET
    True
    """
    below = f"{ROOT.name}."
    own = {
        name: one
        for name, one in [(ROOT.name, ROOT), *ROOT.manager.loggerDict.copy().items()]
        if (one is ROOT or name.startswith(below)) and isinstance(one, logging.Logger)
    }
    if not any(_heard(one) for one in own.values()):
        return None
    return Listener(
        socket.gethostname(), os.getpid(), tuple((name, one.level) for name, one in own.items() if one.level)
    )


def _heard(logger: logging.Logger) -> bool:
    """Whether a logger, or one above it, has a handler that does anything."""
    at: logging.Logger | None = logger
    while at is not None:
        if any(not _to_nobody(handler) for handler in at.handlers):
            return True
        at = at.parent if at.propagate else None
    return False


def _to_nobody(handler: logging.Handler) -> bool:
    """Whether a handler does nothing, or writes to nowhere, as the one that chaospy adds when it is imported."""
    nowhere = isinstance(handler, logging.FileHandler) and handler.baseFilename == os.path.abspath(os.devnull)
    return nowhere or isinstance(handler, logging.NullHandler)


@contextmanager
def collected(told: Listener | None) -> Iterator[list[logging.LogRecord]]:
    """Collect what this thread says, at the levels of the listener; nothing where that is this process, or nobody.

    Handlers of this process do not get it: processes of MPI run the script that adds them, too, and would show all
    of it twice.
    """
    found: list[logging.LogRecord] = []
    if told is None or (told.host, told.process) == (socket.gethostname(), os.getpid()):
        yield found
        return
    collector = _Collector(found)
    with _lock:
        _now.append(collector)
        if len(_now) == 1:
            _before.update({name: logging.getLogger(name).level for name, _ in told.levels})
        for name, level in told.levels:
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


# Loggers belong to the process, and so does what is known of those that are changed: threads of a worker share them.
_lock = threading.Lock()
_now: list[_Collector] = []
_before: dict[str, int] = {}


def _set_level(name: str, level: int) -> None:
    logger = logging.getLogger(name)
    if logger.level != level:  # it makes all loggers forget what is enabled
        logger.setLevel(level)


class _Collector(logging.Handler):
    """Keeps what one thread says, in a form that travels."""

    def __init__(self, found: list[logging.LogRecord]) -> None:
        super().__init__()
        self._found, self._thread = found, threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        if record.thread == self._thread:
            self._found.append(_movable(self, record))


def _movable(handler: logging.Handler, record: logging.LogRecord) -> logging.LogRecord:
    """Return a record without objects that others may not know; its text has the traceback, as that of queues has."""
    found = copy.copy(record)
    found.msg, found.args = handler.format(record), None
    found.exc_info = found.exc_text = found.stack_info = None
    try:
        pickle.dumps(vars(found))
    except Exception:  # whatever somebody's object raises
        found.__dict__ = {name: value for name, value in vars(found).items() if isinstance(value, _PLAIN)}
    return found


def forward(records: Sequence[logging.LogRecord]) -> None:
    """Let the loggers of this process say what those of a worker have said."""
    for record in records:
        logger = logging.getLogger(record.name)
        if logger.isEnabledFor(record.levelno):
            logger.handle(record)
