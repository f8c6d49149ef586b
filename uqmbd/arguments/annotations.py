"""Annotations: their alternatives, the bounds of numbers, and the check of values.

This module does not use the libraries typeguard and beartype, because they apply other rules. For 40 of 546 measured
pairs of an annotation and a value, each library decides differently. typeguard 4.6.1 accepts True as an integer, NaN as
a number, and texts as sequences and arrays. beartype 0.23.1 refuses 0 as a number, and accepts texts as sequences and
arrays. Both libraries check only the kind of an array and ignore its mask. A hook for either library would have to
contain all rules of this module on numbers, sequences and arrays.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import os
import sys
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from numbers import Integral, Number, Rational, Real
from typing import Annotated, Any, Literal, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError

__all__ = [
    "Axis",
    "Bounds",
    "Count",
    "LARGE",
    "LONGEST",
    "MANY",
    "NotNegative",
    "NotNegativeOrInfinite",
    "Numbers",
    "OrInfinite",
    "OrNaN",
    "Positive",
    "Seed",
    "Share",
    "ShareOrNaN",
    "Size",
    "between",
    "beyond",
    "bounded",
    "each",
    "fits",
    "is_array_type",
    "is_one",
    "marks",
    "members",
    "several",
]

MANY = 10_000
"""Maximum number of entries of a sequence that are checked; sequences written by hand are shorter."""

LONGEST = 10**7
"""Largest number of entries of a sequence; a longer array is probably a mistake."""

LARGE = 1000
"""Upper bounds of numbers from this value on are in a message only if the number exceeds them."""


@dataclasses.dataclass(frozen=True)
class Bounds:
    """Bounds of a number, for an annotation such as ``order: Annotated[int, uqmbd.extend.Bounds(0)] = 3``.

    The bounds of a tuple apply to each of its numbers.  A single number counts as a tuple of one number.

    Parameters
    ----------
    least, most : float
        Bounds of the number. An infinite bound means no bound, but the number must be finite.
    above : bool
        Whether `least` itself is excluded.

    Raises
    ------
    uqmbd.StudyError
        If a bound is NaN or not a number, or the bounds do not ascend.

    Examples
    --------
    >>> Bounds(0).words, Bounds(0, above=True).words, Bounds(0, 1).words
    (', 0 or more', ' above 0', ' between 0 and 1')
    """

    least: float
    most: float = math.inf
    above: bool = False

    def __post_init__(self) -> None:
        """Refuse bounds that exclude all numbers."""
        pair: tuple[Any, ...] = (self.least, self.most)
        ends = all(not isinstance(x, bool) and isinstance(x, Real) and bool(x == x) for x in pair)
        if not ends or not isinstance(self.above, bool) or not self.least <= self.most:
            raise StudyError(
                f"Bounds: least is {str(self.least)[:40]}, most is {str(self.most)[:40]} and above is "
                f"{str(self.above)[:40]}; expected numbers with least <= most, and True or False for above."
            )

    @property
    def words(self) -> str:
        """Description of the bounds, placed after the kind of number in a message."""
        if self.least == -math.inf:
            return f" up to {self.most:g}" if self.most < LARGE else ""
        if self.most < LARGE:
            return f" between {self.least:g} and {self.most:g}"
        return f" above {self.least:g}" if self.above else f", {self.least:g} or more"

    def hold(self, number: Any) -> bool:
        """Test whether a number is within the bounds.

        Raises
        ------
        StudyError
            If it is not a number.
        """
        masked = np.ma.is_masked(number)
        if not masked and not isinstance(number, Real) and getattr(number, "shape", None) == ():
            number = number.item()
        if masked or not isinstance(number, Real):
            raise StudyError(f"Bounds.hold: number is {str(number)[:40]}; expected a number.")
        # the number stays as it is: NumPy supports neither fractions nor whole numbers of more than 64 bits
        exact: Any = number
        return abs(exact) < math.inf and between(exact, self)


_FINITE = Bounds(-sys.float_info.max, sys.float_info.max)

Seed: TypeAlias = Annotated[int, Bounds(0)]
"""Seed of random numbers."""

Count: TypeAlias = Annotated[int, Bounds(1, 10**9)]
"""Number of samples; more than 1e9 samples do not fit into memory."""

Axis: TypeAlias = Annotated[int, Bounds(-64, 63)]
"""Axis of an array; NumPy allows at most 64 axes."""

OrNaN: TypeAlias = Annotated[float, "or NaN"]
"""A number that may be unknown; a plain ``float`` is finite."""

OrInfinite: TypeAlias = Annotated[float, "or infinite"]
"""A number, or infinity of either sign, as the end of an interval."""

Size: TypeAlias = Annotated[int, Bounds(0, 10**18)]
"""Number of items, zero included."""

Share: TypeAlias = Annotated[float, Bounds(0, 1)]
"""A probability or a part of a whole."""


ShareOrNaN: TypeAlias = Annotated[OrNaN, Bounds(0, 1)]
"""A probability that may be unknown."""

Positive: TypeAlias = Annotated[float, Bounds(0, above=True)]
"""A tolerance or a length."""

NotNegative: TypeAlias = Annotated[float, Bounds(0)]
"""A duration."""

NotNegativeOrInfinite: TypeAlias = Annotated[OrInfinite, Bounds(0)]
"""An error or a limit of errors; infinity means an unknown error or no limit."""


class Numbers:
    """Real numbers as an array or a sequence; replaces ``ArrayLike``."""


_ARRAY_LIKE = typing.get_args(ArrayLike)


def for_each_annotation(function: Callable[[Any], Any]) -> Any:
    """Cache the results of a function of an annotation; checked calls use few different annotations."""
    known = functools.lru_cache(maxsize=4096)(function)

    @functools.wraps(function)
    def found(annotation: Any) -> Any:
        try:
            return known(annotation)
        except TypeError:  # annotations of third parties may have no hash
            return function(annotation)

    return found


@for_each_annotation
def members(annotation: Any) -> tuple[Any, ...]:
    """Return the alternatives of an annotation.

    >>> members(int | str | None)
    (<class 'int'>, <class 'str'>, <class 'NoneType'>)
    """
    if typing.get_origin(annotation) not in (Union, types.UnionType):
        return (annotation,)
    found = typing.get_args(annotation)
    if set(_ARRAY_LIKE) <= set(found):  # ArrayLike includes texts and bytes, from which NumPy makes no numbers
        found = (Numbers, *(x for x in found if x not in _ARRAY_LIKE))
    return tuple(x for member in found for x in members(member))


@for_each_annotation
def marks(member: Any) -> tuple[Any, ...]:
    """Return the metadata of an annotated type: bounds, and texts that allow NaN or infinity."""
    return typing.get_args(member)[1:] if typing.get_origin(member) is Annotated else ()


@for_each_annotation
def bounded(member: Any) -> tuple[Any, Bounds | None]:
    """Return an alternative without its bounds, and its bounds.

    >>> bounded(Annotated[int, Bounds(0)])
    (<class 'int'>, Bounds(least=0, most=inf, above=False))
    """
    if typing.get_origin(member) is not Annotated:
        return member, None
    base = typing.get_args(member)[0]
    return base, next((mark for mark in marks(member) if isinstance(mark, Bounds)), None)


def each(value: Any) -> list[Any]:
    """Return the entries of a sequence (of an array at most 10 001), or a list that contains a single number."""
    if isinstance(value, np.ndarray):
        return list(np.atleast_1d(value)[: MANY + 1])
    return list(value) if isinstance(value, (tuple, list, range)) else [value]


def between(number: Any, bounds: Bounds) -> bool:
    """Return whether a finite or infinite number is between bounds."""
    return bool(bounds.least <= number <= bounds.most) and not (bounds.above and number == bounds.least)


@for_each_annotation
def several(base: Any) -> bool:
    """Return whether an alternative is a tuple of words."""
    return typing.get_origin(base) is tuple and typing.get_origin(typing.get_args(base)[0]) is Literal


@for_each_annotation
def is_array_type(annotation: Any) -> bool:
    """Return whether an annotation allows only arrays of NumPy, with or without None."""
    kinds = [typing.get_origin(x) or x for x in members(annotation) if x is not types.NoneType]
    return kinds == [np.ndarray]


def beyond(number: Any, most: float = sys.float_info.max) -> bool:
    """Return whether the absolute value of a number exceeds `most`, by default the largest 64-bit float."""
    return bool(abs(number) > most)


def fits(value: Any, annotation: Any) -> bool:
    """Return whether a value fits an annotation.

    >>> fits(True, int), fits([1, 2], Sequence[float]), fits(None, str | None)
    (False, True, True)
    """
    if (
        isinstance(value, str)
        and "\0" in value
        and any(typing.get_origin(x) is os.PathLike for x in members(annotation))
    ):
        return False  # the operating system ends file names at a null character
    if isinstance(value, np.number) and is_array_type(annotation):
        value = np.asarray(value)  # a sum over all axes of an array is a NumPy scalar
    return any(is_one(value, member) for member in members(annotation))


def is_one(value: Any, member: Any) -> bool:
    """Return whether a value fits one alternative of an annotation; an unknown type accepts any value.

    >>> from uqmbd.arguments import OrNaN
    >>> is_one(float("nan"), float), is_one(float("nan"), OrNaN), is_one("a", Sequence[str])
    (False, True, False)
    """
    base, bounds = bounded(member)
    if (exact := type(value)) is base or (exact is int and base is float):  # fast path for most values
        if exact is str or exact in (int, float) and not beyond(value) and between(value, bounds or _FINITE):
            return True
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
    """Return whether a value is a 64-bit number, also in an array of NumPy or xarray without axes."""
    if isinstance(value, (bool, np.bool_)) or np.ma.is_masked(value):
        return False
    if base is int:
        return isinstance(value, Integral)
    if not isinstance(value, np.generic) and getattr(value, "shape", None) == ():
        return getattr(value.dtype, "kind", "") in "iuf"
    # a larger fraction exceeds the range of 64-bit numbers
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
        parent = arguments[0] if arguments else object
        return isinstance(value, type) and (not isinstance(parent, type) or issubclass(value, parent))
    if not isinstance(kind, type) or getattr(kind, "_is_protocol", False):
        return True
    if issubclass(kind, os.PathLike):
        return isinstance(value, os.PathLike)
    if kind is tuple:
        if arguments[-1:] == (Ellipsis,):
            return _is_sequence(value, Sequence, arguments[:1])
        if not isinstance(value, (tuple, list)) or (arguments and len(value) != len(arguments)):
            return False
        return all(fits(x, declared) for x, declared in zip(value, arguments, strict=False))
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
    """Return whether a value is an expression or a finite real number."""
    if isinstance(value, (bool, np.bool_)):
        return False
    if getattr(value, "is_Atom", False) and value.is_number and value.is_finite is not True:
        return False  # SymPy's NaN and infinities
    return isinstance(value, kind) or (_is_number(value, float) and _is_within(value, float))


def _is_sequence(value: Any, kind: type, arguments: tuple[Any, ...]) -> bool:
    """Return whether a value is a sequence of entries that fit; a text is not a sequence of its letters."""
    # a matrix of SymPy has a length and an index operator, but is not a Collection
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
        return True  # the check must not read an iterator, because it can be read only once
    return all(fits(x, arguments[0]) for _, x in zip(range(MANY), value, strict=False))


def _are_numbers(value: Any) -> bool:
    """Return whether NumPy converts a value to real numbers; False for texts, masked arrays and a single bool."""
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
    """Return whether a value is an array of NumPy with a data type that fits."""
    if not isinstance(value, np.ndarray) or np.ma.is_masked(value):
        return False
    entry_types = [x for x in typing.get_args(arguments[-1]) if isinstance(x, type)] if arguments else []
    if not entry_types or not issubclass(entry_types[0], np.generic):
        return True
    allowed = {"f": "biuf", "i": "biu", "c": "biufc", "b": "b"}.get(np.dtype(entry_types[0]).kind, value.dtype.kind)
    return value.dtype.kind in allowed or value.size == 0
