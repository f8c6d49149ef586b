"""Expansion and quadrature rule of the user, for example from chaospy, with checks and conversion to the germs."""

from __future__ import annotations

import hashlib
import re
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import ALIASED, COARSE, Fit, QuadratureProjection
from uqmbd_collocation.runs import CollocationRuns

__all__ = ["UserExpansion", "UserProjection", "Polynomials"]

ALIKE = 1e-6
"""Germ terms count as equal to a polynomial if their misfit is at most this multiple of its largest value."""


@dataclass(frozen=True)
class Polynomials:
    """Polynomials of the inputs, as plain numbers."""

    powers: tuple[tuple[int, ...], ...]  # powers of the inputs, for each monomial
    coefficients: tuple[tuple[float, ...], ...]  # for each monomial, the coefficient in each polynomial

    @classmethod
    def of(cls, expansion: Any) -> Polynomials:
        """Return polynomials from numpoly, the type of chaospy's expansions; raise StudyError for other types."""
        wanted = "expected polynomials of chaospy, e.g. chaospy.generate_expansion(3, joint)"
        if not all(hasattr(expansion, name) for name in ("exponents", "coefficients", "names")):
            raise uqmbd.StudyError(f"Collocation: expansion is {str(expansion)[:60]!r}; {wanted}.")
        columns = [int(name[1:]) if re.fullmatch(r"q\d+", name) else -1 for name in map(str, expansion.names)]
        if min(columns, default=0) < 0:
            raise uqmbd.StudyError(
                f"Collocation: the expansion has the variables {', '.join(map(str, expansion.names))}; {wanted}. "
                "Their variables must be q0, q1, ..., for the inputs in the order of their names."
            )
        values = np.array([np.asarray(c, dtype=float) for c in expansion.coefficients])
        if values.ndim != 2 or not values.shape[1]:
            raise uqmbd.StudyError(
                f"Collocation: the expansion has the shape {values.shape[1:]}; {wanted}, as a one-dimensional array."
            )
        if not np.isfinite(values).all():
            raise uqmbd.StudyError(f"Collocation: the expansion has coefficients that are not finite; {wanted}.")
        powers = np.zeros((len(values), max(columns, default=0) + 1), dtype=int)
        powers[:, columns] = expansion.exponents
        return cls(tuple(map(tuple, powers.tolist())), tuple(map(tuple, values.tolist())))

    def __call__(self, inputs: Array) -> Array:
        """Return values (K, polynomial) at inputs (K, d)."""
        powers = np.array(self.powers)
        monomials = np.ones((len(inputs), len(powers)))
        for k in range(powers.shape[1]):
            monomials *= inputs[:, k, None] ** powers[:, k]
        return np.asarray(monomials @ np.array(self.coefficients))


