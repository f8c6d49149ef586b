"""Tables as smooth functions: cubic splines that enter expressions like a function of SymPy.

SymPy's own splines are piecewise expressions, which take minutes to make, to differentiate and to compile.  Here a
spline is one function with a table; only who compiles it (`uqmbd.dynamics.equations`) looks into the table.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import OwnFunction
from uqmbd.mechanism.expressions.spline_table import SplineTable, table_of
from uqmbd.mechanism.expressions.time import t
from uqmbd.mechanism.expressions.user_values import LARGEST, numbers, shown
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["Spline", "spline"]

Ends = Literal["not-a-knot", "natural", "flat"]
Beyond = Literal["constant", "linear"]

MOST = 10**7
"""Knots, at most."""

CLOSED = 1e-9
"""Difference of the first and the last value of a period, over the largest, that is rounding."""


class Spline(OwnFunction):
    """A spline of an argument: ``Spline(x, table, order, *terms)``, with `order` that of a derivative.

    Its value is the spline through the first values of the table. Each term contributes its product with the spline
    through the values of the term. A call puts another argument in the place of its own.

    Examples
    --------
    A call of `uqmbd.spline` makes a function; with a symbol it is an expression that can be differentiated:

    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.laws import length
    >>> cubic = uqmbd.spline(np.linspace(0, 1, 5), np.linspace(0, 1, 5) ** 3)(length)
    >>> round(float(cubic.subs(length, 0.3)), 6), round(float(cubic.diff(length).subs(length, 0.3)), 6)
    (0.027, 0.27)
    """

    is_real = True

    @classmethod
    def eval(cls, x: Any, table: Any, order: Any, *terms: Any) -> sympy.Expr | None:
        """Compute the value for a number; insert terms that are numbers into the table."""
        if order > 3:
            return sympy.S.Zero
        known = {k: float(e) for k, e in enumerate(terms) if e.is_number}
        if known:
            left = [e for e in terms if not e.is_number]
            return cls(x, table.folded(known), order, *left)
        if x.is_number and not terms and x.is_comparable:
            return sympy.Float(float(table.value(np.array([float(x)]), int(order))[0]))
        return None

    @property
    def argument(self) -> sympy.Expr:
        """Argument of the spline."""
        result: sympy.Expr = self.args[0]
        return result

    @property
    def table(self) -> SplineTable:
        """Its knots and values."""
        result: SplineTable = self.args[1]
        return result

    @property
    def order(self) -> int:
        """Order of the derivative of the spline."""
        return int(self.args[2])

    @property
    def random_terms(self) -> tuple[sympy.Expr, ...]:
        """Terms in which the values are linear."""
        return tuple(self.args[3:])

    def __call__(self, argument: Any) -> sympy.Expr:
        """Return the same function of another argument."""
        result: sympy.Expr = self.func(numbers("spline", "its argument", argument, 1)[0], *self.args[1:])
        return result

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Return the derivative with respect to the argument, or to a term."""
        x, table, order, *terms = self.args
        result: sympy.Expr
        if argindex == 1:
            result = Spline(x, table, order + 1, *terms)
        else:
            column = table.values[:, [argindex - 3]]
            result = Spline(x, SplineTable(table.knots, column, table.ends, table.beyond), order)
        return result

    def _eval_derivative(self, s: sympy.Symbol) -> sympy.Expr:
        x, _, _, *terms = self.args
        parts = [(1, x), *((4 + k, e) for k, e in enumerate(terms))]
        return sympy.Add(*(self.fdiff(k) * e.diff(s) for k, e in parts if s in e.free_symbols))

    def _eval_evalf(self, prec: int) -> None:
        """Do nothing: numbers are evaluated at once, and the remaining ones contain symbols."""

    @staticmethod
    def _imp_(x: Any, text: str, order: int, *terms: Any) -> Any:
        """Compute it in a function that `sympy.lambdify` made."""
        flat = np.broadcast_arrays(np.asarray(x, dtype=float), *(np.asarray(e, dtype=float) for e in terms))
        factors = np.stack([e.ravel() for e in flat[1:]], axis=1) if terms else None
        found = table_of(text).value(flat[0].ravel(), order, factors).reshape(flat[0].shape)
        return float(found) if found.ndim == 0 else found

    def _sympystr(self, printer: Any) -> str:
        return f"spline{chr(39) * self.order}({printer._print(self.argument)})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        power = "" if exp is None else f"^{{{exp}}}"
        return rf"\operatorname{{spline}}{chr(39) * self.order}{power}\left({printer._print(self.argument)}\right)"


