"""Comparison of units given as texts, without conversion."""

from __future__ import annotations

import re

__all__ = ["same_units", "seconds"]

_POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_RAISED = re.compile("[⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+")


def same_units(one: str, other: str) -> bool:
    """Return whether two texts denote the same units, such as ``m/s²``, ``m/s**2`` and ``m/s^2``.

    >>> same_units("m/s²", "m/s^2"), same_units("N·m", "N  m"), same_units("mm", "m"), same_units("mN", "m N")
    (True, True, False, False)
    """
    return _normalised(one) == _normalised(other)


def seconds(units: str) -> bool:
    """Return whether units of time are seconds.

    >>> seconds("s"), seconds("seconds"), seconds("ms"), seconds("seconds since 2026-01-01")
    (True, True, False, False)
    """
    return units.strip() in ("s", "sec", "second", "seconds")


def _normalised(units: str) -> str:
    plain = _RAISED.sub(lambda found: "^" + found.group().translate(_POWERS), units).replace("**", "^")
    return re.sub(r"\s*([/^])\s*", r"\1", " ".join(re.sub("[·⋅*]", " ", plain).split()))
