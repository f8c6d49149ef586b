"""A mechanism in facts: a digest of all that its model is made from, without asking its components for their terms.

What a component of uqmbd states follows from its type, from the code of uqmbd, and from its values, which are written
down here.  Components, spaces and functions that are written elsewhere may state anything: a mechanism with one of them
has no such digest.  Nor has one with controllers, whose functions are the user's.

SymPy's own text (`sympy.srepr`) takes ten times as long, and leaves out what random variables and angles stand for.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from types import FunctionType
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

PLAIN = (bool, int, float, complex, str, bytes, type(None))

OF_OBJECTS = frozenset({"name", "world_pose", "attached", "given", "values", "read", "settled", "stating", "_told"})
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
        if mechanism.controllers:
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
        self.known: dict[int, tuple[Any, bytes]] = {}
        """What was looked at, and its digest, by identity: it stays alive as long as its number means it."""

    def mechanism(self) -> Sequence[Any]:
        """Return all facts, as data that `of` takes."""
        m = self.of_mechanism
        inputs = m.inputs
        bodies = [(name, self.own(type(b)), b.pose) for name, b in m.bodies.items()]
        components = [self.component(c) for c in m.all_components()]
        described = [list(x.items()) for x in (m.outputs, m.scalars, m.conditions)]
        return self.own(type(m)), m.name, m.space, bodies, components, described, inputs.names, inputs.means

    def component(self, component: Component) -> Sequence[Any]:
        """Return the facts of a component."""
        if not vars(component).keys() <= OF_OBJECTS:
            raise _Unknown
        attached = [(role, self.owner(frame)) for role, frame in component.attached.items()]
        return self.own(type(component)), component.name, attached, list(component.values.items())

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
        if isinstance(value, Mapping):
            raise _Unknown
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
    """Whether a type is the one that its module defined, and so are its methods."""
    found: Any = sys.modules.get(kind.__module__)
    for name in kind.__qualname__.split("."):
        found = getattr(found, name, None)
    methods = [x for x in vars(kind).values() if isinstance(x, FunctionType)]
    return found is kind and all(str(x.__module__).partition(".")[0] in OWN for x in methods)


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
