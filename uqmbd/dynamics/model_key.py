"""Keys of models: digests of all data of a model, without evaluation of the terms of its components.

The terms of a component, also of a user's class, are determined by the code of its class and by its values.  A
mechanism with a part of unknown code or value has no key, and its model is not stored.  A mechanism with controllers
also has no key, because users write the functions of controllers.

SymPy's text (`sympy.srepr`) takes ten times as long, and omits the meaning of random variables and angles.
"""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import scipy
import sympy
from sympy.core.singleton import Singleton

from uqmbd.dynamics.code_digest import Content, NoDigest, code_of, is_library, unpatched
from uqmbd.mechanism import (
    AngleSymbol,
    AttachedFrame,
    AuxiliarySymbol,
    Component,
    EventTime,
    Mechanism,
    ReactionSymbol,
    ScalarSymbol,
    SplineTable,
    StateSymbol,
    coordinates_of,
    t,
)
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["Digests", "compute_model_key"]

PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), type(NotImplemented))

CONTAINERS = (dict, list, tuple, set, frozenset, str, bytes, bytearray, int, float, complex, np.ndarray)
"""Types with subclasses that may contain more data than their attributes."""

OF_OBJECTS = frozenset(
    {
        "name",
        "world_pose",
        "attached",
        "given",
        "values",
        "read",
        "prepared_from",
        "settled",
        "stating",
        "_quantities",
        "coordinate_set",
        "settled_space",
    }
)
"""Attributes of every component that are not digested directly.

`Digests.component` adds name, bodies, values and coordinates; the other attributes in this set do not affect the
equations."""


def compute_model_key(mechanism: Mechanism, *others: object, rows: Array | None = None) -> str | None:
    """Return a digest of a mechanism and other plain data, or None if part of the content is unknown.

    The key also contains the input values `rows`.
    """
    if mechanism.controllers or not unpatched():
        return None
    try:
        digests = Digests(mechanism)
        about = digests.of((*others, rows, scipy.__version__, *digests.mechanism()))
        return hashlib.sha256(about + digests.code()).hexdigest()
    except NoDigest:
        return None


