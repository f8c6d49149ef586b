"""Types of arrays, by what they hold, and of what users give; docstrings of what takes them tell their shapes.

This module is public, for plugins as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Distribution", "Index", "Mask", "Quantity", "Vector"]

Array = NDArray[np.float64]
"""Numbers."""

Index = NDArray[np.int64]
"""Whole numbers: which members, rows or columns."""

Mask = NDArray[np.bool_]
"""Truth values."""

Distribution: TypeAlias = Any
"""A distribution of chaospy, of ``scipy.stats`` with its parameters, or of OpenTURNS; these packages have no types."""


class Quantity(Protocol):
    """A number, or an expression in random variables, time and motion.

    Numbers of Python and of NumPy, SymPy's expressions and random variables are; texts and bodies are none.

    Examples
    --------
    >>> def doubled(length: Quantity) -> Quantity:
    ...     return 2 * float(length)
    >>> doubled(np.int64(2))
    4.0
    """

    def __float__(self) -> float:
        """Return the number; expressions that are no number refuse."""


class _Shaped(Protocol):
    """An array, or a column of SymPy's."""

    @property
    def shape(self) -> Any: ...

    def __len__(self) -> int: ...

    def __getitem__(self, key: Any, /) -> Any: ...


Vector: TypeAlias = Quantity | Sequence[Quantity] | _Shaped
"""As many quantities as the space has dimensions: a sequence, an array or a column; on a line also one by itself."""
