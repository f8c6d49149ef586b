"""Import large packages in processes of the command line and of the viewer only when one of their names is used.

`import uqmbd` and study scripts import these packages, but most commands need few of them. chaospy imports
`scipy.stats`, `scipy.optimize` and `scipy.integrate` for five names, most of which no study uses. These imports take a
quarter of the processor time until the viewer shows a mechanism; xarray, with pandas, takes another eighth. They are
measured by ``python -X importtime``.

A postponed module has the attributes of its specification. The first use of any other attribute executes the module.
`importlib.util.LazyLoader` does the same, but a second thread sees an incomplete module (Python issue 114763), and
``from package import name`` executes the package at once. If chaospy executes such a line, it gets a `LateName`, which
looks up the name at its first use.
"""

from __future__ import annotations

import _imp
import contextlib
import importlib
import importlib.machinery
import sys
import threading
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

__all__ = ["postpone_imports", "when_loaded"]

PACKAGES = (
    "numpy.f2py",
    "scipy.integrate",
    "scipy.optimize",
    "scipy.stats",
    "scipy.stats._distn_infrastructure",
    "xarray",
)
"""Modules whose execution is postponed."""


def postpone_imports() -> None:
    """Postpone imports of the packages in this process, unless they are imported already.

    >>> import subprocess, sys
    >>> code = "import sys; from uqmbd.late_imports import *; postpone_imports(); import xarray"
    >>> code += "; print('pandas' in sys.modules); print(xarray.Dataset.__name__, 'pandas' in sys.modules)"
    >>> print(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip())
    False
    Dataset True
    """
    if not any(isinstance(one, _Finder) for one in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


def when_loaded(name: str, action: Callable[[], object]) -> None:
    """Perform an action that uses a package: at once, or after the execution of the package if this is postponed."""
    module = importlib.import_module(name)
    if isinstance(module, LateModule):
        with module._late.lock:
            if not module._late.complete:
                module._late.actions.append(action)
                return
    action()


class LateModule(types.ModuleType):
    """Module that is executed at the first use of an attribute."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._late = _State()

    def __getattr__(self, name: str) -> Any:
        special = name.startswith("__") and name.endswith("__")
        # introspection of all modules, such as that of `warnings`, must not execute this one
        if special and name not in ("__all__", "__version__"):
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        if _importer().startswith("chaospy."):
            return LateName(self, name)
        below = sys.modules.get(f"{self.__name__}.{name}")
        if below is not None and self._late.running:
            return below
        if self._execute():
            return getattr(self, name)
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r} yet")

    def __dir__(self) -> list[str]:
        self._execute()
        return sorted(self.__dict__)

    def __reduce__(self) -> tuple[Any, ...]:
        """Functions of users that name this module are sent to other processes, which import it."""
        return importlib.import_module, (self.__name__,)

    def _execute(self) -> bool:
        """Execute this module once, then the actions that wait for it; return whether it is complete.

        Other threads wait until it is complete. It is incomplete for modules that it imports. A thread within an import
        holds the lock of a module, for which the executing thread may wait. It therefore waits for a limited time only.
        """
        if not self._late.lock.acquire(timeout=_longest_wait()):
            return False
        with contextlib.ExitStack() as held:
            held.callback(self._late.lock.release)
            if self._late.complete:
                return True
            if self._late.running:
                return False
            self._late.running = True
            spec = self.__spec__
            assert spec is not None
            late: Any = spec.loader
            self.__loader__ = spec.loader = late.real
            try:
                late.real.exec_module(self)
            except BaseException:
                self._late.running = False
                self.__loader__ = spec.loader = late
                raise
            self._late.complete = True
            object.__setattr__(self, "__class__", types.ModuleType)  # a usual module from now on
            actions, failed = self._late.actions, []
            self._late.actions = []
            for action in actions:
                try:
                    action()
                except Exception as error:
                    failed.append(error)
            if failed:
                raise failed[0]
        return True

    def _execute_unlocked(self) -> None:
        """Execute this module within an import, unless another thread executes it.

        An import that waited for the other thread would hold the lock of all imports, which that thread needs. Imports
        of modules that are not postponed do not wait for packages that are being executed, either.
        """
        if not self._late.lock.acquire(blocking=False):
            return
        try:
            held = _imp.lock_held()
            if held:
                _imp.release_lock()
            try:
                self._execute()
            finally:
                if held:
                    _imp.acquire_lock()
        finally:
            self._late.lock.release()


@dataclass
class _State:
    """State of a postponed module."""

    lock: Any = field(default_factory=threading.RLock)
    running: bool = False
    complete: bool = False
    actions: list[Callable[[], object]] = field(default_factory=list)


LONGEST_WAIT = 10.0
"""Time, s, that a thread within an import waits for another thread that executes a package."""


def _longest_wait() -> float:
    """Return the time, s, to wait for a package that another thread executes; -1: without a limit.

    ``from package import module`` looks for an attribute first and imports the module if there is none, so that it need
    not wait.
    """
    frame: types.FrameType | None = sys._getframe(2)
    while frame is not None and frame.f_globals.get("__name__") == __name__:
        frame = frame.f_back
    immediate = True
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith("importlib._bootstrap"):
            return 0.0 if immediate else LONGEST_WAIT
        immediate, frame = False, frame.f_back
    return -1.0


def _importer() -> str:
    """Return the name of the module whose import statement runs, or an empty text."""
    frame: types.FrameType | None = sys._getframe(2)
    while frame is not None and str(frame.f_globals.get("__name__")).startswith("importlib."):
        frame = frame.f_back
    if frame is None or frame.f_code.co_name != "<module>":
        return ""
    return str(frame.f_globals.get("__name__"))


class LateName:
    """Name of a postponed module, which is looked up at its first use."""

    def __init__(self, module: types.ModuleType, name: str) -> None:
        self._module = module
        self._name = name

    def __reduce__(self) -> tuple[Any, ...]:
        return getattr, (self._module, self._name)

    def _found(self) -> Any:
        return getattr(self._module, self._name)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._found(), name)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self._found()(*arguments, **options)

    def __instancecheck__(self, one: object) -> bool:
        return isinstance(one, self._found())


class _Finder:
    """Finder of the packages that are postponed."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name in PACKAGES:
            spec = importlib.machinery.PathFinder.find_spec(name, path, target)
            if spec is not None and spec.loader is not None:
                spec.loader = cast(Any, _Loader(spec.loader))
            return spec
        above = sys.modules.get(name.rpartition(".")[0])
        if isinstance(above, LateModule):
            above._execute_unlocked()  # a package is executed before its modules
        return None


class _Loader:
    """Loader that creates a module without executing it."""

    def __init__(self, real: Any) -> None:
        self.real = real

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType:
        return LateModule(spec.name)

    def exec_module(self, module: types.ModuleType) -> None:
        """Leave the module unexecuted."""
