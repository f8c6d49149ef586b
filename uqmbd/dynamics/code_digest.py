"""Content of functions and classes as plain data: their code, and all objects that the code refers to.

The content of a function is its code object, defaults, closure values and named globals. The content of a class is its
bases and attributes.  Names identify packages whose versions are in every key of the cache (`LIBRARIES`).  Objects
without such content, for example from a compiled library, raise `NoDigest`.
"""

from __future__ import annotations

import dis
import sys
import types
from collections.abc import Iterator, Sequence
from functools import cache, cached_property, partial, partialmethod
from types import CodeType, FunctionType, ModuleType
from typing import Any

from uqmbd.plugins import contact_laws

__all__ = ["NoDigest", "code_of", "is_library", "unpatched"]

LIBRARIES = frozenset({"numpy", "pluggy", "scipy", "sympy", "symengine", "uqmbd", *sys.stdlib_module_names})
"""Packages with versions or sources in every key."""

PURE = frozenset(
    {
        "__future__", "abc", "builtins", "cmath", "collections", "contextlib", "copy", "dataclasses", "decimal", "enum",
        "fractions", "functools", "itertools", "math", "numbers", "numpy", "operator", "pluggy", "re", "scipy",
        "statistics", "string", "symengine", "sympy", "types", "typing", "uqmbd", "warnings",
    }
)  # fmt: skip
"""Packages in `LIBRARIES` whose functions, except `IMPURE`, are deterministic in their arguments."""

IMPURE = frozenset(
    {
        "DataSource", "__dict__", "__import__", "attrgetter", "compile", "default_rng", "eval", "exec", "fromfile",
        "fromregex", "genfromtxt", "getenv", "globals", "hb_read", "import_module", "load", "load_npz", "loadmat",
        "loadtxt", "locals", "memmap", "methodcaller", "mmread", "netcdf_file", "open", "random", "readsav", "rvs",
        "vars",
    }
)  # fmt: skip
"""Names of functions whose results depend on more than their arguments."""

REGISTRY = "uqmbd.plugins.registry"
"""Module with functions that return objects registered by plugins: code outside the version of the core."""

WRITING = ("uqmbd.compiled", "uqmbd.dynamics", "uqmbd.mechanism")
"""Parts of the core that derive equations."""

UNSEEN = frozenset(
    {
        "__abstractmethods__", "__annotations__", "__dataclass_fields__", "__dataclass_params__", "__dict__", "__doc__",
        "__firstlineno__", "__match_args__", "__module__", "__orig_bases__", "__parameters__", "__qualname__",
        "__signature__", "__slots__", "__static_attributes__", "__weakref__", "_abc_impl",
    }
)  # fmt: skip
"""Attributes of classes that do not affect their methods."""

LOADS = (dis.opmap["LOAD_GLOBAL"], dis.opmap["LOAD_NAME"])
IMPORT, EXTENDED = dis.opmap["IMPORT_NAME"], dis.opmap["EXTENDED_ARG"]
FUNCTIONS = (FunctionType, partial, type(cache(len)))
SLOTS = (types.GetSetDescriptorType, types.MemberDescriptorType)
COMPILED = (
    types.BuiltinFunctionType, types.MethodDescriptorType, types.WrapperDescriptorType, types.MethodWrapperType,
    types.ClassMethodDescriptorType,
)  # fmt: skip

Content = tuple[object, Sequence[Any]]
"""Plain content, and parts with their own content."""


class NoDigest(Exception):  # noqa: N818 - no error: there is no digest
    """The content of an object is unknown."""


def is_library(name: str | None, packages: frozenset[str] = PURE) -> bool:
    """Return whether a module belongs to a package identified by its version."""
    return str(name).partition(".")[0] in packages


def code_of(value: Any) -> Content | None:
    """Return the content of a function, class, module or descriptor; None for other values.

    Raises `NoDigest` if the value is such an object with unknown content.
    """
    if isinstance(value, FunctionType):
        return _function(value)
    if isinstance(value, type):
        return _class(value)
    if isinstance(value, (classmethod, staticmethod)):
        return type(value).__name__, [value.__func__]
    if isinstance(value, property):
        return "property", [value.fget, value.fset, value.fdel]
    if isinstance(value, cached_property):
        return "cached property", [value.func]
    if isinstance(value, (partial, partialmethod)):
        return type(value).__name__, [value.func, value.args, dict(value.keywords)]
    if isinstance(value, types.MethodType):
        return "method", [value.__func__, value.__self__]
    if hasattr(type(value), "cache_info"):
        return "cached", [value.__wrapped__]
    if isinstance(value, COMPILED):
        owner = getattr(value, "__objclass__", None)
        module = owner.__module__ if owner is not None else getattr(value, "__module__", None)
        if not is_library(module) or isinstance(getattr(value, "__self__", None), types.MethodWrapperType):
            raise NoDigest
        return ("compiled", module, value.__qualname__), ()
    if isinstance(value, ModuleType):
        raise NoDigest  # the code may use any part of the module
    return None


def _function(value: FunctionType) -> Content:
    scope, code = value.__globals__, value.__code__
    wrapped = [x for x in map(_held, value.__closure__ or ()) if isinstance(x, (FunctionType, partial, type))]
    if is_library(scope.get("__name__")):
        if value.__name__ in IMPURE:
            raise NoDigest
        # the version of the core determines closures, except for the functions in them
        cells = wrapped if scope["__name__"].startswith("uqmbd.") else [_held(x) for x in value.__closure__ or ()]
        cells = [*cells, *_looked_up(value)]
        return ("library", scope["__name__"], value.__qualname__, _head(code) if cells else ()), cells
    loaded, attributes = _names(code)
    parts: list[Any] = [value.__defaults__, value.__kwdefaults__, *map(_held, value.__closure__ or ())]
    for name in loaded:
        if name in scope:
            parts += [name, *_taken(scope[name], attributes, known="getattr" not in loaded)]
    return ("function", _head(code)), parts


