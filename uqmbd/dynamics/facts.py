"""A mechanism in facts: a digest of all that its model is made from, without asking its components for their terms.

What a component of uqmbd states follows from its type, from the code of uqmbd, and from its values, which are written
down here.  Components, spaces and functions that are written elsewhere may state anything: a mechanism with one of them
has no such digest.  Nor has one with controllers, whose functions are the user's.

SymPy's own text (`sympy.srepr`) takes ten times as long, and leaves out what random variables and angles stand for.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from types import FunctionType, GetSetDescriptorType, MemberDescriptorType
from typing import Any

import numpy as np
import scipy
import sympy
from sympy.core.singleton import Singleton

from uqmbd.compiled import source_digest
from uqmbd.mechanism import (
    BEGUN,
    AngleSymbol,
    Component,
    EventTime,
    Mechanism,
    Parameter,
    ReactionSymbol,
    ScalarSymbol,
    SplineTable,
    StateSymbol,
    t,
)
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["facts_of"]

OWN = ("uqmbd", "uqmbd_contact", "uqmbd_drivers", "uqmbd_joints", "uqmbd_springs")
"""Packages whose code belongs to this version of uqmbd."""

WRITING = ("uqmbd.compiled", "uqmbd.dynamics", "uqmbd.mechanism")
"""Those parts of uqmbd that write equations."""

LIBRARIES = (
    "abc", "collections", "contextlib", "copy", "dataclasses", "enum", "functools", "hashlib", "html", "importlib",
    "inspect", "itertools", "json", "math", "numpy", "operator", "os", "pathlib", "scipy", "symengine", "sympy",
    "typing", "warnings",
)  # fmt: skip
"""Packages whose functions modules of uqmbd hold."""

PLAIN = (bool, int, float, complex, str, bytes, type(None))

OF_OBJECTS = frozenset(
    {"name", "world_pose", "attached", "given", "values", "read", "prepared_from", "settled", "stating", "_told"}
)
"""What a component has of its own: its equations follow from its name, what it is attached to, and its values."""

ALIKE = 2.0
"""Seconds before the start of the program in which code may have been edited while it was being read."""


class _Unknown(Exception):  # noqa: N818 - no error: there is no digest
    """Something is not known by its facts."""


def facts_of(mechanism: Mechanism, *others: object, rows: Array | None = None) -> str | None:
    """Return a digest of a mechanism, or None where it is not known by its facts.

    Parameters
    ----------
    mechanism : Mechanism
        What to look at.
    *others : plain data
        What else a model depends on.
    rows : array, optional
        Values of its inputs that are looked at besides the means.
    """
    try:
        facts = _Facts(mechanism)
        about = facts.of((*others, rows, scipy.__version__, *facts.mechanism()))
        return hashlib.sha256(about + b"".join(facts.sources())).hexdigest()
    except _Unknown:
        return None


class _Facts:
    """Digests of the parts of a mechanism; that of a part depends on nothing but its content."""

    def __init__(self, mechanism: Mechanism) -> None:
        if mechanism.controllers or not _untouched():
            raise _Unknown
        self.of_mechanism = mechanism
        named: list[tuple[str, Any]] = [("ground", mechanism.ground)]
        named += [(f"body {name}", body) for name, body in mechanism.bodies.items()]
        named += [(f"terms {name}", body.terms) for name, body in mechanism.bodies.items()]
        named += [(f"component {name}", component) for name, component in mechanism.components.items()]
        self.owners = {id(value): name for name, value in named}
        self.inputs = frozenset(mechanism.inputs.variables)
        self.packages: set[str] = set()
        self.types: dict[type, str] = {}
        self.declarations: dict[type, Sequence[Any]] = {}
        self.known: dict[int, tuple[Any, bytes]] = {}
        """What was looked at, and its digest, by identity: it stays alive as long as its number means it."""

    def mechanism(self) -> Sequence[Any]:
        """Return all facts, as data that `of` takes."""
        m = self.of_mechanism
        inputs = m.inputs
        bodies = [(name, self.own(type(b)), b.pose) for name, b in m.bodies.items()]
        components = [self.component(c) for c in m.all_components()]
        described = [list(x.items()) for x in (m.outputs, m.scalars, m.requirements, m.margins, m.conditions)]
        return self.own(type(m)), m.name, m.space, bodies, components, described, inputs.names, inputs.means

    def component(self, component: Component) -> Sequence[Any]:
        """Return the facts of a component."""
        if not vars(component).keys() <= OF_OBJECTS:
            raise _Unknown
        attached = [(role, self.owner(frame)) for role, frame in component.attached.items()]
        kind = type(component)
        return self.own(kind), component.name, attached, list(component.values.items()), self.declared(kind)

    def declared(self, kind: type[Component]) -> Sequence[Any]:
        """Return what a type of component says of itself in data."""
        if kind not in self.declarations:
            names = ("bodies", "grounded", "symbol", "prescribed_angle")
            ranges = [
                (
                    x,
                    *(
                        getattr(p, y)
                        for y in ("kind", "units", "minimum", "maximum", "exclusive", "body", "about", "axes")
                    ),
                )
                for x, p in kind.parameters().items()
            ]
            self.declarations[kind] = [[getattr(kind, x) for x in names], ranges]
        return self.declarations[kind]

    def owner(self, value: object) -> str:
        """Name a body, the ground or a component."""
        name = self.owners.get(id(value))
        if name is None:
            raise _Unknown
        return name

    def own(self, kind: type) -> str:
        """Name a type that belongs to uqmbd, with all that it inherits."""
        if kind in self.types:
            return self.types[kind]
        for base in kind.__mro__[:-1]:
            package = base.__module__.partition(".")[0]
            if package in OWN:
                self.packages.add(package)
                if not _original(base):
                    raise _Unknown
            elif package != "sympy" and base.__module__ not in ("abc", "typing", "enum", "builtins"):
                raise _Unknown
        name = self.types[kind] = f"{kind.__module__}.{kind.__qualname__}"
        return name

    def sources(self) -> Iterable[bytes]:
        """Yield the digests of the packages that have a share in it; `uqmbd` itself is in every key of the cache."""
        for package in sorted(self.packages - {"uqmbd"}):
            digest = _sources(package)
            if digest is None:
                raise _Unknown
            yield digest
            for name in sorted(x for x in sys.modules if x.partition(".")[0] == package):
                # tables and constants, which may be written to
                held = {key: x for key, x in vars(sys.modules[name]).items() if key.isupper()}
                yield self.of([(name, key, x) for key, x in held.items() if isinstance(x, (*PLAIN, tuple, dict))])

    def of(self, value: Any) -> bytes:
        """Digest of a value."""
        found = self.known.get(id(value))
        if found is None:
            head, parts = self.parts(value)
            content = repr((head, len(parts))).encode() + b"".join([self.of(x) for x in parts])
            found = self.known[id(value)] = value, hashlib.sha256(content).digest()
        return found[1]

    def parts(self, value: Any) -> tuple[object, Sequence[Any]]:
        """Return what is plain about a value, and its parts."""
        kind = type(value)
        if kind in PLAIN:
            return (kind.__name__, value), ()
        if kind in (tuple, list):
            return kind.__name__, value
        if kind is dict:
            return "dict", [x for pair in value.items() for x in pair]
        if isinstance(value, sympy.Basic):
            return self.expression(value)
        if isinstance(value, sympy.MatrixBase):
            return ("matrix", value.shape), value.flat()
        if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in "biufc":
            return ("array", value.dtype.str, value.shape, value.tobytes()), ()
        if is_dataclass(value) and not isinstance(value, type):
            names = [x.name for x in fields(value)]
            return ("data", self.own(kind), names), [getattr(value, x) for x in names]
        if isinstance(value, type):
            return ("type", value.__module__, value.__qualname__), ()
        return ("owner", self.owner(value)), ()

    def expression(self, value: sympy.Basic) -> tuple[object, Sequence[Any]]:
        """Do the same for what belongs to SymPy."""
        kind: Any = type(value)
        if value.is_Symbol:
            return self.symbol(value)
        if isinstance(value, sympy.Float):
            return ("Float", value._mpf_, value._prec), ()
        if isinstance(value, sympy.Rational):
            return ("Rational", value.p, value.q), ()
        if isinstance(value, SplineTable):
            return ("table", value.digest), ()
        if isinstance(kind, Singleton):
            return ("singleton", kind.__name__), ()
        if not value.args or not isinstance(kind.__module__, str):
            raise _Unknown
        if kind.__module__.partition(".")[0] != "sympy":
            self.own(kind)
        return (kind.__module__, kind.__name__), value.args

    def symbol(self, value: Any) -> tuple[object, Sequence[Any]]:
        """Do the same for a symbol."""
        kind = type(value)
        if value is t:
            return "time", ()
        if kind is sympy.Symbol:
            return ("symbol", value._hashable_content()), ()
        about = (self.own(kind), value.name)
        if isinstance(value, RandomVariable):
            if value not in self.inputs:
                raise _Unknown
            return about, ()
        if isinstance(value, StateSymbol):
            return (*about, self.owner(value.owner), value.quantity, value.index), ()
        if isinstance(value, ReactionSymbol):
            return (*about, self.owner(value.component), value.quantity, value.index), ()
        if isinstance(value, AngleSymbol):
            return (*about, self.owner(value.owner)), (value.angle,)
        if isinstance(value, EventTime):
            return (*about, self.owner(value.component), value.label), ()
        if isinstance(value, ScalarSymbol):
            return (*about, value.quantity, value.number, value.at), ()
        raise _Unknown


def _original(kind: type) -> bool:
    """Whether a type is the one that its module defined, and all that can be called in it was written by uqmbd."""
    found: Any = sys.modules.get(kind.__module__)
    for name in kind.__qualname__.split("."):
        found = getattr(found, name, None)
    return found is kind and all(map(_written, vars(kind).values()))


def _untouched() -> bool:
    """Whether functions of all modules that write equations were written by uqmbd, or belong to a library."""
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] in OWN[1:] or name.startswith(WRITING):
            for value in list(vars(module).values()):
                plain = isinstance(value, (FunctionType, partial)) or hasattr(value, "cache_info")
                if plain and not _written(value, LIBRARIES):
                    return False
    return True


def _written(value: Any, libraries: tuple[str, ...] = ()) -> bool:
    """Whether what stands in a type or a module was written in the folders of uqmbd, or of a library; data are."""
    if isinstance(value, property):
        return all(_written(x) for x in (value.fget, value.fset, value.fdel) if x is not None)
    if isinstance(value, (classmethod, staticmethod)):
        return _written(value.__func__)
    if isinstance(value, cached_property):
        return _written(value.func)
    if isinstance(value, FunctionType):
        if str(value.__module__).partition(".")[0] in libraries:
            return True
        file = value.__code__.co_filename
        generated = file == "<string>" and value.__name__.startswith("__")  # by dataclasses
        generated |= file in (contextlib.__file__, dataclasses.__file__) and hasattr(value, "__wrapped__")
        inner = [getattr(value, "__wrapped__", None), *(_content(x) for x in value.__closure__ or ())]
        held = [x for x in inner if isinstance(x, (FunctionType, partial))]
        return (generated or file.startswith(_folders())) and all(_written(x, libraries) for x in held)
    if hasattr(value, "cache_info"):
        return _written(value.__wrapped__, libraries)
    if isinstance(value, type):
        return value.__module__.partition(".")[0] in OWN
    if isinstance(value, (Parameter, GetSetDescriptorType, MemberDescriptorType)):
        return True
    return not callable(value) and not hasattr(type(value), "__get__")


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # it is empty
        return None


def _folders() -> tuple[str, ...]:
    """Return the folders of the packages of uqmbd that are loaded."""
    return tuple(_folder(name) for name in OWN if name in sys.modules)


@cache
def _folder(package: str) -> str:
    return f"{os.path.dirname(sys.modules[package].__file__ or '')}{os.sep}"


@cache
def _sources(package: str) -> bytes | None:
    """Digest of the sources of a package; None where they were written after this program began to read them."""
    file = sys.modules[package].__file__
    if file is None:
        return None
    folder = Path(file).parent
    if any(path.stat().st_mtime >= BEGUN - ALIKE for path in folder.rglob("*.py")):
        return None
    return source_digest([folder])
