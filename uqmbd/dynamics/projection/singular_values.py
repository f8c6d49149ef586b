"""Distance of projected constraint Jacobians from singularity, for several times together.

The projected Jacobian ``A_ij = sum_k adjoint_ik psi_kj d_k`` has P m rows.  The computation of all eigenvalues of
``A A^T`` took half the time of a study.  The Davidson method needs only products with the nodal Jacobians ``d_k`` for
the smallest eigenvalue; its preconditioner is the mean of ``d_k d_k^T``.  The eigenvalues of all times are computed
together, which reduces the overhead of NumPy.  :func:`scipy.sparse.linalg.lobpcg` solves one problem at a time, and
takes five times as long.

An iteration may converge to an eigenvalue other than the smallest.  A Cholesky factorisation
of ``A A^T`` minus a bound proves the bound: it exists only if all eigenvalues are larger.  Single precision is used if
it is sufficient.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg

from uqmbd.typing import Array, Mask

__all__ = ["smallest_singular_values"]


TOLERANCE = 1e-2
"""Ratio of the residual of an eigenvector of ``A A^T`` to its eigenvalue, below which the iteration has converged."""

BOUND = 0.99
"""Ratio of the verified lower bound of all eigenvalues to the computed eigenvalue: 0.5 % of a singular value."""

SINGLE = 1e-3
"""Single precision verifies a bound that exceeds this ratio of the largest absolute column sum of ``A A^T``.

