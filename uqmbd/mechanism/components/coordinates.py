"""Coordinates of components: generalised coordinates with kinetic energy, such as modes, flows and angles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import numbers, shown
from uqmbd.names import check_name, check_units, did_you_mean
from uqmbd.randomness import Symbol, Symbolic

__all__ = [
    "Coordinate",
    "CoordinateSet",
    "StateSymbol",
    "coordinate_symbol",
    "coordinates_of",
    "declared_coordinates",
    "pairs_of",
]

QUANTITIES = ("q", "v", "a")
"""Letters of a coordinate and of its first and second time derivatives."""


class StateSymbol(Symbolic, Symbol):
    """Symbol of a coordinate, rate or acceleration of a body or component in output expressions."""

    owner: Any
    quantity: str
    index: int

    def __new__(cls, owner: Any, quantity: str, index: int, name: str, units: str = "") -> StateSymbol:
        """Make a symbol that stores its owner, its kind and its index."""
        self: StateSymbol = sympy.Symbol.__xnew__(cls, name, real=True)
        self.owner, self.quantity, self.index = owner, quantity, index
        self.units = units
        return self

    def __init__(self, *args: Any) -> None:
        """Accept the arguments of ``__new__``."""

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), id(self.owner))


@typechecked
@dataclass(frozen=True)
class Coordinate:
    """Generalised coordinate of a component, with kinetic energy, for `Component.coordinates`.

    The terms of the component contain the coordinate as ``p.coordinate(name)`` and its rate as
    ``p.coordinate(name, 1)``. The equations of motion follow from the kinetic energy, as for coordinates of bodies.

    Parameters
    ----------
    units : str
        Units of the coordinate, such as ``"m^3"`` or ``"rad"``; ``"1"`` for a pure number.
    initial : number or expression
        Value in the given pose, in these units. The assembly changes the value only if motions of bodies cannot satisfy
        the constraints and start conditions.
    rate : number or expression, optional
        Rate at the start, in these units per second. Default: the assembly solves for it, with the smallest norm of all
        free rates, which is zero without a constraint.

    largest : float, optional
        Absolute value, in these units, up to which the component is valid. `uqmbd.simulate` warns if the coordinate
        exceeds it at an output time. Default: no limit.

    Raises
    ------
    uqmbd.StudyError
        If the units are unknown, or the limit is not positive.

    Examples
    --------
    The fluid column of a pipe has inertia. A cylinder presses it into an accumulator, with a period of one second:

    >>> import sympy
    >>> import uqmbd
    >>> class Pipe(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     inertance = uqmbd.Parameter("kg/m^4", "mass of the fluid over the square of the area")
    ...     stiffness = uqmbd.Parameter("Pa/m^3", "pressure of the accumulator per volume")
    ...     def coordinates(self):
    ...         return {"volume": uqmbd.extend.Coordinate("m^3", initial=1e-3)}
    ...     def terms(self, p):
    ...         yield uqmbd.Kinetic(p.inertance * p.coordinate("volume", 1) ** 2 / 2)
    ...         yield uqmbd.Potential(p.stiffness * p.coordinate("volume") ** 2 / 2)
    >>> mechanism = uqmbd.Mechanism("hydraulics", uqmbd.Line())
    >>> pipe = mechanism.add(Pipe("pipe", mechanism.ground, inertance=1e6, stiffness=4e6 * sympy.pi**2))
    >>> mechanism.output("volume", pipe.coordinate("volume"), units="m^3")
    >>> round(float(uqmbd.simulate(mechanism, [0, 0.5])["volume"][-1]), 6)
    -0.001
    """

    units: str
    initial: Any = 0
    rate: Any = None
    largest: float | None = None

    def __post_init__(self) -> None:
        check_units(self.units, "Coordinate")
        if self.largest is not None and not self.largest > 0:
            raise StudyError(f"Coordinate: largest is {self.largest}; expected a positive number.")


class CoordinateSet:
    """All coordinates of one component: names, declarations and symbols."""

    def __init__(self, name: str, component: Any, declared: Mapping[str, Coordinate]) -> None:
        self.name, self.component = name, component
        self.declared = dict(declared)
        self.names = tuple(declared)
        marks = dict(zip(QUANTITIES, ("", "'", "''"), strict=True))
        q, v, a = (
            tuple(
                StateSymbol(self, kind, k, f"{name}.{one}{marks[kind]}", _units(declared[one].units, kind))
                for k, one in enumerate(self.names)
            )
            for kind in QUANTITIES
        )
        self.q, self.v, self.a = q, v, a

    def restated(self, declared: Mapping[str, Coordinate]) -> CoordinateSet:
        """Return the set with new values; the symbols remain valid if names and units are the same."""
        same = {k: c.units for k, c in declared.items()} == {k: c.units for k, c in self.declared.items()}
        if not same:
            return CoordinateSet(self.name, self.component, declared)
        self.declared = dict(declared)
        return self

    @property
    def pairs(self) -> dict[str, tuple[sympy.Symbol, sympy.Symbol]]:
        """Symbols of each coordinate and of its rate, by name."""
        return dict(zip(self.names, zip(self.q, self.v, strict=True), strict=True))

    @property
    def initial(self) -> tuple[sympy.Expr, ...]:
        """Values in the given pose."""
        return tuple(declared.initial for declared in self.declared.values())


def _units(units: str, kind: str) -> str:
    if kind == "q" or not units:
        return units
    over = "s" if kind == "v" else "s^2"
    return f"{units}/{over}"


def coordinates_of(component: Any) -> CoordinateSet | None:
    """Return the coordinates of a component that is in a mechanism; None if it has none."""
    found: CoordinateSet | None = vars(component).get("coordinate_set")
    return found


def pairs_of(component: Any) -> dict[str, tuple[sympy.Symbol, sympy.Symbol]]:
    """Return the symbols of the coordinates of a component and of their rates, by name."""
    found = coordinates_of(component)
    return {} if found is None else found.pairs


def declared_coordinates(where: str, component: Any) -> CoordinateSet | None:
    """Return the set of the coordinates that a component declares, from its method `coordinates`; None: no coordinates.

    Raises `uqmbd.StudyError` if the declaration is invalid.
    """
    declared = component.coordinates()
    if not isinstance(declared, Mapping):
        raise StudyError(
            f"{where}: coordinates() returned {shown(declared)}; expected a dict of names and Coordinates."
        )
    found: dict[str, Coordinate] = {}
    for name, one in declared.items():
        what = f"{where}: coordinates(): {shown(name)}"
        check_name(name, f"{where}: coordinates(): a coordinate")
        if not isinstance(one, Coordinate):
            raise StudyError(f"{what} is {shown(one)}; expected uqmbd.extend.Coordinate(units, initial, rate).")
        initial = numbers(what, "initial", one.initial, 1, one.units)[0]
        rate = None if one.rate is None else numbers(what, "rate", one.rate, 1, f"{one.units} per second")[0]
        found[name] = Coordinate(one.units, initial, rate, one.largest)
    known = coordinates_of(component)
    if known is not None:
        return known.restated(found)
    return CoordinateSet(component.name, component, found) if found else None


def coordinate_symbol(component: Any, name: object, derivative: object) -> StateSymbol:
    """Return the symbol of a coordinate of a component, or of its first or second time derivative."""
    where = f"{type(component).__name__} {component.name!r}: coordinate({name!r:.80})"
    if not component.settled:
        raise StudyError(f"{where}: the component has not been added to a mechanism; call mechanism.add(...) first.")
    found = coordinates_of(component)
    names = () if found is None else found.names
    if found is None or not isinstance(name, str) or name not in names:
        near = did_you_mean(name, list(names)) if isinstance(name, str) else ""
        listed = ", ".join(map(repr, names)) or "none"
        raise StudyError(f"{where}: the component has no such coordinate{near or '.'} Its coordinates are: {listed}.")
    if isinstance(derivative, bool) or derivative not in (0, 1, 2):
        raise StudyError(f"{where}: the derivative is {derivative!r}; expected 0, 1 or 2.")
    return (found.q, found.v, found.a)[int(str(derivative))][names.index(name)]
