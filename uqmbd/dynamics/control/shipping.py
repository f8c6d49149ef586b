"""Functions of users on their way to worker processes.

Functions of modules travel by name, as pickle sends them; lambdas, functions within functions and those of notebooks by
value, by cloudpickle, which pickle cannot.
"""

from __future__ import annotations

import hashlib
import importlib.machinery
import inspect
import sys
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import cloudpickle

from uqmbd.errors import StudyError

__all__ = ["Shipped"]


@dataclass(frozen=True)
class Shipped:
    """A function that can be pickled, whatever it is.

    Attributes
    ----------
    function : callable
    owner : str
        What it belongs to, for messages.
    """

    function: Callable[..., Any]
    owner: str

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (self._packed(), self.owner)

    def digest(self) -> str:
        """Hash of what the function does: of what is sent, and of the source of its module, where there is one."""
        try:
            text = hashlib.sha256(self._packed())
        except StudyError:  # of what cannot be sent nothing is kept that another run could take
            text = hashlib.sha256(repr(self.function).encode())
        module = inspect.getmodule(self.function) or inspect.getmodule(type(self.function))
        try:
            text.update(inspect.getsource(module).encode() if module is not None else b"")
        except (OSError, TypeError):  # a notebook, or compiled
            text.update(getattr(getattr(self.function, "__code__", None), "co_code", b""))
        return text.hexdigest()

    def _packed(self) -> bytes:
        module = sys.modules.get(getattr(self.function, "__module__", None) or "")
        try:
            if module is None or _importable(module):
                packed: bytes = cloudpickle.dumps(self.function)
                return packed
            cloudpickle.register_pickle_by_value(module)
            try:
                packed = cloudpickle.dumps(self.function)
            finally:
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
