"""Check dimensions of expressions: find sums of metres and newtons, and numbers in wrong units.

A finding is an error of the expression, unless a number in it has units that are not visible. A number in an
expression may have any unit, and SymPy removes the number 1 from a product. The check therefore uses these rules:

- a number in a sum fits every dimension, as in ``position - 0.3``;
- a product with a number other than 1 and -1 has an unknown dimension, as ``9.81 * height``. The same number in two
  terms of a sum has the same dimension, unless it is 1.0;
- values of sine, exponential and other functions fit every dimension, and so do quaternions. The reason is that an
  invisible radius of 1 m may multiply such a value. The time also fits every dimension, because an invisible rate of
  1/s may multiply it;
- if parameters of a mechanism equal 1 or 2, such as a mass, each of them may be an invisible factor of a product. See
  `VANISHING` in ``components/parameter_values.py``.

The terms of a component have stricter rules, because units belong to its parameters: exact numbers, multiples of pi and
small fractions, such as 0.5, are pure numbers (`exact=True`).

pint cannot process SymPy expressions. SymPy's units support neither constants without units nor symbols of other
classes: the check of a sum raises an error at the first constant. This module therefore traverses expressions, and uses
the unit algebra of `uqmbd.units`.

Length: this module contains the complete traversal, its messages, and both sets of rules for numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions.computable import FUNCTIONS
from uqmbd.mechanism.expressions.custom_summaries import CustomSummary
from uqmbd.mechanism.expressions.excitations import Excitation
from uqmbd.mechanism.expressions.linear_outputs import LinearOutput
from uqmbd.mechanism.expressions.measures import (
    SAME,
    Measure,
    MeasuredProduct,
    Number,
    common,
    factor_in_words,
    greatest,
    is_off,
    product,
    raised,
)
from uqmbd.mechanism.expressions.summaries import (
    Final,
    FirstTime,
    IntegralOverTime,
    Maximum,
    Minimum,
    RootMeanSquare,
    TimeOfMaximum,
    TimeOfMinimum,
)
from uqmbd.mechanism.expressions.time import step, t
from uqmbd.mechanism.expressions.timeless import AtEquilibrium, AtSteady, ModeShape, ScalarSymbol
from uqmbd.units import PURE, TABLE, Dimension, Unit, in_words, read_units, warn

Unseen = Iterable[Dimension]
"""Dimensions of parameters that may be invisible factors, because they equal 1 or 2."""

__all__ = ["Mismatch", "check_dimensions", "mismatches", "units_of"]

SEEN = "If a factor with units has the value 1, write it explicitly, e.g. 1.0 * (...)."
"""Sentence on how to confirm a correct expression."""

DECLARE = "If a number of the term has units, declare a parameter for it."
"""Sentence on how to confirm a correct term of a component."""

_CYCLES, _ANGLES = re.compile(r"Hz|hertz"), re.compile(r"rad|deg|rev|rpm|turn|°")
"""Units of frequencies in cycles, and units of angular frequencies: both are 1/s, and differ by 2 pi."""

_NUMERATORS, _DENOMINATORS = (1, 2, 3, 4), (1, 2, 3, 4, 6, 8, 12)
_SMALL_FRACTIONS = tuple({n / d for n in _NUMERATORS for d in _DENOMINATORS} - {1.0})
"""Floats that are pure numbers if they occur in a term of a component; 1.0 marks a number with units."""

_SHOWN = 60
"""Largest number of characters of a term in a message."""

_KEEPING = (sympy.Abs, sympy.floor, sympy.ceiling, Maximum, Minimum, RootMeanSquare, Final, AtEquilibrium, AtSteady)
_TIMES = (TimeOfMaximum, TimeOfMinimum, FirstTime)
_SIGNS = (sympy.sign, sympy.Heaviside)
_ALIKE = (sympy.Max, sympy.Min, sympy.atan2)
_OF_NUMBERS = tuple(f for f in FUNCTIONS if f not in (*_KEEPING, *_SIGNS, *_ALIKE, sympy.Piecewise))


@dataclass(frozen=True)
class Mismatch:
    """An error in the units of an expression."""

    text: str  # where, what was given, what was expected, what to try
    # True: wrong by the factor between two units of one quantity; False: dimensions differ, perhaps by a 1 with a unit
    certain: bool = False


def check_dimensions(where: str, expression: Any, units: str = "", unseen: Callable[[], Unseen] = tuple) -> None:
    """Raise if the values of an expression are in other units than stated; warn if its dimensions do not fit.

    Symbols have an attribute `units`; empty `units` accept any dimension.  The argument `unseen` is a function that
    returns the dimensions of parameters that products may contain invisibly.  `unseen` is called only if
    dimensions do not fit.  `check_dimensions` raises `uqmbd.StudyError` if values are wrong by the factor between two
    units, such as metres declared as millimetres.  It warns with `uqmbd.UnitsWarning` if dimensions are inconsistent.

    >>> import chaospy, uqmbd
    >>> gap = uqmbd.RandomVariable("gap", chaospy.Uniform(1, 2), units="mm")
    >>> check_dimensions("output 'gap'", gap / 1000, "m")
    >>> check_dimensions("output 'gap'", gap, "m")
    Traceback (most recent call last):
    uqmbd.errors.StudyError: output 'gap': gap is in mm, but its declared units are m, so its values are wrong by
    a factor of 1000. Write gap/1000, or declare the actual units.
    """
    for found in mismatches(where, expression, units, unseen):
        if found.certain:
            raise StudyError(found.text)
        warn(found.text)


def mismatches(
    where: str, expression: Any, units: str = "", unseen: Callable[[], Unseen] = tuple, *, exact: bool = False
) -> list[Mismatch]:
    """Return findings on the units of an expression; see `check_dimensions`.

    With `exact`, exact numbers, multiples of pi and small fractions are pure numbers.

    >>> import uqmbd
    >>> stone = uqmbd.Mechanism("fall", uqmbd.Line()).body("stone", mass=2)
    >>> [len(mismatches("x", stone.position[0] * 3 / 2, "J", exact=exact)) for exact in (False, True)]
    [0, 1]
    """
    if not isinstance(expression, sympy.Basic) or isinstance(expression, sympy.Number) or not expression.free_symbols:
        return []
    walk = _Walk(where, unseen, exact)
    found = walk.measure(expression)
    declared = read_units(units)
    if declared is not None and isinstance(found, MeasuredProduct):
        found = _in_cycles(expression, found, declared, units)
        walk.compare(expression, found, declared, units)
    return walk.found


def units_of(expression: sympy.Expr, *, exact: bool = False) -> str:
    """Return the SI units of an expression; empty if the units are unknown. See `mismatches` for `exact`.

    >>> import uqmbd
    >>> stone = uqmbd.Mechanism("fall", uqmbd.Line()).body("stone", mass=2)
    >>> units_of(stone.position[0] - 3), units_of(9.81 * stone.position[0])
    ('m', '')
    """
    found = _Walk("", tuple, exact).measure(expression)
    if not isinstance(found, MeasuredProduct) or found.free or not math.isclose(found.unit.factor, 1.0, rel_tol=SAME):
        return ""
    return "1" if found.unit.dimension == PURE else in_words(found.unit.dimension)


@dataclass
class _Walk:
    """Traversal of an expression that visits each part once."""

    where: str
    unseen: Callable[[], Unseen]
    exact: bool
    found: list[Mismatch] = field(default_factory=list)
    known: dict[Any, Measure] = field(default_factory=dict)

    def measure(self, part: Any) -> Measure:
        """Return the measure of a part."""
        if part not in self.known:
            self.known[part] = self._measured(part)
        return self.known[part]

    def _measured(self, part: Any) -> Measure:
        if part.is_Symbol:
            unit = read_units(getattr(part, "units", ""))
            return None if unit is None or part == t else MeasuredProduct(unit)
        if not part.free_symbols:
            return _number(part, self.exact)
        if part.is_Mul:
            return self._product(part.args)
        if part.is_Add:
            return self._sum(part, part.args)
        if part.is_Pow:
            return self._power(part)
        if isinstance(part, sympy.exp):  # in SymPy, the exponential is not a `Pow`
            return self._of_numbers(part)
        if isinstance(part, IntegralOverTime):
            return product(self.measure(part.args[0]), MeasuredProduct(Unit(_SECOND)))
        if isinstance(part, _TIMES):
            self.measure(part.args[0])
            return MeasuredProduct(Unit(_SECOND))
        if isinstance(part, _KEEPING):
            return self.measure(part.args[0])
        if isinstance(part, _SIGNS):
            self.measure(part.args[0])
            return Number()
        if isinstance(part, _ALIKE):
            alike = self._sum(part, part.args)
            return MeasuredProduct(Unit()) if isinstance(part, sympy.atan2) else alike
        if isinstance(part, ModeShape):
            return product(self.measure(part.args[0]), raised(self.measure(part.args[1]), Fraction(-1)))
        if isinstance(part, LinearOutput):
            return self._declared(part.seen, part.declared.power, part.declared.unit)
        if isinstance(part, CustomSummary):
            self._further(part)
            return self._declared(part.summed, part.declared.power, part.declared.unit)
        if isinstance(part, Excitation):
            unit = read_units(part.args[1].source.units) if part.args[2] == 0 else None
            return None if unit is None else MeasuredProduct(unit)
        if isinstance(part, step):
            self._sum(part, [part.args[k] for k in (0, 1, 3)])
            return self._sum(part, [part.args[k] for k in (2, 4)])
        if isinstance(part, sympy.Piecewise):
            for _, condition in part.args:
                self._relations(condition)
            return self._sum(part, [value for value, _ in part.args])
        if isinstance(part, _OF_NUMBERS):
            return self._of_numbers(part)
        for inner in part.args:
            if isinstance(inner, sympy.Expr):
                self.measure(inner)
        return None

    def _further(self, part: CustomSummary) -> None:
        """Compare the units of further expressions with the declared units."""
        for expression, units in zip(part.further, part.declared.further, strict=True):
            measure, declared = self.measure(expression), read_units(units)
            if isinstance(measure, MeasuredProduct) and units and declared is not None:
                self.compare(expression, measure, declared, units)

    def _declared(self, expression: sympy.Expr, power: int | None, unit: Unit | None) -> Measure:
        """Return the units of an expression to a power, times a unit."""
        inner = self.measure(expression)
        if power is None or unit is None:
            return None
        # with the power 0, as for the rate of an event, the units of the expression do not matter
        return product(raised(inner, Fraction(power)), MeasuredProduct(unit)) if power else MeasuredProduct(unit)

    def _relations(self, condition: Any) -> None:
        if isinstance(condition, sympy.core.relational.Relational):
            self._sum(condition, condition.args)
            return
        for inner in condition.args:
            self._relations(inner)

    def _product(self, factors: tuple[Any, ...]) -> Measure:
        found: Measure = Number()
        for measure in [self.measure(factor) for factor in factors]:
            found = product(found, measure)
        return found

    def _power(self, part: Any) -> Measure:
        base, power = self.measure(part.base), part.exp
        if power.is_Rational or (power.is_Float and math.isfinite(float(power))):
            return raised(base, Fraction(str(power)).limit_denominator(10**6))
        self._pure(part.exp, self.measure(power))
        self._pure(part.base, base)
        return None

    def _of_numbers(self, part: Any) -> Measure:
        for inner in part.args:
            self._pure(inner, self.measure(inner), type(part).__name__)
        return None if part.has(t) else Number()  # the rate of cos(t) contains its frequency of 1 rad/s as a factor

    def _pure(self, part: Any, measure: Measure, function: str = "") -> None:
        """Check a part that must be a pure number, or an angle in radians."""
        if not isinstance(measure, MeasuredProduct):
            return
        what = (
            f"the argument of {function} must be a pure number or an angle in rad"
            if function
            else "an exponent must be a pure number"
        )
        if measure.unit.dimension == PURE:
            if is_off(measure, Unit()):
                ratio = measure.unit.factor
                self.found.append(
                    Mismatch(
                        f"{self.where}: {what}, but {_short(part)} is in {_own(part, measure.unit)}; multiply it by "
                        f"{factor_in_words(ratio)}.",
                        certain=True,
                    )
                )
        elif not measure.free and not self._explained([measure.unit.dimension, PURE]):
            self.found.append(
                Mismatch(
                    f"{self.where}: {what}, but {_short(part)} is in {in_words(measure.unit.dimension)}. Divide it "
                    f"by a reference value in the same units, or check the units of its terms. {self._advice()}"
                )
            )

    def _sum(self, whole: Any, terms: Any) -> Measure:
        """Return the measure of a sum, and check that the measures of its terms agree."""
        pairs = [(term, self.measure(term)) for term in terms]
        known = [(term, measure) for term, measure in pairs if isinstance(measure, MeasuredProduct)]
        if not known:
            numbers = [measure for _, measure in pairs if isinstance(measure, Number)]
            return greatest(numbers) if len(numbers) == len(pairs) else None
        groups: list[list[tuple[Any, MeasuredProduct]]] = []
        for term, measure in known:
            for group in groups:
                one = group[0][1]
                stated = one.free and math.isclose(one.constant, 1.0, rel_tol=SAME)  # each 1.0 may have other units
                if (
                    one.free == measure.free
                    and not stated
                    and (not one.free or math.isclose(one.constant, measure.constant, rel_tol=SAME))
                ):
                    group.append((term, measure))
                    break
            else:
                groups.append([(term, measure)])
        for group in groups:
            different = list({measure.unit.dimension: (term, measure) for term, measure in reversed(group)}.values())
            if len(different) > 1:
                if not self._explained([measure.unit.dimension for _, measure in different]):
                    self._unlike(whole, different[-1], different[-2])
                return None
        if any(self._apart(*pair) for pair in _pairs(known)):
            return None
        return common([group[0][1] for group in groups])

    def _unlike(self, whole: Any, one: tuple[Any, MeasuredProduct], other: tuple[Any, MeasuredProduct]) -> None:
        words = [in_words(measure.unit.dimension) for _, measure in (one, other)]
        verb = "adds" if getattr(whole, "is_Add", False) else "compares"
        self.found.append(
            Mismatch(
                f"{self.where}: {_short(whole)} {verb} {_short(one[0])}, which is in {words[0]}, and "
                f"{_short(other[0])}, which is in {words[1]}; check both, and the units of random variables. "
                f"{self._advice()}"
            )
        )

    def _advice(self) -> str:
        return DECLARE if self.exact else SEEN

    def _explained(self, dimensions: list[Dimension]) -> bool:
        """Return whether dimensions are equal after multiplication by invisible factors."""
        ones = {PURE, *self.unseen()}
        products = {_sum_of(one, other) for one in ones for other in ones}
        reached = [{_sum_of(dimension, one) for one in products} for dimension in dimensions]
        return bool(set.intersection(*reached))

    def _apart(self, one: tuple[Any, MeasuredProduct], other: tuple[Any, MeasuredProduct]) -> bool:
        """Report two terms of the same dimension with values in different units; return whether they differ."""
        a, b = one[1], other[1]
        if a.unit.dimension != b.unit.dimension:
            return False
        if not is_off(replace(a, constant=a.constant / b.constant), b.unit):
            return False
        ratio = a.unit.factor / b.unit.factor
        self.found.append(
            Mismatch(
                f"{self.where}: {_short(one[0])} is in {_own(one[0], a.unit)}, and {_short(other[0])} in "
                f"{_own(other[0], b.unit)}; multiply the former by {factor_in_words(ratio)}.",
                certain=True,
            )
        )
        return True

    def compare(self, expression: Any, found: MeasuredProduct, declared: Unit, units: str) -> None:
        """Compare the units of an expression with the stated units."""
        text = _short(expression)
        if found.unit.dimension != declared.dimension:
            # a frequency or a damping ratio alone is not a product with an invisible factor
            alone = isinstance(expression, ScalarSymbol)
            if not found.free and (alone or not self._explained([found.unit.dimension, declared.dimension])):
                self.found.append(
                    Mismatch(
                        f"{self.where}: {text} is in {_own(expression, found.unit)}, but its declared units are "
                        f"{units}; "
                        f"check both, and the units of random variables. {self._advice()}"
                    )
                )
        elif is_off(found, declared):
            ratio = found.unit.factor / declared.factor
            self.found.append(
                Mismatch(
                    f"{self.where}: {text} is in {_own(expression, found.unit)}, but its declared units are {units}, "
                    f"so its values are wrong by a factor of {_size(ratio)}. Write {_scaled(expression, ratio)}, or "
                    "declare the actual units.",
                    certain=True,
                )
            )


def _in_cycles(expression: Any, found: MeasuredProduct, declared: Unit, units: str) -> MeasuredProduct:
    """Return the measure of a frequency, in rad/s if the declared units are those of an angular frequency."""
    if found.unit.dimension != declared.dimension or declared.dimension != TABLE["Hz"].dimension:
        return found
    cycles = any(_CYCLES.search(getattr(s, "units", "") or "") for s in expression.free_symbols)
    if not (cycles and _ANGLES.search(units)):
        return found
    return replace(found, unit=replace(found.unit, factor=2 * math.pi * found.unit.factor))


def _sum_of(one: Dimension, other: Dimension) -> Dimension:
    return tuple(a + b for a, b in zip(one, other, strict=True))


_SECOND: Dimension = TABLE["s"].dimension


def _number(part: Any, exact: bool) -> Measure:
    try:
        size = abs(float(part))
    except (TypeError, ValueError, OverflowError):
        return None
    seen = not _is_pure(part, size) if exact else part.is_Float or part not in (1, -1)
    return Number(size, seen=bool(size) and seen) if math.isfinite(size) else None


def _is_pure(part: Any, size: float) -> bool:
    """Return whether a number is exact, a small fraction, or a multiple of pi."""
    if not part.has(sympy.Float):
        return True
    turns = Fraction(size / math.pi).limit_denominator(360)
    return any(math.isclose(size, x, rel_tol=1e-14) for x in (*_SMALL_FRACTIONS, float(turns) * math.pi))


def _pairs(
    known: list[tuple[Any, MeasuredProduct]],
) -> Iterator[tuple[tuple[Any, MeasuredProduct], tuple[Any, MeasuredProduct]]]:
    """Yield pairs of terms of equal dimension: a term, if possible without numerical factor, and each other term."""
    firsts: dict[Dimension, tuple[Any, MeasuredProduct]] = {}
    for one in sorted(known, key=lambda pair: pair[1].free):
        first = firsts.setdefault(one[1].unit.dimension, one)
        if first is not one:
            yield first, one


def _short(expression: Any) -> str:
    text = sympy.sstr(expression, full_prec=False)
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def _own(expression: Any, unit: Unit) -> str:
    """Return a name for the units of an expression: the units of one of its symbols, if they are equal."""
    named = sorted(text for s in expression.free_symbols if _reads(text := getattr(s, "units", ""), unit))
    if named:
        return named[0]
    words = in_words(unit.dimension)
    return words if math.isclose(unit.factor, 1.0, rel_tol=SAME) else f"{unit.factor:.6g} {words}"


def _reads(text: str, unit: Unit) -> bool:
    """Return whether a text names a unit; a unit of cycles, such as Hz, also names the equal angular frequency."""
    found = read_units(text)
    turned = replace(found, factor=2 * math.pi * found.factor) if found and _CYCLES.search(text) else found
    return unit in (found, turned)


def _size(ratio: float) -> str:
    return f"{max(ratio, 1 / ratio):.6g}"


def _scaled(expression: Any, ratio: float) -> str:
    text, factor = _short(expression), factor_in_words(ratio)
    text = f"({text})" if expression.is_Add else text
    return f"{text}{factor[1:]}" if factor.startswith("1/") else f"{factor}*{text}"
