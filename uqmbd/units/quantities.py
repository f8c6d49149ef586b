"""Conversion of quantities of pint, which users can give instead of numbers."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.units.pint_units import unit_of_pint
from uqmbd.units.text import read_units
from uqmbd.units.unit import Unit, in_words

__all__ = ["is_quantity", "without_quantities"]


def is_quantity(value: Any) -> bool:
    """Return whether a value is a quantity of pint, without importing pint."""
    pint = sys.modules.get("pint")
    return pint is not None and isinstance(value, pint.Quantity)


def without_quantities(what: str, value: Any, units: str) -> Any:
    """Return a value with its quantities replaced by numbers in `units`, such as ``m``.

    The value is a number, expression or quantity, or a sequence or array of them.  The magnitude of a quantity may be a
    number, an array or an expression.  A value without quantities is returned unchanged.  Raise `uqmbd.StudyError` if a
    quantity has another dimension, or the expected units are unknown; the message begins with `what`.
    """
    if "pint" not in sys.modules:
        return value
    if is_quantity(value):
        return _number(what, value, units)
    if isinstance(value, (list, tuple)):
        found = [without_quantities(what, part, units) for part in value]
        return tuple(found) if type(value) is tuple else found
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [without_quantities(what, part, units) for part in value.tolist()]
    return value


def _number(what: str, value: Any, units: str) -> Any:
    expected, given = read_units(units), unit_of_pint(value.units)
    if expected is None:
        raise StudyError(
            f"{what} is the quantity {value}, and the required units are unknown; give a number, as "
            "quantity.m_as('m') returns."
        )
    if given is None or given.dimension != expected.dimension:
        named = in_words(given.dimension) if given else str(value.units)
        raise StudyError(
            f"{what} is the quantity {value}, which is in {named}; expected a number or quantity in {units}."
        )
    number = _in(value, given, expected)
    return number.tolist() if isinstance(number, (np.ndarray, np.generic)) else number


def _in(value: Any, given: Unit, expected: Unit) -> Any:
    """Return the magnitude of a quantity in the expected units; pint converts numbers, but not expressions."""
    if given == expected:
        return value.magnitude
    if hasattr(value.magnitude, "free_symbols"):
        return value.magnitude * (given.factor / expected.factor)
    return value.to_base_units().magnitude / expected.factor
