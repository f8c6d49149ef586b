"""Germs: independent standard variables, with their orthonormal polynomials and Gauss rules."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.special
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.randomness.germs.quantile_tables import LARGEST, interpolate, probit
from uqmbd.randomness.germs.recurrences import CLASSICAL, recurrence
from uqmbd.randomness.index_sets import whole_number
from uqmbd.typing import Array

__all__ = ["Germ"]


STORED = 64
"""Number of recurrence coefficients that a classical germ stores; more are computed on demand."""


@dataclass(frozen=True, eq=False)
class Germ:
    """Independent standard variable with its orthonormal polynomials.

    Every operation treats each point separately: evaluating some points, or all, gives the same bits. Gauss nodes of a
    discrete germ are between its values, except for the rule with as many nodes as values.
    """

    name: str
    family: str
    """Family of `recurrence` (hermite, legendre, jacobi, laguerre), discrete (finitely many values) or stieltjes
    (others)."""
    alpha: Array  # (N,) recurrence coefficients of the monic polynomials; a discrete germ has one per value
    beta: Array  # (N,), ``beta[0] = 1``
    parameters: tuple[float, ...] = ()  # ``a, b`` of the beta density, the shape of the gamma density
    bounds: tuple[float, float] = (-np.inf, np.inf)  # the support
    table: Array | None = None
    """(2, M): quantiles over the probit scale ("stieltjes"), or cumulative probabilities and values ("discrete")."""

    @classmethod
    def classical(cls, name: str, family: str, *parameters: float) -> Germ:
        """Return a germ of a classical family."""
        alpha, beta = recurrence(family, parameters, STORED)
        bounds = {"hermite": (-np.inf, np.inf), "laguerre": (0.0, np.inf)}.get(family, (-1.0, 1.0))
        return cls(name, family, alpha, beta, tuple(float(p) for p in parameters), bounds)

    def renamed(self, name: str) -> Germ:
        """Return the same germ under another name."""
        return replace(self, name=name)

    @property
    def values(self) -> int | None:
        """Number of values of a discrete germ; None for a continuous one."""
        return self.table.shape[1] if self.family == "discrete" and self.table is not None else None

    @property
    def highest_degree(self) -> int | None:
        """Highest degree of an orthonormal polynomial; None if unlimited."""
        return None if self.family in CLASSICAL else len(self.alpha) - 1

    def coefficients(self, count: int) -> tuple[Array, Array]:
        """Return `count` recurrence coefficients ``alpha, beta``.

        Raise StudyError if the germ has no polynomials of that degree.
        """
        if count <= len(self.alpha):
            return self.alpha[:count], self.beta[:count]
        if self.family in CLASSICAL:
            return recurrence(self.family, self.parameters, count)
        only = f" has only {self.values} values, so it" if self.values == len(self.alpha) else ""
        raise StudyError(
            f"Input {self.name!r}{only} has polynomials up to degree {len(self.alpha) - 1} and Gauss "
            f"rules of up to {len(self.alpha)} nodes; degree {count - 1} or {count} nodes are "
            "requested. Use a lower order for this input."
        )

    def polynomials(self, x: ArrayLike, degree: int) -> Array:
        """Evaluate the orthonormal polynomials of degree 0 to `degree` by their three-term recurrence.

        Points (...) give values (..., degree + 1). Raise StudyError if the degree is not a whole number of at least 0,
        or is above :attr:`highest_degree`.
        """
        whole_number(degree, f"The degree of the polynomials of {self.name!r}", 0)
        points = np.asarray(x, dtype=float)
        alpha, beta = self.coefficients(degree + 1)
        norm = np.sqrt(beta)
        values = np.empty((degree + 1, *points.shape))
        values[0] = 1.0
        for k in range(degree):
            following = (points - alpha[k]) * values[k]
            if k:
                following -= norm[k] * values[k - 1]
            values[k + 1] = following / norm[k + 1]
        return np.ascontiguousarray(np.moveaxis(values, 0, -1))

    def derivatives(self, x: ArrayLike, degree: int) -> Array:
        """Evaluate the derivatives of the polynomials of degree 0 to `degree`, by their recurrence.

        See :meth:`polynomials`.
        """
        values = self.polynomials(x, degree)
        points = np.asarray(x, dtype=float)
        alpha, beta = self.coefficients(degree + 1)
        norm = np.sqrt(beta)
        found = np.zeros_like(values)
        for k in range(degree):
            following = values[..., k] + (points - alpha[k]) * found[..., k]
            if k:
                following -= norm[k] * found[..., k - 1]
            found[..., k + 1] = following / norm[k + 1]
        return found

    def gauss(self, count: int) -> tuple[Array, Array]:
        """Return ascending nodes (count,) and weights (count,) of sum 1, exact up to the degree ``2 * count - 1``.

        Golub and Welsch, Math. Comp. 23 (1969) 221: nodes are eigenvalues of the Jacobi matrix; weights are Christoffel
        numbers, ``1 / sum(p_k(node)**2)``, with small relative errors. Raise StudyError if `count` is not a whole
        number of at least 1, or is above ``highest_degree + 1``.
        """
        whole_number(count, f"The number of Gauss nodes of {self.name!r}", 1)
        if count not in self._gauss_rules:
            self._gauss_rules[count] = self._golub_welsch(count)
        nodes, weights = self._gauss_rules[count]
        return nodes.copy(), weights.copy()

    def _golub_welsch(self, count: int) -> tuple[Array, Array]:
        """Return nodes and weights (count,) of :meth:`gauss`."""
        import scipy.linalg

        alpha, beta = self.coefficients(count)
        nodes: Array = scipy.linalg.eigvalsh_tridiagonal(alpha, np.sqrt(beta[1:])) if count > 1 else alpha.copy()
        if self._symmetric:
            nodes = (nodes - nodes[::-1]) / 2
        weights = 1.0 / (self.polynomials(nodes, count - 1) ** 2).sum(axis=-1)
        if self._symmetric:
            weights = (weights + weights[::-1]) / 2
        return nodes, weights / weights.sum()

    def from_uniform(self, u: ArrayLike) -> Array:
        """Map uniform numbers, of any shape, to the germ by its quantile function."""
        uniform = np.asarray(u, dtype=float)
        values: Array
        if self.family == "hermite":
            values = probit(uniform)
        elif self.family == "legendre":
            values = 2 * uniform - 1
        elif self.family == "jacobi":
            values = 2 * scipy.special.betaincinv(*self.parameters, uniform) - 1
        elif self.family == "laguerre":
            values = scipy.special.gammaincinv(*self.parameters, np.minimum(uniform, LARGEST))
        elif self.table is None:
            raise StudyError(
                f"The quantile function of {self.name!r} was not stored. Build the GermSpace from the study again."
            )
        elif self.family == "discrete":
            chosen = np.searchsorted(self.table[0], uniform, side="right")
            values = self.table[1][np.minimum(chosen, self.table.shape[1] - 1)]
        else:
            values = np.clip(interpolate(self.table, probit(uniform)), *self.bounds)
        return values

    def linearisation(self, degree: int) -> Array:
        """Return ``E[p_i p_j p_k]`` for ``i, j <= degree``, ``k <= 2 * degree``.

        The shape is (degree + 1, degree + 1, 2 * degree + 1). Values come from an exact Gauss rule. The highest degree
        of a discrete germ is its number of values minus one; entries of higher degrees have no norm, and are zero.
        """
        highest = 2 * whole_number(degree, f"The degree of products of {self.name!r}", 0)
        if self.values == len(self.alpha):
            known = min(highest, self.values - 1)
            nodes, weights = self.gauss(min(highest + 1, self.values))
        else:
            known = highest
            nodes, weights = self.gauss(highest + 1)
        p = self.polynomials(nodes, known)
        result = np.zeros((degree + 1, degree + 1, highest + 1))
        factors = p[:, : degree + 1]
        result[..., : known + 1] = np.einsum("n,ni,nj,nk->ijk", weights, factors, factors, p, optimize=True)
        return result

    @cached_property
    def _gauss_rules(self) -> dict[int, tuple[Array, Array]]:
        """Cached rules by their number of nodes: a sparse grid uses the same rules hundreds of times."""
        return {}

    @cached_property
    def _symmetric(self) -> bool:
        return self.family in ("hermite", "legendre") or bool(self.family == "jacobi" and not np.any(self.alpha))

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields for pickling; derived data are computed again."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}
