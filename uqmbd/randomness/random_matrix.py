"""Random matrices of maximum entropy, positive definite, in independent random variables (Soize 2000)."""

from __future__ import annotations

import math

import sympy

from uqmbd.randomness.variable import RandomVariable

__all__ = ["random_factor", "random_root"]


def random_factor(name: str, dispersion: float) -> RandomVariable:
    """Return a positive factor of mean 1 and standard deviation `dispersion`: gamma distributed.

    Examples
    --------
    >>> random_factor("x", 0.5).description
    'Gamma(4.0, scale=0.25)'
    """
    import chaospy

    return RandomVariable(name, chaospy.Gamma(1 / dispersion**2, dispersion**2), "1")


def random_root(name: str, dispersion: float, size: int) -> sympy.Matrix:
    r"""Return an upper triangular matrix ``L`` of independent entries, so that ``L^T L`` is a random matrix of mean 1.

    Its dispersion :math:`\sqrt{E \lVert L^T L - 1 \rVert^2 / n}` is the one given.  With
    ``s = dispersion / sqrt(n + 1)``, entries beside the diagonal are normal of standard deviation ``s``; those on it,
    numbered from zero, are ``s`` times chi distributed of ``(n + 1) / dispersion^2 - i`` degrees of freedom.

    Parameters
    ----------
    name : str
        Beginning of the names of the variables; the number of row and column follows, from one.
    dispersion : float
        Positive, below the square root of ``(n + 1) / (n - 1)``.
    size : int
        n, at least 2.

    Examples
    --------
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
