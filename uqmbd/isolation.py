"""Code of others at work: whatever it raises is held and told, and harms nobody else.

Plugins, and methods of propagation, are called within :class:`Isolated`.  Only what the user does ends the program: a
press of Ctrl-C, or a signal that a handler in Python answers.
"""

from __future__ import annotations

import signal
import threading
import traceback
from types import FrameType, TracebackType
from typing import Any

from uqmbd.errors import UqmbdError

__all__ = ["ERRORS_AND_EXITS", "Isolated", "last_line", "reason_of", "release"]

ERRORS_AND_EXITS = Exception, SystemExit
"""What a method or a script may raise while the program goes on."""

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name))

_LONGEST = 1000
"""Characters of a text that are reported."""


class Isolated:
    """A context that holds what is raised in it instead of passing it on.

    `holding`: what is held: by default everything.  An exception that a signal caused, as Ctrl-C does, is never held.
    `error`: what was raised.

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
        """Whether something was raised."""
        return self.error is not None

    @property
    def reason(self) -> str:
        """What was raised, in one line; empty if nothing was."""
        return "" if self.error is None else reason_of(self.error)

    def __enter__(self) -> Isolated:
        # Signals are answered in the main thread, and only there can their handlers be exchanged.
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                before = signal.getsignal(number)
                if callable(before):
                    noting = self._noting(before)
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

    def _noting(self, before: Any) -> Any:
        def note(number: int, frame: FrameType | None) -> Any:
            self._signalled = True
            return before(number, frame)

        return note


def reason_of(error: BaseException) -> str:
    """Say why something failed: the message of an error of uqmbd, else the last line of the traceback and its place."""
    if isinstance(error, UqmbdError):
        return str(error)
    if isinstance(error, MemoryError):
        return "out of memory; try fewer samples, terms, outputs, times or workers"
    return last_line(error)


def last_line(error: BaseException) -> str:
    """Say in one line the type of an error, its text, and where it was raised.

    >>> last_line(ValueError("too short"))
    'ValueError: too short'
    """
    kind = type(error).__name__
    try:
        text = " ".join(str(error.msg if isinstance(error, SyntaxError) else error).split())
    except BaseException:  # noqa: BLE001 - even the text of an error is code of others
        text = "(its text cannot be made)"
    line = f"{kind}: {text if len(text) <= _LONGEST else text[: _LONGEST - 3] + '...'}" if text else kind
    frames = traceback.extract_tb(error.__traceback__)
    return f"{line} ({frames[-1].filename}, line {frames[-1].lineno})" if frames else line


def release(error: BaseException) -> None:
    """Let go of the local variables of the frames in which something failed: they may be large."""
    seen: set[int] = set()
    waiting: list[BaseException | None] = [error]
    while waiting:
        one = waiting.pop()
        if one is not None and id(one) not in seen:
            seen.add(id(one))
            traceback.clear_frames(one.__traceback__)
            waiting += [one.__cause__, one.__context__]
