"""Options of methods: what the annotations of their fields allow, for programs and the command line alike."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import sys
import types
import typing
from functools import lru_cache
from numbers import Integral, Rational, Real
from typing import Annotated, Any, ClassVar, Literal, Protocol, Union

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean

__all__ = ["Bounds", "Method", "check_options", "option_types", "plain"]


LARGE = 1000
"""An upper bound from here on is named to those alone who pass it."""


class Method(Protocol):
    """What a node tells of a method: its registered name; its options are its fields."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    name: ClassVar[str]


@dataclasses.dataclass(frozen=True)
class Bounds:
    """Which numbers an option may be, in its annotation: ``order: Annotated[int, uqmbd.extend.Bounds(0)] = 3``.

    Of a tuple each number is meant; one number stands for a tuple of itself.

    Parameters
    ----------
    least, most : float
        A bound that is infinite is none, but the option must be finite.
    above : bool
        Whether `least` itself is too little.

    Examples
    --------
    >>> Bounds(0).words, Bounds(0, above=True).words, Bounds(0, 1).words
    (', 0 or more', ' above 0', ' between 0 and 1')
    """

    least: float
    most: float = math.inf
    above: bool = False

    @property
    def words(self) -> str:
        """What follows the kind of number in a message."""
        if self.most < LARGE:
            return f" between {self.least:g} and {self.most:g}"
        return f" above {self.least:g}" if self.above else f", {self.least:g} or more"

    def hold(self, number: float) -> bool:
        """Tell whether a number lies within."""
        # of any kind of number: NumPy knows neither fractions nor whole numbers of more than 64 bits
        within = bool(self.least <= number <= self.most) and abs(number) < math.inf
        return within and not (self.above and number == self.least)


def check_options(kind: type, options: dict[str, Any]) -> None:
    """Raise StudyError where an option is none of the values that its field in the dataclass declares.

    What is declared as a whole number, a number, a truth, a text or one of some words is looked at; anything else
    (sequences, objects) is left to the method itself.
    """
    declared = option_types(kind)
    for name, value in options.items():
        if name not in declared or _fits(value, declared[name]):
            continue
        words = [x for x in _literals(declared[name]) if isinstance(x, str)]
        near = did_you_mean(value, words) if isinstance(value, str) else ""
        expected = _expected(declared[name], [repr(x) for x in words])
        if most := _passed(value, declared[name]):
            expected += f"; at most {most:g}"
        told = f"{near} Expected {expected}." if near else f"; expected {expected}."
        raise StudyError(f"{kind.__name__}: {name} is {_shown(value)}{told}")


@lru_cache(maxsize=64)
def option_types(kind: type) -> dict[str, Any]:
    """Return the annotations of the fields of a dataclass; one that only a type checker can resolve is left out."""
    found: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        owner = next(base for base in kind.__mro__ if field.name in vars(base).get("__annotations__", {}))
        one = type("One", (), {"__annotations__": {field.name: field.type}, "__module__": owner.__module__})
        with contextlib.suppress(NameError, TypeError):
            found[field.name] = typing.get_type_hints(one, include_extras=True)[field.name]
    return found


def plain(value: Any, annotation: Any) -> Any:
    """Return an option that fits its annotation as a plain number, or a tuple of these, where it has bounds.

    >>> plain(np.int64(3), Annotated[int, Bounds(0)]), plain([1, 2], Annotated[tuple[float, ...], Bounds(0)])
    (3, (1.0, 2.0))
    """
    for member in _members(annotation):
        base, bounds = _bounded(member)
        if _several(base) and isinstance(value, list):
            return tuple(value)
        if bounds is None or value is None or not _is_one(value, member):
            continue
        if typing.get_origin(base) is tuple:
            return tuple(typing.get_args(base)[0](x) for x in _each(value))
        return base(value)
    return value


def _members(annotation: Any) -> tuple[Any, ...]:
    """Return the alternatives of an annotation."""
    if typing.get_origin(annotation) in (Union, types.UnionType):
        return tuple(x for member in typing.get_args(annotation) for x in _members(member))
    return (annotation,)


