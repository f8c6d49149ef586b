"""Three-term recurrences of the classical orthogonal polynomials, in closed form."""

from __future__ import annotations

import numpy as np

from uqmbd.typing import Array

__all__ = ["CLASSICAL", "recurrence"]


CLASSICAL = ("hermite", "legendre", "jacobi", "laguerre")
"""Families with a closed form of the recurrence for any degree."""


def recurrence(family: str, parameters: tuple[float, ...], count: int) -> tuple[Array, Array]:
    """Return alpha, beta (count,) of the monic polynomials ``p[k + 1] = (x - alpha[k]) p[k] - beta[k] p[k - 1]``.

    Families: "hermite" (standard normal), "legendre" (uniform on [-1, 1]), "jacobi" (beta on [-1, 1]; parameters ``a,
    b`` of the density ``(1 + x)**(a - 1) * (1 - x)**(b - 1)``), "laguerre" (gamma of scale 1; parameter: shape).
    Source: Gautschi, Orthogonal Polynomials: Computation and Approximation, Oxford 2004, table 1.1, for weights that
    are probability densities (``beta[0] = 1``).

    >>> recurrence("hermite", (), 4)[1]
    array([1., 1., 2., 3.])
    >>> recurrence("laguerre", (1.0,), 4)[0]
    array([1., 3., 5., 7.])
    """
    k = np.arange(count, dtype=float)
    alpha = np.zeros(count)
    if family == "hermite":
        beta = k.copy()
    elif family == "legendre":
        beta = k**2 / (4 * k**2 - 1)
    elif family == "laguerre":
        (shape,) = parameters
        alpha = 2 * k + shape
        beta = k * (k + shape - 1)
    elif family == "jacobi":
        alpha, beta = _jacobi(k, *parameters)
    else:
        raise ValueError(family)
    beta[:1] = 1
    return alpha, beta


def _jacobi(k: Array, a: float, b: float) -> tuple[Array, Array]:
    left, right = a - 1, b - 1  # exponents at -1 and at 1
    total = left + right
    twice = 2 * k + total
    alpha = np.empty_like(k)
    beta = np.empty_like(k)
    alpha[:1] = (left - right) / (total + 2)
    alpha[1:] = (left**2 - right**2) / (twice[1:] * (twice[1:] + 2))
    # the general form divides by zero at k = 1 where a + b = 1
    beta[1:2] = 4 * (1 + left) * (1 + right) / ((2 + total) ** 2 * (3 + total))
    j, s = k[2:], twice[2:]
    beta[2:] = 4 * j * (j + left) * (j + right) * (j + total) / (s**2 * (s + 1) * (s - 1))
    return alpha, beta
