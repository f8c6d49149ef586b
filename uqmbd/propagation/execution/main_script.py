"""Run the main script in a worker process only if a task uses an object from the script.

Processes of `multiprocessing` import the main script of their parent when they start. A script that starts processes
must therefore start them under ``if __name__ == "__main__":``. The workers of uqmbd need the script only if a task uses
a function or class from the script, which is rare. Workers start without the script. At the first use, a worker runs
the script up to the line that started the workers; all definitions before that line are then available.
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
"""Module name of the main script in a child process: a guard ``if __name__ == "__main__":`` is then false."""

_lock = threading.Lock()


@dataclass(frozen=True)
class Script:
    """Location of the main script of a process."""

    module: str  # name of a script that was started as a module (``python -m``); otherwise empty
    path: str  # file of a script that was not started as a module


class _ScriptEnds(SystemExit):
    """A worker has reached the line of the script that started the workers, and does not run the rest."""


def find_main_script() -> Script | None:
    """Return the main script of this process; None in a notebook, for example."""
    main = sys.modules["__main__"]
    spec = getattr(main, "__spec__", None)
    if spec is not None:
        return Script(spec.name, "")
    path = getattr(main, "__file__", None)
    return Script("", os.path.abspath(path)) if path else None


class _SpawnProcess(multiprocessing.context.SpawnProcess):
    """Process that does not import the main script at its start."""

    @staticmethod
    def _Popen(process_obj: Any) -> Any:  # noqa: N802 - multiprocessing prescribes the name
        with _unmentioned():
            return multiprocessing.context.SpawnProcess._Popen(process_obj)


class _SpawnContext(multiprocessing.context.SpawnContext):
    Process = _SpawnProcess


def spawning() -> multiprocessing.context.SpawnContext:
    """Return the start method of worker processes: spawned processes that do not import the main script."""
    return _SpawnContext()


@contextmanager
def _unmentioned() -> Iterator[None]:
    """Hide the path of the main script from `multiprocessing`: new processes would otherwise import the script."""
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
    """Make a worker import the script at the first use of an object from it."""
    if script is not None:
        sys.modules["__main__"] = sys.modules[_NAME] = _Deferred(script)


def refuse_workers_of_workers() -> None:
    """End the import of the script in a worker at the line that started the worker.

    Raise StudyError if a worker tries to start workers in any other place, for example in an imported module.
    """
    frame = inspect.currentframe()
    while frame is not None:
        if frame.f_code.co_name == "<module>" and frame.f_globals.get("__name__") == _NAME:
            raise _ScriptEnds(1)
        frame = frame.f_back
    if isinstance(sys.modules.get("__main__"), _Deferred):
        raise StudyError(
            "A worker process cannot start further workers. A module must start studies only when it runs as the main "
            'script: put the line that starts the study under if __name__ == "__main__":'
        )


class _Deferred(types.ModuleType):
    """Main script in a worker; the script runs at the first use of one of its objects."""

    def __init__(self, script: Script) -> None:
        super().__init__(_NAME)
        self._script: Script | None = script

    def __getattr__(self, name: str) -> Any:
        script = vars(self).get("_script")
        if script is None or (name.startswith("__") and name.endswith("__")):
            raise AttributeError(f"the script of this run does not define {name!r} before the line that starts the run")
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
