"""Products of orthonormal polynomials of germs as polynomials of chaospy (numpoly), in monomials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from uqmbd.randomness.germs import Germ
from uqmbd.typing import Array, Index

__all__ = ["as_numpoly"]


def as_numpoly(germs: Sequence[Germ], multi_index: Index, coefficients: Array) -> Any:
    """Return a sum of products of orthonormal polynomials as a polynomial of chaospy, of the shape (...).

    Germ k is the variable ``qk``; `multi_index` (P, d) contains the degrees of the terms, `coefficients` is (P, ...).

    >>> germ = Germ.classical("x", "legendre")
    >>> p = as_numpoly([germ], np.array([[0], [1]]), np.array([2.0, 1.0]))
    >>> float(p(0.0)), round(float(p(1.0)), 9)
    (2.0, 3.732050808)
    """
    import numpoly
    import scipy.sparse

    shape, exponents = coefficients.shape[1:], np.asarray(multi_index)
    values = coefficients.reshape(len(exponents), -1)
    for k, germ in enumerate(germs):
        degrees = exponents[:, k]
        table = _monomial_coefficients(germ, int(degrees.max(initial=0)))
        rows = np.repeat(np.arange(len(degrees)), degrees + 1)
        powers = np.concatenate([np.arange(degree + 1) for degree in degrees])
        expanded = exponents[rows]
        expanded[:, k] = powers
        exponents, place = np.unique(expanded, axis=0, return_inverse=True)
        size = (len(exponents), len(degrees))
        spread = scipy.sparse.csr_array((table[degrees[rows], powers], (np.ravel(place), rows)), shape=size)
        values = spread @ values
    return numpoly.ndpoly.from_attributes(
        exponents=exponents,
        coefficients=[row.reshape(shape) for row in values],
        names=tuple(f"q{k}" for k in range(len(germs))),
    )


def _monomial_coefficients(germ: Germ, degree: int) -> Array:
    """Return coefficients (polynomial, power) of the orthonormal polynomials in powers of the germ."""
    alpha, beta = germ.coefficients(degree + 1)
    norm = np.sqrt(beta)
    table = np.zeros((degree + 1, degree + 1))
    table[0, 0] = 1.0
    for k in range(degree):
        following = -alpha[k] * table[k]
        following[1:] += table[k, :-1]
        if k:
            following -= norm[k] * table[k - 1]
        table[k + 1] = following / norm[k + 1]
    return table
