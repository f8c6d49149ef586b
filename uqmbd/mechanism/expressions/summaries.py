"""Scalar outputs that summarise a motion: extremes, times of extremes, integrals, last values, first times."""

from __future__ import annotations

from typing import Any, ClassVar

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import Placeholder
from uqmbd.mechanism.expressions.timeless import single
from uqmbd.mechanism.expressions.user_values import shown
from uqmbd.names import checked

__all__ = [
    "Final",
    "FirstTime",
    "IntegralOverTime",
    "Maximum",
    "Minimum",
    "RootMeanSquare",
    "Summary",
    "TimeOfMaximum",
    "TimeOfMinimum",
    "final",
    "first_time",
    "integral",
    "maximum",
    "minimum",
    "root_mean_square",
    "time_of_maximum",
    "time_of_minimum",
]


class Summary(Placeholder, sympy.Function):
    """Base class of summaries: scalars computed from an expression over the whole motion of a realisation."""

    nargs: ClassVar[int | None] = 1
    is_real = True
    kind: ClassVar[str] = ""

    @property
    def summed(self) -> sympy.Expr:
        """Expression that is summarised over time."""
        found: sympy.Expr = self.args[0]
        return found

    @property
    def further(self) -> tuple[sympy.Expr, ...]:
        """Further expressions that the summary follows over time."""
        return ()

    def _sympystr(self, printer: Any) -> str:
        return f"{self.kind}({printer.doprint(self.args[0])})"


class Maximum(Summary):
    """The largest value of an expression."""

    kind = "maximum"


class Minimum(Summary):
    """The smallest value of an expression."""

    kind = "minimum"


class TimeOfMaximum(Summary):
    """Time at which an expression is largest."""

    kind = "time_of_maximum"


class TimeOfMinimum(Summary):
    """Time at which an expression is smallest."""

    kind = "time_of_minimum"


class RootMeanSquare(Summary):
    """The root of the mean square of an expression."""

    kind = "root_mean_square"

    @property
    def summed(self) -> sympy.Expr:
        """Square of the expression."""
        found: sympy.Expr = self.args[0] ** 2
        return found


class IntegralOverTime(Summary):
    """The integral of an expression over time."""

    kind = "integral"


class Final(Summary):
    """The last value of an expression."""

    kind = "final"


class FirstTime(Summary):
    """First time at which an expression is zero or above."""

    kind = "first_time"

    def _sympystr(self, printer: Any) -> str:
        return f"{self.kind}({printer.doprint(self.args[0])} >= 0)"


@checked
def maximum(expression: Any) -> sympy.Expr:
    """Return the largest value of an expression over the motion of a realisation, for use in an output.

    The search covers the whole motion from the first output time to the last, and not only the output times.  uqmbd
    evaluates the expression at interpolated states on the steps of the integrator; the maximum is as accurate as these
    states.  At a jump, such as the jump of a velocity at an impact, the values on both sides count.  The search may
    miss a peak that is shorter than 1/300 of the whole time, unless the integration steps are equally short.  An output
    of a maximum has one value per realisation and no time.  Summaries can be combined, as in ``maximum(x) -
    minimum(x)``.

    If two peaks exchange their order within the range of the inputs, the maximum has a kink over the inputs, and
    `time_of_maximum` jumps. Polynomials converge slowly to a kink.

    Parameters
    ----------
    expression : SymPy expression
        Scalar expression in quantities that an output may contain: positions, reactions, random variables, time ...

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, is a number, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    >>> mass = mechanism.body("mass", mass=1, position=(2, 0))
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), 100, free_length=1.5))
    >>> mechanism.output("farthest", uqmbd.maximum(mass.position[0]), units="m")
    >>> mechanism.output("fastest", uqmbd.maximum(mass.velocity[0]), units="m/s")
    >>> found = uqmbd.simulate(mechanism, [0, 1])
    >>> round(float(found["farthest"]), 5), round(float(found["fastest"]), 4)
    (2.0, 5.0)
    """
    found: sympy.Expr = Maximum(single("maximum", expression))
    return found


@checked
def minimum(expression: Any) -> sympy.Expr:
    """Return the smallest value of an expression over the motion of a realisation, for use in an output.

    See `uqmbd.maximum`.

    Parameters
    ----------
    expression : SymPy expression
        Scalar expression, as for `uqmbd.maximum`.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, is a number, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.minimum(uqmbd.t)
    minimum(t)
    """
    found: sympy.Expr = Minimum(single("minimum", expression))
    return found


