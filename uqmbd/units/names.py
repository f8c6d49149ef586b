"""Table of the units for mechanisms.

The table replaces the registry of pint to save time. On the reference machine ``import pint`` takes 0.2 to 0.6 s. The
registry takes 0.5 s, or 0.05 s from its cache on disk. A whole run of the slider-crank takes 4 s and ``uqmbd --help``
0.15 s. The table takes less than a millisecond. pint supplies the units that are not in the table. A test compares all
entries with pint.
"""

from __future__ import annotations

import math
from fractions import Fraction

from uqmbd.units.unit import BASES, Unit

__all__ = ["SPELLINGS", "TABLE"]


def _unit(exponents: tuple[int, ...], factor: float = 1.0) -> Unit:
    return Unit(tuple(map(Fraction, (*exponents, *(0,) * (len(BASES) - len(exponents))))), factor)


_PREFIXES = {"n": 1e-9, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}

_PREFIXED: dict[str, Unit] = {
    "m": _unit((1,)),
    "g": _unit((0, 1), 1e-3),
    "s": _unit((0, 0, 1)),
    "K": _unit((0, 0, 0, 1)),
    "A": _unit((0, 0, 0, 0, 1)),
    "N": _unit((1, 1, -2)),
    "Pa": _unit((-1, 1, -2)),
    "J": _unit((2, 1, -2)),
    "W": _unit((2, 1, -3)),
    "Hz": _unit((0, 0, -1)),
    "V": _unit((2, 1, -3, 0, -1)),
    "rad": _unit(()),
}
"""Units that take prefixes."""

_LENGTH = 0.0254
_POUND = 0.45359237
_FREE_FALL = 9.80665

_PLAIN: dict[str, Unit] = {
    "cm": _unit((1,), 1e-2),
    "dm": _unit((1,), 1e-1),
    "min": _unit((0, 0, 1), 60.0),
    "h": _unit((0, 0, 1), 3600.0),
    "d": _unit((0, 0, 1), 86400.0),
    "t": _unit((0, 1), 1e3),
    "l": _unit((3,), 1e-3),
    "L": _unit((3,), 1e-3),
    "bar": _unit((-1, 1, -2), 1e5),
    "Wh": _unit((2, 1, -2), 3600.0),
    "kWh": _unit((2, 1, -2), 3.6e6),
    "°C": _unit((0, 0, 0, 1)),
    "degC": _unit((0, 0, 0, 1)),
    "%": _unit((), 1e-2),
    "‰": _unit((), 1e-3),
    "ppm": _unit((), 1e-6),
    "deg": _unit((), math.pi / 180),
    "°": _unit((), math.pi / 180),
    "arcmin": _unit((), math.pi / 10800),
    "arcsec": _unit((), math.pi / 648000),
    "rev": _unit((), 2 * math.pi),
    "rpm": _unit((0, 0, -1), 2 * math.pi / 60),
    "in": _unit((1,), _LENGTH),
    "ft": _unit((1,), 12 * _LENGTH),
    "mi": _unit((1,), 63360 * _LENGTH),
    "mph": _unit((1, 0, -1), 63360 * _LENGTH / 3600),
    "lb": _unit((0, 1), _POUND),
    "lbf": _unit((1, 1, -2), _POUND * _FREE_FALL),
    "psi": _unit((-1, 1, -2), _POUND * _FREE_FALL / _LENGTH**2),
    "mol": _unit((0, 0, 0, 0, 0, 1)),
    "cd": _unit((0, 0, 0, 0, 0, 0, 1)),
}
"""Units that do not take prefixes."""

TABLE: dict[str, Unit] = {
    **{prefix + name: _unit(()) * Unit(unit.dimension, unit.factor * size)
       for name, unit in _PREFIXED.items() for prefix, size in _PREFIXES.items()},
    **_PREFIXED,
    **_PLAIN,
}  # fmt: skip
"""Units by their symbols."""

_WRITTEN = {
    "m": "meter metre", "mm": "millimeter millimetre", "cm": "centimeter centimetre", "km": "kilometer kilometre",
    "um": "micrometer micrometre micron", "kg": "kilogram kilogramme", "g": "gram gramme", "s": "second sec",
    "ms": "millisecond msec", "min": "minute", "h": "hour hr", "d": "day", "N": "newton", "kN": "kilonewton",
    "Pa": "pascal", "MPa": "megapascal", "J": "joule", "W": "watt", "kW": "kilowatt", "Hz": "hertz", "K": "kelvin",
    "A": "ampere amp", "V": "volt", "rad": "radian rad", "mrad": "milliradian", "deg": "degree", "rev": "turn",
    "%": "percent", "in": "inch inches", "ft": "foot feet", "mi": "mile", "lb": "pound lbs", "t": "tonne",
    "l": "liter litre", "1": "dimensionless unitless nondimensional",
}  # fmt: skip

SPELLINGS: dict[str, str] = {
    spelt: symbol for symbol, words in _WRITTEN.items() for word in words.split() for spelt in (word, f"{word}s")
}
"""Symbols of units, by the name of the unit in words, singular or plural, in lower case."""
