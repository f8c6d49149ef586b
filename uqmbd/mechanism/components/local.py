"""Argument of `Component.terms`: frames of bodies, symbols of parameters, states, and named quantities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import as_symbolic, flatten
from uqmbd.mechanism.geometry import Frame, Space
from uqmbd.names import check_units, did_you_mean

__all__ = ["RESERVED", "Local", "QuantitySymbol"]

RESERVED = frozenset(
    {"attach", "coordinate", "insert", "let", "rate_of", "space", "state", "states", "time", "quantities", "units"}
)
"""Names of `Local` that parameters would hide."""


class QuantitySymbol(sympy.Dummy):
    """Symbol of a named quantity, see `Local.let`; SymPy must not treat the symbol as constant in derivatives."""

    contains: frozenset[sympy.Symbol] = frozenset()

    @property
    def free_symbols(self) -> set[sympy.Symbol]:
        """Return the symbol itself, and the symbols of its definition."""
        return {self, *self.contains}

    def _eval_derivative_n_times(self, s: sympy.Symbol, n: Any) -> sympy.Expr:
        if s not in self.contains:
            return super()._eval_derivative_n_times(s, n)
        raise StudyError(
            f"{self.name!r} is a quantity of let(), so its derivative is unknown in terms(). Use rate_of() for its "
            "time derivative, or differentiate the expression before the call of let()."
        )


class Local:
    """Argument of `Component.terms`: frames for bodies, symbols for parameters, and the time.

    The attributes are named after the body arguments, the parameters and the prepared values of the component.  A body
    argument is a `Frame`; a parameter or prepared value is an expression or a column of expressions.  Symbols replace
    numbers, so that one derivation of the equations is valid for all instances and values.

    Parameters
    ----------
    space : Space
        Space of the mechanism.
    frames : mapping of str to Frame
        Frame of each body, by name of the body argument.
    values : mapping of str to object
        Symbols of parameters and prepared values, and values of options.
    time : symbol
        `uqmbd.t`, s.
    coordinates : mapping of str to pair of symbols
        Coordinates of the component and their rates, by name.

    Examples
    --------
    >>> import uqmbd
    >>> class Drag(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     rate = uqmbd.Parameter("N s/m", "drag rate")
    ...     def terms(self, p):
    ...         assert isinstance(p, uqmbd.extend.Local)
    ...         speed = p.let("speed", p.body.velocity[0])  # a named quantity, computed once
    ...         yield uqmbd.VirtualWork(-p.rate * speed, speed)
    >>> mechanism = uqmbd.Mechanism("slide", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, velocity=1)
    >>> drag = mechanism.add(Drag("drag", mass, rate=1))
    >>> mechanism.output("speed", mass.velocity[0], units="m/s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["speed"][-1]), 4)  # exp(-1)
    0.3679
    """

    def __init__(
        self,
        space: Space,
        frames: Mapping[str, Frame],
        values: Mapping[str, Any],
        time: sympy.Symbol,
        coordinates: Mapping[str, tuple[sympy.Symbol, sympy.Symbol]] | None = None,
    ) -> None:
        self.space = space
        self.time = time
        self._coordinates = dict(coordinates or {})
        self._names = {**frames, **values}
        self.states: dict[str, sympy.Symbol] = {}
        self.units: dict[str, str] = {}
        self.quantities: dict[QuantitySymbol, tuple[str, sympy.Expr]] = {}

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - a frame, an expression, a vector or an option
        try:
            return self.__dict__["_names"][name]
        except KeyError:
            names = sorted(self.__dict__.get("_names", ()))
            near = "; the time is p.time." if name == "t" else did_you_mean(name, names) or "."
            there = ", ".join([*names, "time", "space", "let", "rate_of", "state", "coordinate"])
            raise AttributeError(f"p has no attribute {name!r}{near} Available are {there}") from None

    @typechecked
    def state(self, name: str, units: str = "") -> sympy.Symbol:
        """Return the symbol of an auxiliary differential state; the method `terms` must also yield its `Auxiliary`.

        Outputs contain the state as ``component.state(name)``.

        Parameters
        ----------
        name : str
            Name of the state, unique within the component.
        units : str
            Units of the state, such as ``"Pa"``. Outputs and `uqmbd.testing.check_component` compare these units with
            the units of expressions that contain the state. Empty: unknown.

        Raises
        ------
        uqmbd.StudyError
            If the name is not a text, or the units are unknown.
        """
        if units or name not in self.units:
            self.units[name] = check_units(units, f"state({name!r})")
        return self.states.setdefault(name, sympy.Symbol(f"_s{len(self.states)}", real=True))

    @typechecked
    def coordinate(self, name: str, derivative: Literal[0, 1] = 0) -> sympy.Symbol:
        """Return the symbol of a coordinate that `Component.coordinates` declares, or of its rate.

        Parameters
        ----------
        name : str
            Name of the coordinate.
        derivative : int
            0 for the coordinate, 1 for its rate.

        Raises
        ------
        uqmbd.StudyError
            If the component declares no such coordinate.
        """
        if name not in self._coordinates:
            listed = ", ".join(map(repr, self._coordinates)) or "none"
            raise StudyError(
                f"coordinate({name!r}): the component has no such coordinate"
                f"{did_you_mean(name, self._coordinates) or '.'} Its method coordinates() declares: {listed}."
            )
        return self._coordinates[name][derivative]

    def attach(self, frames: Mapping[str, Sequence[sympy.Expr]]) -> None:
        """Add frames with given coordinates by name; the coordinates and their rates are named quantities."""
        for name, coordinates in frames.items():
            # name plain symbols too: rates of points are derivatives with respect to named quantities only
            q = [x if x.is_number else self._quantity(name, x, "value") for x in coordinates]
            self._names[name] = Frame(self.space, q, [self._named("rate", x, "rate") for x in q])

    def insert(self, values: Mapping[sympy.Basic, sympy.Expr]) -> None:
        """Replace symbols in the values of parameters by their definitions."""
        if values:
            self._names = {
                key: x.xreplace(values) if isinstance(x, (sympy.Basic, sympy.MatrixBase)) else x
                for key, x in self._names.items()
            }

    def let(self, name: str, expression: Any) -> Any:  # noqa: ANN401 - an expression, or a column of them
        """Name an intermediate quantity (a gap, a normal), so that its definition is derived and computed only once.

        The derivation of the equations is slow if terms contain a long expression many times. A named quantity instead
        of the expression makes the derivation faster.

        Parameters
        ----------
        name : str
            Name of the quantity, for messages.
        expression : expression, or vector of expressions
            Definition, in coordinates, velocities, states, time, parameters and other named quantities.

        Returns
        -------
        symbol, or column of symbols
            Symbol of the quantity, whose definition is included in derivatives of terms. Numbers and symbols are
            returned unchanged.
        """
        return self._named(name, expression, "value")

    def rate_of(self, expression: Any) -> Any:  # noqa: ANN401 - an expression, or a column of them
        """Return the time derivative of an expression or vector in coordinates, states, time and named quantities.

        Returns
        -------
        symbol, or column of symbols
            Placeholder for ``d expression / d q . v + d expression / d t``, plus the corresponding term for states.
        """
        return self._named("rate", expression, "rate")

    def _named(self, name: str, expression: Any, kind: str) -> Any:  # noqa: ANN401 - same types as in let and rate_of
        if isinstance(expression, (list, tuple, sympy.MatrixBase)):
            return sympy.Matrix([self._named(name, x, kind) for x in flatten(expression)])
        value = as_symbolic(expression)
        if value.is_number or (value.is_Symbol and kind == "value"):
            return value if kind == "value" else sympy.S.Zero
        return self._quantity(name, value, kind)

    def _quantity(self, name: str, value: sympy.Expr, kind: str) -> QuantitySymbol:
        symbol = QuantitySymbol(name, real=True)
        symbol.contains = frozenset(value.free_symbols)
        self.quantities[symbol] = (kind, value)
        return symbol
