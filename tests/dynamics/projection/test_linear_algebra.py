"""Jacobians, linear solvers and integrators of the coefficients agree with one another and with differences."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

import uqmbd
from uqmbd.dynamics.equations import state_arguments
from uqmbd.dynamics.linear import nodal
from uqmbd.dynamics.projection import ida as projected_ida
from uqmbd.dynamics.projection.ensemble import ProjectedSystem
from uqmbd_galerkin import Galerkin
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 1, 21)


@pytest.fixture(scope="module")
def crank(mechanisms, project):
    return project(mechanisms["slider_crank"](torque=0.1), 2)


def somewhere(projected, seed=0):
    shape = (projected.terms, projected.model.layout.unknowns)
    y, rates = np.random.default_rng(seed).normal(size=(2, *shape))
    return y, rates


def test_dense_jacobian_by_differences(crank):
    y, rates = somewhere(crank)
    c, d = 3.7, crank.model.layout.differential
    found = crank.jacobian(0.1, y, rates, c)
    for k in np.random.default_rng(1).choice(crank.unknowns, 25, replace=False):
        step = np.zeros(crank.unknowns)
        step[k] = 1e-6
        step = step.reshape(y.shape)
        moved = step * (np.arange(y.shape[1]) < d)  # multipliers have no rates
        high = crank.residual(0.1, y + step, rates + c * moved)
        low = crank.residual(0.1, y - step, rates - c * moved)
        expected = (high - low).ravel() / 2e-6
        np.testing.assert_allclose(found[:, k], expected, rtol=1e-6, atol=1e-7 * np.abs(found).max())


def test_sparse_values_and_products_are_those_of_the_dense_jacobian(crank):
    y, rates = somewhere(crank)
    expected = crank.jacobian(0.1, y, rates, 2.0)
    linear = projected_ida.CoefficientJacobian(crank, "sparse", {})
    options = linear.options()
    pattern = options["sparsity"]
    values = np.zeros(pattern.nnz)
    options["jacfn"](0.1, y.ravel(), rates.ravel(), None, 2.0, values)
    found = sparse.csc_matrix((values, pattern.indices, pattern.indptr), shape=pattern.shape)
    np.testing.assert_array_equal(found.toarray(), expected)
    assert pattern.has_sorted_indices
    krylov = projected_ida.CoefficientJacobian(crank, "krylov-nodal", {}).options()["jactimes"]
    krylov.setupfn(0.1, y.ravel(), rates.ravel(), None, 2.0)
    vector, product = np.random.default_rng(2).normal(size=(2, crank.unknowns))
    krylov.solvefn(0.1, y.ravel(), rates.ravel(), None, vector, product, 2.0)
    np.testing.assert_allclose(product, expected @ vector, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


def test_nodal_preconditioner_is_exact_where_nothing_is_truncated(mechanisms, project):
    projected = project(mechanisms["slider_crank"](torque=0.1), 1, index_set="tensor")
    assert projected.collocates
    start = projected.start
    q, s, v = projected.split(start.state)
    y = projected.ensemble.pack(q, s, v, start.multipliers)
    rates = np.zeros_like(y)
    linear = projected_ida.CoefficientJacobian(projected, "krylov-nodal", {}).options()["precond"]
    linear.setupfn(0.0, y.ravel(), rates.ravel(), None, 50.0)
    vector, found = np.random.default_rng(2).normal(size=(2, projected.unknowns))
    linear.solvefn(0.0, y.ravel(), rates.ravel(), None, vector, found, 50.0, 0.0)
    whole = projected.jacobian(0.0, y, rates, 50.0)
    np.testing.assert_allclose(whole @ found, vector, atol=1e-8)


@pytest.mark.thorough
@pytest.mark.parametrize("solver", ["auto", "dense", "sparse", "krylov-nodal", "krylov-mean"])
def test_all_solvers_and_both_integrators_agree(crank, solver):
    expected = crank.integrate(TIMES, 1e-9, "dop853")
    found = crank.integrate(TIMES, 1e-7, "ida", solver)
    assert not found.message and found.integrator == "ida"
    np.testing.assert_allclose(
        found.coefficients, expected.coefficients, atol=2e-5 * np.abs(expected.coefficients).max()
    )
    assert found.counters["residuals"] > 0 and found.counters["factorisations"] > 0
    if solver.startswith("krylov"):
        assert found.counters["jacobian_products"] > 0 and found.counters["preconditioner_solutions"] > 0


@pytest.mark.filterwarnings("ignore:.*no output depends on the random input 'mass':uqmbd.UnusedInputWarning")
def test_counters_are_in_the_result(mechanisms):
    study = uqmbd.Study("counts", mechanisms["pendulum"](), np.linspace(0, 0.2, 3))
    for integrator, names in (
        ("dop853", {"accelerations", "steps", "systems", "iterations", "direct", "krylov"}),
        ("ida", {"residuals", "factorisations", "unknowns"}),
    ):
        node = study.propagate(Galerkin(order=2, integrator=integrator, verify=0))
        assert names <= set(json.loads(node.attrs["solver_counters"]))
        assert node.attrs["integrated_by"] == integrator


def test_mean_that_breaks_down_is_left(crank, monkeypatch):
    """What the mean preconditioner cannot do goes to the nodal one, and the counters say so."""
    monkeypatch.setattr(projected_ida, "SPARSE_TO", 10)

    class SpoiledMean(projected_ida.CoefficientJacobian):
        """Its mean preconditioner multiplies by random numbers."""

        def options(self):
            found = super().options()
            if self.kind == "krylov-mean":
                random, n = np.random.default_rng(0).normal(size=(self.n, self.n)), self.n

                def solve(t, y, yp, res, r, z, c, delta):
                    z[:] = (r.reshape(-1, n) @ random).ravel()

                found["precond"] = type(found["precond"])(found["precond"].setupfn, solve)
            return found

    monkeypatch.setattr(projected_ida, "CoefficientJacobian", SpoiledMean)
    found = crank.integrate(TIMES[:5], 1e-6, "ida", "auto")
    assert not found.message and found.counters["left_the_mean"] == 1


@pytest.mark.thorough
def test_what_is_stiff_goes_to_ida_by_itself(mechanisms):
    """Overdamped by far: x = exp(-slow t), with the smaller root of the characteristic equation; exact at the nodes."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(90, 110))
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.9, 1.1))
    mechanism = mechanisms["oscillator"](stiffness, damping=1e5, mass=mass)
    node = uqmbd.Study("stiff", mechanism, np.linspace(0, 2, 21)).propagate(Galerkin(order=2))
    assert node.attrs["integrated_by"] == "ida" and '"stiff": 1' in node.attrs["solver_counters"]
    slow = 1e-5 * np.linspace(90, 110, 10001)  # k / c, to 1e-8
    expected = np.exp(-slow[:, None] * np.linspace(0, 2, 21))
    np.testing.assert_allclose(node["statistics"]["mean"][0], expected.mean(axis=0), atol=1e-6)
    np.testing.assert_allclose(node["statistics"]["std"][0], expected.std(axis=0), atol=1e-7)


