"""Ends of logarithmic axes in per cent."""

from __future__ import annotations

from uqmbd.report.drawing import decades

__all__ = ["percent_ends"]


def percent_ends(ends: tuple[float, float]) -> tuple[float, float]:
    """Return the full decades, in per cent, about two values."""
    first, last = decades(*(100 * end for end in ends))
    return float(f"1e{first}"), float(f"1e{last}")
