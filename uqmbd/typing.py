"""Types of arrays, by what they hold; the docstrings of what takes or returns them tell their shapes.

This module is public, for plugins as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Index", "Mask"]

Array = NDArray[np.float64]
"""Numbers."""

Index = NDArray[np.int64]
"""Whole numbers: which members, rows or columns."""

Mask = NDArray[np.bool_]
"""Truth values."""
