"""Parameters of components: declared numbers, vectors and options with units and ranges."""

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
"""Largest number of entries of a default."""


class _Required:
    """Marker for a parameter without a default."""

    def __repr__(self) -> str:
        return "required"


_REQUIRED: Any = _Required()

Kind = Literal["scalar", "point", "axis", "turning_axis", "vector", "moment", "rotation", "numbers", "option"]


class _Owner(Protocol):
    """Object with parameter values: a component."""

    name: str
    stating: bool
    values: dict[str, Any]
    read: set[str]


@typechecked
@dataclass(frozen=True, repr=False)
class Parameter(Generic[Given]):
    """Declaration of a number, vector or option of a component.

    ``x: uqmbd.Parameter[Quantity] = uqmbd.Parameter(...)`` in a `uqmbd.extend.TypedComponent` declares the type of
    the argument for editors and type checkers; the annotation has no effect at run time.

    Parameters
    ----------
    units : str
        Units of the value.
    description : str
        Meaning of the parameter, for help and messages.
    kind : str
        Kind of the value. ``scalar``: one number. ``point``, ``axis`` or ``vector``: one number for each dimension of
        the space. ``turning_axis``: three numbers in three dimensions, omitted in planar space. ``moment``: three
        numbers in three dimensions, one in planar space. ``rotation``: quaternion or matrix. ``numbers``: a row of any
        length. ``option``: an object that is not a number and is not converted.
    default : object
        Default value. A parameter without a default is required. For a ``turning_axis``, ``default=()`` makes the axis
        optional for type checkers, because it is omitted in planar space; in three dimensions it is still required.
    choices : tuple
        Allowed values of an option. A type in the tuple allows all objects of this type.
    example : object
        Value with which `uqmbd.testing.check_component` tests the component, if arbitrary numbers are unsuitable.
    minimum, maximum : float
        Range of each number, in the units of the parameter. `Mechanism.add` raises an error for a constant outside the
        range. `Mechanism.add` also raises an error for an expression that is outside the range at the means of its
        random variables. A realisation with a value outside the range fails. uqmbd does not check values that depend on
        time or motion.
    exclusive : bool
        Whether the range excludes its ends.
    at_minimum : str
        Effect of a constant equal to `minimum`, if it selects other equations, such as "the joint sticks". Random
        numbers must then be above the minimum. Default: none.
    one_sign : bool
        Whether a random number, such as a stiffness, should have the same sign in all realisations as at the means.
        Realisations with the opposite sign still run, and the study warns about them.
    body : str
        Name of the body argument in whose frame a point or an axis is given. Default: the body argument with the same
        ending (`point_i` is in the frame of `body_i`), otherwise the first body argument.
    about : str
        Name of the point at the centre of a sphere or wheel with this radius, for figures. Default: none. If no
        parameter of the component has `about`, `radius_i` is about `point_i`, and `radius` is about the points of the
        last body.
    axes : str
        Axes in which a vector or a moment is given: ``world`` or ``body``.
    dimensions : int
        Smallest dimension of a space in which the parameter has an effect, such as 2 for friction, which needs a
        tangential direction. In spaces of lower dimension, every value other than the default is an error.
    registered : str
        Plugin hook, such as ``contact_laws``. The names that plugins register with it are further choices of an option.
        Default: none.
    name : str
        Name of the parameter, set by the class that declares it.

    Raises
    ------
    uqmbd.StudyError
        If the range is empty or does not suit the kind, or if a required default is missing.

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
    at_minimum: str = field(default="", kw_only=True)
    one_sign: bool = field(default=False, kw_only=True)
    body: str = field(default="", kw_only=True)
    about: str = field(default="", kw_only=True)
    axes: Literal["world", "body"] = field(default="world", kw_only=True)
    dimensions: Annotated[int, Bounds(1, 3)] = field(default=1, kw_only=True)
    registered: Literal["", "contact_laws"] = field(default="", kw_only=True)

    def __post_init__(self) -> None:
        if self.dimensions > 1 and self.required:
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): the parameter applies only to spaces of "
                f"{self.dimensions} or more dimensions, so it needs a default for the other spaces; give default=."
            )
        for key in ("default", "example") if self.kind != "option" else ():
            if not _usable(value := getattr(self, key)):
                raise StudyError(
                    f"Parameter({self.units!r}, {self.description!r}): {key} is {shown(value)}; expected finite "
                    f"numbers for the kind {self.kind!r}."
                )
        if not self.minimum < self.maximum:
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): minimum is {self.minimum!r}, and maximum is "
                f"{self.maximum!r}; expected a minimum below the maximum."
            )
        if self.ranged and self.kind in ("option", "rotation", "axis", "turning_axis"):
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): a parameter of kind {self.kind!r} has no range; "
                "omit minimum= and maximum=."
            )

        if self.at_minimum and (self.exclusive or not self.ranged or self.minimum == -math.inf):
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): at_minimum is {self.at_minimum!r}, but the range "
                "contains no minimum; give minimum=, without exclusive=True."
            )
        if self.one_sign and self.kind != "scalar":
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): a parameter of kind {self.kind!r} has no sign; "
                "omit one_sign=."
            )
        if self.axes == "body" and self.kind not in ("vector", "moment"):
            raise StudyError(
                f"Parameter({self.units!r}, {self.description!r}): axes='body' applies only to vectors and moments; "
                f"a parameter of kind {self.kind!r} is always in the frame of a body."
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
                f"terms() uses self.{self.name}; use p.{self.name} instead. The terms of a component class are "
                "derived once, in symbols, for all objects and values."
            )
        instance.read.add(self.name)
        return instance.values[self.name]

    def __set__(self, instance: _Owner, value: Given) -> NoReturn:
        """Raise `uqmbd.StudyError` always: a later value would not reach the equations."""
        raise StudyError(
            f"{type(instance).__name__} {instance.name!r}: {self.name} cannot be changed after the creation of the "
            "component. Create another component, or use an expression in random variables or in uqmbd.t."
        )

    @property
    def required(self) -> bool:
        """Whether an argument must be given: it is applicable and has no default."""
        return self.default is _REQUIRED or self.left_out

    @property
    def left_out(self) -> bool:
        """Whether type checkers accept an omitted argument: a turning axis with default ``()``."""
        return self.kind == "turning_axis" and isinstance(self.default, tuple) and not self.default

    @property
    def ranged(self) -> bool:
        """Whether the numbers of the parameter have a range."""
        return self.minimum > -math.inf or self.maximum < math.inf

    @property
    def range_text(self) -> str:
        """Range in words, for messages."""
        return range_text(self.minimum, self.maximum, exclusive=self.exclusive)

    @property
    def words(self) -> tuple[Any, ...]:
        """Choices of an option that are values, without the choices that are types."""
        return tuple(x for x in self.choices if not isinstance(x, type))

    def offers(self, value: Any) -> bool:
        """Return whether a value is allowed for an option."""
        types = tuple(x for x in self.choices if isinstance(x, type))
        same = any(isinstance(value, type(x)) and value == x for x in self.words)
        if not self.choices or same or isinstance(value, types):
            return True
        return isinstance(value, str) and value in self.names_of_plugins()

    def names_of_plugins(self) -> tuple[str, ...]:
        """Load the installed plugins, and return the choices that they add."""
        return tuple(sorted(set(contact_laws()) - set(self.words))) if self.registered else ()

    def allows(self, value: float) -> bool:
        """Return whether a number is within the range."""
        if self.exclusive:
            return self.minimum < value < self.maximum
        return self.minimum <= value <= self.maximum

    def fits(self, space: Space) -> bool:
        """Return whether the parameter has an effect in a space."""
        return space.dimension >= self.dimensions

    def size(self, space: Space) -> int:
        """Return the number of entries of the parameter in a space."""
        if self.kind in ("point", "axis", "vector"):
            return space.dimension
        if self.kind in ("turning_axis", "moment"):
            return 3 if space.dimension == 3 else (1 if self.kind == "moment" else 0)
        return 0 if self.kind in ("option", "numbers") else 1


def _usable(value: Any) -> bool:
    """Return whether a default is valid for numbers: None, a finite number, an expression, or a row of such values."""
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
    """Return a range as text that follows "expected" in messages.

    >>> range_text(0, math.inf), range_text(0, 1), range_text(-math.inf, 2, exclusive=True)
    ('0 or more', '0 to 1', 'less than 2')
    """
    if minimum > -math.inf and maximum < math.inf:
        return f"more than {minimum:g} and less than {maximum:g}" if exclusive else f"{minimum:g} to {maximum:g}"
    if maximum < math.inf:
        return f"less than {maximum:g}" if exclusive else f"{maximum:g} or less"
    return f"more than {minimum:g}" if exclusive else f"{minimum:g} or more"