def assembled(projected):
    """The projected index-1 system as one dense matrix and right-hand side."""
    model, n = projected.model, projected.model.layout.coordinates
    q, s, v = projected.split(projected.psi @ projected.start.state)
    found = model.evaluate("acceleration", state_arguments(model.time, q, s, v), projected.ensemble.block)
    d = found["d"][:, model.layout.kept]
    size = n + d.shape[1]
    nodal = np.zeros((len(d), size, size))
    nodal[:, :n, :n], nodal[:, n:, :n], nodal[:, :n, n:] = found["mass"], d, d.transpose(0, 2, 1)
    right = np.concatenate([found["force"], found["gamma"][:, model.layout.kept]], axis=1)
    whole = np.einsum("ik,kab,kj->iajb", projected.adjoint, nodal, projected.psi)
    return np.linalg.solve(whole.reshape(projected.terms * size, -1), (projected.adjoint @ right).ravel())


def very_random(mechanisms):
    mass = uqmbd.RandomVariable("mass", chaospy.LogNormal(0, 1.0))
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(1, 200))
    mechanism = mechanisms["oscillator"](stiffness, mass=mass)
    other = mechanism.body("other", mass=mass**2, position=(1, 1))
    mechanism.add(SpringDamper("tie", mechanism.bodies["body"], other, (0, 0), (0, 0), 50, 1))
    return mechanism


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("name", "way"), [("slider_crank", "plain"), ("very random", "krylov"), ("very random", "direct")]
)
def test_coupled_system_is_solved_as_a_dense_one(mechanisms, project, monkeypatch, compiled, name, way):
    """By GMRES with the nodal preconditioner, and by a factorisation: with a variance for which iterations are slow."""
    mechanism = very_random(mechanisms) if name == "very random" else mechanisms[name]()
    projected = project(mechanism, 3)
    if not compiled:
        monkeypatch.setattr(nodal, "is_compilable", lambda operations: False)
        projected.model.system.programs.others.clear()
    state = projected.start.state
    coupled = ProjectedSystem(projected.model, projected.psi, projected.adjoint, projected.ensemble.block)
    assert coupled.compiled == compiled
    coupled.systems.structure.worth = 0.0 if way == "direct" else -1.0
    found, _ = coupled.solve(state, 0.0, 1e-12)
    assert coupled.counters["krylov"] == (way != "plain")
    if way == "direct":
        found, _ = coupled.solve(state, 0.0, 1e-12)
        assert (coupled.counters["krylov"], coupled.counters["direct"]) == (1, 1)
    expected = assembled(projected).reshape(found.shape)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_balanced_forces_do_not_wear_the_iteration_out(project):
    """A pendulum at rest at its lowest point: all accelerations vanish, and no relative accuracy can be reached."""
    from uqmbd_joints import Revolute

    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.05))
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2))
    mechanism = uqmbd.Mechanism("hanging", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=mass, inertia=mass * length**2 / 12, position=(0, -length / 2), angle=-np.pi / 2)
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.output("y", rod.position[1], units="m")
    found = project(mechanism, 3).integrate(TIMES, 1e-6, "dop853")
    assert not found.message and found.counters["krylov"] == 0
    assert found.counters["iterations"] < 3 * found.counters["systems"]
    np.testing.assert_allclose(found.coefficients[:, -1], found.coefficients[:, 0], atol=1e-10)


@pytest.mark.thorough
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), power=st.floats(0, 40), often=st.integers(1, 3))
def test_accelerations_do_not_depend_on_what_was_solved_before(crank, seed, power, often):
    """A step that was refused may have been anywhere, with forces of any size: it leaves no trace in the next one."""
    rng = np.random.default_rng(seed)
    state = crank.start.state * (1 + 1e-2 * rng.normal(size=crank.start.state.shape))
    wild = crank.start.state.copy()
    velocities = crank.split(wild)[2]
    velocities += 10**power * rng.normal(size=velocities.shape)
    fresh, used = (ProjectedSystem(crank.model, crank.psi, crank.adjoint, crank.ensemble.block) for _ in range(2))
    expected, _ = fresh.solve(state, 0.0, 1e-10)
    for _ in range(often):
        used.solve(wild, 0.0, 1e-10)
    found, _ = used.solve(state, 0.0, 1e-10)
    n = crank.model.layout.coordinates
    scale = np.abs(expected[:, :n]).max()
    np.testing.assert_allclose(found[:, :n], expected[:, :n], atol=1e-8 * scale)
