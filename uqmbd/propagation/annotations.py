"""Options of methods held against the types that their fields declare."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import types
import typing
from functools import lru_cache
from numbers import Integral, Real
from typing import Any, Literal, Union

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean

__all__ = ["check_options"]


def check_options(kind: type, options: dict[str, Any]) -> None:
    """Raise where an option is none of the values that its field declares.

    What is declared as a whole number, a number, a truth, a text or one of some words is looked at; anything else
    (sequences, objects) is left to the method itself.

    Parameters
    ----------
    kind : type
        A dataclass.
    options : dict
        As they are given.

    Raises
    ------
    uqmbd.StudyError
        Which option, what was given, what was expected.

    Examples
    --------
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> check_options(MonteCarlo, {"sampling": "sobl"})
    Traceback (most recent call last):
    uqmbd.errors.StudyError: MonteCarlo: sampling is 'sobl'; did you mean 'sobol'? Expected one of 'random',
    'latin-hypercube', 'sobol'.
    """
    declared = _declared(kind)
    for name, value in options.items():
        if name not in declared or _fits(value, declared[name]):
            continue
        words = [repr(x) for x in _words(declared[name])]
        near = did_you_mean(value, _words(declared[name])) if isinstance(value, str) else ""
        expected = _expected(declared[name], words)
        told = f"{near} Expected {expected}." if near else f"; expected {expected}."
        raise StudyError(f"{kind.__name__}: {name} is {_shown(value)}{told}")


@lru_cache(maxsize=64)
def _declared(kind: type) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        owner = next(base for base in kind.__mro__ if field.name in vars(base).get("__annotations__", {}))
        one = type("One", (), {"__annotations__": {field.name: field.type}, "__module__": owner.__module__})
        with contextlib.suppress(NameError, TypeError):  # one that only a type checker can resolve
            found[field.name] = typing.get_type_hints(one)[field.name]
    return found


def _members(annotation: Any) -> tuple[Any, ...]:
    """Return the alternatives of an annotation."""
    if typing.get_origin(annotation) in (Union, types.UnionType):
        return tuple(x for member in typing.get_args(annotation) for x in _members(member))
    return (annotation,)


def _words(annotation: Any) -> list[str]:
    """Return the words among the values that an annotation allows."""
    literal = [m for m in _members(annotation) if typing.get_origin(m) is Literal]
    return [x for m in literal for x in typing.get_args(m) if isinstance(x, str)]


def _fits(value: Any, annotation: Any) -> bool:
    return any(_is_one(value, member) for member in _members(annotation))


def _is_one(value: Any, member: Any) -> bool:
    """Tell whether a value may be of a type; any may where nothing is known of the type."""
    truth = isinstance(value, (bool, np.bool_))
    if typing.get_origin(member) is Literal:
        return isinstance(value, (str, int, type(None))) and any(
            type(value) is type(x) and value == x for x in typing.get_args(member)
        )
    if member in (None, types.NoneType):
        return value is None
    if member is bool:
        return truth
    if member is int:
        return isinstance(value, Integral) and not truth
    if member is float:
        return isinstance(value, Real) and not truth and not math.isnan(value)
    if member is str:
        return isinstance(value, str)
    return True


def _expected(annotation: Any, words: list[str]) -> str:
    """Say what an annotation allows."""
    named = {int: "a whole number", float: "a number", bool: "True or False", str: "a text"}
    kinds = [named[m] for m in _members(annotation) if m in named]
    if len(words) > 1:
        kinds.append(f"one of {', '.join(words)}")
    elif words:
        kinds.append(words[0])
    return " or ".join([*kinds, *(["None"] if types.NoneType in _members(annotation) else [])])


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
