"""Parameters: the numbers, vectors and options that a component declares, with their units and ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Annotated, Any, Generic, Literal, NoReturn, Protocol, TypeVar, overload

import numpy as np
import sympy

from uqmbd.arguments import Bounds, OrInfinite, fits, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.geometry import Space
from uqmbd.plugins import contact_laws
from uqmbd.typing import Array

__all__ = ["Parameter", "range_text"]

if TYPE_CHECKING:
    from typing_extensions import TypeVar as _TypeVar

    Given = _TypeVar("Given", default=Any)
else:
    Given = TypeVar("Given")


MOST = 10_000
"""Most numbers of a default."""


class _Required:
    """The default of a parameter that has none."""

    def __repr__(self) -> str:
        return "required"


_REQUIRED: Any = _Required()

Kind = Literal["scalar", "point", "axis", "turning_axis", "vector", "moment", "rotation", "numbers", "option"]


class _Owner(Protocol):
    """Owner of values of parameters: a component."""

    name: str
    stating: bool
    values: dict[str, Any]
    read: set[str]


@typechecked
@dataclass(frozen=True, repr=False)
class Parameter(Generic[Given]):
    """A declared number, vector or option of a component.

    ``x: uqmbd.Parameter[Quantity] = uqmbd.Parameter(...)`` in a `uqmbd.extend.TypedComponent` tells editors and
    checkers of types what is given for it; to a program it is the same without an annotation.

    Parameters
    ----------
    units : str
        Units of the value.
    description : str
        What it is, for people.
    kind : str
        ``scalar``; ``point``, ``axis``, ``vector`` (as many numbers as the space has dimensions);
        ``turning_axis`` (three numbers in space, left out in the plane); ``moment`` (three numbers in space, one in the
        plane); ``rotation`` (quaternion or matrix); ``numbers`` (a row of as many as are given); ``option`` (anything
        that is no number, handed through as it is).
    default : object
        Value when left out; required without it.  Of a ``turning_axis`` ``default=()`` says to checkers of types that
        it may be left out, which is so in the plane; in space it is required all the same.
    choices : tuple
        Allowed values of an option; a type stands for all its objects.
    example : object
        A value to try the component with, where any numbers will not do; `uqmbd.testing.check_component` uses it.
    minimum, maximum : float
        Range of the number, or of each of its numbers, in its units.  A constant outside is an error when the component
        is added, as is an expression in random variables that is outside at their means; a realisation in which it is
        outside has failed.  Values that depend on time or motion are not looked at.
    exclusive : bool
        Whether the ends of the range do not belong to it.
    one_sign : bool
        Whether a random number is expected to have the sign that it has at the means in all realisations, as a
        stiffness: others run, and studies warn of them.
    body : str
        Body argument in whose frame a point or an axis is given; empty: the one whose name ends alike (`point_i` is in
        the frame of `body_i`), else the first.
    about : str
        Name of the point about which the number is the radius of a sphere or wheel, as figures draw it; empty: that of
        no point. However, if no parameter of the component states one, `radius_i` is about `point_i`, and `radius`
        about the points of the last body.
    axes : str
        Axes of a vector or a moment: ``world`` or ``body``.
    dimensions : int
        How many the space must have for it to make sense, as friction across a normal takes two; in spaces of fewer it
        stays at its default, and another value is an error.
    registered : str
        Hook of plugins whose names are choices of an option as well: ``contact_laws``; empty: none.
    name : str
        Set by the class that declares it.

    Raises
    ------
    uqmbd.StudyError
        If the range is empty, or makes no sense for the kind; if no default is given where some spaces need one.

    Examples
    --------
    >>> Parameter("N/m", "spring rate", default=0)
    Parameter('N/m', 'spring rate', default=0)
    >>> Parameter("m", "length", minimum=0, exclusive=True).range_text
    'more than 0'
    """

    units: str = ""
    description: str = ""
    kind: Kind = "scalar"
    default: Any = _REQUIRED
    choices: tuple[Any, ...] = ()
    example: Any = None
    name: str = field(default="", compare=False)
    minimum: OrInfinite = field(default=-math.inf, kw_only=True)
    maximum: OrInfinite = field(default=math.inf, kw_only=True)
    exclusive: bool = field(default=False, kw_only=True)
    one_sign: bool = field(default=False, kw_only=True)
    body: str = field(default="", kw_only=True)
    about: str = field(default="", kw_only=True)
    axes: Literal["world", "body"] = field(default="world", kw_only=True)
    dimensions: Annotated[int, Bounds(1, 3)] = field(default=1, kw_only=True)
    registered: Literal["", "contact_laws"] = field(default="", kw_only=True)

    def __post_init__(self) -> None:
        if self.dimensions > 1 and self.required:
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): it makes sense from dimensions={self.dimensions} on "
                "and has no default for spaces of fewer; give it one."
            )
        for key in ("default", "example") if self.kind != "option" else ():
            if not _usable(value := getattr(self, key)):
                raise StudyError(
                    f"Parameter({self.units!r}, {self.description!r}): {key} is {shown(value)}; expected finite "
                    f"numbers for the kind {self.kind!r}."
                )
        if not self.minimum < self.maximum:
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): its range is from minimum={self.minimum!r} to "
                f"maximum={self.maximum!r}; expected a minimum below the maximum."
            )
        if self.ranged and self.kind in ("option", "rotation", "axis", "turning_axis"):
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): a parameter of kind {self.kind!r} has no range; "
                "leave minimum= and maximum= out."
            )

        if self.one_sign and self.kind != "scalar":
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): a parameter of kind {self.kind!r} has no sign; "
                "leave one_sign= out."
            )
        if self.axes == "body" and self.kind not in ("vector", "moment"):
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): axes='body' is for vectors and moments; a "
                f"parameter of kind {self.kind!r} is in the frame of a body by itself."
            )

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)

    def __repr__(self) -> str:
        stated = {x.name: getattr(self, x.name) for x in fields(self) if x.name not in ("units", "description", "name")}
        usual = {x.name: x.default for x in fields(self)}
        words = [f"{key}={value!r}" for key, value in stated.items() if value is not usual[key]]
        return f"Parameter({', '.join([repr(self.units), repr(self.description), *words])})"

    @overload
    def __get__(self, instance: None, owner: type) -> Parameter[Given]: ...
    @overload
    def __get__(self, instance: _Owner, owner: type) -> Any: ...
    def __get__(self, instance: _Owner | None, owner: type) -> Any:
        if instance is None:
            return self
        if instance.stating and self.kind != "option":
            raise StudyError(
                f"terms() uses self.{self.name}; write p.{self.name}: the terms of one type of component are stated "
                "once, in symbols, for all its objects and values."
            )
        instance.read.add(self.name)
        return instance.values[self.name]

    def __set__(self, instance: _Owner, value: Given) -> NoReturn:
        """Raise `uqmbd.StudyError`, always: a value that is given later would not reach the equations."""
        raise StudyError(
            f"{type(instance).__name__} {instance.name!r}: {self.name} is given when the component is made and stays; "
            "make another component, or give an expression in random variables or in uqmbd.t."
        )

    @property
    def required(self) -> bool:
        """Whether the argument has no default although it is applicable."""
        return self.default is _REQUIRED or self.left_out

    @property
    def left_out(self) -> bool:
        """Whether type checkers accept its omission, which is an error in space: a turning axis with ``()``."""
        return self.kind == "turning_axis" and isinstance(self.default, tuple) and not self.default

    @property
    def ranged(self) -> bool:
        """Whether its numbers have a range."""
        return self.minimum > -math.inf or self.maximum < math.inf

    @property
    def range_text(self) -> str:
        """The range in words, for messages."""
        return range_text(self.minimum, self.maximum, exclusive=self.exclusive)

    @property
    def words(self) -> tuple[Any, ...]:
        """The choices of an option that are values, no types."""
        return tuple(x for x in self.choices if not isinstance(x, type))

    def offers(self, value: Any) -> bool:
        """Return whether an option can have a value."""
        types = tuple(x for x in self.choices if isinstance(x, type))
        same = any(isinstance(value, type(x)) and value == x for x in self.words)
        if not self.choices or same or isinstance(value, types):
            return True
        return isinstance(value, str) and value in self.names_of_plugins()

    def names_of_plugins(self) -> tuple[str, ...]:
        """Return the names that installed plugins add to the choices; they are loaded to know them."""
        return tuple(sorted(set(contact_laws()) - set(self.words))) if self.registered else ()

    def allows(self, value: float) -> bool:
        """Return whether a number is within the range."""
        if self.exclusive:
            return self.minimum < value < self.maximum
        return self.minimum <= value <= self.maximum

    def fits(self, space: Space) -> bool:
        """Return whether the parameter makes sense in a space."""
        return space.dimension >= self.dimensions

    def size(self, space: Space) -> int:
        """Return how many numbers the parameter has in a space."""
        if self.kind in ("point", "axis", "vector"):
            return space.dimension
        if self.kind in ("turning_axis", "moment"):
            return 3 if space.dimension == 3 else (1 if self.kind == "moment" else 0)
        return 0 if self.kind in ("option", "numbers") else 1


def _usable(value: Any) -> bool:
    """Return whether a default may stand for numbers: None, finite numbers and expressions, and rows of these."""
    if value is None or value is _REQUIRED:
        return True
    if isinstance(value, np.ndarray):
        return (
            value.size <= MOST and value.dtype.kind in "biuf" and fits(value, Array) and bool(np.isfinite(value).all())
        )
    if isinstance(value, (tuple, list, range)):
        return len(value) <= MOST and all(map(_usable, value))
    if isinstance(value, (sympy.Basic, sympy.MatrixBase)):
        return not value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo)
    return fits(value, float)


def range_text(minimum: float, maximum: float, *, exclusive: bool = False) -> str:
    """Return a range in words, for a message after "expected".

    >>> range_text(0, math.inf), range_text(0, 1), range_text(-math.inf, 2, exclusive=True)
    ('0 or more', '0 to 1', 'less than 2')
    """
    if minimum > -math.inf and maximum < math.inf:
        return f"more than {minimum:g} and less than {maximum:g}" if exclusive else f"{minimum:g} to {maximum:g}"
    if maximum < math.inf:
        return f"less than {maximum:g}" if exclusive else f"{maximum:g} or less"
    return f"more than {minimum:g}" if exclusive else f"{minimum:g} or more"
