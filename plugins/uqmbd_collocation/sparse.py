"""Sparse regression: few terms out of many, chosen by scikit-learn, their number by the leave-one-out error."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

__all__ = ["SOLVERS", "sparse_regression"]

Array = NDArray[np.float64]

SOLVERS = ("omp", "lars")

COMPONENT = 1e-8
"""Principal components of the responses below this share of the largest are left out: rounding."""

FULL = 0.8
"""Most terms of a fit over the number of samples: beyond, the leave-one-out error means nothing."""


def sparse_regression(response: Array, psi: Array, solver: str = "omp") -> tuple[Array, Array]:
    """Fit few terms of a basis to realisations.

    The responses of an output over time are taken apart into principal components; each is fitted on its own, so that
    an output at 400 times costs as much as its dozen components.  scikit-learn tells in which order terms enter
    (orthogonal matching pursuit or least-angle regression); among the least-squares fits on the first so many of them
    the one with the smallest corrected leave-one-out error is taken [1]_.

    Parameters
    ----------
    response : array, shape (K, O, T)
        In the units of the outputs.
    psi : array, shape (K, P)
        The basis at the samples; its first term is the constant.
    solver : {"omp", "lars"}
        Who orders the terms.

    Returns
    -------
    coefficients : array, shape (P, O, T)
        Mostly zeros.
    leave_one_out : array, shape (O, T)
        Corrected leave-one-out error relative to the variance of the samples; 0 where they agree.  The same samples
        chose the terms, so that it can be several times too small where there are no few terms to be found.

    References
    ----------
    .. [1] G. Blatman and B. Sudret, Journal of Computational Physics 230 (2011) 2345-2367.

    Examples
    --------
    >>> x = np.linspace(-1, 1, 12)
    >>> psi = x[:, None] ** np.arange(20)
    >>> coefficients, error = sparse_regression((1 + 3 * x**2)[:, None, None], psi)
    >>> coefficients[:, 0, 0].round(8)[:4].tolist(), bool(error < 1e-12)
    ([1.0, 0.0, 3.0, 0.0], True)
    """
    samples, outputs, times = response.shape
    coefficients = np.zeros((psi.shape[1], outputs, times))
    leave_one_out = np.zeros((outputs, times))
    for k in range(outputs):
        mean = response[:, k].mean(axis=0)
        centred = response[:, k] - mean
        left, size, right = np.linalg.svd(centred, full_matrices=False)
        # what is far below the rounding of the values themselves does not vary
        floor = max(COMPONENT * size[0], 1e-13 * float(np.abs(response[:, k]).max(initial=0.0)) * np.sqrt(samples))
        used = np.flatnonzero(size > floor)
        errors = np.zeros((samples, len(used)))
        for c in used:
            fitted, errors[:, c] = _fit(left[:, c] * size[c], psi, solver)
            coefficients[:, k] += fitted[:, None] * right[c]
        coefficients[0, k] += mean
        variance = centred.var(axis=0, ddof=1)
        press = np.mean((errors @ right[used]) ** 2, axis=0)
        leave_one_out[k] = np.divide(press, variance, out=np.zeros(times), where=variance > 0)
    return coefficients, leave_one_out


def _fit(values: Array, psi: Array, solver: str) -> tuple[Array, Array]:
    """Fit one component: coefficients (P,), and the error at each sample if it is left out, corrected (K,)."""
    from scipy.linalg import solve_triangular

    samples = len(values)
    order = np.concatenate([[0], _entering(values, psi, solver)])
    basis, triangle = np.linalg.qr(psi[:, order])
    leverage = np.cumsum(basis**2, axis=1)
    residual = values[:, None] - np.cumsum(basis * (basis.T @ values), axis=1)
    errors = residual / np.maximum(1.0 - leverage, 1e-10)
    counts = np.arange(1, len(order) + 1)
    # the correction of [1]_: K / (K - P) (1 + trace((Psi^T Psi)^-1)); the trace grows by the columns of R^-1
    inverse = solve_triangular(triangle, np.eye(len(order)))
    trace = np.cumsum(np.sum(inverse**2, axis=0))
    correction = samples / (samples - counts) * (1.0 + trace)
    score = np.mean(errors**2, axis=0) * correction
    best = int(np.argmin(score)) + 1
    coefficients = np.zeros(psi.shape[1])
    coefficients[order[:best]] = solve_triangular(triangle[:best, :best], basis[:, :best].T @ values)
    return coefficients, errors[:, best - 1] * np.sqrt(correction[best - 1])


def _entering(values: Array, psi: Array, solver: str) -> NDArray[np.int64]:
    """Return the terms but the constant, in the order in which they enter; only independent ones."""
    from sklearn.linear_model import lars_path, orthogonal_mp

    centred = psi[:, 1:] - psi[:, 1:].mean(axis=0)
    norm = np.linalg.norm(centred, axis=0)
    centred = centred / np.where(norm > 0, norm, 1.0)
    most = min(centred.shape[1], max(1, int(FULL * len(values)) - 1))
    target = values - values.mean()
    with warnings.catch_warnings():
        # both stop early, with a warning, where nothing is left to explain
        warnings.simplefilter("ignore")
        if solver == "lars":
            _, active, _ = lars_path(centred, target, method="lar", max_iter=most)
            entering = [int(k) for k in active]
        else:
            path = orthogonal_mp(centred, target, n_nonzero_coefs=most, return_path=True)
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
