"""Positive definite random matrices of maximum entropy, as functions of independent random variables (Soize 2000)."""

from __future__ import annotations

import math

import sympy

from uqmbd.randomness.variable import RandomVariable

__all__ = ["random_factor", "random_root"]


def random_factor(name: str, dispersion: float) -> RandomVariable:
    """Return a gamma distributed positive factor of mean 1 and standard deviation `dispersion`.

    >>> random_factor("x", 0.5).description
    'Gamma(4.0, scale=0.25)'
    """
    import chaospy

    return RandomVariable(name, chaospy.Gamma(1 / dispersion**2, dispersion**2), "1")


def random_root(name: str, dispersion: float, size: int) -> sympy.Matrix:
    """Return an upper triangular n x n matrix ``L`` of independent entries, so that ``L^T L`` has the mean 1.

    n = `size` is at least 2. `dispersion` = sqrt(E |L^T L - 1|^2 / n) must be positive, and below the square root of
    ``(n + 1) / (n - 1)``. With ``s = dispersion / sqrt(n + 1)``, entries above the diagonal are normal with standard
    deviation ``s``. Diagonal entries, numbered from zero, are ``s`` times chi-distributed variables with ``(n + 1) /
    dispersion^2 - i`` degrees of freedom. Names of the variables consist of `name` and the numbers of row and column,
    from one.

    >>> random_root("x", 0.5, 2)
    Matrix([
    [x.11, x.12],
    [   0, x.22]])
    """
    import chaospy

    scale = dispersion / math.sqrt(size + 1)
    found = sympy.zeros(size, size)
    for i in range(size):
        freedom = (size + 1) / dispersion**2 - i
        found[i, i] = RandomVariable(f"{name}.{i + 1}{i + 1}", chaospy.Chi(freedom, scale), "1")
        for j in range(i + 1, size):
            found[i, j] = RandomVariable(f"{name}.{i + 1}{j + 1}", chaospy.Normal(0, scale), "1")
    return found
