"""Measures of parts of expressions: numbers, and products of units with a number."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

from uqmbd.units import Unit

__all__ = [
    "SAME",
    "MeasuredProduct",
    "Measure",
    "Number",
    "common",
    "factor_in_words",
    "greatest",
    "is_off",
    "product",
    "raised",
]

SAME = 1e-9
"""Relative difference below which factors count as equal."""

CLEARLY = 2.5
"""Ratio of logarithms by which a number must be nearer to 1 than to a missing factor between two units.

A hundredth of a length in metres, converted to millimetres, has the factor 10, which is as near to 1 as to 1000.
"""

FAR = math.log(50)
"""Logarithm of the factor between two units above which `CLEARLY` applies to any number.

Below this limit it applies only to integers and their reciprocals, such as 2, 3 and 1/2.  A third of a speed in m/s,
converted to km/h, has the factor 1.2.
"""


@dataclass(frozen=True)
class Number:
    """Measure of a number, or of a symbol that represents a number: it fits every dimension."""

    size: float = 1.0  # absolute value
    seen: bool = False  # whether the number is visible in the expression: 1.0 is visible, the integer 1 is not


@dataclass(frozen=True)
class MeasuredProduct:
    """Measure of a product, whose dimension is known except for the dimension of a numerical factor."""

    unit: Unit  # unit of the product without the numerical factor
    constant: float = 1.0  # absolute value of the numerical factor; 1 without a factor
    free: bool = False  # whether the product contains a numerical factor, which may have any dimension


Measure = Number | MeasuredProduct | None
"""Measure of an expression; None: unknown."""


def product(one: Measure, other: Measure) -> Measure:
    """Return the measure of a product.

    >>> product(Number(2.0, seen=True), MeasuredProduct(Unit()))
    MeasuredProduct(unit=Unit(dimension=(...), factor=1.0), constant=2.0, free=True)
    """
    if one is None or other is None:
        return None
    if isinstance(one, Number):
        if isinstance(other, Number):
            return Number(one.size * other.size, one.seen or other.seen)
        return replace(other, constant=other.constant * one.size, free=other.free or one.seen)
    if isinstance(other, Number):
        return product(other, one)
    return MeasuredProduct(one.unit * other.unit, one.constant * other.constant, one.free or other.free)


def raised(measure: Measure, power: Fraction) -> Measure:
    """Return the measure of a power."""
    try:
        if isinstance(measure, Number):
            return replace(measure, size=measure.size ** float(power))
        if isinstance(measure, MeasuredProduct):
            return MeasuredProduct(measure.unit**power, measure.constant ** float(power), measure.free)
    except (OverflowError, ZeroDivisionError):
        pass
    return None


def greatest(numbers: list[Number]) -> Number:
    """Return the measure of a sum of numbers: ``1000 + 20*sin(x)`` is as large as 1000.

    >>> greatest([Number(1000.0, seen=True), Number(20.0, seen=True)])
    Number(size=1000.0, seen=True)
    """
    return Number(max(x.size for x in numbers) or 1.0, seen=any(x.seen for x in numbers))


def common(measures: list[MeasuredProduct]) -> Measure:
    """Return the measure of a sum, from measures of terms with different numerical factors."""
    if len(measures) == 1:
        return measures[0]
    for measure in measures:
        if not measure.free:
            return measure
    alike = all(m.unit == measures[0].unit for m in measures)
    return max(measures, key=lambda m: abs(math.log(m.constant or 1.0))) if alike else None


def is_off(found: MeasuredProduct, expected: Unit) -> bool:
    """Return whether a factor between two units is missing: the constant is clearly nearer to 1 than to the factor.

    >>> metres, millimetres = Unit(), Unit(factor=1e-3)
    >>> [is_off(MeasuredProduct(metres, number, free=True), millimetres) for number in (1.0, 2.0, 1000.0, 20.0)]
    [True, True, False, False]
    """
    ratio = found.unit.factor / expected.factor
    if math.isclose(ratio, 1.0, rel_tol=SAME) or not found.constant:
        return False
    constant = math.log(found.constant)
    if CLEARLY * abs(constant) >= abs(constant - math.log(ratio)):
        return False
    return abs(math.log(ratio)) > FAR or any(
        math.isclose(x, round(x), rel_tol=SAME) for x in (found.constant, 1 / found.constant)
    )


def factor_in_words(ratio: float) -> str:
    """Return a factor between two units as text, in closed form if possible.

    >>> [factor_in_words(x) for x in (1e3, 1e-3, math.pi / 180, 30 / math.pi, 25.4)]
    ['1000', '1/1000', 'pi/180', '30/pi', '127/5']
    """
    for number, over, under in (
        (ratio, "{}", "1/{}"),
        (ratio / math.pi, "{}*pi", "pi/{}"),
        (ratio * math.pi, "{}/pi", ""),
    ):
        near = Fraction(number).limit_denominator(10**5)
        if near and math.isclose(float(near), number, rel_tol=1e-14):
            if near.numerator == 1 and under and near.denominator > 1:
                return under.format(near.denominator)
            return over.format(near).removeprefix("1*")
    return f"{ratio:.15g}"
