"""Warnings about units that do not fit."""

from __future__ import annotations

import sys
import warnings

from uqmbd.errors import UnitsWarning

__all__ = ["warn"]


def warn(text: str) -> None:
    """Warn about units, at the line outside of uqmbd that states them."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "uqmbd":
        level, frame = level + 1, frame.f_back
    warnings.warn(text, UnitsWarning, stacklevel=level + 1)
