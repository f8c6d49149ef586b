"""Fit of a polynomial chaos to realisations at nodes: projection if the rule allows it, otherwise regression."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

import uqmbd
from uqmbd.extend import least_squares, project
from uqmbd.typing import Array, Index
from uqmbd_collocation.runs import CollocationRuns
from uqmbd_collocation.sparse import sparse_regression

__all__ = ["Fit", "QuadratureProjection", "Regression", "refitted"]


ALIASED = 0.2
"""Error of the rule for products of the basis above which projection is not meaningful."""
COARSE = 1e-6
"""A warning is issued if the error of the rule for products of the basis exceeds this value."""
MOST_FAILURES = 0.5
"""Share of failed realisations above which no fit is computed, because failures are then not rare."""


@dataclass(frozen=True)
class Fit:
    """Coefficients of a polynomial chaos, and the method of their fit."""

    coefficients: Array  # (P, O, T), in the units of the outputs
    multi_index: Index  # (P, d)
    how: str  # description of the fit
    where: Index  # (K,) indices of the fitted realisations
    leave_one_out: Array | None = None  # (O, T), for a regression on samples
    weights: Array | None = None  # (K,), weights of a quadrature
    failed: int = 0  # number of failed realisations, which the fit omits


@dataclass(frozen=True, eq=False)
class QuadratureProjection:
    """Pseudo-spectral projection on a basis by a quadrature rule."""

    rule: uqmbd.extend.Quadrature
    multi_index: Index  # (P, d)
    exact: bool  # whether the rule integrates products of the basis exactly
    label: str  # label of the propagator, for messages

    @property
    def nodes(self) -> Array:
        """Inputs of the realisations, shape (K, d)."""
        return self.rule.nodes

    def check(self, space: uqmbd.extend.GermSpace) -> None:
        """Raise StudyError if aliasing of the rule makes coefficients meaningless; warn if it is considerable."""
        wrong = 0.0 if self.exact else uqmbd.extend.gram_error(space, self.rule, self.multi_index)
        if wrong > ALIASED:
            raise uqmbd.StudyError(
                f"{self.label}: the rule ({self.rule.name}) does not resolve the {len(self.multi_index)} terms of "
                f"the basis: it integrates products of two terms with an error of {wrong:.2g}. Use more nodes, a "
                "lower order, Gauss nodes, or method='regression'."
            )
        if wrong > COARSE:
            warnings.warn(
                f"{self.label}: the rule ({self.rule.name}) integrates products of the "
                f"{len(self.multi_index)} terms with an error of {wrong:.1g}, so coefficients have "
                "errors of about this size. Use more nodes, or a Gauss rule.",
                stacklevel=2,
            )

    def fit(self, runs: CollocationRuns) -> Fit:
        """Return the projection; if a node failed, return a regression on the other nodes."""
        where = runs.at(self.rule.nodes)
        if not runs.good(where).all():
            return refitted(runs, where, self.multi_index, self.label, self.rule.weights)
        psi = runs.space.evaluate(self.rule.nodes, self.multi_index)
        coefficients = project(runs.response[where], psi, self.rule.weights)
        how = f"projection by {self.rule.name}"
        return Fit(coefficients, self.multi_index, how, where, weights=self.rule.weights)


@dataclass(frozen=True, eq=False)
class Regression:
    """Fit to samples by least squares, or by sparse regression (``omp``, ``lars``)."""

    nodes: Array  # (K, d) samples in germs
    multi_index: Index  # (P, d)
    method: str  # ``regression``, ``omp`` or ``lars``
    label: str  # label of the propagator, for messages

    def check(self, space: uqmbd.extend.GermSpace) -> None:
        """Raise StudyError if there are too few samples.

        Least squares needs at least as many samples as terms, and sparse regression needs three.
        """
        terms = len(self.multi_index)
        if self.method == "regression" and terms > len(self.nodes):
            raise uqmbd.StudyError(
                f"{self.label}: the basis has {terms} terms, more than the {len(self.nodes)} samples. Use at least "
                f"{2 * terms} samples, a lower order, or method='omp', which selects a few terms."
            )
        if self.method != "regression" and len(self.nodes) < 3:
            raise uqmbd.StudyError(
                f"{self.label}: {len(self.nodes)} samples are too few for method={self.method!r}; use "
                "at least a few dozen."
            )

    def fit(self, runs: CollocationRuns) -> Fit:
        """Fit the successful samples, and warn of failed ones; raise IntegrationError if too few are left."""
        terms, every = len(self.multi_index), runs.at(self.nodes)
        where = every[runs.good(every)]
        failed = len(every) - len(where)
        if failed:
            reason = runs.reason(every)
            least = terms if self.method == "regression" else 3
            if len(where) < least or failed > MOST_FAILURES * len(every):
                raise uqmbd.IntegrationError(
                    f"{self.label}: {failed} of {len(every)} samples failed; the successful ones are too few for "
                    f"{terms} terms. Reason of the failure: {reason}"
                )
            warnings.warn(
                f"{self.label}: {failed} of {len(every)} samples failed and are omitted from the fit. In the region "
                f"of failure the chaos is an extrapolation. Reason of the failure: {reason}",
                stacklevel=2,
            )
        psi, response = runs.space.evaluate(runs.germs[where], self.multi_index), runs.response[where]
        if self.method == "regression":
            found = least_squares(response, psi)
            how = f"regression on {len(where)} samples"
            return Fit(found.coefficients, self.multi_index, how, where, found.leave_one_out, failed=failed)
        coefficients, leave_one_out = sparse_regression(response, psi, self.method)
        kept = np.union1d([0], np.flatnonzero((coefficients != 0).any(axis=(1, 2))))
        how = f"sparse regression ({self.method}) on {len(where)} samples, {len(kept)} of {terms} terms"
        return Fit(coefficients[kept], self.multi_index[kept], how, where, leave_one_out, None, failed)


def refitted(runs: CollocationRuns, every: Index, multi_index: Index, label: str, weights: Array | None = None) -> Fit:
    """Return the projection on quadrature nodes with indices `every` (K,); if nodes fail, fit the others and warn.

    See `uqmbd.extend.fit_nodes`.
    """
    good = runs.good(every)
    psi = runs.space.evaluate(runs.germs[every], multi_index)
    found = uqmbd.extend.fit_nodes(label, runs.response[every], good, runs.reason(every), psi, multi_index, weights)
    if found.warning:
        warnings.warn(found.warning, stacklevel=2)
    # omit the leave-one-out error: on a grid, an omitted node has neighbours in every coordinate, so its error is too
    # small
    return Fit(found.coefficients, found.multi_index, found.how, every[good], failed=found.failed)
