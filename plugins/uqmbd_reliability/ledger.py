"""Limit state with a count and storage of all its realisations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from uqmbd.typing import Array

__all__ = ["BudgetExhausted", "LimitStateLedger", "LimitState"]


LimitState = Callable[[Array], tuple[Array, NDArray[np.bool_]]]
"""Function of points (K, d) of the standard normal space that returns margins (K, requirement) and failures (K,).

A margin below zero is a violation. Margins of failed realisations do not matter."""


class BudgetExhausted(Exception):
    """Error: more realisations are requested than remain."""


class LimitStateLedger:
    """Limit state with a budget of `most` realisations, which stores all points and margins."""

    def __init__(self, limit: LimitState, dimension: int, most: int) -> None:
        self.dimension, self.most = dimension, most
        self._limit = limit
        self._points: list[Array] = []
        self._margins: list[Array] = []

    def __call__(self, points: Array) -> Array:
        """Return margins (K, requirement); NaN for failed realisations.

        Raise BudgetExhausted, without any computation, if more than the remaining realisations are requested.
        """
        if len(points) > self.left:
            raise BudgetExhausted
        margins, failed = self._limit(points)
        # infinite margins keep their sign; plus infinity means that the event has not occurred
        found = np.where(failed[:, None] | np.isnan(margins), np.nan, margins)
        found[np.isnan(found).any(axis=1)] = np.nan
        self._points.append(points)
        self._margins.append(found)
        return found

    @property
    def count(self) -> int:
        """Number of realisations so far."""
        return sum(map(len, self._points))

    @property
    def left(self) -> int:
        """Number of realisations that may still be computed."""
        return self.most - self.count

    @property
    def points(self) -> Array:
        """All points so far, shape (K, d)."""
        return np.concatenate([np.zeros((0, self.dimension)), *self._points])

    @property
    def margins(self) -> Array:
        """All margins so far, shape (K, requirement)."""
        return np.concatenate(self._margins)