def _bounded(member: Any) -> tuple[Any, Bounds | None]:
    """Return an alternative without its bounds, and these."""
    if typing.get_origin(member) is not Annotated:
        return member, None
    base, *marks = typing.get_args(member)
    return base, next((mark for mark in marks if isinstance(mark, Bounds)), None)


def _each(value: Any) -> list[Any]:
    """Return the numbers of a row, or the one that stands for a row."""
    if isinstance(value, np.ndarray):
        return list(np.atleast_1d(value))
    return list(value) if isinstance(value, (tuple, list, range)) else [value]


def _several(base: Any) -> bool:
    """Tell whether an alternative is a row of words."""
    return typing.get_origin(base) is tuple and typing.get_origin(typing.get_args(base)[0]) is Literal


def _literals(annotation: Any) -> list[Any]:
    """Return the values that an annotation lists."""
    members = [m for m in _members(annotation) if typing.get_origin(m) is Literal]
    return [x for m in members for x in typing.get_args(m)]


def _fits(value: Any, annotation: Any) -> bool:
    return any(_is_one(value, member) for member in _members(annotation))


def _is_one(value: Any, member: Any) -> bool:
    """Tell whether a value may be of a type; any may where nothing is known of the type."""
    base, bounds = _bounded(member)
    if bounds is not None and typing.get_origin(base) is tuple:
        kind, numbers = typing.get_args(base)[0], _each(value)
        return bool(numbers) and all(_is_one(x, kind) and bounds.hold(x) for x in numbers)
    if _several(base):
        return isinstance(value, (tuple, list)) and all(_is_one(x, typing.get_args(base)[0]) for x in value)
    truth = isinstance(value, (bool, np.bool_))
    if typing.get_origin(base) is Literal:
        return isinstance(value, (str, int, type(None))) and any(
            type(value) is type(x) and value == x for x in typing.get_args(base)
        )
    if base in (None, types.NoneType):
        return value is None
    if base is bool:
        return truth
    if base in (int, float):
        number = isinstance(value, Integral if base is int else Real) and not truth and value == value
        if base is float and isinstance(value, Rational) and _beyond(value):
            return False  # no number of 64 bits holds it
        return number and (bounds is None or bounds.hold(value))
    if base is str:
        return isinstance(value, str)
    if typing.get_origin(base) is np.ndarray:
        return isinstance(value, np.ndarray)
    return True


def _beyond(number: Any, most: float = sys.float_info.max) -> bool:
    """Tell whether a number of any kind is larger than another, which is that of 64 bits."""
    return bool(abs(number) > most)


def _passed(value: Any, annotation: Any) -> float:
    """Return the upper bound that a number, or one of a row, passes; 0: it is not for that that it does not fit."""
    for base, bounds in map(_bounded, _members(annotation)):
        kind = Integral if base is int or (typing.get_origin(base) is tuple and int in typing.get_args(base)) else Real
        if bounds is not None and any(isinstance(x, kind) and _beyond(x, bounds.most) for x in _each(value)):
            return bounds.most if bounds.most >= LARGE else 0
        if bounds is not None and kind is Real and any(isinstance(x, Rational) and _beyond(x) for x in _each(value)):
            return sys.float_info.max
    return 0


def _expected(annotation: Any, words: list[str]) -> str:
    """Say what an annotation allows."""
    named = {int: "a whole number", float: "a number", bool: "True or False", str: "a text"}
    kinds = []
    for base, bounds in map(_bounded, _members(annotation)):
        row = typing.get_origin(base) is tuple and bounds is not None
        if (kind := named.get(typing.get_args(base)[0] if row else base)) is not None:
            kinds.append(kind + (bounds.words if bounds else "") + (" for each input" if row else ""))
    if words:
        kinds.append(f"one of {', '.join(words)}" if len(words) > 1 else words[0])
    for base in filter(_several, _members(annotation)):
        kinds.append(f"a tuple of {', '.join(repr(x) for x in typing.get_args(typing.get_args(base)[0]))}")
    kinds += ["None"] if types.NoneType in _members(annotation) else []
    return (", or " if any("," in kind for kind in kinds[:-1]) else " or ").join(kinds)


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:  # Python writes no whole number of more than 4300 digits
        return f"a {type(value).__name__} of more than 4300 digits"
    return text if len(text) <= 80 else text[:77] + "..."
