"""The public names of uqmbd and of its built-in plugins, as the packages list them themselves."""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
from types import ModuleType
from typing import Any

__all__ = ["CORE", "PLUGINS", "file_names", "kind", "public_names", "told_at_its_place"]

CORE = ("uqmbd", "uqmbd.laws", "uqmbd.results", "uqmbd.report", "uqmbd.testing", "uqmbd.typing")
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
