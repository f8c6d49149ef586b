"""Unit with a power for each base quantity, and its size in the SI."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

__all__ = ["BASES", "PURE", "Dimension", "Unit", "in_words"]

BASES = ("m", "kg", "s", "K", "A", "mol", "cd")
"""Units of the base quantities."""

Dimension = tuple[Fraction, ...]
"""Exponents of the base quantities, in the order of `BASES`."""

PURE: Dimension = (Fraction(0),) * len(BASES)
"""Dimension of pure numbers and of angles."""

_WORDS: dict[tuple[Fraction | int, ...], str] = {
    (1, 1, -2): "N", (2, 1, -2): "N m", (-1, 1, -2): "Pa", (2, 1, -3): "W", (0, 1, -2): "N/m", (0, 1, -1): "N s/m",
    (1, 1, -1): "N s",
}  # fmt: skip
"""SI units of mechanical dimensions with shorter names than the products of base units."""


@dataclass(frozen=True)
class Unit:
    """Dimension and size of a unit."""

    dimension: Dimension = PURE  # exponents of the base quantities
    factor: float = 1.0  # size in the SI unit of this dimension: 0.001 for a millimetre, pi/180 for a degree

    def __mul__(self, other: Unit) -> Unit:
        return Unit(
            tuple(a + b for a, b in zip(self.dimension, other.dimension, strict=True)), self.factor * other.factor
        )

    def __pow__(self, power: Fraction) -> Unit:
        return Unit(tuple(a * power for a in self.dimension), math.pow(self.factor, float(power)))


def in_words(dimension: Dimension) -> str:
    """Return the SI unit of a dimension as text."""
    if dimension == PURE:
        return "a pure number"
    if not any(dimension[3:]) and dimension[:3] in _WORDS:
        return _WORDS[dimension[:3]]
    pairs = [(unit, power) for unit, power in zip(BASES, dimension, strict=True) if power]
    pairs.sort(key=lambda pair: pair[0] != "kg")
    over = " ".join(_power(unit, power) for unit, power in pairs if power > 0)
    under = [_power(unit, -power) for unit, power in pairs if power < 0]
    below = f"({' '.join(under)})" if len(under) > 1 else "".join(under)
    return f"{over or '1'}/{below}" if under else over


def _power(unit: str, power: Fraction) -> str:
    if power == 1:
        return unit
    return f"{unit}^{power}" if power.denominator == 1 else f"{unit}^({power})"
