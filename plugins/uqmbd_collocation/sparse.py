"""Sparse regression: few terms out of many, chosen by scikit-learn, their number by the leave-one-out error."""

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
"""Spread below this share of the largest until then is left out: rounding."""

TURNED = 0.5
"""Sine of the angle between the responses at two times, over the error of the fit, below which one order serves both.

Smaller values cost more orders of terms and gain little: what the order misses is a part of the error."""

ENOUGH = 1e-7
"""Error of a fit over the standard deviation below which no better order is sought."""

FULL = 0.8
"""Most terms of a fit over the number of samples: beyond, the leave-one-out error means nothing."""


def linear_models(solver: str) -> ModuleType:
    """Import the module of scikit-learn that has the solver."""
    return uqmbd.extend.require_package("sklearn.linear_model", f"Collocation(method={solver!r})", "uqmbd[learning]")


def sparse_regression(response: Array, psi: Array, solver: str = "omp") -> tuple[Array, Array]:
    """Fit few of the terms `psi` (K, P) to responses (K, O, T).

    Return coefficients (P, O, T) and leave-one-out errors (O, T). Each time is fitted separately. scikit-learn gives
    the order in which terms enter (`solver`: orthogonal matching pursuit or least-angle regression); a least-squares
    fit follows on the first n of them, for each n. The one with the smallest corrected leave-one-out error is taken
    (Blatman and Sudret, Journal of Computational Physics 230 (2011) 2345-2367). Later times reuse the order of an
    earlier time while the responses hardly change direction. So an output at 400 times needs some dozen orders. No fit
    depends on later times: a failure there does not affect earlier results. Errors are relative to the variance of the
    samples, 0 where they agree; as the same samples chose the terms, they can be several times too small where the
    expansion is not sparse.
    """
    samples, outputs, times = response.shape
    coefficients = np.zeros((psi.shape[1], outputs, times))
    leave_one_out = np.zeros((outputs, times))
    for k in range(outputs):
        # times in rows, whose sums do not depend on how many there are
        rows = np.ascontiguousarray(response[:, k].T)
        mean = rows.mean(axis=1)
        centred = rows - mean[:, None]
        size = np.linalg.norm(centred, axis=1)
        # what is far below the rounding of the values themselves does not vary
        rounding = 1e-13 * np.abs(rows).max(axis=1, initial=0.0) * np.sqrt(samples)
        floor = np.maximum.accumulate(np.maximum(NOISE * size, rounding))
        known: list[_TermOrder] = []
        for t in np.flatnonzero(size > floor):
            coefficients[:, k, t], error = _at_time(centred[t] / size[t], psi, solver, known)
            coefficients[:, k, t] *= size[t]
            leave_one_out[k, t] = error * (samples - 1)
        coefficients[0, k] += mean
    return coefficients, leave_one_out


@dataclass(frozen=True, eq=False)
class _TermOrder:
    """Order in which terms enter, found from responses in a direction, and the factorisation that its fits share."""

    direction: Array  # (K,) responses about their mean, of length 1
    terms: NDArray[np.int64]  # (N,) the constant first
    basis: Array
    triangle: Array  # with `basis` (K, N) the QR factorisation of the terms at the samples, (N, N)
    left: Array  # (K, N) 1 - leverage of each sample in the fit on the first n + 1 terms
    correction: Array  # (N,) factor of the mean squared leave-one-out error: K / (K - P) (1 + trace((Psi^T Psi)^-1))

    @classmethod
    def of(cls, direction: Array, psi: Array, solver: str) -> _TermOrder:
        from scipy.linalg import solve_triangular

        terms = np.concatenate([[0], _entering(direction, psi, solver)])
        basis, triangle = np.linalg.qr(psi[:, terms])
        counts = np.arange(1, len(terms) + 1)
        # the trace grows by the columns of R^-1
        inverse = solve_triangular(triangle, np.eye(len(terms)))
        correction = len(psi) / (len(psi) - counts) * (1.0 + np.cumsum(np.sum(inverse**2, axis=0)))
        left = np.maximum(1.0 - np.cumsum(basis**2, axis=1), 1e-10)
        return cls(direction, terms, basis, triangle, left, correction)

    def fit(self, values: Array, terms: int) -> tuple[Array, float]:
        """Fit values (K,): coefficients (P,) of all `terms`, and the corrected mean squared leave-one-out error."""
        from scipy.linalg import solve_triangular

        amounts = self.basis.T @ values
        residual = values[:, None] - np.cumsum(self.basis * amounts, axis=1)
        score = np.mean((residual / self.left) ** 2, axis=0) * self.correction
        best = int(np.argmin(score)) + 1
        coefficients = np.zeros(terms)
        coefficients[self.terms[:best]] = solve_triangular(self.triangle[:best, :best], amounts[:best])
        return coefficients, float(score[best - 1])


def _at_time(values: Array, psi: Array, solver: str, known: list[_TermOrder]) -> tuple[Array, float]:
    """Fit responses of length 1 (K,) on the nearest known order, or on their own, which is known from then on."""
    found: tuple[Array, float] | None = None
    if known:
        cosine = np.abs([order.direction @ values for order in known])
        near = int(np.argmax(cosine))
        found = known[near].fit(values, psi.shape[1])
        turned = np.sqrt(max(1.0 - float(cosine[near]) ** 2, 0.0))
        missed = np.sqrt(found[1] * len(values))
        if missed <= ENOUGH or turned <= TURNED * missed:
            return found
    known.append(_TermOrder.of(values, psi, solver))
    own = known[-1].fit(values, psi.shape[1])
    return own if found is None or own[1] <= found[1] else found


def _entering(values: Array, psi: Array, solver: str) -> NDArray[np.int64]:
    """Return the terms but the constant, in the order in which they enter; only independent ones."""
    linear = linear_models(solver)
    centred = psi[:, 1:] - psi[:, 1:].mean(axis=0)
    norm = np.linalg.norm(centred, axis=0)
    centred = centred / np.where(norm > 0, norm, 1.0)
    most = min(centred.shape[1], max(1, int(FULL * len(values)) - 1))
    target = values - values.mean()
    with warnings.catch_warnings():
        # both stop early, with a warning, where nothing is left to explain
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
