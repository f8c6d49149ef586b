"""Child process of the viewer as seen by its parent: requests with a time limit."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from uqmbd.viewer.messages import Answer

__all__ = ["Child", "ChildEnded", "ChildTimeout", "UNPREPARED", "end_early", "first_child", "start_early"]


UNPREPARED = "--unprepared"
"""Argument of a process that draws no mechanism while it waits for its script."""

START = 120.0
"""Time limit for the start of a process, which imports large packages, s."""


class ChildTimeout(Exception):
    """The child did not answer within the time limit."""


class ChildEnded(Exception):
    """The child process ended without an answer."""


_early: list[Child] = []
"""Process that the command line has started before its other imports, until a viewer takes it."""


def start_early() -> None:
    """Start the first process, which `first_child` returns once."""
    with contextlib.suppress(OSError):  # the viewer tries again, and reports the error
        _early.append(Child(prepared=False))


def first_child() -> Child:
    """Return the process that was started early, or a new one."""
    return _early.pop() if _early else Child(prepared=False)


def end_early() -> None:
    """End the process that was started early if no viewer has taken it."""
    while _early:
        _early.pop().end()


class Child:
    """One child process (module `uqmbd.viewer.worker`), which loads at most one script.

    `prepared`: whether the process draws a small mechanism while it waits for its script. The first process only
    imports packages, because its script waits already.
    """

    def __init__(self, *, prepared: bool = True) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "uqmbd.viewer.worker", *([] if prepared else [UNPREPARED])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            # Ctrl-C ends the viewer, which then ends its children
            start_new_session=True,
        )
        self._lock = threading.Lock()
        self.ready = threading.Event()
        self._answers: queue.Queue[str | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def ask(self, request: dict[str, Any], seconds: float) -> Iterator[Answer]:
        """Yield the answers to a request; raise ChildTimeout or ChildEnded, after which the child is unusable."""
        with self._lock:
            if not self.ready.wait(START):
                raise ChildTimeout
            end = time.monotonic() + seconds
            assert self._process.stdin is not None
            try:
                self._process.stdin.write(json.dumps(request) + "\n")
                self._process.stdin.flush()
            except (OSError, ValueError):  # a broken or closed pipe
                raise ChildEnded from None
            while True:
                try:
                    line = self._answers.get(timeout=max(end - time.monotonic(), 1e-3))
                except queue.Empty:
                    raise ChildTimeout from None
                if line is None:
                    raise ChildEnded
                answer: Answer = json.loads(line)
                if answer["kind"] == "done":
                    return
                yield answer

    def end(self) -> None:
        """End the process and, except on Windows, all processes that its script started."""
        with contextlib.suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()
        self._process.wait()
        self._reader.join()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if self.ready.is_set():
                self._answers.put(line)
            self.ready.set()  # the first line states that the imports are complete
        self._answers.put(None)
        self.ready.set()
