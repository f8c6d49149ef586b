"""Scalar outputs that plugin functions compute from the linearised mechanism."""

from __future__ import annotations

import types
from collections.abc import Callable
from typing import Any, ClassVar, Self, overload

import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import FunctionData, Placeholder
from uqmbd.mechanism.expressions.custom_summaries import function_digest
from uqmbd.mechanism.expressions.timeless import single
from uqmbd.mechanism.expressions.user_values import shown
from uqmbd.units import Unit, read_units

__all__ = ["DeclaredLinearOutput", "LinearOutput", "linear_output"]

POSES = ("equilibrium", "start", "steady")
"""Poses, and the steady motion, about which the motion can be linearised."""


class DeclaredLinearOutput:
    """Declared function of the linearised mechanism; a call with an expression returns a quantity for outputs."""

    def __init__(self, function: Callable[..., Any], power: int | None = None, unit: Unit | None = None) -> None:
        self.function, self.power, self.unit = function, power, unit
        self.__name__, self.__qualname__ = function.__name__, function.__qualname__
        self.__module__, self.__doc__ = function.__module__, function.__doc__
        self.digest = function_digest(function)

    def __call__(self, expression: Any, *numbers: float, at: str = "equilibrium") -> sympy.Expr:
        """Return the quantity for an expression; `numbers` are further arguments of the function."""
        name = self.__name__.lstrip("_")
        try:
            seen = single(name, expression)
        except StudyError as error:
            raise StudyError(str(error).replace(f"uqmbd.{name}(", f"{name}(")) from None
        for number in numbers:
            if isinstance(number, bool) or not isinstance(number, (int, float)) or not abs(number) < float("inf"):
                raise StudyError(f"{name} was given {shown(number)} after the expression; expected finite numbers.")
        if at not in POSES:
            raise StudyError(f"{name}: at is {shown(at)}; expected 'equilibrium', 'start' or 'steady'.")
        pose = sympy.Integer(POSES.index(at))
        found: sympy.Expr = LinearOutput(seen, LinearFunction(self), pose, *map(sympy.Float, numbers))
        return found

    def __reduce__(self) -> str:
        return self.__qualname__  # workers import the function by this name


class LinearFunction(FunctionData):
    """Declared function as an atom of expressions; atoms with the same code are equal."""

    declared: DeclaredLinearOutput

    def __new__(cls, declared: DeclaredLinearOutput) -> Self:
        """Store the declaration."""
        self: Self = super().__new__(cls)
        self.declared = declared
        return self

    def _hashable_content(self) -> tuple[Any, ...]:
        return (self.declared.digest,)

    def __reduce__(self) -> tuple[Any, ...]:
        return (LinearFunction, (self.declared,))

    def _sympyrepr(self, printer: Any) -> str:
        return f"LinearFunction({self.declared.digest!r})"


class LinearOutput(Placeholder, sympy.Function):
    """Scalar that a declared function computes from the response of an expression in the linearised mechanism."""

    nargs: ClassVar[int | None] = None
    is_real = True

    @property
    def seen(self) -> sympy.Expr:
        """Expression whose response the function receives."""
        found: sympy.Expr = self.args[0]
        return found

    @property
    def declared(self) -> DeclaredLinearOutput:
        """The declared function."""
        found: DeclaredLinearOutput = self.args[1].declared
        return found

    @property
    def at(self) -> str:
        """Pose of the linearisation."""
        return POSES[int(self.args[2])]

    @property
    def numbers(self) -> tuple[float, ...]:
        """Further arguments of the function."""
        return tuple(float(number) for number in self.args[3:])

    def _sympystr(self, printer: Any) -> str:
        arguments = [printer.doprint(self.seen), *(f"{number:g}" for number in self.numbers)]
        pose = "" if self.at == "equilibrium" else f", {self.at}"
        return f"{self.declared.__name__.lstrip('_')}({', '.join(arguments)}{pose})"


@overload
def linear_output(
    function: Callable[..., Any], *, power: int | None = None, units: str = ""
) -> DeclaredLinearOutput: ...


@overload
def linear_output(
    *, power: int | None = None, units: str = ""
) -> Callable[[Callable[..., Any]], DeclaredLinearOutput]: ...


@typechecked
def linear_output(function: Callable[..., Any] | None = None, *, power: int | None = None, units: str = "") -> Any:
    """Declare an output of the linearised mechanism, such as a standard deviation; every method can propagate it.

    Parameters
    ----------
    function : callable
        Function of a module, which workers can import. ``function(system, *numbers)`` receives the response of one
        expression in K realisations as `uqmbd.extend.LinearSystem`. The function returns K numbers, and K texts: the
        reason of a realisation without a value, or an empty text. Without `function`, the call returns a decorator.
    power : int, optional
        The quantity has the units of the expression to this power, times `units`: 1 for a standard deviation, 2 for a
        variance, 0 for a rate. Default: uqmbd does not check the units of the quantity.
    units : str
        Further factor of the units, such as ``"1/s"`` or ``"s"``.

    Returns
    -------
    callable
        Function ``function(expression, *numbers, at="equilibrium")``, which returns a scalar quantity for outputs and
        requirements. With ``at="start"`` the motion is linearised about the initial pose, and with
        ``at="steady"`` about the steady motion, as for `uqmbd.eigenfrequency`.

    Raises
    ------
    uqmbd.StudyError
        If `function` is not a function, `units` is unknown or given without `power`, or the argument of the quantity is
        not a single expression.

    Examples
    --------
    The static response to a unit force:

    >>> import numpy as np
    >>> import uqmbd
    >>> from dataclasses import dataclass
    >>> from uqmbd_springs import PointForce, SpringDamper
    >>> @dataclass(frozen=True)
    ... class Force:
    ...     name: str = "force"
    ...     units: str = "N"
    >>> def compliance(system):
    ...     state = np.linalg.solve(system.a, system.b[:, :, :1])[:, :, 0]
    ...     return system.e[:, 0, 0] - np.einsum("kn,kn->k", system.c, state), [""] * len(state)
    >>> compliance = uqmbd.extend.linear_output(compliance)
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=2, position=1)
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, 50, damping=1, free_length=1))
    >>> force = uqmbd.extend.excitation(Force(), uqmbd.t)
    >>> load = mechanism.add(PointForce("load", mass, 0, force))
    >>> mechanism.output("compliance", compliance(mass.position[0]), units="m/N")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["compliance"]), 9)
    0.02
    """
    unit = read_units(units or "1")
    if unit is None or (units and power is None):
        raise StudyError(
            f"linear_output: units is {units!r} and power is {power}; expected known units and a power, such as "
            "units='1/s', power=0. The result has the units of the expression to this power, times units."
        )

    def declare(written: Any) -> DeclaredLinearOutput:
        if not isinstance(written, types.FunctionType):
            raise StudyError(f"linear_output was given {shown(written)}; expected a function written in Python.")
        return DeclaredLinearOutput(written, power, unit)

    return declare if function is None else declare(function)