def _looked_up(value: FunctionType) -> list[Any]:
    """Return the objects that a library function may find by names registered by plugins."""
    named = [value, *(value.__globals__.get(name) for name in value.__code__.co_names)]
    lookups = [x.__name__ for x in named if isinstance(x, FunctionType) and x.__globals__.get("__name__") == REGISTRY]
    if not lookups:
        return []
    if not {"contact_law", "contact_laws"}.issuperset(lookups):
        raise NoDigest
    try:
        return [part for name, kind in sorted(contact_laws().items()) for part in (name, kind().law())]
    except Exception as error:
        raise NoDigest from error


def _class(value: type) -> Content:
    name = (value.__module__, value.__qualname__)
    if is_library(value.__module__):
        if value.__module__.startswith("uqmbd.") and not _as_written(value):
            raise NoDigest
        return ("class", *name), ()
    own = {key: x for key, x in vars(value).items() if key not in UNSEEN and not isinstance(x, SLOTS)}
    return ("class", *name, sorted(own)), [*value.__mro__[1:], type(value), *(own[key] for key in sorted(own))]


def _taken(value: Any, attributes: frozenset[str], *, known: bool) -> Iterator[Any]:
    """Return the part of a global that code uses; for a foreign module, the attributes that the code may access."""
    if not isinstance(value, ModuleType):
        yield value
    elif is_library(value.__name__):
        yield value.__name__
    elif not known or "__getattr__" in vars(value) or is_library(value.__name__, LIBRARIES):
        raise NoDigest
    else:
        for name in sorted(attributes & vars(value).keys()):
            yield name
            yield from _taken(vars(value)[name], attributes, known=known)


def _held(cell: Any) -> Any:
    """Return the content of a cell of a closure."""
    try:
        return cell.cell_contents
    except ValueError:  # the cell is empty
        return ()


@cache
def _head(code: CodeType) -> tuple[object, ...]:
    """Return the content of a code object and nested code objects, without file names and lines."""
    constants = [_head(x) if isinstance(x, CodeType) else (type(x).__name__, _constant(x)) for x in code.co_consts]
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return code.co_code, getattr(code, "co_exceptiontable", b""), counts, names, tuple(constants)


def _constant(value: object) -> str:
    """Return a constant as text, with sets in a fixed order."""
    return repr(sorted(map(repr, value))) if isinstance(value, frozenset) else repr(value)


@cache
def _names(code: CodeType) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return the globals that code reads, and all names in the code; its imports must be libraries."""
    loaded, extended = set(), 0
    for op, low in zip(code.co_code[::2], code.co_code[1::2], strict=True):
        argument, extended = low | extended, (low | extended) << 8 if op == EXTENDED else 0
        if op in LOADS:
            # the lowest bit of the argument of the first operation encodes the calling convention
            loaded.add(code.co_names[argument >> 1 if op == LOADS[0] else argument])
        elif op == IMPORT and not is_library(code.co_names[argument]):
            raise NoDigest
    attributes = set(code.co_names)
    if attributes & IMPURE:
        raise NoDigest
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            more, others = _names(inner)
            loaded |= set(more)
            attributes |= others
    return tuple(sorted(loaded)), frozenset(attributes)


def unpatched() -> bool:
    """Return whether all functions in modules that derive equations are from the core or from a library."""
    for name, module in list(sys.modules.items()):
        scope = vars(module) if name.startswith(WRITING) else {}
        for value in list(scope.values()):
            if isinstance(value, FunctionType) and value.__globals__.get("__name__") == "lazy_loader":
                own = True  # it imports the modules of a folder, and derives nothing
            elif isinstance(value, FunctionType):
                own = value.__globals__ is scope and not value.__closure__
            else:
                own = not isinstance(value, FUNCTIONS)
            if not (own or _written(value)):
                return False
    return True


def _as_written(kind: type) -> bool:
    """Return whether a class of the core is unchanged since its definition in its module, with its methods."""
    found: Any = sys.modules.get(kind.__module__)
    for name in kind.__qualname__.split("."):
        found = getattr(found, name, None)
    return found is kind and all(
        _written(x) and not isinstance(x, (partial, partialmethod)) for x in vars(kind).values()
    )


def _written(value: Any) -> bool:
    """Return whether all functions in a value are from the core or from a library; True for data."""
    if isinstance(value, FunctionType):
        inner = [getattr(value, "__wrapped__", None), *map(_held, value.__closure__ or ())]
        return is_library(value.__globals__.get("__name__"), LIBRARIES) and all(
            _written(x) for x in inner if isinstance(x, (FunctionType, partial))
        )
    if isinstance(value, (property, classmethod, staticmethod, cached_property, partial, partialmethod)):
        inner = [getattr(value, x, None) for x in ("fget", "fset", "fdel", "__func__", "func")]
        return all(x is None or (_written(x) and not isinstance(x, type)) for x in inner)
    if hasattr(type(value), "cache_info"):
        return _written(value.__wrapped__)
    return is_library(type(value).__module__, LIBRARIES) or not (callable(value) or hasattr(type(value), "__get__"))
