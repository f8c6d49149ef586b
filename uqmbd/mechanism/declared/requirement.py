"""Requirements of a mechanism (relations of expressions), and their margins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import sympy
from sympy.matrices.matrixbase import MatrixBase

from uqmbd.arguments import Bounds, typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.declared.output import Output
from uqmbd.mechanism.declared.recorded import require_recordable
from uqmbd.mechanism.declared.scope import Described, require_known, unseen_numbers
from uqmbd.mechanism.expressions import (
    EventTime,
    FirstTime,
    Maximum,
    Minimum,
    MotionSymbol,
    Summary,
    check_dimensions,
    check_scalar,
    is_scalar,
    random_variables,
    shown,
    t,
    units_of,
)
from uqmbd.names import ANY, check_name, unwritable

__all__ = ["Requirement", "requirement_of"]

BELOW = (sympy.LessThan, sympy.StrictLessThan)
ABOVE = (sympy.GreaterThan, sympy.StrictGreaterThan)


@typechecked
@dataclass(frozen=True)
class Requirement:
    """Requirement: a relation that a mechanism must satisfy.

    Attributes
    ----------
    name, description : str
        Name and description, as declared.
    relation : str
        Relation, as text.
    over_time : bool
        True: the relation must be true at all times. False: the relation is one condition for each realisation.
    at_the_end : bool
        Whether the condition is evaluated only at the end of the motion, as for an integral.
    open : {-1, 0, 1}
        Sign of the derivative of the margin with respect to the first time or event time in it; 0 if the margin
        contains several such times or none, or if the sign is not fixed. A time that does not occur until the end of
        the motion is later than the end. The margin is then larger (1) or smaller (-1) than the margin with the end as
        the time. If this bound does not decide whether the requirement is met, the realisation fails.
    units : str
        SI units of the margin, the difference of both sides; empty if they do not follow from the relation.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> mechanism.require("in reach", stone.position[0] > -10, "it stays above the ground")
    >>> (one,) = mechanism.requirements.values()
    >>> one.name, one.words, one.over_time, one.units
    ('in reach', 'it stays above the ground', True, 'm')
    """

    name: str
    description: str
    relation: str
    over_time: bool
    at_the_end: bool = False
    open: Annotated[int, Bounds(-1, 1)] = 0
    units: str = ""

    @property
    def words(self) -> str:
        """Description, or the relation if there is no description."""
        return self.description or self.relation


def requirement_of(mechanism: Described, name: str, relation: Any, description: Any) -> tuple[Requirement, Output]:
    """Return a requirement of a mechanism and its margin, or raise if an argument is invalid; see `Mechanism.require`.

    The margin is the difference of the two sides of the relation; a negative margin violates the requirement.
    """
    where = f"requirement {check_name(name, 'requirement')!r}"
    if name == ANY:
        raise StudyError(f"{where}: this name is reserved for the violation of any requirement; choose another name.")
    if name in mechanism.requirements:
        raise StudyError(f"{where}: a requirement with this name exists already; choose another name.")
    if not isinstance(description, str):
        raise StudyError(f"{where}: the description is {shown(description)}; expected a text.")
    if mark := unwritable(description):
        raise StudyError(f"{where}: the description is {shown(description)}; a description must not contain {mark}.")
    margin = _over_time(_margin(where, relation))
    value = require_recordable(where, margin)
    if not value.free_symbols:
        raise StudyError(
            f"{where}: the relation {relation} contains neither a quantity of the mechanism nor a random variable; "
            "expected a relation such as body.position[0] <= 0.47."
        )
    if value.free_symbols == {t}:
        raise StudyError(
            f"{where}: the relation {relation} depends only on time, not on the mechanism; expected a relation with "
            "a quantity of the mechanism or a random variable."
        )
    require_known(mechanism, where, value, "output")
    timeless = is_scalar(value) or not value.free_symbols - random_variables(value)
    if is_scalar(value):
        check_scalar(where, value)
    check_dimensions(where, value, unseen=unseen_numbers(mechanism))
    late = bool(value.atoms(Summary, MotionSymbol))
    found = Requirement(name, description, str(relation), not timeless, late, _bounds(value), units_of(value))
    return found, Output(name, value, "")


def _margin(where: str, relation: Any) -> sympy.Expr:
    """Return the difference of the two sides of a relation; it is positive if the relation is true."""
    expected = "expected a relation such as slider.position[0] <= 0.47 or uqmbd.eigenfrequency(1) >= 2"
    if isinstance(relation, (np.ndarray, MatrixBase, list, tuple)):
        raise StudyError(
            f"{where}: the argument is a sequence, {shown(relation)}; {expected}. Add a requirement for each entry."
        )
    if relation in (True, False, sympy.true, sympy.false):
        always = "always" if relation in (True, sympy.true) else "never"
        raise StudyError(f"{where}: the relation is {always} satisfied, for every motion; {expected}.")
    if isinstance(relation, (sympy.Equality, sympy.Unequality)):
        raise StudyError(
            f"{where}: the relation is {relation}, but a random quantity equals a value with probability zero; "
            f"{expected}, or two requirements for a band."
        )
    if isinstance(relation, (sympy.And, sympy.Or, sympy.Not)):
        raise StudyError(
            f"{where}: the argument contains several relations, {shown(relation)}. Define a separate requirement for "
            "each of them; the results also contain the probability that any requirement is violated."
        )
    if not isinstance(relation, (*BELOW, *ABOVE)):
        raise StudyError(f"{where}: the relation is {shown(relation)}; {expected}.")
    return relation.rhs - relation.lhs if isinstance(relation, BELOW) else relation.lhs - relation.rhs


def _over_time(margin: sympy.Expr) -> sympy.Expr:
    """Convert the margin of a largest or smallest value to the equivalent margin over time.

    ``maximum(x) <= c`` means ``x <= c`` at all times; the latter form also yields the time of the first violation.
    """
    extremes = sorted(margin.atoms(Maximum, Minimum), key=str)
    if len(extremes) != 1:
        return margin
    (extreme,) = extremes
    slope, rest = _linear(margin, extreme)
    falls = bool(slope.is_negative if isinstance(extreme, Maximum) else slope.is_positive)
    if not (slope.is_number and falls) or is_scalar(rest) or rest.free_symbols - random_variables(rest):
        return margin
    found: sympy.Expr = rest + slope * extreme.summed
    return found


def _bounds(margin: sympy.Expr) -> int:
    """Return the sign of the derivative of a margin with respect to its only first time or event time.

    Return 0 if the margin contains several such times or none, or if the derivative is not a number.
    """
    firsts = sorted(margin.atoms(EventTime, FirstTime), key=str)
    slope = _linear(margin, firsts[0])[0] if len(firsts) == 1 else sympy.Integer(0)
    return int(sympy.sign(slope)) if slope.is_number else 0


def _linear(margin: sympy.Expr, part: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the slope of a margin with respect to one part of the margin, and the margin without this part."""
    held = sympy.Dummy(real=True)
    inner = margin.xreplace({part: held})
    return inner.diff(held), inner.xreplace({held: sympy.Integer(0)})
