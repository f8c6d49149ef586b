"""Systems and motions that are coupled through a basis, against the assembled system and closed forms."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
import pytest
import symengine as se
from hypothesis import example, given, settings
from hypothesis import strategies as st

from uqmbd.compiled import (
    CoupledSystems,
    ExplicitOptions,
    ExplicitStatus,
    IntegrationState,
    NodalSystems,
    ProgramPart,
    ProgramWriter,
    compile_kernel,
)
from uqmbd.compiled.driver import address, aligned, load_driver

NOTHING = ProgramPart((), 0)


def basis(random, nodes, terms):
    """Basis at the nodes, orthonormal under positive weights, the first function constant; and ``Psi^T W``."""
    weights = random.uniform(0.5, 1.5, nodes)
    weights /= weights.sum()
    values = random.normal(size=(nodes, terms))
    values[:, 0] = 1
    orthonormal, _ = np.linalg.qr(values * np.sqrt(weights)[:, None])
    psi = orthonormal / np.sqrt(weights)[:, None]
    return psi, (psi * weights[:, None]).T


@dataclass
class Saddle:
    """Random systems ``[M D^T; D 0]``, right-hand sides and residuals at the nodes, put into the work arrays by hand."""

    systems: CoupledSystems
    matrices: np.ndarray
    right: np.ndarray
    drift: np.ndarray
    psi: np.ndarray
    adjoint: np.ndarray

    @classmethod
    def random(cls, seed, nodes, terms, coordinates, constraints, spread):
        random, size, n = np.random.default_rng(seed), coordinates + constraints, coordinates
        psi, adjoint = basis(random, nodes, terms)
        mass, gradient = random.normal(size=(n, n)), random.normal(size=(constraints, n))
        a = np.zeros((nodes, size, size))
        # positive definite at every node, as masses are: the iteration relies on it
        masses = mass + spread * random.normal(size=(nodes, n, n))
        a[:, :n, :n] = masses @ masses.transpose(0, 2, 1) + n / 10 * np.eye(n)
        a[:, n:, :n] = gradient + spread * random.normal(size=(nodes, constraints, n))
        a[:, :n, n:] = a[:, n:, :n].transpose(0, 2, 1)
        right = random.normal(size=size) + spread * random.normal(size=(nodes, size))
        drift = random.normal(size=(2, nodes, size))
        rows, columns = np.nonzero(a.any(axis=0))
        ends = np.cumsum([2 * n + 2, len(rows), size, 2 * size, size, size, size])
        entries, motion, constraint, to, guess, solution = (np.arange(*x) for x in zip(ends, ends[1:], strict=False))

        def outside(work, new):
            if not new:
                found = np.linalg.solve(cls._lanes(a, len(work)), work[:, to].transpose(0, 2, 1)[..., None])[..., 0]
                work[:, solution] = found.transpose(0, 2, 1)

        nodal = NodalSystems(
            *(2 * n, n, 0, NOTHING, NOTHING, NOTHING, NOTHING, int(ends[-1]), int(to[0]), int(guess[0]), solution),
            *(np.searchsorted(rows, np.arange(size + 1)), columns, entries, motion, constraint.reshape(2, size)),
            np.zeros(0, dtype=np.int64),
        )
        systems = CoupledSystems(nodal, psi, adjoint, np.zeros((nodes, 0)), outside)
        for where, values in ((entries, a[:, rows, columns]), (motion, right), (constraint, np.hstack([*drift]))):
            systems.work[:, where] = cls._lanes(values, len(systems.work)).transpose(0, 2, 1)
        return cls(systems, a, right, drift, psi, adjoint)

    @staticmethod
    def _lanes(values, groups):
        return values[np.minimum(np.arange(8 * groups), len(values) - 1)].reshape(groups, 8, *values.shape[1:])

    def solved(self, right):
        """Solution of the assembled system, by LAPACK."""
        whole = np.einsum("ik,krc,kj->irjc", self.adjoint, self.matrices, self.psi)
        projected = self.adjoint @ right
        return np.linalg.solve(whole.reshape(projected.size, -1), projected.ravel()).reshape(projected.shape)


@given(
    seed=st.integers(0, 2**32 - 1),
    nodes=st.integers(1, 40),
    part=st.floats(0, 1),
    coordinates=st.integers(1, 9),
    constraints=st.integers(0, 8),
    spread=st.sampled_from([0.0, 0.02, 0.2, 0.7]),
)
# 416 unknowns, where GMRES stands still
@example(seed=0, nodes=34, part=0.75, coordinates=9, constraints=7, spread=0.7)
@settings(max_examples=60, deadline=None)
def test_solutions_are_those_of_the_assembled_system(seed, nodes, part, coordinates, constraints, spread):
    terms = 1 + round(part * (nodes - 1))
    saddle = Saddle.random(seed, nodes, terms, coordinates, min(constraints, coordinates - 1), spread)
    systems, state = saddle.systems, np.zeros((terms, 2 * coordinates))
    whole = np.einsum("ik,krc,kj->irjc", saddle.adjoint, saddle.matrices, saddle.psi)
    condition = np.linalg.cond(whole.reshape(terms * systems.systems.size, -1))
    scales = np.linalg.svd(saddle.matrices, compute_uv=False)
    worst = max(condition, scales.max() / scales.min())  # of all nodes together: one nearly singular node is enough
    if worst > 1e6:  # the iteration follows changes, which say less of the error
        return
    expected = saddle.solved(saddle.right)
    for _ in range(3):  # again: from the correction of the last solution
        found, _ = systems.rate(0.0, state)
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-12 * worst * np.abs(expected).max())
    for found, side in zip(systems.excess(0.0, state), saddle.drift, strict=True):
        expected = saddle.solved(side)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found, expected[:, :coordinates], rtol=0, atol=1e-8 * worst * scale)


def test_slow_iterations_are_left():
    """Systems that differ much from node to node: GMRES, then LAPACK for a while; small differences need neither."""
    far, near = Saddle.random(5, 14, 8, 5, 1, 1.0).systems, Saddle.random(5, 14, 8, 5, 1, 0.01).systems
    for systems in (far, near):
        systems.structure.worth = 3.0
        for _ in range(20):
            systems.rate(0.0, np.zeros((8, 10)))
    _, _, direct, krylov, _ = far.counts
    assert direct > 10 and krylov
    assert not near.counts[2:4].any() and near.counts[1] < 30


def test_singular_systems_are_reported():
    saddle = Saddle.random(0, 10, 4, 3, 0, 0.1)
    systems = saddle.systems
    systems.work[:, systems.systems.entries] = 0.0
    assert np.isnan(systems.rate(0.0, np.zeros((4, 6)))[0]).all()


Q, V, S, T, ZERO, P = se.symbols("q v s t zero p")
END = 2.0


def oscillators(seed, nodes, terms):
    """``q'' = -p q / m`` and ``s' = q`` at the nodes, with m = 1 + p / 400 so that the matrix differs between nodes."""
    random = np.random.default_rng(seed)
    psi, adjoint = basis(random, nodes, terms)
    p = random.uniform(1, 30, nodes)
    writer = ProgramWriter(6)
    mass, force, rate = writer.call(
        compile_kernel([Q, S, V, T, ZERO, P], [1 + P / 400, -P * Q, Q]), np.arange(6)[None]
    ).ravel()
    values = writer.part()
    right, guess = writer.sums([[], []])
    begin = len(writer.steps)
    (solution,) = writer.call(compile_kernel([Q, V], [Q / V]), np.array([[right, mass]])).ravel()
    some = np.array([0]), np.array([[-1], [-1]])
    nodal = NodalSystems(
        *(3, 1, 1, values, NOTHING, NOTHING, writer.part(begin), writer.size, int(right), int(guess)),
        *(np.array([solution]), np.array([0, 1]), some[0], np.array([mass]), np.array([force]), some[1]),
        np.array([rate]),
    )
    systems = CoupledSystems(nodal, psi, adjoint, p[:, None])
    m, k = ((adjoint * x) @ psi for x in (1 + p / 400, p))
    return systems, np.linalg.solve(m, k), random.normal(size=(terms, 3))


