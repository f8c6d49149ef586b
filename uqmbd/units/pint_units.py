"""Units of pint that are not in the table, if pint is installed."""

from __future__ import annotations

import functools
import importlib.util
from fractions import Fraction
from typing import Any

from uqmbd.units.unit import Unit

__all__ = ["unit_from_name", "unit_of_pint"]

_DIMENSIONS = ("[length]", "[mass]", "[time]", "[temperature]", "[current]", "[substance]", "[luminosity]")
"""Names of the base quantities in pint."""


@functools.lru_cache(maxsize=256)
def unit_from_name(name: str) -> Unit | None:
    """Return the unit with a name from pint's application registry; None if it is unknown or pint is not installed.

    >>> unit_from_name("no_such_unit") is None
    True
    """
    if importlib.util.find_spec("pint") is None:
        return None
    import pint

    registry: Any = pint.application_registry
    try:
        return unit_of_pint(registry.get().parse_units(name))
    except Exception:  # noqa: BLE001 - pint raises many types of exceptions for names that are not units
        return None


def unit_of_pint(found: Any) -> Unit | None:
    """Return the dimension and factor of a unit of pint; None if it is not a unit of a quantity of the SI."""
    exponents = dict(found.dimensionality)
    if set(exponents) - set(_DIMENSIONS):
        return None
    dimension = tuple(Fraction(exponents.get(name, 0)).limit_denominator(64) for name in _DIMENSIONS)
    try:
        factor = float((1 * found).to_base_units().magnitude)
    except Exception:  # noqa: BLE001 - a scale with an offset, or a logarithmic scale, has no factor
        return None
    return Unit(dimension, factor) if factor > 0 else None