@dataclass(frozen=True)
class UserExpansion:
    """Polynomials, nodes and weights, as plain numbers."""

    polynomials: Polynomials
    nodes: tuple[tuple[float, ...], ...]  # a row for each input, in the order of the input names
    weights: tuple[float, ...]

    @classmethod
    def of(cls, expansion: Any, nodes: Any, weights: Any) -> UserExpansion:
        """Return the expansion after checks of shapes and finiteness; raise StudyError for invalid values."""
        polynomials = Polynomials.of(expansion)
        if nodes is None or weights is None:
            raise uqmbd.StudyError(
                f"Collocation: expansion= also requires {'nodes=' if nodes is None else 'weights='}, e.g. from "
                "nodes, weights = chaospy.generate_quadrature(3, joint, rule='gaussian')."
            )
        try:
            at, by = np.atleast_2d(np.asarray(nodes, dtype=float)), np.asarray(weights, dtype=float)
        except (TypeError, ValueError) as error:
            raise uqmbd.StudyError(
                "Collocation: with expansion=, nodes and weights must be arrays of numbers; the conversion failed: "
                f"{error}."
            ) from None
        inputs = len(polynomials.powers[0])
        if at.ndim != 2 or by.ndim != 1 or at.shape[1] != len(by) or not len(by):
            raise uqmbd.StudyError(
                f"Collocation: nodes have the shape {at.shape}, and weights have the shape {by.shape}. Expected the "
                "shapes (inputs, K) and (K,), as returned by chaospy.generate_quadrature."
            )
        if len(at) < inputs:
            raise uqmbd.StudyError(
                f"Collocation: nodes have {len(at)} rows, but the expansion has {inputs} variables; expected a row for "
                "each input. Create expansion and quadrature rule from the same joint distribution."
            )
        for what, numbers in (("nodes", at), ("weights", by)):
            if not np.isfinite(numbers).all():
                raise uqmbd.StudyError(f"Collocation: {what} contain NaN or infinity; expected finite numbers.")
        if abs(by.sum() - 1) > 1e-6:
            raise uqmbd.StudyError(
                f"Collocation: the sum of the weights is {by.sum():.6g}; expected 1, as for a quadrature rule of the "
                "distributions of the inputs. Divide the weights by their sum if they belong to such a rule."
            )
        return cls(polynomials, tuple(map(tuple, at.tolist())), tuple(by.tolist()))

    def __repr__(self) -> str:
        """Return a text for the recorded options, which distinguishes rules with equal numbers of nodes."""
        numbers = (self.polynomials.powers, self.polynomials.coefficients, self.nodes, self.weights)
        digest = hashlib.sha256(repr(numbers).encode()).hexdigest()[:12]
        return f"{len(self.polynomials.coefficients[0])} polynomials, {len(self.weights)} nodes ({digest})"

    def plan(self, space: uqmbd.extend.GermSpace, label: str) -> UserProjection:
        """Return a projection in the germs; raise StudyError if polynomials and rule do not fit the inputs.

        Polynomials and rule must have the number of inputs of `space`. Inputs must be independent, and nodes must be
        inside the distributions. The polynomials must belong to the distributions, and each input must be an affine
        function of its germ.
        """
        if len(self.nodes) != space.dimension or len(self.polynomials.powers[0]) > space.dimension:
            raise uqmbd.StudyError(
                f"{label}: the nodes have {len(self.nodes)} inputs, but the mechanism has {space.dimension} "
                f"({', '.join(space.inputs)}, in this order). Expected a rule and an expansion for all of them."
            )
        if not space.independent:
            raise uqmbd.StudyError(
                f"{label}: expansion= requires independent inputs, but some inputs are dependent. Omit expansion=, "
                "or define dependent inputs as functions of independent ones, which you declare as random variables."
            )
        nodes = space.to_germs(np.array(self.nodes).T)
        powers = np.zeros((len(self.polynomials.powers), space.dimension), dtype=int)
        powers[:, : len(self.polynomials.powers[0])] = self.polynomials.powers
        terms = _below(powers)
        table = self._table(space, terms, label)
        gram = table @ table.T
        norms = np.sqrt(np.diag(gram))
        skew = float(np.abs(gram / np.outer(norms, norms) - np.eye(len(gram))).max()) if (norms > 0).all() else np.inf
        where = (
            f"{label}: polynomials of the expansion are not orthogonal for the distributions of "
            f"{', '.join(space.inputs)} (in this order): the largest correlation of two of them is {skew:.2g}"
        )
        if skew > ALIASED:
            raise uqmbd.StudyError(
                f"{where}. Create the expansion for the joint distribution of the inputs in the order of their names: "
                "chaospy.J(*(v.distribution for v in mechanism.inputs.variables))."
            )
        if skew > COARSE:
            text = (
                f"{where}. The chaos is the projection on the span of the polynomials; coefficients have errors of "
                "about this size."
            )
            warnings.warn(text, stacklevel=2)
        rank = np.linalg.matrix_rank(table / norms[:, None], tol=1e-8)
        projector = None if rank == len(terms) else np.linalg.pinv(table, rcond=1e-10) @ table
        rule = uqmbd.extend.Quadrature(nodes, np.array(self.weights), None, f"{len(nodes)} given nodes")
        return UserProjection(QuadratureProjection(rule, terms, False, label), projector)

    def _table(self, space: uqmbd.extend.GermSpace, terms: Index, label: str) -> Array:
        """Return the coefficients (polynomial, term) of the polynomials in the terms of the germs."""
        points = uqmbd.extend.monte_carlo_rule(space, 4 * len(terms) + 64, 0, "sobol").nodes
        psi, values = space.evaluate(points, terms), self.polynomials(space.to_inputs(points))
        found = np.linalg.lstsq(psi, values, rcond=None)[0]
        largest = np.maximum(np.abs(values).max(axis=0), 1e-300)
        misfit = float((np.abs(psi @ found - values).max(axis=0) / largest).max())
        if not misfit < ALIKE:
            raise uqmbd.StudyError(
                f"{label}: the expansion is not a polynomial of the germs (relative misfit {misfit:.2g}), because an "
                "input is not an affine function of its germ, e.g. a lognormal one. Omit expansion=, or use a "
                "normal random variable and write its exponential into the mechanism."
            )
        return np.asarray(found.T)


@dataclass(frozen=True, eq=False)
class UserProjection:
    """Projection on the span of given polynomials, by a given rule."""

    complete: QuadratureProjection  # projection on all terms that occur in the polynomials
    # (P, P), from the terms to the span of the polynomials; None if the span contains all terms
    projector: Array | None

    @property
    def nodes(self) -> Array:
        """Inputs of the realisations, shape (K, d)."""
        return self.complete.nodes

    @property
    def multi_index(self) -> Index:
        """Multi-indices of the terms, shape (P, d)."""
        return self.complete.multi_index

    def check(self, space: uqmbd.extend.GermSpace) -> None:
        """Raise an error if the rule does not resolve the terms; warn if it resolves them with a considerable error."""
        self.complete.check(space)

    def fit(self, runs: CollocationRuns) -> Fit:
        """Return the projection; if a node failed, return a regression on the other nodes.

        Raise IntegrationError if a node failed and the polynomials do not span all products up to their degrees.
        """
        found = self.complete.fit(runs)
        if self.projector is None:
            return found
        if found.failed:
            raise uqmbd.IntegrationError(
                f"{self.complete.label}: {found.failed} of {len(self.nodes)} nodes failed, and a fit to the other "
                "nodes is not possible, because the expansion lacks products of low degree. Truncate the "
                f"distributions to exclude the failure. Reason of the failure: {runs.reason(runs.at(self.nodes))}"
            )
        coefficients = np.einsum("pq,q...->p...", self.projector, found.coefficients)
        return Fit(coefficients, found.multi_index, found.how, found.where, weights=found.weights)


def _below(powers: Index) -> Index:
    """Return all monomials that divide at least one of `powers`, in order of degree, starting with the constant."""
    found = {tuple(row) for row in powers.tolist()}
    waiting = list(found)
    while waiting:
        row = waiting.pop()
        for k, power in enumerate(row):
            lower = (*row[:k], power - 1, *row[k + 1 :])
            if power and lower not in found:
                found.add(lower)
                waiting.append(lower)
    return np.array(sorted(found, key=lambda row: (sum(row), tuple(-p for p in row))), dtype=np.int64)
