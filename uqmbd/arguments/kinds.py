"""Whether a value is what an annotation declares.

Own code, because two libraries were measured and differ from these rules for 40 of 546 pairs of an annotation and a
value each.  typeguard 4.6.1 takes True for an integer, NaN for a number, and texts for sequences and arrays;
beartype 0.23.1 refuses 0 for a number and takes texts for sequences and arrays.  Both judge arrays by kind only
and miss masks.  Their hooks would need every rule on numbers, sequences and arrays that is below.
"""

from __future__ import annotations

import math
import os
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from numbers import Integral, Number, Rational, Real
from typing import Any, Literal

import numpy as np

from uqmbd.arguments.annotations import (
    LONGEST,
    MANY,
    Numbers,
    between,
    beyond,
    bounded,
    each,
    is_array_type,
    marks,
    members,
    several,
)

__all__ = ["fits", "is_one"]


def fits(value: Any, annotation: Any) -> bool:
    """Return whether a value is what an annotation declares.

    >>> fits(True, int), fits([1, 2], Sequence[float]), fits(None, str | None)
    (False, True, True)
    """
    if (
        isinstance(value, str)
        and "\0" in value
        and any(typing.get_origin(x) is os.PathLike for x in members(annotation))
    ):
        return False  # the system ends the name of a file there
    if isinstance(value, np.number) and is_array_type(annotation):
        value = np.asarray(value)  # sums over all axes of an array are NumPy's numbers
    return any(is_one(value, member) for member in members(annotation))


def is_one(value: Any, member: Any) -> bool:
    """Return whether a value may be of a type; any may where nothing is known of the type.

    >>> from uqmbd.arguments import OrNaN
    >>> is_one(float("nan"), float), is_one(float("nan"), OrNaN), is_one("a", Sequence[str])
    (False, True, False)
    """
    base, bounds = bounded(member)
    if bounds is not None and typing.get_origin(base) is tuple:
        kind, numbers = typing.get_args(base)[0], each(value)
        return 0 < len(numbers) <= MANY and all(is_one(x, kind) and bounds.hold(x) for x in numbers)
    if several(base):
        return isinstance(value, (tuple, list)) and all(is_one(x, typing.get_args(base)[0]) for x in value)
    if typing.get_origin(base) is Literal:
        return isinstance(value, (str, int, type(None))) and any(
            type(value) is type(x) and value == x for x in typing.get_args(base)
        )
    if base in (None, types.NoneType):
        return value is None
    if base is bool:
        return isinstance(value, (bool, np.bool_))
    if base in (int, float):
        return _is_number(value, base) and _is_within(value, member)
    if base is str:
        return isinstance(value, str)
    if base is Any:
        return True
    if base is complex:
        return isinstance(value, Number) and not isinstance(value, (bool, np.bool_))
    return _is_object(value, base)


def _is_number(value: Any, base: type) -> bool:
    """Return whether a value is a number of 64 bits; of NumPy and xarray also one without axes."""
    if isinstance(value, (bool, np.bool_)) or np.ma.is_masked(value):
        return False
    if base is int:
        return isinstance(value, Integral)
    if not isinstance(value, np.generic) and getattr(value, "shape", None) == ():
        return getattr(value.dtype, "kind", "") in "iuf"
    # no number of 64 bits holds a larger fraction
    return isinstance(value, Real) and not (isinstance(value, Rational) and beyond(value))


def _is_within(number: Any, member: Any) -> bool:
    """Return whether a number is finite and within its bounds, or is NaN or infinite where the annotation allows it."""
    bounds, allowed = bounded(member)[1], marks(member)
    if isinstance(number, Integral) or math.isfinite(number):
        return bounds is None or bounds.hold(number)
    if math.isnan(number):
        return "or NaN" in allowed
    return "or infinite" in allowed and (bounds is None or between(number, bounds))


