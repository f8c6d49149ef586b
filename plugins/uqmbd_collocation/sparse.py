"""Sparse regression: scikit-learn selects few terms; the leave-one-out error determines their number."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.typing import Array

__all__ = ["SOLVERS", "linear_models", "sparse_regression"]


SOLVERS = ("omp", "lars")

NOISE = 1e-8
"""A spread below this multiple of the largest earlier spread counts as rounding error."""

TURNED = 0.5
"""Largest ratio of sin(angle between the responses at two times) to the error of the fit at which both use one order.

The order is the sequence in which terms enter the fit. A smaller ratio requires more sequences with little gain,
because the error of the fit includes the effect of the sequence."""

ENOUGH = 1e-7
"""No better order of terms is sought if the error of a fit is below this multiple of the standard deviation."""

FULL = 0.8
"""Largest ratio of terms to samples of a fit; above it, the leave-one-out error is not meaningful."""


def linear_models(solver: str) -> ModuleType:
    """Return the module of scikit-learn that contains the solver."""
    return uqmbd.extend.require_package("sklearn.linear_model", f"Collocation(method={solver!r})", "uqmbd[learning]")


def sparse_regression(response: Array, psi: Array, solver: str = "omp") -> tuple[Array, Array]:
    """Fit few of the terms `psi` (K, P) to responses (K, O, T).

    Return coefficients (P, O, T) and leave-one-out errors (O, T), with a separate fit for each time. scikit-learn
    determines the order in which terms enter (`solver`: orthogonal matching pursuit or least-angle regression). A
    least-squares fit on the first n terms follows for each n. The result is the fit with the smallest corrected
    leave-one-out error (Blatman and Sudret, Journal of Computational Physics 230 (2011) 2345-2367). Later times reuse
    the order of an earlier time as long as the direction of the responses hardly changes. So an output at 400 times
    needs several dozen orders. No fit depends on later times, so a failure at a later time does not affect earlier
    results. Errors are relative to the variance of the samples; if all samples are equal, the errors are 0. The same
    samples select the terms and determine the errors. If the expansion is not sparse, the errors can therefore be
    several times too small.
    """
    samples, outputs, times = response.shape
    coefficients = np.zeros((psi.shape[1], outputs, times))
    leave_one_out = np.zeros((outputs, times))
    for k in range(outputs):
        # each row is a time, so that sums do not depend on the number of times
        rows = np.ascontiguousarray(response[:, k].T)
        mean = rows.mean(axis=1)
        centred = rows - mean[:, None]
        size = np.linalg.norm(centred, axis=1)
        # a deviation far below the rounding errors of the values counts as zero
        rounding = 1e-13 * np.abs(rows).max(axis=1, initial=0.0) * np.sqrt(samples)
        floor = np.maximum.accumulate(np.maximum(NOISE * size, rounding))
        known: list[_TermOrder] = []
        directions = np.empty((times, samples))
        for t in np.flatnonzero(size > floor):
            coefficients[:, k, t], error = _at_time(centred[t] / size[t], psi, solver, known, directions)
            coefficients[:, k, t] *= size[t]
            leave_one_out[k, t] = error * (samples - 1)
        coefficients[0, k] += mean
    return coefficients, leave_one_out


@dataclass(frozen=True, eq=False)
class _TermOrder:
    """Order in which terms enter, from responses in one direction, and the QR factorisation of fits in this order."""

    terms: NDArray[np.int64]  # (N,) indices of terms, the constant first
    basis: Array
    triangle: Array  # (N, N); `basis` (K, N) and `triangle` are the QR factors of the terms at the samples
    left: Array  # (K, N) one minus leverage of each sample in the fit on the first n + 1 terms
    correction: Array  # (N,) factor of the mean squared leave-one-out error: K / (K - P) (1 + trace((Psi^T Psi)^-1))

    @classmethod
    def of(cls, direction: Array, psi: Array, solver: str) -> _TermOrder:
        from scipy.linalg import solve_triangular

        terms = np.concatenate([[0], _entry_order(direction, psi, solver)])
        basis, triangle = np.linalg.qr(psi[:, terms])
        counts = np.arange(1, len(terms) + 1)
        # each column of R^-1 adds to the trace
        inverse = solve_triangular(triangle, np.eye(len(terms)))
        correction = len(psi) / (len(psi) - counts) * (1.0 + np.cumsum(np.sum(inverse**2, axis=0)))
        left = np.maximum(1.0 - np.cumsum(basis**2, axis=1), 1e-10)
        return cls(terms, basis, triangle, left, correction)

    def fit(self, values: Array, terms: int) -> tuple[Array, float]:
        """Return coefficients (P,) of all `terms` and the corrected mean square leave-one-out error for values (K,)."""
        from scipy.linalg import solve_triangular

        amounts = self.basis.T @ values
        residual = values[:, None] - np.cumsum(self.basis * amounts, axis=1)
        score = np.mean((residual / self.left) ** 2, axis=0) * self.correction
        best = int(np.argmin(score)) + 1
        coefficients = np.zeros(terms)
        coefficients[self.terms[:best]] = solve_triangular(self.triangle[:best, :best], amounts[:best])
        return coefficients, float(score[best - 1])


def _at_time(values: Array, psi: Array, solver: str, known: list[_TermOrder], directions: Array) -> tuple[Array, float]:
    """Fit responses of length 1 (K,) with the nearest known order, or with a new order, which is added to `known`.

    The first rows of `directions` (T, K) belong to the known orders.
    """
    found: tuple[Array, float] | None = None
    if known:
        cosine = np.abs(directions[: len(known)] @ values)
        near = int(np.argmax(cosine))
        found = known[near].fit(values, psi.shape[1])
        turned = np.sqrt(max(1.0 - float(cosine[near]) ** 2, 0.0))
        missed = np.sqrt(found[1] * len(values))
        if missed <= ENOUGH or turned <= TURNED * missed:
            return found
    directions[len(known)] = values
    known.append(_TermOrder.of(values, psi, solver))
    own = known[-1].fit(values, psi.shape[1])
    return own if found is None or own[1] <= found[1] else found


def _entry_order(values: Array, psi: Array, solver: str) -> NDArray[np.int64]:
    """Return the independent terms in the order in which they enter, without the constant."""
    linear = linear_models(solver)
    centred = psi[:, 1:] - psi[:, 1:].mean(axis=0)
    norm = np.linalg.norm(centred, axis=0)
    centred = centred / np.where(norm > 0, norm, 1.0)
    most = min(centred.shape[1], max(1, int(FULL * len(values)) - 1))
    target = values - values.mean()
    with warnings.catch_warnings():
        # both solvers stop early with a warning if the residual vanishes
        warnings.simplefilter("ignore")
        if solver == "lars":
            _, active, _ = linear.lars_path(centred, target, method="lar", max_iter=most)
            entering = [int(k) for k in active]
        else:
            path = linear.orthogonal_mp(centred, target, n_nonzero_coefs=most, return_path=True)
            chosen = path.reshape(centred.shape[1], -1) != 0
            step = chosen.shape[1] - chosen.sum(axis=1)  # a term that has entered stays
            entering = np.argsort(step, kind="stable")[: int(chosen.any(axis=1).sum())].tolist()
    kept: list[int] = []
    basis = np.zeros((len(values), 0))
    for k in entering:
        rest = centred[:, k] - basis @ (basis.T @ centred[:, k])
        length = np.linalg.norm(rest)
        if length > 1e-8:
            kept.append(k + 1)
            basis = np.column_stack([basis, rest / length])
    return np.array(kept, dtype=np.int64)
