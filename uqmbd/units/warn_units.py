"""Warnings about units."""

from __future__ import annotations

import sys
import warnings

from uqmbd.errors import UnitsWarning

__all__ = ["warn"]


def warn(text: str) -> None:
    """Warn about units, with the position of the calling line outside uqmbd."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "uqmbd":
        level, frame = level + 1, frame.f_back
    warnings.warn(text, UnitsWarning, stacklevel=level + 1)
