"""The public names of uqmbd and of its built-in plugins, as the packages list them themselves."""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
import typing
from collections.abc import Iterator
from types import ModuleType
from typing import Any

__all__ = ["CORE", "PLUGINS", "file_names", "kind", "owners", "public_names", "returned", "told_at_its_place"]

CORE = (
    "uqmbd",
    "uqmbd.extend",
    "uqmbd.laws",
    "uqmbd.results",
    "uqmbd.report",
    "uqmbd.shapes",
    "uqmbd.testing",
    "uqmbd.typing",
)
"""Public modules of uqmbd."""

PLUGINS = (
    "uqmbd_joints",
    "uqmbd_drivers",
    "uqmbd_springs",
    "uqmbd_contact",
    "uqmbd_montecarlo",
    "uqmbd_collocation",
    "uqmbd_galerkin",
    "uqmbd_reliability",
    "uqmbd_calibration",
    "uqmbd_models",
    "uqmbd_processes",
    "uqmbd_fmi",
    "uqmbd_geometry",
    "uqmbd_flexible",
)
"""Packages of built-in plugins."""


def public_names(module: str) -> dict[str, Any]:
    """Return the objects that a module lists in ``__all__``, in alphabetical order; modules are not among them."""
    found = importlib.import_module(module)
    objects = {name: getattr(found, name) for name in sorted(found.__all__, key=lambda name: (name.lower(), name))}
    return {name: x for name, x in objects.items() if not isinstance(x, ModuleType) and name != "__version__"}


def kind(found: Any) -> str:
    """Return what an object is: ``exception``, ``class``, ``function`` or ``data``."""
    if isinstance(found, type):
        return "exception" if issubclass(found, BaseException) else "class"
    return "function" if inspect.isroutine(found) else "data"


def file_names(module: str) -> dict[str, str]:
    """Return the name of the page of each public name: without those that differ in capitals alone."""
    names = list(public_names(module))
    lower = [name.lower() for name in names]
    return {
        name: f"{module}.{name}" + ("-class" if lower.count(name.lower()) > 1 and name[0].isupper() else "")
        for name in names
    }


def returned() -> dict[type, list[str]]:
    """Return the classes that are not public by name but are what public functions and methods return, and which."""
    everything = {(module, name): x for module in (*CORE, *PLUGINS) for name, x in public_names(module).items()}
    public = {id(x) for x in everything.values()}
    found: dict[type, list[str]] = {}
    for (module, name), x in everything.items():
        owned = [one for owner in owners(x) for one in vars(owner).items()] if kind(x) == "class" else ()
        functions = {f"{module}.{name}": x} if kind(x) == "function" else {}
        functions |= {f"{module}.{name}.{key}": f for key, f in owned if not key.startswith("_")}
        for place, function in functions.items():
            for cls in _classes(_stated_return(function)):
                if cls.__module__.startswith("uqmbd") and id(cls) not in public:
                    found.setdefault(cls, []).append(place)
    return dict(sorted(found.items(), key=lambda item: item[0].__name__))


def owners(cls: type) -> list[type]:
    """Return the classes whose members the page of a class shows: it, and the base that holds its data."""
    return [x for x in cls.__mro__ if x is cls or x.__name__ == f"{cls.__name__}Data"]


def _stated_return(function: Any) -> Any:
    """Return the annotation of what a function, method or property returns, or None."""
    plain = function.fget if isinstance(function, property) else getattr(function, "__func__", function)
    try:
        return typing.get_type_hints(plain).get("return") if inspect.isfunction(plain) else None
    except NameError:  # a type that is known to checkers of types only
        return None


def _classes(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and not typing.get_args(annotation):
        yield annotation
    for argument in typing.get_args(annotation):
        yield from _classes(argument)


def told_at_its_place(name: str, found: Any) -> str:
    """Return what stands below the assignment of an object that has no docstring of its own, or nothing."""
    for module in [name for name in sys.modules if name.split(".")[0].split("_")[0] == "uqmbd"]:
        if vars(sys.modules[module]).get(name) is found and (told := _after_assignment(module, name)):
            return told
    return ""


def _after_assignment(module: str, name: str) -> str:
    """Return the text that stands alone behind the assignment of a name, or nothing."""
    try:
        body = ast.parse(inspect.getsource(sys.modules[module])).body
    except (OSError, TypeError):
        return ""
    for statement, behind in zip(body, body[1:], strict=False):
        targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
        if any(isinstance(target, ast.Name) and target.id == name for target in targets):
            text = behind.value if isinstance(behind, ast.Expr) else None
            return (
                " ".join(text.value.split()) if isinstance(text, ast.Constant) and isinstance(text.value, str) else ""
            )
    return ""
