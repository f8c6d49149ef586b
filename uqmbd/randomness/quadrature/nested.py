"""Nested rules of one germ: Clenshaw-Curtis and Fejer, mapped by the quantile function unless the germ is uniform."""

from __future__ import annotations

import numpy as np

from uqmbd.randomness.germs import Germ
from uqmbd.typing import Array

__all__ = ["nested_count", "nested_exactness", "nested_rule"]


def nested_count(germ: Germ, level: int) -> int:
    """Return the number of nodes of :func:`nested_rule`.

    >>> [nested_count(Germ.classical("x", "legendre"), level) for level in range(4)]
    [1, 3, 5, 9]
    >>> [nested_count(Germ.classical("x", "hermite"), level) for level in range(4)]
    [1, 3, 7, 15]
    """
    if not np.isfinite(germ.bounds).all():
        return int(2 ** (level + 1)) - 1
    return int(2**level) + 1 if level else 1


def nested_exactness(germ: Germ, level: int) -> int:
    """Return the highest degree that :func:`nested_rule` integrates exactly.

    >>> nested_exactness(Germ.classical("x", "legendre"), 2), nested_exactness(Germ.classical("x", "hermite"), 2)
    (5, 0)
    """
    return nested_count(germ, level) if germ.family == "legendre" else 0


def nested_rule(germ: Germ, level: int) -> tuple[Array, Array]:
    """Return ascending nodes and weights of the nested rule of a germ; see `uqmbd.extend.clenshaw_curtis`.

    Weights are sums according to Waldvogel, BIT Numer. Math. 46 (2006) 195, equations 2.2 and 2.4.

    >>> nested_rule(Germ.classical("x", "legendre"), 1)[1].round(12).tolist()
    [0.166666666667, 0.666666666667, 0.166666666667]
    """
    count = nested_count(germ, level)
    if count == 1:
        x, weights = np.zeros(1), np.ones(1)
    elif np.isfinite(germ.bounds).all():
        last = count - 1
        k = np.arange(count)
        x = np.cos(np.pi * (last - k) / last)
        j = np.arange(1, last // 2 + 1)
        factor = np.where(2 * j == last, 1.0, 2.0) / (4 * j**2 - 1)
        weights = (1 - np.cos(2 * np.pi * np.outer(k, j) / last) @ factor) / last
        weights[[0, -1]] /= 2
    else:
        parts = count + 1
        angle = np.pi * np.arange(count, 0, -1) / parts
        x = np.cos(angle)
        j = 2 * np.arange(1, parts // 2 + 1) - 1
        weights = 2 * np.sin(angle) / parts * (np.sin(np.outer(angle, j)) @ (1 / j))
    x, weights = (x - x[::-1]) / 2, (weights + weights[::-1]) / 2
    return (x if germ.family == "legendre" else germ.from_uniform((x + 1) / 2)), weights