The column sum is an upper limit of the eigenvalues. For random matrices of up to 1050 rows, single precision changes
the largest bound that passes by at most 1.1e-5 of its value."""

STEPS = 60
"""Largest number of steps; unconverged values are computed from the full matrix."""

MOST, KEPT = 12, 4
"""Largest number of vectors of a basis, and number of vectors after a restart."""

SMALL = 64
"""Largest number of rows for which the full matrix costs less."""

CLOSE = 0.998
"""Ratio of the lower bound for squared singular values of all nodes to the value of the candidate node."""


def smallest_singular_values(jacobians: Array, psi: Array, adjoint: Array, weights: Array) -> tuple[Array, Array]:
    """Return the smallest singular values (T,) of projected Jacobians, and the smallest nodal ones (T,).

    The Jacobians (T, K, m, n) usually have full rank, with 1 <= m <= n; psi (K, P), adjoint (P, K) and weights (K,).
    Projected values are accurate to 0.5 %. The values are accurate to rounding if the iteration does not converge, as
    for a singular matrix, or misses the smallest value. A nodal value is the exact value of one node; the values of
    other nodes are less by at most 0.1 %.
    """
    grams = jacobians @ jacobians.swapaxes(2, 3)
    mean = np.einsum("k,tkab->tab", weights, grams)
    nodal = _of_nodes(jacobians, grams, mean)
    found = np.zeros(len(nodal))
    settled = np.zeros(len(nodal), dtype=bool)
    if psi.shape[1] * jacobians.shape[2] > SMALL:
        try:
            found, settled = _iterated(jacobians, psi, adjoint, np.linalg.inv(mean))
        except np.linalg.LinAlgError:
            pass
    for k, jacobian in enumerate(jacobians):
        if not settled[k] or not _bounded(jacobian, psi, adjoint, BOUND * found[k] ** 2):
            found[k] = _from_full_matrix(jacobian, psi, adjoint)
    return found, nodal


def _of_nodes(jacobians: Array, grams: Array, mean: Array) -> Array:
    """Return the smallest nodal singular values (T,); check a probable candidate before computing all nodes."""
    rows, every = jacobians.shape[2], np.arange(len(jacobians))
    weakest = np.linalg.eigh(mean)[1][:, None, None, :, 0]
    candidate = np.linalg.norm((weakest @ jacobians)[:, :, 0], axis=2).argmin(axis=1)
    found: Array = np.linalg.svd(jacobians[every, candidate], compute_uv=False)[:, -1]
    for k, (value, some) in enumerate(zip(found, grams, strict=True)):
        try:
            # the factorisation exists if all eigenvalues of all nodes exceed the bound
            np.linalg.cholesky(some - (CLOSE * value**2) * np.eye(rows))
        except np.linalg.LinAlgError:
            found[k] = np.linalg.svd(jacobians[k], compute_uv=False)[:, -1].min()
    return found


def _iterated(jacobians: Array, psi: Array, adjoint: Array, inverse: Array) -> tuple[Array, Mask]:
    """Return the smallest singular values of the projected Jacobians (T,), and a mask of the converged values."""
    times, _, rows, columns = jacobians.shape
    terms = psi.shape[1]
    to_nodes, to_terms = np.ascontiguousarray(adjoint.T), np.ascontiguousarray(psi.T)
    basis, images = np.zeros((times, MOST, terms * rows)), np.zeros((times, MOST, terms * columns))
    # a random start includes all isolated parts of a mechanism
    x = np.random.default_rng(0).standard_normal((times, terms, rows))
    for _ in range(5):
        x = x @ inverse
        x /= np.linalg.norm(x, axis=(1, 2), keepdims=True)
    x = x.reshape(times, -1)
    size, value, residual = 0, np.zeros(times), np.full(times, np.inf)
    for _ in range(STEPS):
        for _ in range(2):
            known = basis[:, :size]
            x = x - ((x[:, None] @ known.swapaxes(1, 2)) @ known)[:, 0]
            x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), np.finfo(float).tiny)
        at_nodes = (to_nodes @ x.reshape(times, terms, rows))[:, :, None]
        basis[:, size], images[:, size] = x, (to_terms @ (at_nodes @ jacobians)[:, :, 0]).reshape(times, -1)
        size += 1
        image = images[:, :size]
        values, vectors = np.linalg.eigh(image @ image.swapaxes(1, 2))
        value, least = values[:, 0], vectors[:, None, :, 0]
        at_nodes = psi @ (least @ image).reshape(times, terms, columns)
        applied = (adjoint @ (jacobians @ at_nodes[..., None])[..., 0]).reshape(times, -1)
        left = applied - value[:, None] * (least @ basis[:, :size])[:, 0]
        residual = np.linalg.norm(left, axis=1)
        if (residual <= TOLERANCE * value).all():
            break
        if size == MOST:
            lowest, size = vectors[:, :, :KEPT].swapaxes(1, 2), KEPT
            basis[:, :KEPT], images[:, :KEPT] = lowest @ basis, lowest @ images
        x = (left.reshape(times, terms, rows) @ inverse).reshape(times, -1)
    return np.sqrt(np.maximum(value, 0.0)), residual <= TOLERANCE * value


def _from_full_matrix(jacobians: Array, psi: Array, adjoint: Array) -> float:
    """Return the smallest singular value of one projected Jacobian, from its entries."""
    # the square root halves the number of correct digits, which still suffices to detect a singularity
    least = scipy.linalg.eigh(_gram(jacobians, psi, adjoint), eigvals_only=True, subset_by_index=[0, 0])[0]
    return float(np.sqrt(max(least, 0.0)))


def _bounded(jacobians: Array, psi: Array, adjoint: Array, bound: float) -> bool:
    """Return whether no eigenvalue of ``A A^T`` is below a bound."""
    gram = _gram(*(x.astype(np.float32) for x in (jacobians, psi, adjoint)))
    if not bound > SINGLE * np.abs(gram).sum(axis=0).max():
        gram = _gram(jacobians, psi, adjoint)
    gram[np.diag_indices(len(gram))] -= bound
    factorised = scipy.linalg.get_lapack_funcs("potrf", (gram,))
    return int(factorised(gram.T, lower=True, clean=False, overwrite_a=True)[1]) == 0


def _gram(jacobians: Any, psi: Any, adjoint: Any) -> Any:
    """Return the product of one projected Jacobian and its transpose, (P m, P m), in the precision of the input."""
    _, rows, columns = jacobians.shape
    terms = psi.shape[1]
    products = np.einsum("ik,kj->ijk", adjoint, psi).reshape(-1, len(psi))
    blocks = (products @ jacobians.reshape(len(psi), -1)).reshape(terms, terms, rows, columns)
    whole = blocks.transpose(0, 2, 1, 3).reshape(terms * rows, -1)
    return whole @ whole.T
