"""The arguments of terms: frames of bodies, symbols of parameters, states, and named quantities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import as_symbolic, flatten
from uqmbd.mechanism.geometry import Frame, Space
from uqmbd.names import check_units, did_you_mean

__all__ = ["RESERVED", "Local", "QuantitySymbol"]

RESERVED = frozenset({"insert", "let", "rate_of", "space", "state", "states", "time", "quantities", "units"})
"""Names of `Local` that parameters would hide."""


class QuantitySymbol(sympy.Dummy):
    """Symbol of a named quantity, see `Local.let`; SymPy must not differentiate past it."""

    contains: frozenset[sympy.Symbol] = frozenset()

    @property
    def free_symbols(self) -> set[sympy.Symbol]:
        """Return the symbol itself, and the symbols of its definition."""
        return {self, *self.contains}

    def _eval_derivative_n_times(self, s: sympy.Symbol, n: Any) -> sympy.Expr:
        if s not in self.contains:
            return super()._eval_derivative_n_times(s, n)
        raise StudyError(
            f"{self.name!r} is a quantity made by let(), whose derivative is not known here; use rate_of() "
            "for its rate in time, or differentiate the expression before it is given to let()."
        )


class Local:
    """The argument of `Component.terms`: frames for bodies, symbols for parameters, and the time.

    Attributes have the names of the component's body arguments (a `Frame` each), parameters and prepared values
    (an expression or a column of them).  Numbers are symbols here: one derivation serves all instances and values.

    Parameters
    ----------
    space : Space
        Of the mechanism.
    frames : mapping of str to Frame
        By the names of the body arguments.
    values : mapping of str to object
        Symbols of parameters and prepared values, and options as they are.
    time : symbol
        `uqmbd.t`, s.

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
        self, space: Space, frames: Mapping[str, Frame], values: Mapping[str, Any], time: sympy.Symbol
    ) -> None:
        self.space = space
        self.time = time
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
            there = ", ".join([*names, "time", "space", "let", "rate_of", "state"])
            raise AttributeError(f"nothing named {name!r} here{near} There are {there}") from None

    @typechecked
    def state(self, name: str, units: str = "") -> sympy.Symbol:
        """Return the symbol of an auxiliary differential state; yield `Auxiliary` for it as well.

        Studies record it as ``component.state(name)``.

        Parameters
        ----------
        name : str
            Of the state, within the component.
        units : str
            Of the state, as ``"Pa"``; outputs and `uqmbd.testing.check_component` compare them with its uses. Empty:
            unknown.

        Raises
        ------
        uqmbd.StudyError
            If the name is not a text, or the units have no meaning.
        """
        if units or name not in self.units:
            self.units[name] = check_units(units, f"state({name!r})")
        return self.states.setdefault(name, sympy.Symbol(f"_s{len(self.states)}", real=True))

    def insert(self, values: Mapping[sympy.Basic, sympy.Expr]) -> None:
        """Replace symbols in the values of parameters by their definitions."""
        if values:
            self._names = {
                key: x.xreplace(values) if isinstance(x, (sympy.Basic, sympy.MatrixBase)) else x
                for key, x in self._names.items()
            }

    def let(self, name: str, expression: Any) -> Any:  # noqa: ANN401 - an expression, or a column of them
        """Name an intermediate quantity (a gap, a normal), so that its definition is derived and computed once.

        Terms that hold one long expression many times over take long to derive; with a name for it they do not.

        Parameters
        ----------
        name : str
            For messages.
        expression : expression, or vector of them
            In coordinates, velocities, states, time, parameters and other quantities.

        Returns
        -------
        symbol, or column of them
            Stands for the expression in terms; differentiated wherever the terms are.  Numbers and symbols are returned
            as they are.
        """
        return self._named(name, expression, "value")

    def rate_of(self, expression: Any) -> Any:  # noqa: ANN401 - an expression, or a column of them
        """Rate in time of an expression, or of a vector of them, in coordinates, states, time and quantities.

        Returns
        -------
        symbol, or column of them
            Stands for ``d expression / d q . v + d expression / d t`` (and the same for states).
        """
        return self._named("rate", expression, "rate")

    def _named(self, name: str, expression: Any, kind: str) -> Any:  # noqa: ANN401 - as for let and rate_of
        if isinstance(expression, (list, tuple, sympy.MatrixBase)):
            return sympy.Matrix([self._named(name, x, kind) for x in flatten(expression)])
        value = as_symbolic(expression)
        if value.is_number or (value.is_Symbol and kind == "value"):
            return value if kind == "value" else sympy.S.Zero
        symbol = QuantitySymbol(name, real=True)
        symbol.contains = frozenset(value.free_symbols)
        self.quantities[symbol] = (kind, value)
        return symbol
