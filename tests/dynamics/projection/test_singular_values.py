"""Smallest singular values of projected Jacobians, against those of matrices that are put together entry by entry."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss, legval

from uqmbd.dynamics.projection.singular_values import SMALL, smallest_singular_values
from uqmbd.typing import Array


def legendre(terms: int, nodes: int) -> tuple[Array, Array, Array]:
    """Orthonormal polynomials at Gauss nodes: psi, its adjoint, weights; with the nodes as the second polynomial."""
    x, w = leggauss(nodes)
    psi = legval(x, np.eye(terms)).T * np.sqrt(2 * np.arange(terms) + 1)
    return psi, (psi * w[:, None] / 2).T, w / 2


def of_the_whole(jacobians: Array, psi: Array, adjoint: Array) -> Array:
    """Smallest singular values from all entries."""
    terms, (_, _, rows, columns) = psi.shape[1], jacobians.shape
    whole = np.einsum("ik,tkab,kj->tiajb", adjoint, jacobians, psi).reshape(-1, terms * rows, terms * columns)
    return np.linalg.svd(whole, compute_uv=False)[:, -1]


def checked(jacobians: Array, psi: Array, adjoint: Array, weights: Array) -> tuple[Array, Array]:
    """Compute the smallest values, and compare them with those of all matrices."""
    projected, nodal = smallest_singular_values(jacobians, psi, adjoint, weights)
    size = np.linalg.norm(jacobians, ord=2, axis=(2, 3)).max()
    np.testing.assert_allclose(projected, of_the_whole(jacobians, psi, adjoint), rtol=6e-3, atol=1e-7 * size)
    exact = np.linalg.svd(jacobians, compute_uv=False)[..., -1].min(axis=1)
    np.testing.assert_allclose(nodal, exact, rtol=1.1e-3, atol=1e-12 * size)
    return projected, nodal


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    terms=st.integers(2, 9),
    more=st.integers(0, 3),
    rows=st.integers(1, 16),
    wide=st.integers(0, 4),
    spread=st.sampled_from([0.0, 1e-3, 0.1, 0.5, 2.0]),
    least=st.sampled_from([1.0, 0.1, 1e-3, 1e-6, 0.0]),
    apart=st.booleans(),
    scales=st.sampled_from([0, 1, 3]),
)
def test_smallest_values_are_those_of_the_matrices(seed, terms, more, rows, wide, spread, least, apart, scales):
    """Of Jacobians that vary little or much, are near to singular or singular, and of parts that do not touch."""
    rng = np.random.default_rng(seed)
    psi, adjoint, weights = legendre(terms, terms + more)
    mean = rng.standard_normal((3, 1, rows, rows + wide))
    u, s, v = np.linalg.svd(mean, full_matrices=False)
    s[..., -1] *= least
    jacobians = (u * s[..., None, :]) @ v
    jacobians = jacobians + spread * psi[:, 1, None, None] * rng.standard_normal(mean.shape) / np.sqrt(rows)
    jacobians = jacobians + spread * rng.standard_normal((3, terms + more, rows, rows + wide)) / rows
    jacobians = jacobians * 10.0 ** -rng.integers(0, scales + 1, rows)[:, None]
    if apart and rows > 1:
        half, columns = rows // 2, (rows + wide) // 2
        jacobians[:, :, :half, columns:] = 0.0
        jacobians[:, :, half:, :columns] = 0.0
    checked(jacobians, psi, adjoint, weights)


@pytest.mark.parametrize("turn", [0.5, 1.5, 3.0])
def test_what_is_singular_as_a_whole_only_is_found(turn):
    """Directions of unit length that turn with the germ cancel in the projection: every node is regular."""
    psi, adjoint, weights = legendre(8, 12)
    rows, rng = 12, np.random.default_rng(1)
    angle = np.pi * turn * psi[:, 1] / np.sqrt(3)
    jacobians = np.zeros((1, 12, rows, rows + 1))
    jacobians[:, :, range(rows), range(rows)] = rng.uniform(1, 2, rows)
    jacobians[0, :, -1, -2], jacobians[0, :, -1, -1] = np.cos(angle), np.sin(angle)
    assert psi.shape[1] * rows > SMALL
    projected, nodal = checked(jacobians, psi, adjoint, weights)
    assert nodal[0] == pytest.approx(1.0, rel=1e-12)
    assert projected[0] < 0.9 * nodal[0]


@pytest.mark.parametrize("short", [0.3, 0.1, 0.05, 0.01, 1e-4])
@pytest.mark.parametrize("across", [0.0, 1e-6, 1e-3])
def test_a_part_of_another_scale_is_not_missed(short, across):
    """Constraints with short gradients settle at once; one with a long gradient, whose sign changes, is singular."""
    psi, adjoint, weights = legendre(5, 8)
    rows, germ = 21, psi[:, 1] / np.sqrt(3)
    jacobians = np.zeros((1, 8, rows, rows + 4))
    jacobians[:, :, range(rows), range(rows)] = short * (1 + 0.05 * germ[:, None] * np.linspace(-1, 1, rows))
    jacobians[:, :, -1] = 0.0
    jacobians[0, :, -1, rows], jacobians[0, :, -1, 0] = germ, across
    projected, nodal = checked(jacobians, psi, adjoint, weights)
    assert projected[0] < 0.02 * nodal[0] + across


def test_a_part_that_is_by_itself_is_not_missed():
    """The weakest constraint of the mean is in one part, and the node that is nearest to singular in another."""
    psi, adjoint, weights = legendre(8, 9)
    rows = 14
    jacobians = np.tile(np.eye(rows), (2, 9, 1, 1))
    jacobians[:, :, 0, 0] = 0.3
    jacobians[:, :, 1, 1] = np.where(np.arange(9) < 4, 1e-4, 2.0)
    projected, nodal = checked(jacobians, psi, adjoint, weights)
    assert (nodal < 2e-4).all() and (projected < 0.3).all()


def test_times_do_not_depend_on_one_another():
    """A time has the value that it has alone, to what is promised, beside one that is singular."""
    rng = np.random.default_rng(2)
    psi, adjoint, weights = legendre(7, 7)
    jacobians = rng.standard_normal((3, 1, 10, 13)) + 0.1 * rng.standard_normal((3, 7, 10, 13))
    jacobians[1, :, 0] = 0.0
    together = checked(jacobians, psi, adjoint, weights)
    for k in range(3):
        alone = checked(jacobians[k : k + 1], psi, adjoint, weights)
        np.testing.assert_allclose([x[k] for x in together], [x[0] for x in alone], rtol=2e-3, atol=1e-7)
    assert together[0][1] < 1e-6 and together[1][1] < 1e-12