def _is_object(value: Any, base: Any) -> bool:
    """Return whether a value is a path, an array, a function, a sequence, a mapping or an instance that fits."""
    origin, arguments = typing.get_origin(base), typing.get_args(base)
    kind = origin or base
    if kind is np.ndarray:
        return _is_array(value, arguments)
    if kind is Numbers:
        return _are_numbers(value)
    if kind is Callable:
        return callable(value)
    if kind is type:
        wanted = arguments[0] if arguments else object
        return isinstance(value, type) and (not isinstance(wanted, type) or issubclass(value, wanted))
    if not isinstance(kind, type) or getattr(kind, "_is_protocol", False):
        return True
    if issubclass(kind, os.PathLike):
        return isinstance(value, os.PathLike)
    if kind is tuple:
        return _is_tuple(value, arguments)
    if issubclass(kind, Mapping) and (origin is not None or kind in (Mapping, dict)):
        if not isinstance(value, Mapping):
            return False
        return not arguments or all(fits(k, arguments[0]) and fits(x, arguments[1]) for k, x in value.items())
    if issubclass(kind, Iterable) and origin is not None:
        return _is_sequence(value, kind, arguments)
    if kind.__module__.startswith("sympy"):
        return _is_symbolic(value, kind)
    return isinstance(value, kind)


def _is_symbolic(value: Any, kind: type) -> bool:
    """Return whether a value is an expression, or a finite real number in place of one."""
    if isinstance(value, (bool, np.bool_)):
        return False
    if getattr(value, "is_Atom", False) and value.is_number and value.is_finite is not True:
        return False  # SymPy's NaN and infinities
    return isinstance(value, kind) or (_is_number(value, float) and _is_within(value, float))


def _is_tuple(value: Any, arguments: tuple[Any, ...]) -> bool:
    if arguments[-1:] == (Ellipsis,):
        return _is_sequence(value, Sequence, arguments[:1])
    if not isinstance(value, (tuple, list)) or (arguments and len(value) != len(arguments)):
        return False
    return all(fits(x, declared) for x, declared in zip(value, arguments, strict=False))


def _is_sequence(value: Any, kind: type, arguments: tuple[Any, ...]) -> bool:
    """Return whether a value is a row of what is declared; a text is no row of its letters."""
    # a matrix of SymPy has a length and places, and is no Collection
    sized = isinstance(value, Collection) or (hasattr(value, "__len__") and hasattr(value, "__getitem__"))
    if isinstance(value, (str, bytes, type)) or not (sized or hasattr(value, "__iter__")):
        return False
    if isinstance(value, np.ndarray) and value.size > LONGEST:
        return False
    if isinstance(value, np.ndarray):
        if value.ndim == 0 or value.ndim > 1 and (not arguments or members(arguments[0])[0] in (int, float, str)):
            return False
        value = value[:MANY]
        if np.ma.is_masked(value):
            return False
    elif isinstance(value, Mapping) and not issubclass(Mapping, kind):
        return False
    elif issubclass(kind, Sequence) and not hasattr(value, "__getitem__"):
        return False
    if not sized or not arguments:
        return True  # an iterator is read once, by who uses it
    return all(fits(x, arguments[0]) for _, x in zip(range(MANY), value, strict=False))


def _are_numbers(value: Any) -> bool:
    """Return whether NumPy reads real numbers from a value; texts, masks and truth values by themselves are none."""
    if isinstance(value, (str, bytes, bool, type, Mapping)) or value is None or np.ma.is_masked(value):
        return False
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return False
    if array.dtype.kind == "O":  # whole numbers of more than 64 bits, fractions
        return all(isinstance(x, Real) and not beyond(x) for x in array.ravel()[:MANY])
    return array.dtype.kind in "biuf"


def _is_array(value: Any, arguments: tuple[Any, ...]) -> bool:
    """Return whether a value is an array of NumPy of a kind of number that fits."""
    if not isinstance(value, np.ndarray) or np.ma.is_masked(value):
        return False
    wanted = [x for x in typing.get_args(arguments[-1]) if isinstance(x, type)] if arguments else []
    if not wanted or not issubclass(wanted[0], np.generic):
        return True
    allowed = {"f": "biuf", "i": "biu", "c": "biufc", "b": "b"}.get(np.dtype(wanted[0]).kind, value.dtype.kind)
    return value.dtype.kind in allowed or value.size == 0