def spline(
    times_or_values: Sequence[Any],
    values: Sequence[Any],
    periodic: bool = False,  # noqa: FBT001, FBT002 - a short way to mark a table of one period
    *,
    ends: Ends | None = None,
    beyond: Beyond | None = None,
) -> Spline:
    """Return the cubic spline through a table, as a function of `uqmbd.t`; called, of anything else.

    It is twice continuously differentiable, and enters every place where an expression does: prescribed motions,
    forces, laws in a user's symbol, outputs.  Neither the time that it takes to compile nor, nearly, that to evaluate
    grows with the number of knots.

    Parameters
    ----------
    times_or_values : sequence of n numbers
        The knots, increasing: times (s), or values of whatever the spline is called with (its units).
    values : sequence of n numbers or expressions
        The values there, in units of their own; expressions in random variables.
    periodic : bool
        Whether the table is one period, which goes on in both directions: first and last value are the same.
    ends : {"not-a-knot", "natural", "flat"}, optional
        What closes the spline at both ends, if it is not periodic.  ``not-a-knot`` (the default): the first two
        intervals have one cubic, as have the last two, which keeps the order of accuracy; ``natural``: no curvature;
        ``flat``: no slope.
    beyond : {"constant", "linear"}, optional
        Its course beyond the ends, if it is not periodic.  ``constant`` (the default): the first and the last value,
        with a corner there unless the ends are flat; ``linear``: straight lines with the slopes of the ends.

    Returns
    -------
    expression
        In `uqmbd.t`.  ``spline(...)(x)`` is the same function of the expression `x`.  It may be differentiated and
        inserted into like any other; ``float(expression.subs(uqmbd.t, 0.3))`` is its value.

    Raises
    ------
    uqmbd.StudyError
        If there are too few knots, or not one for each value; if knots are not increasing numbers, values not finite or
        not of random variables alone, or the ends of a period differ.

    Notes
    -----
    The third derivative jumps at the knots, which the error estimate of ``dop853`` does not see. If the argument is
    linear in time, with random numbers or without, steps of ``dop853`` end at the knots that count at the tolerance. If
    there are too many, steps are short. Where the argument is a state, such as the angle of a cam, the error estimate
    alone controls the steps: with a table that is not smooth take a smaller `rtol`, or ``integrator="ida"``, whose
    estimate sees the knots.

    The coefficients of a spline are linear in its values, so that random values cost little more than numbers.  That of
    the ends ``not-a-knot`` is the default of `scipy.interpolate.CubicSpline` [1]_.

    References
    ----------
    .. [1] C. de Boor, "A Practical Guide to Splines", Springer, 2001, chapter IV.

    Examples
    --------
    >>> import uqmbd
    >>> torque = uqmbd.spline([0, 0.5, 1, 2], [0, 3, 4, 4])
    >>> torque, torque.diff(uqmbd.t)
    (spline(t), spline'(t))
    >>> [round(float(torque.subs(uqmbd.t, x)), 6) for x in (-1, 0.5, 2, 9)]
    [0.0, 3.0, 4.0, 4.0]

    A cam's lift over its angle, one turn:

    >>> import sympy
    >>> lift = uqmbd.spline([0, 1.57, 3.14, 4.71, 6.28], [0, 0.01, 0.02, 0.01, 0], periodic=True)
    >>> angle = sympy.Symbol("angle", real=True)
    >>> [round(float(lift(angle).subs(angle, x)), 6) for x in (1.57, 1.57 + 3 * 6.28)]
    [0.01, 0.01]
    """
    knots = _knots(times_or_values)
    table, terms = _values(values)
    if len(knots) != len(table):
        raise StudyError(
            f"spline: there are {len(knots)} knots and {len(table)} values; expected a value for each knot."
        )
    if not isinstance(periodic, (bool, np.bool_)):
        raise StudyError(f"spline: periodic is {shown(periodic)}; expected True or False.")
    least = 3 if periodic else 2
    if len(knots) < least:
        raise StudyError(
            f"spline: there {'is' if len(knots) == 1 else 'are'} {len(knots)} knot{'s' * (len(knots) != 1)}; expected "
            f"at least {least}{' of a period' if periodic else ''}."
        )
    options = (("ends", ends, ("not-a-knot", "natural", "flat")), ("beyond", beyond, ("constant", "linear")))
    for name, option, known in options:
        if option is not None and periodic:
            raise StudyError(f"spline: {name} is {shown(option)}, but a period has no ends; leave {name} out.")
        if option is not None and not (isinstance(option, str) and option in known):
            raise StudyError(f"spline: {name} is {shown(option)}; expected one of {', '.join(map(repr, known))}.")
    if periodic:
        gap = np.abs(table[-1] - table[0])
        if (gap > CLOSED * np.abs(table).max(axis=0, initial=0.0)).any():
            first, *_, last = np.asarray(values, dtype=object).tolist()
            raise StudyError(
                f"spline: the first value of the period is {shown(first)} and the last {shown(last)}; expected the "
                "same value at both ends of a period."
            )
        table[-1] = table[0]
    if ends == "flat" and beyond == "linear":
        raise StudyError("spline: beyond is 'linear', but flat ends have no slope; leave beyond out.")
    atom = SplineTable(knots, table, "periodic" if periodic else ends or "not-a-knot", beyond or "constant")
    result = Spline(t, atom, 0, *terms)
    assert isinstance(result, Spline)
    return result


