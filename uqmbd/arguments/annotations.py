"""What an annotation declares: its alternatives, the bounds of numbers, rows of words."""

from __future__ import annotations

import dataclasses
import math
import sys
import types
import typing
from numbers import Real
from typing import Annotated, Any, Literal, TypeAlias, Union

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError

__all__ = [
    "LARGE",
    "LONGEST",
    "MANY",
    "Axis",
    "Bounds",
    "Count",
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
    "is_array_type",
    "marks",
    "members",
    "several",
]

MANY = 10_000
"""Entries of a sequence that are looked at one by one: all of what people write, some of what programs make."""

LONGEST = 10**7
"""Entries of a sequence, at most: more are an array that is large by mistake."""

LARGE = 1000
"""An upper bound from here on is named to those alone who pass it."""


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

    Raises
    ------
    uqmbd.StudyError
        If a bound is NaN or no number, or the bounds are not in ascending order.

    Examples
    --------
    >>> Bounds(0).words, Bounds(0, above=True).words, Bounds(0, 1).words
    (', 0 or more', ' above 0', ' between 0 and 1')
    """

    least: float
    most: float = math.inf
    above: bool = False

    def __post_init__(self) -> None:
        """Refuse bounds that no number is within."""
        pair: tuple[Any, ...] = (self.least, self.most)
        ends = all(not isinstance(x, bool) and isinstance(x, Real) and bool(x == x) for x in pair)
        if not ends or not isinstance(self.above, bool) or not self.least <= self.most:
            raise StudyError(
                f"Bounds: least is {str(self.least)[:40]}, most is {str(self.most)[:40]} and above is "
                f"{str(self.above)[:40]}; expected two numbers in ascending order, and True or False."
            )

    @property
    def words(self) -> str:
        """What follows the kind of number in a message."""
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
        # of any kind of number: NumPy knows neither fractions nor whole numbers of more than 64 bits
        exact: Any = number
        return abs(exact) < math.inf and between(exact, self)


Seed: TypeAlias = Annotated[int, Bounds(0)]
"""Of random numbers."""

Count: TypeAlias = Annotated[int, Bounds(1, 10**9)]
"""How many samples: more do not fit into memory."""

Axis: TypeAlias = Annotated[int, Bounds(-64, 63)]
"""Of an array; NumPy allows at most 64 axes."""

OrNaN: TypeAlias = Annotated[float, "or NaN"]
"""A number that may be unknown; a plain ``float`` is finite."""

OrInfinite: TypeAlias = Annotated[float, "or infinite"]
"""A number, or infinity of either sign, as the end of an interval."""

Size: TypeAlias = Annotated[int, Bounds(0, 10**18)]
"""A number of things that may be none."""

Share: TypeAlias = Annotated[float, Bounds(0, 1)]
"""A probability or a part of a whole."""


ShareOrNaN: TypeAlias = Annotated[OrNaN, Bounds(0, 1)]
"""A probability that may be unknown."""

Positive: TypeAlias = Annotated[float, Bounds(0, above=True)]
"""A tolerance or a length."""

NotNegative: TypeAlias = Annotated[float, Bounds(0)]
"""A duration."""

NotNegativeOrInfinite: TypeAlias = Annotated[OrInfinite, Bounds(0)]
"""An error, or a limit of errors; infinite: the error is unknown, or there is no limit."""


class Numbers:
    """In place of ``ArrayLike``: real numbers, as an array or a sequence."""


_ARRAY_LIKE = typing.get_args(ArrayLike)


def members(annotation: Any) -> tuple[Any, ...]:
    """Return the alternatives of an annotation.

    >>> members(int | str | None)
    (<class 'int'>, <class 'str'>, <class 'NoneType'>)
    """
    if typing.get_origin(annotation) not in (Union, types.UnionType):
        return (annotation,)
    found = typing.get_args(annotation)
    if set(_ARRAY_LIKE) <= set(found):  # it names texts and bytes, which NumPy reads as such
        found = (Numbers, *(x for x in found if x not in _ARRAY_LIKE))
    return tuple(x for member in found for x in members(member))


def marks(member: Any) -> tuple[Any, ...]:
    """Return what an annotation adds to a type: bounds, and texts that allow NaN or infinity.

    >>> marks(OrNaN), marks(float)
    (('or NaN',), ())
    """
    return typing.get_args(member)[1:] if typing.get_origin(member) is Annotated else ()


def bounded(member: Any) -> tuple[Any, Bounds | None]:
    """Return an alternative without its bounds, and these.

    >>> bounded(Annotated[int, Bounds(0)])
    (<class 'int'>, Bounds(least=0, most=inf, above=False))
    """
    if typing.get_origin(member) is not Annotated:
        return member, None
    base = typing.get_args(member)[0]
    return base, next((mark for mark in marks(member) if isinstance(mark, Bounds)), None)


def each(value: Any) -> list[Any]:
    """Return the numbers of a row, or the one that stands for a row.

    >>> each((1, 2)), each(1)
    ([1, 2], [1])
    """
    if isinstance(value, np.ndarray):
        return list(np.atleast_1d(value)[: MANY + 1])
    return list(value) if isinstance(value, (tuple, list, range)) else [value]


def between(number: Any, bounds: Bounds) -> bool:
    """Return whether a number, which may be infinite, is between bounds."""
    return bool(bounds.least <= number <= bounds.most) and not (bounds.above and number == bounds.least)


def several(base: Any) -> bool:
    """Return whether an alternative is a row of words.

    >>> several(tuple[Literal["a", "b"], ...]), several(tuple[int, ...])
    (True, False)
    """
    return typing.get_origin(base) is tuple and typing.get_origin(typing.get_args(base)[0]) is Literal


def is_array_type(annotation: Any) -> bool:
    """Return whether an annotation is an array of NumPy, or None.

    >>> is_array_type(np.ndarray | None), is_array_type(tuple[float, ...] | np.ndarray)
    (True, False)
    """
    kinds = [typing.get_origin(x) or x for x in members(annotation) if x is not types.NoneType]
    return kinds == [np.ndarray]


def beyond(number: Any, most: float = sys.float_info.max) -> bool:
    """Return whether a number of any kind is larger than another, which is that of 64 bits."""
    return bool(abs(number) > most)
