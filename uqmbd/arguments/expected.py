"""Messages on refused values and on the expected values."""

from __future__ import annotations

import math
import os
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Rational, Real
from typing import Any, Literal, TypeVar

import numpy as np

from uqmbd.arguments.annotations import LARGE, MANY, Numbers, beyond, bounded, each, fits, marks, members, several
from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean

__all__ = ["refusal", "returned", "shown"]

Returned = TypeVar("Returned")


def refusal(name: str, value: Any, annotation: Any) -> str:
    """Return a message with the value of an argument and the expected values.

    >>> from typing import Annotated
    >>> from uqmbd.arguments import Bounds
    >>> refusal("order", -1, Annotated[int, Bounds(0)])
    'order is -1; expected a whole number, 0 or more.'
    >>> refusal("fmi", 1, Literal[2, 3])
    'fmi is 1; expected one of 2, 3.'
    """
    words = [x for x in _literals(annotation) if isinstance(x, str)]
    near = did_you_mean(value, words) if isinstance(value, str) else ""
    expected = _describe_annotation(annotation, [repr(x) for x in _literals(annotation)])
    if not _finite(value):
        expected = expected.replace("a number", "a finite number").replace("of numbers", "of finite numbers")
    if most := _passed(value, annotation):
        expected += f"; at most {most:g}"
    text = f"{near} Expected {expected}." if near else f"; expected {expected}."
    return f"{name} is {shown(value)}{text}"


def returned(function: str, value: Returned, annotation: Any) -> Returned:
    """Check the return value of a user's or plugin's function against an annotation, and return it.

    Raise StudyError if the value does not fit.

    >>> returned("mine: weight", 2, int)
    2
    >>> returned("mine: weight", "2", int)
    Traceback (most recent call last):
    uqmbd.errors.StudyError: mine: weight returned '2'; expected a whole number.
    """
    if not fits(value, annotation):
        raise StudyError(refusal(function, value, annotation).replace(" is ", " returned ", 1))
    return value


def _finite(value: Any) -> bool:
    """Return whether a number, or each number of a sequence or a mapping, is finite."""
    entries = list(value.values()) if isinstance(value, Mapping) else each(value)
    floats = [float(x) for x in entries[:MANY] if isinstance(x, (float, np.floating))]
    return all(map(math.isfinite, floats))


def _literals(annotation: Any) -> list[Any]:
    """Return the values of the ``Literal`` types in an annotation."""
    listed = [m for m in members(annotation) if typing.get_origin(m) is Literal]
    return [x for m in listed for x in typing.get_args(m)]


def _passed(value: Any, annotation: Any) -> float:
    """Return the upper bound that a number, or an entry of a sequence, exceeds; 0 for bounds below `LARGE`."""
    for base, bounds in map(bounded, members(annotation)):
        kind = Integral if base is int or (typing.get_origin(base) is tuple and int in typing.get_args(base)) else Real
        if bounds is not None and any(isinstance(x, kind) and beyond(x, bounds.most) for x in each(value)):
            return bounds.most if bounds.most >= LARGE else 0
        if bounds is not None and kind is Real and any(isinstance(x, Rational) and beyond(x) for x in each(value)):
            return sys.float_info.max
    return 0


def _describe_annotation(annotation: Any, words: list[str]) -> str:
    """Describe the values that an annotation allows."""
    kinds = []
    for member in members(annotation):
        base, bounds = bounded(member)
        row = typing.get_origin(base) is tuple and bounds is not None
        if (kind := _NAMED.get(typing.get_args(base)[0] if row else base)) is not None:
            kinds.append(kind + (bounds.words if bounds else "") + (" for each input" if row else ""))
            kinds += [x.removeprefix("or ") for x in marks(member) if isinstance(x, str)]
        elif not row and not several(base) and typing.get_origin(base) is not Literal and base is not types.NoneType:
            kinds.append(_named(base))
    if words:
        kinds.append(f"one of {', '.join(words)}" if len(words) > 1 else words[0])
    for base in filter(several, members(annotation)):
        kinds.append(f"a tuple of {', '.join(repr(x) for x in typing.get_args(typing.get_args(base)[0]))}")
    kinds += ["None"] if types.NoneType in members(annotation) else []
    kinds = list(dict.fromkeys(kinds))
    return (", or " if any("," in kind for kind in kinds[:-1]) else " or ").join(kinds)