def _knots(given: Any) -> Array:
    """Return the knots as numbers; raise if they are invalid."""
    found, expressions = _plain_numbers("knots", given)
    if expressions:
        random = [s for _, e in expressions for s in e.free_symbols if isinstance(s, RandomVariable)]
        what = (
            f"the random variable {random[0]}"
            if random
            else f"the symbol {min(map(str, expressions[0][1].free_symbols))}"
        )
        raise StudyError(
            f"spline: the knot {shown(expressions[0][1])} contains {what}; expected numbers. Values may be random, "
            "knots not: to stretch the table by a random factor, call the spline with its argument over the factor."
        )
    wrong = np.flatnonzero(~(np.diff(found) > 0))
    if len(wrong):
        k = int(wrong[0])
        raise StudyError(
            f"spline: the knots do not increase: number {k + 1} is {found[k]:g} and number {k + 2} is {found[k + 1]:g}."
        )
    return found


def _values(given: Any) -> tuple[Array, list[sympy.Expr]]:
    """Return values (n, 1 + M), a constant and factors of terms, and the M terms; raise if they are invalid."""
    constant, expressions = _plain_numbers("values", given)
    columns: dict[sympy.Expr, Array] = {}
    for k, e in expressions:
        if others := sorted((s for s in e.free_symbols if not isinstance(s, RandomVariable)), key=str):
            what = "time" if others[0] == t else f"the symbol {others[0]}"
            raise StudyError(
                f"spline: the value {shown(e)} depends on {what}; expected numbers, or expressions in random variables."
            )
        for term, factor in e.as_coefficients_dict().items():
            if term == 1:
                constant[k] += float(factor)
            else:
                columns.setdefault(term, np.zeros(len(constant)))[k] = float(factor)
    return np.column_stack([constant, *columns.values()]), list(columns)


def _plain_numbers(what: str, given: Any) -> tuple[Array, list[tuple[int, sympy.Expr]]]:
    """Return numbers (n,), zero where an expression is, and the expressions with their places."""
    wanted = f"expected a list of {'numbers' if what == 'knots' else 'numbers or expressions'}"
    if isinstance(given, (str, bytes, type)) or not (hasattr(given, "__len__") or hasattr(given, "__array__")):
        raise StudyError(f"spline: the {what} are {shown(given)}; {wanted}.")
    if np.ma.is_masked(given) or getattr(given, "size", 0) > MOST:
        raise StudyError(f"spline: the {what} are {shown(given)}; {wanted}, none masked, {MOST} at most.")
    try:
        array = np.asarray(given)
    except ValueError:
        array = None
    if array is None or array.ndim != 1:
        raise StudyError(f"spline: the {what} are {shown(given)}, which is nested; {wanted}.")
    if array.dtype.kind in "fiu":
        if not np.isfinite(array).all():
            k = int(np.flatnonzero(~np.isfinite(array))[0])
            raise StudyError(f"spline: {what[:-1]} number {k + 1} is {array[k]}; expected finite numbers.")
        if np.abs(array).max(initial=0) > LARGEST:
            raise StudyError(f"spline: {what} reach {np.abs(array).max():g}; expected numbers up to {LARGEST:g}.")
        return array.astype(float), []
    # of an array `numbers` takes few only: it is to become an expression, and a table is not
    entries = given if isinstance(given, (list, tuple)) else array.tolist()
    parts = numbers("spline", what, entries, len(entries))
    found = np.array([float(e) if e.is_number else 0.0 for e in parts])
    return found, [(k, e) for k, e in enumerate(parts) if not e.is_number]
