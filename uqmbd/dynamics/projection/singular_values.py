"""Distance of projected constraint Jacobians from singularity, at several times at once, without eigenvalues.

The projected Jacobian ``A_ij = sum_k adjoint_ik psi_kj d_k`` has P m rows; all eigenvalues of ``A A^T`` took half the
time of a study.  The smallest one follows from products with the nodal Jacobians ``d_k`` alone, by the method of
Davidson preconditioned with the mean of ``d_k d_k^T``.  Those of all times are computed together: NumPy's share of a
step is then paid once.  :func:`scipy.sparse.linalg.lobpcg` takes one problem at a time, and five times as long.

An iteration may stop at an eigenvalue that is not the smallest one, so that none is below is shown: a Cholesky
factorisation of ``A A^T`` less a bound exists, in single precision where that is enough.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg

from uqmbd.typing import Array, Mask

__all__ = ["smallest_singular_values"]


TOLERANCE = 1e-2
"""Residual of an eigenvector of the product with the transpose, over the eigenvalue, at which it has converged."""

BOUND = 0.99
"""Part of an eigenvalue below which it is shown that there is no other: 0.5 % of the singular value."""

SINGLE = 1e-3
"""Part of the largest eigenvalue from which single precision, of 1e-5 at worst, is enough to show that."""

STEPS = 60
"""Most steps; unconverged values are computed from the whole matrix."""

MOST, KEPT = 12, 4
"""Vectors of a basis, and those that are left when it starts again."""

SMALL = 64
"""Rows up to which the whole matrix is cheaper."""

CLOSE = 0.998
"""Part of the smallest value of some nodes that is a bound for those of all others."""


def smallest_singular_values(jacobians: Array, psi: Array, adjoint: Array, weights: Array) -> tuple[Array, Array]:
    """Return the smallest singular values (T,) of projected Jacobians, and the smallest of those at the nodes (T,).

    The Jacobians (T, K, m, n) have full rank as a rule, with 1 <= m <= n; psi (K, P), adjoint (P, K) and weights (K,).
    Projected values are accurate to 0.5 %; they are accurate to rounding where the iteration does not converge, as for
    a singular matrix, or has missed the smallest one.  Nodal values are exact values of nodes that no other undercuts
    by more than 0.1 %.
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
            found[k] = _of_the_whole(jacobian, psi, adjoint)
    return found, nodal


def _of_nodes(jacobians: Array, grams: Array, mean: Array) -> Array:
    """Smallest singular value of all nodes: one that is probably the smallest, if it is shown that no other is."""
    rows, every = jacobians.shape[2], np.arange(len(jacobians))
    weakest = np.linalg.eigh(mean)[1][:, None, None, :, 0]
    candidate = np.linalg.norm((weakest @ jacobians)[:, :, 0], axis=2).argmin(axis=1)
    found: Array = np.linalg.svd(jacobians[every, candidate], compute_uv=False)[:, -1]
    for k, (value, some) in enumerate(zip(found, grams, strict=True)):
        try:
            # it exists if no eigenvalue of any node is below the bound
            np.linalg.cholesky(some - (CLOSE * value**2) * np.eye(rows))
        except np.linalg.LinAlgError:
            found[k] = np.linalg.svd(jacobians[k], compute_uv=False)[:, -1].min()
    return found


def _iterated(jacobians: Array, psi: Array, adjoint: Array, inverse: Array) -> tuple[Array, Mask]:
    """Smallest singular values of the projected Jacobians (T,), and which of them have converged."""
    times, _, rows, columns = jacobians.shape
    terms = psi.shape[1]
    to_nodes, to_terms = np.ascontiguousarray(adjoint.T), np.ascontiguousarray(psi.T)
    basis, images = np.zeros((times, MOST, terms * rows)), np.zeros((times, MOST, terms * columns))
    # from anywhere, so that no part of a mechanism that is by itself is missed
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


def _of_the_whole(jacobians: Array, psi: Array, adjoint: Array) -> float:
    """Smallest singular value of one projected Jacobian, from its entries."""
    # the precision of a root is enough to see a singularity
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
    """Multiply one projected Jacobian by its transpose, (P m, P m), in the precision that is given."""
    _, rows, columns = jacobians.shape
    terms = psi.shape[1]
    products = np.einsum("ik,kj->ijk", adjoint, psi).reshape(-1, len(psi))
    blocks = (products @ jacobians.reshape(len(psi), -1)).reshape(terms, terms, rows, columns)
    whole = blocks.transpose(0, 2, 1, 3).reshape(terms * rows, -1)
    return whole @ whole.T