_NAMED = {int: "a whole number", float: "a number", complex: "a number", bool: "True or False", str: "a text"}


def _named(base: Any) -> str:
    """Describe an object of a type with an article, such as ``a sequence of numbers``."""
    origin, arguments = typing.get_origin(base), typing.get_args(base)
    kind = origin or base
    if kind is Numbers:
        return "real numbers in an array or a sequence"
    if kind is np.ndarray:
        entry_types = [x for x in typing.get_args(arguments[-1]) if isinstance(x, type)] if arguments else []
        letter = np.dtype(entry_types[0]).kind if entry_types and issubclass(entry_types[0], np.generic) else ""
        of = {"f": "numbers", "i": "whole numbers", "b": "truth values", "c": "complex numbers"}.get(letter, "values")
        return f"a NumPy array of {of}"
    if kind is Callable:
        return "a function"
    if kind.__module__.startswith("sympy.") and kind.__name__ in ("Expr", "Basic"):
        return "a number or an expression"
    if kind is type:
        return f"a class{f' of {_named(arguments[0])}' if arguments else ''}"
    if not isinstance(kind, type):
        return str(kind)
    if issubclass(kind, os.PathLike):
        return "a path"
    if issubclass(kind, Mapping) and (origin is not None or kind in (Mapping, dict)):
        of = f" from {_entries(arguments[0])} to {_entries(arguments[1])}" if arguments else ""
        return f"a mapping{of}"
    if kind is tuple and arguments and Ellipsis not in arguments:
        return f"a tuple ({', '.join(_describe_annotation(x, []) for x in arguments)})"
    if issubclass(kind, Iterable) and origin is not None:
        return f"a sequence{f' of {_entries(arguments[0])}' if arguments else ''}"
    name = (
        kind.__qualname__
        if kind.__module__ == "builtins"
        else f"{kind.__module__.partition('.')[0]}.{kind.__qualname__}"
    )
    return f"{'an' if name[0] in 'aeiox' else 'a'} {name}"


def _entries(annotation: Any) -> str:
    """Name the entries of a sequence in the plural, such as ``numbers``."""
    plural = {int: "whole numbers", float: "numbers", bool: "truth values", str: "texts"}
    found = []
    for member in members(annotation):
        base, bounds = bounded(member)
        plain = plural.get(base, "") + (bounds.words if bounds else "")
        found.append(plain or f"({_describe_annotation(member, [repr(x) for x in _literals(member)])})")
    return "values" if annotation is Any else " or ".join(found)


def shown(value: object) -> str:
    """Return a short representation of a value for a message; an array is described by its shape.

    >>> shown(0.5), shown(np.zeros((2, 3)))
    ('0.5', 'an array of the shape (2, 3)')
    """
    if isinstance(value, np.ndarray):
        return _shown_array(value)
    if isinstance(value, type):
        return f"the class {value.__name__}"
    try:
        text = repr(value)
    except ValueError:  # Python converts whole numbers of at most 4300 digits to texts
        return f"a {type(value).__name__} of more than 4300 digits"
    return text if len(text) <= 80 else text[:77] + "..."


def _shown_array(array: np.ndarray[Any, Any]) -> str:
    """Describe an array by its first masked or complex entry, or by its kind of entries and its shape."""
    if np.ma.is_masked(array):
        mask = np.ma.getmaskarray(array)
        at = tuple(int(k) for k in np.argwhere(mask)[0])
        return f"a masked array with {np.count_nonzero(mask)} masked values, the first at index {at}"
    if array.dtype.kind == "c":
        off = np.argwhere(array.imag != 0)
        at = tuple(int(k) for k in off[0]) if len(off) else (0,) * array.ndim
        return f"complex, {array[at]} at index {at}" if array.size else "a complex array without entries"
    of = {"U": "texts of ", "S": "bytes of ", "O": "objects of "}.get(array.dtype.kind, "")
    return f"an array of {of}the shape {array.shape}"