@checked
def time_of_maximum(expression: Any) -> sympy.Expr:
    """Return the time at which an expression is largest in the motion of a realisation, in s, for use in an output.

    Peaks count as equal if they differ by less than ten times the tolerance of the integration (`rtol`), relative to
    the largest value. The result is the time of the first of several equal peaks. If another peak becomes the largest
    within the range of the inputs, the time jumps, and a surrogate of the time must represent a discontinuity.

    Parameters
    ----------
    expression : SymPy expression
        Scalar expression, as for `uqmbd.maximum`.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, is a number, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_springs import SpringDamper
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    >>> mass = mechanism.body("mass", mass=1, position=(2, 0))
    >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), 100, free_length=1.5))
    >>> mechanism.output("when", uqmbd.time_of_maximum(-mass.position[0]), units="s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["when"]), 6)
    0.314159
    """
    found: sympy.Expr = TimeOfMaximum(single("time_of_maximum", expression))
    return found


@checked
def time_of_minimum(expression: Any) -> sympy.Expr:
    """Return the time at which an expression is smallest in the motion of a realisation, in s, for use in an output.

    See `uqmbd.time_of_maximum`.

    Parameters
    ----------
    expression : SymPy expression
        Scalar expression, as for `uqmbd.maximum`.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, is a number, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.time_of_minimum(uqmbd.t)
    time_of_minimum(t)
    """
    found: sympy.Expr = TimeOfMinimum(single("time_of_minimum", expression))
    return found


@checked
def root_mean_square(expression: Any) -> sympy.Expr:
    """Return the root of the mean square of an expression over the motion of a realisation, for use in an output.

    Parameters
    ----------
    expression : SymPy expression
        Scalar expression, as for `uqmbd.maximum`.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, is a number, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("throw", uqmbd.Translational(gravity=(0, -10)))
    >>> ball = mechanism.body("ball", mass=1)
    >>> mechanism.output("speed", uqmbd.root_mean_square(ball.velocity[1]), units="m/s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 3])["speed"]) ** 2, 6)
    300.0
    """
    found: sympy.Expr = RootMeanSquare(single("root_mean_square", expression))
    return found


@checked
def integral(expression: Any) -> sympy.Expr:
    """Return the integral of an expression over the motion of a realisation, for use in an output.

    The integral has the units of the expression times s, and extends from the first output time to the last.

    Parameters
    ----------
    expression : SymPy expression
        Scalar expression, as for `uqmbd.maximum`.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, is a number, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("throw", uqmbd.Translational(gravity=(0, -10)))
    >>> ball = mechanism.body("ball", mass=1)
    >>> mechanism.output("area", uqmbd.integral(ball.position[1]), units="m s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 3])["area"]), 6)
    -45.0
    """
    found: sympy.Expr = IntegralOverTime(single("integral", expression))
    return found


@checked
def final(expression: Any) -> sympy.Expr:
    """Return the value of an expression at the last output time, for use in an output.

    Parameters
    ----------
    expression : SymPy expression
        Scalar expression, as for `uqmbd.maximum`.

    Raises
    ------
    uqmbd.StudyError
        If `expression` is not a single expression, is a number, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("throw", uqmbd.Translational(gravity=(0, -10)))
    >>> ball = mechanism.body("ball", mass=1)
    >>> mechanism.output("depth", -uqmbd.final(ball.position[1]), units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 3])["depth"]), 6)
    45.0
    """
    found: sympy.Expr = Final(single("final", expression))
    return found


@checked
def first_time(relation: Any) -> sympy.Expr:
    """Return the time at which a relation is first true in the motion of a realisation, in s, for use in an output.

    If the relation is false until the last output time, the value is *censored*: the realisation has not failed,
    but has no value.  Statistics of samples use the uncensored realisations, and contain the share of censored
    realisations (``censored``).  A surrogate of the time is fitted only if none of its realisations is censored,
    including those of the verification.  `uqmbd.simulate` returns NaN.

    Parameters
    ----------
    relation : SymPy relation
        Relation such as ``x >= level``, in quantities that an output may contain. If the relation is true at the start,
        the value is the first output time.

    Raises
    ------
    uqmbd.StudyError
        If `relation` is not a relation with ``<=``, ``<``, ``>=`` or ``>``, or already contains a scalar output.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("throw", uqmbd.Translational(gravity=(0, -10)))
    >>> ball = mechanism.body("ball", mass=1)
    >>> mechanism.output("landing", uqmbd.first_time(ball.position[1] <= -5), units="s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 3])["landing"]), 6)
    1.0
    """
    if isinstance(relation, (sympy.Ge, sympy.Gt)):
        difference = relation.lhs - relation.rhs
    elif isinstance(relation, (sympy.Le, sympy.Lt)):
        difference = relation.rhs - relation.lhs
    else:
        always = isinstance(relation, (bool, sympy.logic.boolalg.BooleanAtom))
        why = ", which is the same at all times" if always else ""
        raise StudyError(
            f"first_time: the argument is {shown(relation)}{why}; expected a relation, e.g. "
            "uqmbd.first_time(body.position[0] >= 0.5)."
        )
    found: sympy.Expr = FirstTime(single("first_time", difference))
    return found
