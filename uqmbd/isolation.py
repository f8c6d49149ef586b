"""Isolation of code of plugins and users: its exceptions are caught and reported, and do not affect other code.

Plugins and methods of propagation are called within :class:`Isolated`.  Only the user can end the program: by Ctrl-C,
or by a signal with a handler in Python.
"""

from __future__ import annotations

import signal
import threading
import traceback
from functools import partial
from types import FrameType, TracebackType
from typing import Any

from uqmbd.errors import UqmbdError

__all__ = ["ERRORS_AND_EXITS", "Isolated", "last_line", "reason_of", "release"]

ERRORS_AND_EXITS = Exception, SystemExit
"""Exceptions of a method or a script after which the program continues."""

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))

_LONGEST = 1000
"""Largest number of characters of a reported text."""


class Isolated:
    """Context that catches an exception and stores it in `error`.

    `holding` contains the types of caught exceptions, by default all.  An exception caused by a signal, such as
    Ctrl-C, is never caught.

    >>> with Isolated() as work:
    ...     raise SystemExit("no licence")
    >>> work.failed, type(work.error).__name__
    (True, 'SystemExit')
    >>> with Isolated() as work:
    ...     value = 3
    >>> work.failed
    False
    """

    def __init__(self, *holding: type[BaseException]) -> None:
        self.holding = holding or (BaseException,)
        self.error: BaseException | None = None
        self._signalled = False
        self._before: dict[int, tuple[Any, Any]] = {}

    @property
    def failed(self) -> bool:
        """Whether an exception was caught."""
        return self.error is not None

    @property
    def reason(self) -> str:
        """Reason of the caught exception, or an empty text."""
        return "" if self.error is None else reason_of(self.error)

    def __enter__(self) -> Isolated:
        # Python calls signal handlers in the main thread, and only this thread can replace them.
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                before = signal.getsignal(number)
                if callable(before):
                    noting = partial(self._note, before)
                    self._before[number] = (before, noting)
                    signal.signal(number, noting)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        for number, (before, noting) in self._before.items():
            if signal.getsignal(number) is noting:
                signal.signal(number, before)
        if error is None or self._signalled or not isinstance(error, self.holding):
            return False
        self.error = error
        return True

    def _note(self, before: Any, number: int, frame: FrameType | None) -> Any:
        self._signalled = True
        return before(number, frame)


def reason_of(error: BaseException) -> str:
    """Return the reason of a failure: the message of uqmbd's own errors, or the last line of the traceback."""
    if isinstance(error, UqmbdError):
        return str(error)
    if isinstance(error, MemoryError):
        return "out of memory; try fewer samples, terms, outputs, times or workers"
    return last_line(error)


def last_line(error: BaseException) -> str:
    """Return the type, the text and the location of an error in one line.

    >>> last_line(ValueError("too short"))
    'ValueError: too short'
    """
    kind = type(error).__name__
    try:
        text = " ".join(str(error.msg if isinstance(error, SyntaxError) else error).split())
    except BaseException:  # noqa: BLE001 - the text of an error is computed by code of others
        text = "(its text is not available, because __str__ failed)"
    line = f"{kind}: {text if len(text) <= _LONGEST else text[: _LONGEST - 3] + '...'}" if text else kind
    frames = traceback.extract_tb(error.__traceback__)
    return f"{line} ({frames[-1].filename}, line {frames[-1].lineno})" if frames else line


def release(error: BaseException) -> None:
    """Release the local variables of the frames of an error, which may need much memory."""
    seen: set[int] = set()
    waiting: list[BaseException | None] = [error]
    while waiting:
        one = waiting.pop()
        if one is not None and id(one) not in seen:
            seen.add(id(one))
            traceback.clear_frames(one.__traceback__)
            waiting += [one.__cause__, one.__context__]
