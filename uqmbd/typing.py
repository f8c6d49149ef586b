"""Types of arrays by their entries, and types of user input; docstrings of functions state the shapes.

This module is public, and plugins can use it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "Distribution", "Index", "Mask", "Quantity", "Vector"]

Array = NDArray[np.float64]
"""Array of numbers."""

Index = NDArray[np.int64]
"""Array of whole numbers, such as indices of realisations, rows or columns."""

Mask = NDArray[np.bool_]
"""Array of truth values."""

Distribution: TypeAlias = Any
"""A distribution of chaospy, of ``scipy.stats`` with its parameters, or of OpenTURNS; these packages have no types."""


class Quantity(Protocol):
    """A number, or an expression in random variables, time and motion.

    Numbers of Python and NumPy, expressions of SymPy and random variables are quantities.  Texts and bodies are not.

    Examples
    --------
    >>> def doubled(length: Quantity) -> Quantity:
    ...     return 2 * float(length)
    >>> doubled(np.int64(2))
    4.0
    """

    def __float__(self) -> float:
        """Return the number; an expression that is not a number raises an error."""


class _Shaped(Protocol):
    """An array, or a column vector of SymPy."""

    @property
    def shape(self) -> Any: ...

    def __len__(self) -> int: ...

    def __getitem__(self, key: Any, /) -> Any: ...


Vector: TypeAlias = Quantity | Sequence[Quantity] | _Shaped
"""One quantity for each dimension of the space: a sequence, an array or a column; on a line also a single quantity."""