class Digests:
    """Digests of the parts of a mechanism; the digest of a part depends only on its content.

    Classes and functions may refer to each other in cycles. A digest therefore contains their numbers, in the order of
    first occurrence, and `code` is the digest of all of them.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.of_mechanism = mechanism
        named: list[tuple[str, Any]] = [("ground", mechanism.ground)]
        named += [(f"body {name}", body) for name, body in mechanism.bodies.items()]
        named += [(f"terms {name}", body.terms) for name, body in mechanism.bodies.items()]
        named += [(f"component {name}", component) for name, component in mechanism.components.items()]
        sets = ((c.name, coordinates_of(c)) for c in mechanism.components.values())
        named += [(f"coordinates {name}", one) for name, one in sets if one is not None]
        self.owners = {id(value): name for name, value in named}
        self.inputs = frozenset(mechanism.inputs.variables)
        self.numbers: dict[int, int] = {}
        self.contents: list[Content] = []
        """Contents of classes and functions, by number."""
        self.known: dict[int, tuple[Any, bytes]] = {}
        """Values and their digests, by `id`; the reference to a value prevents Python from reusing its `id`."""
        self.open: set[int] = set()

    def mechanism(self) -> Sequence[Any]:
        """Return all data that define a mechanism, in a form for `of`."""
        m = self.of_mechanism
        inputs = m.inputs
        bodies = [(name, type(b), b.pose) for name, b in m.bodies.items()]
        components = [self.component(c) for c in m.all_components()]
        described = [list(x.items()) for x in (m.outputs, m.scalars, m.requirements, m.margins, m.conditions)]
        units = [v.units for v in inputs.variables]
        return type(m), m.name, m.space, bodies, components, described, inputs.names, units, inputs.means

    def component(self, component: Component) -> Sequence[Any]:
        """Return all data that define a component."""
        attached = [(role, *self.frame(frame)) for role, frame in component.attached.items()]
        more = sorted(vars(component).keys() - OF_OBJECTS)
        declared = [(key, parameter) for key, parameter in component.parameters().items()]
        own = [(key, vars(component)[key]) for key in more]
        coordinates = coordinates_of(component)
        stated = [] if coordinates is None else list(coordinates.declared.items())
        return type(component), component.name, attached, list(component.values.items()), declared, own, stated

    def frame(self, frame: Any) -> tuple[Any, ...]:
        """Return all data that define an attached frame: its carrier, and its motion relative to the carrier."""
        if isinstance(frame, AttachedFrame):
            return frame.name, self.owner(frame.body), frame.offset, frame.turned
        return (self.owner(frame),)

    def owner(self, value: object) -> str:
        """Return the name of a body, the ground or a component."""
        name = self.owners.get(id(value))
        if name is None:
            raise NoDigest
        return name

    def code(self) -> bytes:
        """Return the digest of all classes and functions of the key, and of all classes and functions they refer to."""
        text, done = hashlib.sha256(), 0
        while done < len(self.contents):
            head, parts = self.contents[done]
            text.update(repr((head, len(parts))).encode() + b"".join([self.of(x) for x in parts]))
            done += 1
        return text.digest()

    def of(self, value: Any) -> bytes:
        """Return the digest of a value."""
        found = self.known.get(id(value))
        if found is None:
            head, parts = self.parts(value)
            if id(value) in self.open:
                raise NoDigest  # a value that contains itself
            self.open.add(id(value))
            content = repr((head, len(parts))).encode() + b"".join([self.of(x) for x in parts])
            self.open.discard(id(value))
            found = self.known[id(value)] = value, hashlib.sha256(content).digest()
        return found[1]

    def parts(self, value: Any) -> Content:
        """Return the plain content of a value, and its parts."""
        kind = type(value)
        if kind in PLAIN:
            return (kind.__name__, value), ()
        if kind in (tuple, list):
            return kind.__name__, value
        if kind is dict:
            return "dict", [x for pair in value.items() for x in pair]
        if kind in (set, frozenset):
            return (kind.__name__, sorted(self.of(x) for x in value)), ()
        if isinstance(value, sympy.Basic):
            return self.expression(value)
        if isinstance(value, sympy.MatrixBase):
            return ("matrix", value.shape), value.flat()
        if (kind is np.ndarray or isinstance(value, np.generic)) and value.dtype.kind in "biufc":
            return ("array", value.dtype.str, value.shape, value.tobytes()), ()
        if id(value) in self.owners:
            return ("owner", self.owner(value)), ()
        if isinstance(value, enum.Enum):
            return ("member", value.name), [kind, value.value]
        if (content := code_of(value)) is not None:
            return ("code", self.number(value, content)), ()
        if isinstance(value, CONTAINERS):
            raise NoDigest  # subclasses of containers may contain more data than their attributes
        if is_dataclass(value):
            names = [x.name for x in fields(value)]
            if vars_of(value).keys() - set(names):
                raise NoDigest
            return ("data", names), [kind, *(getattr(value, x) for x in names)]
        if is_library(kind.__module__) and vars_of(value):
            raise NoDigest
        if any(vars(one).get("__slots__") for one in kind.__mro__):
            raise NoDigest
        return ("object", sorted(vars_of(value))), [kind, *(x for _, x in sorted(vars_of(value).items()))]

    def number(self, value: Any, content: Content) -> int:
        """Return the number of a class or function, and keep a reference to it."""
        if id(value) not in self.numbers:
            self.numbers[id(value)] = len(self.contents)
            self.contents.append(content)
        return self.numbers[id(value)]

    def expression(self, value: sympy.Basic) -> Content:
        """Return the content of an object of SymPy."""
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
            raise NoDigest
        return (kind.__module__, kind.__name__), value.args if is_library(kind.__module__) else [kind, *value.args]

    def symbol(self, value: Any) -> Content:
        """Return the content of a symbol."""
        kind = type(value)
        if value is t:
            return "time", ()
        if kind is sympy.Symbol:
            return ("symbol", value._hashable_content()), ()
        about = (kind.__module__, kind.__qualname__, value.name)
        if not is_library(kind.__module__):
            raise NoDigest
        if isinstance(value, RandomVariable):
            if value not in self.inputs:
                raise NoDigest
            return about, ()
        if isinstance(value, StateSymbol):
            return (*about, self.owner(value.owner), value.quantity, value.index), ()
        if isinstance(value, ReactionSymbol):
            return (*about, self.owner(value.component), value.quantity, value.index), ()
        if isinstance(value, AngleSymbol):
            return (*about, self.owner(value.owner)), (value.angle,)
        if isinstance(value, EventTime):
            return (*about, self.owner(value.component), value.label), ()
        if isinstance(value, AuxiliarySymbol):
            return (*about, self.owner(value.component), value.state), ()
        if isinstance(value, ScalarSymbol):
            return (*about, value.quantity, value.number, value.at), ()
        raise NoDigest


def vars_of(value: Any) -> dict[str, Any]:
    """Return the attributes of an object; raise if its attributes are elsewhere."""
    if not hasattr(value, "__dict__"):
        raise NoDigest
    return dict(vars(value))