def integrated(systems, z, times, rtol, intervals=((END, np.inf, False),), solved=0.01):
    systems.tolerances(solved * rtol, 1e-3)
    method = ExplicitOptions(rtol, 1e-3, 4.0, 6.1, 15, 3, 20_000, guarded=False)
    dynamics = systems.dynamics(2, np.array([0]), 3, constrained=False)
    run = IntegrationState(dynamics, method, z, np.zeros((len(z), 0)), times, [intervals], np.full(len(z), rtol))
    run.advance()
    return run


def motion(k, z, times):
    """Closed form by the eigenvalues of ``M^-1 K``."""
    squares, vectors = np.linalg.eig(k)
    w = np.sqrt(squares.real)[:, None]
    q, v = (np.linalg.solve(vectors.real, z[:, j])[:, None] for j in (0, 2))
    c, s = np.cos(w * times), np.sin(w * times)
    found = [q * c + v / w * s, q * s / w + v / w**2 * (1 - c), v * c - q * w * s]
    found = np.stack([vectors.real @ x for x in found], axis=2)
    found[..., 1] += z[:, 1:2]
    return found


@pytest.mark.parametrize(("nodes", "terms"), [(1, 1), (5, 3), (9, 8), (20, 9), (25, 25), (30, 17)])
def test_motion_of_coefficients(nodes, terms):
    systems, k, z = oscillators(terms, nodes, terms)
    times = np.linspace(0, END, 7)
    found = integrated(systems, z, times, 1e-9)
    assert set(found.status[:8].tolist()) == {ExplicitStatus.DONE}
    assert np.abs(found.result - motion(k, z, times)).max() < 1e-7 * np.abs(z).max()


