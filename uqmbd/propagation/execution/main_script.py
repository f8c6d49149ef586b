"""The script that is run, as worker processes see it: they import it only where they need something that it defines.

Processes of `multiprocessing` import the main script of their parent when they start. So a script that starts processes
must guard this by ``if __name__ == "__main__":``. The workers of uqmbd need the script only where a function or class
of its own is a part of the work, which is rare. So they start without it, and where it is needed it is run as far as
the line that started the work; what it defines before that line is there.
"""

from __future__ import annotations

import importlib.util
import inspect
import multiprocessing.context
import os
import sys
import threading
import types
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from uqmbd.errors import StudyError

__all__ = ["Script", "adopt", "find_main_script", "refuse_workers_of_workers", "spawning"]

_NAME = "__mp_main__"
"""Under which `multiprocessing` imports the main script; a guard ``if __name__ == "__main__":`` then does not hold."""

_lock = threading.Lock()


@dataclass(frozen=True)
class Script:
    """Location of the main script of a process."""

    module: str  # name, if it was started as a module (``python -m``); else empty
    path: str  # file, if it was not started as a module


class _ScriptEnds(SystemExit):
    """A worker has imported the script as far as the line that started the work: the rest is not its business."""


def find_main_script() -> Script | None:
    """Return the main script of this process; None where there is none, as in a notebook."""
    main = sys.modules["__main__"]
    spec = getattr(main, "__spec__", None)
    if spec is not None:
        return Script(spec.name, "")
    path = getattr(main, "__file__", None)
    return Script("", os.path.abspath(path)) if path else None


class _SpawnProcess(multiprocessing.context.SpawnProcess):
    """A process that does not import the main script when it starts."""

    @staticmethod
    def _Popen(process_obj: Any) -> Any:  # noqa: N802 - the name is that of multiprocessing
        with _unmentioned():
            return multiprocessing.context.SpawnProcess._Popen(process_obj)


class _SpawnContext(multiprocessing.context.SpawnContext):
    Process = _SpawnProcess


def spawning() -> multiprocessing.context.SpawnContext:
    """Return how worker processes are started: afresh, and without the main script."""
    return _SpawnContext()


@contextmanager
def _unmentioned() -> Iterator[None]:
    """Hide where the main script is from `multiprocessing`, which else tells new processes to import it."""
    main = sys.modules["__main__"]
    with _lock:
        hidden: dict[str, Any] = {name: vars(main)[name] for name in ("__spec__", "__file__") if name in vars(main)}
        main.__spec__ = None
        vars(main).pop("__file__", None)
        try:
            yield
        finally:
            vars(main).update(hidden)


def adopt(script: Script | None) -> None:
    """Let a worker import the script when it first needs something of it."""
    if script is not None:
        sys.modules["__main__"] = sys.modules[_NAME] = _Deferred(script)


def refuse_workers_of_workers() -> None:
    """End the import of the script where a worker reaches the line that started it.

    Raise StudyError if a worker reaches such a line elsewhere.
    """
    frame = inspect.currentframe()
    while frame is not None:
        if frame.f_code.co_name == "<module>" and frame.f_globals.get("__name__") == _NAME:
            raise _ScriptEnds(1)
        frame = frame.f_back
    if isinstance(sys.modules.get("__main__"), _Deferred):
        raise StudyError(
            "A worker process cannot start further workers. A module that a study needs must start studies only "
            'when it is run itself: put that line under if __name__ == "__main__":'
        )


class _Deferred(types.ModuleType):
    """The main script in a worker: it is run when something of it is asked for."""

    def __init__(self, script: Script) -> None:
        super().__init__(_NAME)
        self._script: Script | None = script

    def __getattr__(self, name: str) -> Any:
        script = vars(self).get("_script")
        if script is None or (name.startswith("__") and name.endswith("__")):
            raise AttributeError(f"the script of this run has no {name!r} before the line that starts the work")
        self._script = None
        with suppress(_ScriptEnds):
            exec(self._code(script), vars(self))
        return getattr(self, name)

    def _code(self, script: Script) -> Any:
        if script.module:
            spec = importlib.util.find_spec(script.module)
            assert spec is not None and spec.loader is not None  # the parent has imported it
            self.__package__ = spec.parent
            self.__file__ = spec.origin
            return spec.loader.get_code(script.module)  # type: ignore[attr-defined]  # as runpy does
        self.__file__ = script.path
        with open(script.path, "rb") as file:
            return compile(file.read(), script.path, "exec")
