"""Operations and functions that expressions may contain, because they can be compiled and differentiated."""

from __future__ import annotations

from typing import Any, ClassVar

import sympy
from sympy.core.function import AppliedUndef
from sympy.core.numbers import ImaginaryUnit
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

__all__ = [
    "FUNCTIONS",
    "UNEVALUATED",
    "WITHOUT_DERIVATIVE",
    "FunctionData",
    "OwnFunction",
    "Placeholder",
    "foreign_part",
    "describe_foreign_part",
]

FUNCTIONS: tuple[type[sympy.Basic], ...] = (
    sympy.sin, sympy.cos, sympy.tan, sympy.cot, sympy.sec, sympy.csc,
    sympy.asin, sympy.acos, sympy.atan, sympy.acot, sympy.asec, sympy.acsc, sympy.atan2,
    sympy.sinh, sympy.cosh, sympy.tanh, sympy.coth, sympy.sech, sympy.csch,
    sympy.asinh, sympy.acosh, sympy.atanh, sympy.acoth,
    sympy.exp, sympy.log, sympy.erf, sympy.erfc, sympy.gamma, sympy.loggamma,
    sympy.Abs, sympy.sign, sympy.Heaviside, sympy.Max, sympy.Min, sympy.floor, sympy.ceiling, sympy.Piecewise,
)  # fmt: skip
"""Functions that expressions may contain."""

WITHOUT_DERIVATIVE: tuple[type[sympy.Basic], ...] = (sympy.floor, sympy.ceiling, sympy.gamma, sympy.loggamma)
"""Functions in `FUNCTIONS` whose derivative cannot be computed."""


class Placeholder:
    """Base class of functions that represent separately computed quantities, such as a value at equilibrium."""


class OwnFunction(sympy.Function):
    """Base class of functions missing from SymPy; a subclass expands into SymPy functions or has a table."""

    named: ClassVar[bool] = True
    """Whether users write the name of the function in expressions."""


class FunctionData(sympy.AtomicExpr):
    """Base class of atoms that contain the data of an `OwnFunction`."""


_OPERATIONS: tuple[type[sympy.Basic], ...] = (
    sympy.Add, sympy.Mul, sympy.Pow, sympy.Symbol, sympy.Number, sympy.NumberSymbol, ImaginaryUnit,
    sympy.core.relational.Relational, BooleanFunction, BooleanAtom, sympy.functions.elementary.piecewise.ExprCondPair,
)  # fmt: skip

UNEVALUATED: tuple[type[sympy.Basic], ...] = (
    sympy.Integral, sympy.Derivative, sympy.Sum, sympy.Product, sympy.Limit, sympy.Subs,
)  # fmt: skip
"""Objects of SymPy that represent unevaluated operations."""


_KNOWN: tuple[Any, ...] = (*_OPERATIONS, *FUNCTIONS, OwnFunction, FunctionData, Placeholder)


def foreign_part(expression: Any) -> sympy.Basic | None:
    """Return a part of an expression that can be neither compiled nor differentiated; None if there is none.

    >>> x = sympy.Symbol("x")
    >>> foreign_part(2 * sympy.sin(x)), foreign_part(1 + sympy.besselj(0, x))
    (None, besselj(0, x))
    """
    waiting: list[Any] = [expression]
    seen: set[Any] = set()
    while waiting:
        part = waiting.pop()
        if part in seen:
            continue
        seen.add(part)
        if not isinstance(part, _KNOWN):
            return part
        waiting += list(part.args)
    return None


def describe_foreign_part(part: sympy.Basic) -> str:
    """Return the end of a message: why a part found by `foreign_part` is invalid, and its replacement.

    >>> print(describe_foreign_part(sympy.Function("f")(sympy.Symbol("x"))))
    the expression contains f(x), but the function f is not defined. Insert the expression of the function.
    """
    text = str(part)
    text = text if len(text) <= 80 else text[:77] + "..."
    kind = type(part).__name__
    if isinstance(part, AppliedUndef):
        return (
            f"the expression contains {text}, but the function {kind} is not defined. Insert the "
            "expression of the function."
        )
    if isinstance(part, sympy.Derivative):
        # advising .doit() would be wrong: SymPy treats positions as independent of time
        return (
            f"the expression contains {text}, but SymPy cannot differentiate the motion of bodies. Write rates as "
            "body.velocity, body.acceleration, body.angular_velocity or body.point_velocity(local). For the rate of "
            "another expression, use the chain rule over the positions."
        )
    if isinstance(part, UNEVALUATED):
        return (
            f"the expression contains {text}, which is not evaluated. Call .doit() on it, or replace it, e.g. by a "
            "spline through samples or by an auxiliary state of a custom component."
        )
    if isinstance(part, sympy.Function):
        # users write functions of uqmbd in lower-case letters
        names = {f.__name__ for f in FUNCTIONS} | {f.__name__.lower() for f in OwnFunction.__subclasses__() if f.named}
        listed = ", ".join(sorted(names))
        return f"the expression contains {text}, but {kind} is not supported. Use the supported functions: {listed}."
    return f"the expression contains {text}, which is a {kind}, not a number."