def test_order_of_convergence():
    systems, k, z = oscillators(0, 12, 10)
    times, errors = np.array([0, END]), []
    for steps in (10, 20):
        found = integrated(systems, z, times, 1e-2, ((END, END / steps, False),), solved=1e-11)
        errors.append(np.abs(found.result - motion(k, z, times))[:, -1].max())
    assert 7.5 < np.log2(errors[0] / errors[1]) < 8.7


def test_terms_share_one_step():
    """A step size for all: as many steps as SciPy takes for the coefficients as one problem."""
    from scipy.integrate import solve_ivp

    systems, k, z = oscillators(3, 20, 12)
    found = integrated(systems, z, np.array([0, END]), 1e-8)
    assert len(set(found.steps[:8].tolist())) == 1
    parts = (12, 3)

    def rate(t, y):
        q, _, v = y.reshape(parts).T
        return np.stack([v, q, -k @ q], axis=1).ravel()

    # its norm is of all entries, ours of the sums over the terms: the same up to the number of terms
    one = solve_ivp(rate, (0, END), z.ravel(), method="DOP853", rtol=1e-8, atol=1e-8)
    assert 0.5 * (len(one.t) - 1) <= found.steps[0] <= 2 * (len(one.t) - 1)


def test_interruptions_and_repetitions_change_nothing(monkeypatch):
    times, found = np.linspace(0, END, 9), []
    for budget in (40_000, 40_000, 500):
        monkeypatch.setattr("uqmbd.compiled.explicit.BUDGET", budget)
        systems, _, z = oscillators(1, 25, 15)
        found.append(integrated(systems, z, times, 1e-6).result)
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


def test_lanes_without_a_term_are_numbers_where_lapack_solves():
    """They are stepped with the others, and what is not finite there would refuse every step."""
    saddle = Saddle.random(0, 12, 7, 5, 2, 1.0)
    systems = saddle.systems
    systems.structure.worth = 0.0  # no iteration is worth it
    systems.memory[:] = np.nan  # as if something else had been there
    size = systems.systems.size
    state, rate = aligned((systems.systems.width + 1) * systems.blocks), aligned(size * systems.blocks)
    for _ in range(2):
        rate[:] = np.nan
        load_driver().coupled_rate(ctypes.addressof(systems.structure), address(state), address(rate))
    assert systems.counts[2]
    assert np.isfinite(rate).all()
    np.testing.assert_allclose(rate[:, :7].T, saddle.solved(saddle.right), rtol=1e-9)
