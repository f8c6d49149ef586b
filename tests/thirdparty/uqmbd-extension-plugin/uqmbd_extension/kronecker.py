"""A sequence of low discrepancy: multiples of irrational numbers, all of them shifted alike."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Kronecker"]


class Kronecker:
    """Points ``(shift + n alpha) mod 1``, with alpha from the roots of ``x^(d + 1) = x + 1`` and a random shift.

    References
    ----------
    H. Niederreiter, Random Number Generation and Quasi-Monte Carlo Methods, SIAM, 1992, section 3.1.
    """

    name: ClassVar[str] = "kronecker"
    extendable = True

    def points(self, dimension: int, numbers: range, seed: int | np.random.SeedSequence) -> NDArray[np.float64]:
        """Draw the points of some numbers, shape (len(numbers), dimension)."""
        root = 2.0
        for _ in range(100):
            root = (1 + root) ** (1 / (dimension + 1))
        alpha = root ** -np.arange(1.0, dimension + 1)
        shift = np.random.default_rng(seed).random(dimension)
        found: NDArray[np.float64] = (shift + np.array(numbers)[:, None] * alpha) % 1
        return found
