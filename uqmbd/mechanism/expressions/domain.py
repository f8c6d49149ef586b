"""Conditions on the parts of an expression under which it is a finite real number.

A function of an expression may be real where the expression is not; an example is the square of a root.  The
conditions are therefore taken from the expression as the user wrote it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.mechanism.expressions.time import step
from uqmbd.mechanism.expressions.user_values import as_symbolic
from uqmbd.randomness import RandomVariable

__all__ = ["DomainCondition", "domain_of"]


@dataclass(frozen=True)
class DomainCondition:
    """Condition for a finite real value of an expression: one of its parts must be nonzero, or nonnegative."""

    part: sympy.Expr
    nonzero: bool  # True: the part must differ from zero; False: the part must be zero or above

    @property
    def moves(self) -> bool:
        """Whether the part may change along a motion."""
        return any(not isinstance(s, RandomVariable) for s in self.part.free_symbols)

    def within(self, condition: Any) -> DomainCondition:
        """Return the condition restricted to the branch of a piecewise expression in which it applies."""
        return DomainCondition(sympy.Piecewise((self.part, condition), (1, True)), self.nonzero)


def domain_of(expression: Any) -> tuple[DomainCondition, ...]:
    """Return the conditions under which an expression is finite and real; empty if it is always finite and real."""
    return tuple(dict.fromkeys(_conditions(as_symbolic(expression), set())))


def _conditions(expression: sympy.Basic, seen: set[sympy.Basic]) -> Iterator[DomainCondition]:
    """Yield the conditions of an expression and its parts, except for parts in `seen`."""
    waiting: list[sympy.Basic] = [expression]
    while waiting:
        part = waiting.pop()
        if part in seen or not part.args:
            continue
        seen.add(part)
        if isinstance(part, step):
            part = part.doit()
        if isinstance(part, sympy.Piecewise):
            before: list[Any] = []
            for value, condition in part.args:
                here = sympy.And(condition, *(sympy.Not(one) for one in before))
                yield from (one.within(here) for one in _conditions(value, set()))
                before.append(condition)
            continue
        yield from _of(part)
        waiting += reversed(part.args)


def _of(part: sympy.Basic) -> Iterator[DomainCondition]:
    """Yield the conditions of one operation."""
    if isinstance(part, sympy.Pow):
        base, exponent = part.args[0], _exponent(part)
        if not exponent.is_integer and not nonnegative(base):
            real = DomainCondition(base, nonzero=False)
            # a power of a negative number is real if the exponent, such as a discrete random variable, is an integer
            yield real if exponent.is_number else real.within(sympy.Ne(exponent, sympy.floor(exponent)))
        falls = exponent.is_negative if exponent.is_number else not nonnegative(exponent)
        if falls:
            yield from _other_than_zero(base)
        return
    x = part.args[0]
    if isinstance(part, sympy.log):
        if not nonnegative(x):
            yield DomainCondition(x, nonzero=False)
        yield from _other_than_zero(x)
    elif isinstance(part, sympy.asin | sympy.acos | sympy.atanh):
        yield DomainCondition(1 - x**2, nonzero=False)
        if isinstance(part, sympy.atanh):
            yield from _other_than_zero(1 - x**2)
    elif isinstance(part, sympy.asec | sympy.acsc | sympy.acoth):
        yield DomainCondition(x**2 - 1, nonzero=False)
        if isinstance(part, sympy.acoth):
            yield from _other_than_zero(x**2 - 1)
    elif isinstance(part, sympy.acosh):
        yield DomainCondition(x - 1, nonzero=False)
    elif isinstance(part, sympy.tan | sympy.sec):
        yield from _other_than_zero(sympy.cos(x))
    elif isinstance(part, sympy.cot | sympy.csc):
        yield from _other_than_zero(sympy.sin(x))
    elif isinstance(part, sympy.coth | sympy.csch):
        yield from _other_than_zero(x)
    elif isinstance(part, sympy.gamma | sympy.loggamma):  # the compiled code computes both from log |gamma|
        yield from _other_than_zero(sympy.Piecewise((sympy.sin(sympy.pi * x), x < sympy.Rational(1, 2)), (1, True)))


def _exponent(power: sympy.Pow) -> sympy.Expr:
    """Return the exponent of a power; convert floats to rationals because SymPy does not treat 2.0 as an integer."""
    exponent = power.args[1]
    return sympy.Rational(exponent) if exponent.is_Float and exponent.is_finite else exponent


def _other_than_zero(part: sympy.Expr) -> Iterator[DomainCondition]:
    """Yield the conditions that the factors of a part are nonzero, for parts that change and may be zero."""
    if isinstance(part, sympy.Abs | sympy.Mul) or (isinstance(part, sympy.Pow) and _exponent(part).is_positive):
        for factor in part.args[:1] if isinstance(part, sympy.Pow) else part.args:
            yield from _other_than_zero(factor)
        return
    found = DomainCondition(part, nonzero=True)
    if found.moves and not positive(part):
        yield found


def nonnegative(e: sympy.Basic) -> bool:
    """Return whether the structure proves that an expression is nonnegative; the test of SymPy may take minutes."""
    if e.is_number or not e.args:
        return bool(e.is_nonnegative)
    if isinstance(e, sympy.Add | sympy.Mul):
        return all(nonnegative(x) for x in e.args)
    if isinstance(e, sympy.Pow):
        return bool(_exponent(e).is_even) or nonnegative(e.args[0])
    if isinstance(e, sympy.Max):
        return any(nonnegative(x) for x in e.args)
    return isinstance(e, sympy.Abs | sympy.Heaviside | sympy.acos | sympy.acosh) or positive(e)


def positive(e: sympy.Basic) -> bool:
    """Return whether the structure alone proves that an expression is positive."""
    if e.is_number or not e.args:
        return bool(e.is_positive)
    if isinstance(e, sympy.Add):
        return all(nonnegative(x) for x in e.args) and any(positive(x) for x in e.args)
    if isinstance(e, sympy.Mul):
        return all(positive(x) for x in e.args)
    if isinstance(e, sympy.Pow):
        return positive(e.args[0])
    if isinstance(e, sympy.Max):
        return any(positive(x) for x in e.args)
    return isinstance(e, sympy.exp | sympy.cosh | sympy.sech)
