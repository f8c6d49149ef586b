"""Hashes of the content of callables of users: code, constants, closures and named objects.

`uqmbd.dynamics.code_digest` is stricter: it rejects objects whose content is not completely known.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import re
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

__all__ = ["fingerprint", "parts"]

PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...), np.generic)
DATA = (*PLAIN, np.ndarray, tuple, list, dict, set, frozenset)
CODE = ("co_argcount", "co_kwonlyargcount", "co_flags", "co_names", "co_varnames", "co_freevars", "co_code")
OF_CLASSES = (
    "__dict__",
    "__weakref__",
    "_abc_impl",
    "__slotnames__",
    "__module__",
    "__doc__",
    "__firstlineno__",
    "__static_attributes__",
)


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a hash of the content of a callable.

    The hash includes the code with constants, defaults and closures, and the source of the module. It also includes
    named objects of this and other modules, such as functions and numbers.  For a ``functools.partial``, the hash
    includes functions and arguments; for an object, its class and attributes.  Libraries (standard library and
    installed packages) are included by name.  For an object that cannot be copied, the hash includes its text without
    the address, and its attributes.
    """
    return _Hashing().of(function).hex()


def parts(function: Any) -> Iterator[Any]:
    """Yield a callable and its parts, such as contents of partials and bound methods."""
    yield function
    inner: list[Any] = []
    if isinstance(function, functools.partial):
        inner = [function.func, *function.args, *function.keywords.values()]
    elif isinstance(function, MethodType):
        inner = [function.__func__, function.__self__]
    for part in inner:
        yield from parts(part)


class _Hashing:
    """Hashes of values, each computed once."""

    def __init__(self) -> None:
        self.known: dict[int, tuple[Any, bytes]] = {}

    def of(self, value: Any) -> bytes:
        if isinstance(value, PLAIN):
            return _joined([type(value).__name__.encode(), repr(value).encode()])
        if id(value) not in self.known:
            self.known[id(value)] = value, b"itself"
            self.known[id(value)] = value, _joined(self._seen(value))
        return self.known[id(value)][1]

    def _seen(self, value: Any) -> list[bytes]:
        kind = type(value)
        found = [f"{kind.__module__}.{kind.__qualname__}".encode()]
        if kind is np.ndarray:
            content = self.of(value.tolist()) if value.dtype.hasobject else value.tobytes()
            return [*found, repr((value.shape, value.dtype.str)).encode(), content]
        if kind in (tuple, list):
            return [*found, *map(self.of, value)]
        if kind in (set, frozenset):
            return [*found, *sorted(map(self.of, value))]
        if kind is dict:
            return [*found, *sorted(_joined([self.of(key), self.of(x)]) for key, x in value.items())]
        if isinstance(value, CodeType):
            return [*found, *(self.of(getattr(value, name)) for name in CODE), self.of(value.co_consts)]
        if isinstance(value, ModuleType):  # the type of a module whose import is postponed changes at its execution
            return [b"builtins.module", _source(value) or value.__name__.encode()]
        if isinstance(value, (FunctionType, type)) and _of_library(value):
            return [*found, f"{value.__module__}.{value.__qualname__}".encode()]
        if isinstance(value, FunctionType):
            return found + self._function(value)
        if isinstance(value, type):
            content = {k: x for k, x in vars(value).items() if k not in OF_CLASSES and not inspect.isdatadescriptor(x)}
            gets = {k: x.fget for k, x in vars(value).items() if isinstance(x, property)}
            return [*found, value.__qualname__.encode(), *map(self.of, (value.__bases__, content, gets))]
        if isinstance(value, functools.partial):
            return [*found, *map(self.of, (value.func, value.args, value.keywords))]
        if isinstance(value, (MethodType, staticmethod, classmethod)):
            return [*found, self.of(value.__func__), self.of(getattr(value, "__self__", None))]
        return found + self._object(value)

    def _function(self, value: FunctionType) -> list[bytes]:
        source = _source(sys.modules.get(value.__module__ or ""))
        held = [_content(cell) for cell in value.__closure__ or ()]
        found = [source, *map(self.of, (value.__code__, value.__defaults__, value.__kwdefaults__, held))]
        names = sorted(_names(value.__code__))
        for name in names:
            if name not in value.__globals__:
                continue
            named = value.__globals__[name]
            # the source, if available, determines other objects
            if source and not (isinstance(named, (*DATA, ModuleType)) or callable(named)):
                continue
            found += [name.encode(), self.of(named)]
            if isinstance(named, ModuleType) and _source(named):
                found += [self.of(x) for x in (vars(named).get(name) for name in names) if isinstance(x, DATA)]
                found += [self.of(x) for x in (vars(named).get(name) for name in names) if callable(x)]
        return found

    def _object(self, value: Any) -> list[bytes]:
        """Return the data for pickle to restore an object."""
        found = [self.of(type(value))]
        if (wrapped := getattr(value, "__wrapped__", None)) is not None:
            found.append(self.of(wrapped))
        try:
            made = value.__reduce_ex__(4)
        except Exception:
            text = re.sub(r" at 0x[0-9a-fA-F]+", "", repr(value))
            return [*found, text.encode(), self.of(getattr(value, "__dict__", None))]
        if isinstance(made, str):
            return [*found, made.encode()]
        return found + [self.of(x if isinstance(x, PLAIN) or not isinstance(x, Iterator) else list(x)) for x in made]


def _joined(found: Iterable[bytes]) -> bytes:
    text = hashlib.sha256()
    for part in found:
        text.update(len(part).to_bytes(8, "little") + part)
    return text.digest()


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # the cell is still empty
        return None


def _names(code: CodeType) -> set[str]:
    """Return the names in a code object, including nested code objects."""
    return set(code.co_names).union(*(_names(x) for x in code.co_consts if isinstance(x, CodeType)))


def _source(module: ModuleType | None) -> bytes:
    """Return the source of a user module, or empty bytes."""
    if module is None or _of_library(module):
        return b""
    try:
        return inspect.getsource(module).encode()
    except (OSError, TypeError):  # a notebook or a compiled module
        return b""


@functools.cache
def _libraries() -> tuple[Path, ...]:
    paths = sysconfig.get_paths()
    return tuple(Path(paths[key]).resolve() for key in ("stdlib", "platstdlib", "purelib", "platlib"))


def _of_library(value: Any) -> bool:
    """Return whether a module, function or class belongs to an installed package."""
    module = value if isinstance(value, ModuleType) else sys.modules.get(getattr(value, "__module__", None) or "")
    if module is None or module.__name__ == "__main__":
        return False
    if module.__name__.partition(".")[0] == __name__.partition(".")[0]:
        return True
    if (file := getattr(module, "__file__", None)) is None:
        return module.__name__ in sys.builtin_module_names
    return any(folder in Path(file).resolve().parents for folder in _libraries())
