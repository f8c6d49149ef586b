"""Symbol for time and functions of time for use in expressions."""

from __future__ import annotations

from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import OwnFunction
from uqmbd.mechanism.expressions.user_values import numbers
from uqmbd.randomness import Symbol, Symbolic

__all__ = ["step", "t"]


class _Time(Symbolic, Symbol):
    """The time symbol; a separate class distinguishes it from a user's symbol named ``t``."""

    def __new__(cls) -> _Time:
        self: _Time = sympy.Symbol.__xnew__(cls, "t", real=True)
        self.units = "s"
        return self

    def _hashable_content(self) -> tuple[Any, ...]:
        return (*super()._hashable_content(), "uqmbd time")

    def __reduce__(self) -> tuple[Any, ...]:
        return (_Time, ())


t = _Time()
"""Time in seconds: a SymPy symbol for drivers, forces and outputs."""


class step(OwnFunction):  # noqa: N801 - expressions contain the class like a function
    """Cubic step from `y0` at `x0` to `y1` at `x1`: constant outside, ``3 s^2 - 2 s^3`` between.

    The second derivative of the step jumps at both ends. If `x` is the time, the integrator is restarted at the ends.

    Parameters
    ----------
    x, x0, y0, x1, y1 : number or expression
        Independent variable, and coordinates of the two corners; ``x0 < x1``.

    Examples
    --------
    >>> import uqmbd
    >>> [uqmbd.step(x, 0, 1, 2, 5).doit() for x in (-1, 1, 3)]
    [1, 3, 5]
    """

    nargs = 5

    def __new__(cls, *arguments: Any, **options: Any) -> Any:
        """Raise, before SymPy fails, for an argument that is neither a number nor an expression."""
        if len(arguments) != 5:
            raise StudyError(f"step: {len(arguments)} arguments are given; expected step(x, x0, y0, x1, y1).")
        named = zip(("x", "x0", "y0", "x1", "y1"), arguments, strict=True)
        return super().__new__(cls, *(numbers("step", name, value, 1)[0] for name, value in named), **options)

    @classmethod
    def eval(cls, x: Any, x0: Any, y0: Any, x1: Any, y1: Any) -> None:
        """Raise if the corners are in the wrong order; evaluate nothing."""
        if x0.is_number and x1.is_number and not x0 < x1:
            raise StudyError(
                f"step({x}, {x0}, {y0}, {x1}, {y1}): x0 is {x0}, and x1 is {x1}; expected step(x, x0, y0, x1, y1) "
                "with x0 < x1, for a step from y0 at x0 to y1 at x1."
            )

    def doit(self, **hints: Any) -> sympy.Expr:
        """Return the step as a piecewise polynomial."""
        x, x0, y0, x1, y1 = self.args
        s = (x - x0) / (x1 - x0)
        return sympy.Piecewise((y0, x <= x0), (y1, x >= x1), (y0 + (y1 - y0) * s * s * (3 - 2 * s), True))

    def _eval_rewrite_as_Piecewise(self, *args: Any, **kwargs: Any) -> sympy.Expr:  # noqa: N802 - SymPy's hook
        return self.doit()

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Return the derivative with respect to one argument."""
        dummies = [sympy.Dummy(real=True) for _ in self.args]
        return (
            self.func(*dummies).doit().diff(dummies[argindex - 1]).xreplace(dict(zip(dummies, self.args, strict=True)))
        )
