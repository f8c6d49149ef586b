"""Functions of users on their way to worker processes.

Functions of modules travel by name, as pickle sends them; lambdas, functions within functions and those of notebooks by
value, by cloudpickle, which pickle cannot.
"""

from __future__ import annotations

import importlib.machinery
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import cloudpickle

from uqmbd.dynamics.control.fingerprint import fingerprint, parts
from uqmbd.errors import StudyError

__all__ = ["Shipped"]


@dataclass(frozen=True)
class Shipped:
    """Wrapper that makes any function picklable."""

    function: Callable[..., Any]
    owner: str  # what the function belongs to, for messages

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (self._packed(), self.owner)

    def digest(self) -> str:
        """Hash of what the function does, the same in every process."""
        return fingerprint(self.function)

    def _packed(self) -> bytes:
        modules = [
            module for name in sorted(_modules(self.function))
            if (module := sys.modules.get(name)) is not None and not _importable(module)
        ]  # fmt: skip
        try:
            for module in modules:
                cloudpickle.register_pickle_by_value(module)
            try:
                packed: bytes = cloudpickle.dumps(self.function)
            finally:
                for module in modules:
                    cloudpickle.unregister_pickle_by_value(module)
        except StudyError:
            raise
        except Exception as error:
            raise StudyError(
                f"{self.owner}: its function cannot be sent to where it is computed ({type(error).__name__}: {error}). "
                "Define it at the level of a module or a script, and let it use numbers and arrays only: no mechanism, "
                "open file or lock."
            ) from error
        return packed


def _modules(function: Any) -> set[str]:
    """Names of the modules of which a callable is put together."""
    names = {getattr(part, "__module__", None) for part in parts(function)}
    return {name for name in names if isinstance(name, str)}


def _unpacked(packed: bytes, owner: str) -> Shipped:
    return Shipped(cloudpickle.loads(packed), owner)


def _importable(module: ModuleType) -> bool:
    """Whether another process finds a module by its name (of the main script cloudpickle sends values anyway)."""
    name = module.__name__
    if name == "__main__" or name in sys.builtin_module_names or "." in name:
        return True
    try:
        return importlib.machinery.PathFinder.find_spec(name) is not None
    except (ImportError, ValueError):
        return False
