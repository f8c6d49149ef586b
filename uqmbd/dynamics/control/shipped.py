"""Transfer of functions of users to worker processes."""

from __future__ import annotations

import importlib.machinery
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import cloudpickle

from uqmbd.dynamics.fingerprints import fingerprint, parts
from uqmbd.errors import StudyError

__all__ = ["Shipped"]


@dataclass(frozen=True)
class Shipped:
    """Wrapper that makes any function picklable."""

    function: Callable[..., Any]
    owner: str  # owner of the function, for messages

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (self._packed(), self.owner)

    def digest(self) -> str:
        """Hash of the content of the function, equal in all processes."""
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
                f"{self.owner}: its function cannot be sent to the worker processes ({type(error).__name__}: {error}). "
                "Define it at the level of a module or a script, and let it use numbers and arrays only: no mechanism, "
                "open file or lock."
            ) from error
        return packed


def _modules(function: Any) -> set[str]:
    """Return the names of the modules of a callable and its parts."""
    names = {getattr(part, "__module__", None) for part in parts(function)}
    return {name for name in names if isinstance(name, str)}


def _unpacked(packed: bytes, owner: str) -> Shipped:
    return Shipped(cloudpickle.loads(packed), owner)


def _importable(module: ModuleType) -> bool:
    """Return whether another process finds a module by name (cloudpickle sends the main script by value)."""
    name = module.__name__
    if name == "__main__" or name in sys.builtin_module_names or "." in name:
        return True
    try:
        return importlib.machinery.PathFinder.find_spec(name) is not None
    except (ImportError, ValueError):
        return False
