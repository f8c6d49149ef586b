"""Units in texts: their dimension and size, their spelling in uqmbd, and messages on other spellings."""

from __future__ import annotations

from uqmbd.units.names import SPELLINGS, TABLE
from uqmbd.units.quantities import is_quantity, without_quantities
from uqmbd.units.text import advice_on, read_units, same_units, spelling
from uqmbd.units.unit import PURE, Dimension, Unit, in_words
from uqmbd.units.warn_units import warn

__all__ = [
    "PURE",
    "SPELLINGS",
    "TABLE",
    "Dimension",
    "Unit",
    "advice_on",
    "in_words",
    "is_quantity",
    "read_units",
    "same_units",
    "spelling",
    "warn",
    "without_quantities",
]
