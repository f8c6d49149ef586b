"""Contents of expressions: operations and functions that can be compiled and differentiated."""

from __future__ import annotations

from typing import Any

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
"""Functions among them whose derivative cannot be computed."""


class Placeholder:
    """Base of functions that represent separately computed quantities, such as a value at equilibrium."""


class OwnFunction(sympy.Function):
    """Base of functions that SymPy does not have: they write themselves out in those that it has, or have a table."""


class FunctionData(sympy.AtomicExpr):
    """Base of atoms that are no numbers, but data of an `OwnFunction`."""


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
    """Return, as the end of a sentence, why a part found by `foreign_part` is invalid, and what to write instead.

    >>> print(describe_foreign_part(sympy.Function("f")(sympy.Symbol("x"))))
    it contains f(x), and the function f is not defined; write the expression that it stands for.
    """
    text = str(part)
    text = text if len(text) <= 80 else text[:77] + "..."
    kind = type(part).__name__
    if isinstance(part, AppliedUndef):
        return f"it contains {text}, and the function {kind} is not defined; write the expression that it stands for."
    if isinstance(part, sympy.Derivative):
        # .doit() would be wrong: to SymPy positions do not depend on time
        return (
            f"it contains {text}, and SymPy does not know how bodies move. Write rates as body.velocity, "
            "body.acceleration, body.angular_velocity or body.point_velocity(local). The rate of an expression is the "
            "sum of its derivatives by positions times their velocities."
        )
    if isinstance(part, UNEVALUATED):
        return (
            f"it contains {text}, which is not evaluated. Call .doit() on it, or write an equivalent: a spline through "
            "samples, or an auxiliary variable of a custom component, whose rate is known."
        )
    if isinstance(part, sympy.Function):
        # a class of its own is written in small letters
        names = {f.__name__ for f in FUNCTIONS} | {f.__name__.lower() for f in OwnFunction.__subclasses__()}
        listed = ", ".join(sorted(names))
        return f"it contains {text}, and {kind} cannot be computed; write it with the functions that can: {listed}."
    return f"it contains {text}, which is a {kind} and no number."
