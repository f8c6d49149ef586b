"""Large mechanisms: the elimination by blocks, and how its work grows."""

from __future__ import annotations

from dataclasses import replace

import chaospy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.equations import state_arguments
from uqmbd.dynamics.linear import index1
from uqmbd.dynamics.linear.fronts import FrontalSolver, frontal
from uqmbd.dynamics.linear.ordering import rounds_of, units_of
from uqmbd.dynamics.linear.programs import programs_of
from uqmbd.dynamics.linear.system import SparsePattern
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute

GRAVITY, SPEED = 9.81, 3.0
TIMES = np.linspace(0, 1, 21)


def chain(number, length=1.0):
    """N + 1 hanging cranks with couplers between their tips, all of mass 1, that swing alike."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Planar(gravity=(0, -GRAVITY)))
    angle, cranks = -np.pi / 2, []
    for k in range(number + 1):
        speed = {} if k else {"angular_velocity": SPEED}
        pose = {"position": (k, -length / 2), "angle": angle} | speed
        cranks.append(mechanism.body(f"crank{k}", mass=1, inertia=length**2 / 12, **pose))
        mechanism.add(Revolute(f"bearing{k}", mechanism.ground, cranks[k], (k, 0), (-length / 2, 0)))
    for k in range(number):
        coupler = mechanism.body(f"coupler{k}", mass=1, inertia=1 / 12, position=(k + 0.5, -length))
        mechanism.add(Revolute(f"left{k}", cranks[k], coupler, (length / 2, 0), (-0.5, 0)))
        mechanism.add(Revolute(f"right{k}", cranks[k + 1], coupler, (length / 2, 0), (0.5, 0)))
    mechanism.output("first", cranks[0].point((length / 2, 0))[0], units="m")
    mechanism.output("last", cranks[-1].point((length / 2, 0))[0] - number, units="m")
    return mechanism


def swing(number, times, length=1.0):
    """Horizontal position of the tips: ``((N + 1) / 3 + N) L phi'' = -((N + 1) / 2 + N) g cos(phi)``."""
    ratio = ((number + 1) / 2 + number) / ((number + 1) / 3 + number) * GRAVITY / length

    def rate(_, z):
        return [z[1], -ratio * np.cos(z[0])]

    found = solve_ivp(rate, (0, times[-1]), [-np.pi / 2, SPEED], "DOP853", times, rtol=1e-11, atol=1e-12)
    return length * np.cos(found.y[0])


def states_of(model, count=5, seed=0):
    """Random coordinates and velocities, which nothing holds together, and parameters."""
    ensemble = Ensemble(model, np.tile([0.5] * len(model.inputs), (count, 1)))
    generator = np.random.default_rng(seed)
    q = ensemble.start.q + generator.uniform(-0.1, 0.1, ensemble.start.q.shape)
    return q, generator.normal(size=q.shape), ensemble.block


def values_of(model, count=5, seed=0):
    """Results of the ``acceleration`` evaluator at these states."""
    q, v, parameters = states_of(model, count, seed)
    state = state_arguments(0.0, q, np.zeros((count, model.layout.states)), v)
    return np.ascontiguousarray(model.evaluators["acceleration"](state, parameters))


def lapack(model, values):
    system = model.system
    return np.linalg.solve(system.matrix(values), system.right(values)[:, :, None])[:, :, 0]


@pytest.fixture(scope="module")
def models():
    return {n: build(chain(n)) for n in (5, 10, 20)}


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["dop853", "ida"])
def test_chain_swings_like_a_pendulum(models, method):
    model = models[10]
    ensemble = Ensemble(model, np.zeros((1, 0)))
    found = integrate(ensemble, TIMES, 1e-8, method=method)
    outputs = ensemble.outputs(TIMES, found.states)[0]
    for tip in outputs:
        np.testing.assert_allclose(tip, swing(10, TIMES), atol={"dop853": 1e-7, "ida": 1e-5}[method])
    kinetic, potential = ensemble.energies(TIMES, found.states)[0]
    np.testing.assert_allclose(kinetic + potential, kinetic[0] + potential[0], atol=1e-4 * kinetic[0])


def test_all_routes_to_the_accelerations_agree(models):
    model = models[10]
    assert model.system.fronts is not None
    values = values_of(model)
    expected = lapack(model, values)
    size = np.abs(expected).max()
    np.testing.assert_allclose(model.system.solve(values), expected, rtol=0, atol=1e-11 * size)
    np.testing.assert_allclose(
        index1.solve_directly(model.system, values, model.system.right(values)), expected, rtol=0, atol=1e-11 * size
    )
    np.testing.assert_allclose(model.system.solve(values[:1]), expected[:1], rtol=0, atol=1e-11 * size)


@pytest.mark.thorough
def test_small_systems_by_blocks_as_in_one_piece(monkeypatch):
    """What is compiled in one piece today gives the same by blocks."""
    model = build(chain(2))
    assert model.system.fronts is None
    values = values_of(model)
    monkeypatch.setattr("uqmbd.dynamics.linear.system.ELIMINATION_LIMIT", 0)
    blocks = index1.index1_system(model, model.system.poses)
    assert blocks.fronts is not None
    expected = model.system.solve(values)
    np.testing.assert_allclose(blocks.solve(values), expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    random, ensemble = np.random.default_rng(1), Ensemble(model, np.zeros((5, 0)))
    off = ensemble.start.state + 1e-3 * random.normal(size=ensemble.start.state.shape)
    other = replace(model, system=blocks)
    expected = np.hstack(index1.excess(model, off, 0.0, ensemble.block))
    found = np.hstack(index1.excess(other, off, 0.0, ensemble.block))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_work_grows_no_faster_than_the_chain(models):
    """Operations and code: linear in N but for the ends of the chain, with few kernels."""
    work, entries, code = [], [], []
    for model in models.values():
        layout, bare = model.layout, index1.index1_system(model, None)
        owners = [model.owners[k] for k in layout.kept]
        units = units_of(bare.rows, bare.columns, layout.coordinates, model.size, owners)
        values = values_of(model, 2)
        rounds = rounds_of(units, bare.rows, bare.columns, values[:, bare.source])
        fronts = frontal(rounds, bare.rows, bare.columns, bare.source, values.shape[1], bare.size)
        work.append(fronts.operations)
        entries.append(fronts.width)
        code.append(len(fronts.batches))
    for counts in (work, entries):
        assert counts[1] < 2.2 * counts[0]
        assert counts[2] < 2.1 * counts[1]
    assert np.diff(code).max() <= 8


def hub(number, mass):
    """Rods, hinged in line one after the other to a disc that turns."""
    mechanism = uqmbd.Mechanism("hub", uqmbd.Planar(gravity=(0, -GRAVITY)))
    disc = mechanism.body("disc", mass=5, inertia=1)
    mechanism.add(Revolute("axle", mechanism.ground, disc, (0, 0), (0, 0)))
    for k in range(number):
        x, y = np.cos(k), np.sin(k)
        rod = mechanism.body(f"rod{k}", mass=mass, inertia=0.01, position=(x, y - 0.5), angle=-np.pi / 2)
        mechanism.add(Revolute(f"pin{k}", disc, rod, (x, y), (-0.5, 0)))
    mechanism.output("x", disc.quaternion[1], units="1")
    return mechanism


@pytest.mark.thorough
def test_a_hub_stays_small():
    """Forty rods on one disc: were the disc eliminated early, all their multipliers would be coupled."""
    small, large = (build(hub(n, 1.0)) for n in (20, 40))
    assert large.system.fronts.operations < 2.1 * small.system.fronts.operations
    values = values_of(large)
    expected = lapack(large, values)
    np.testing.assert_allclose(large.system.solve(values), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.thorough
def test_bodies_without_mass_are_merged_with_what_holds_them():
    """Cranks without mass and inertia: their own blocks are singular, the system is not."""
    links = uqmbd.Mechanism("links", uqmbd.Planar(gravity=(0, -GRAVITY)))
    before = links.ground
    for k in range(20):
        light = k % 2 == 0
        body = links.body(f"link{k}", mass=0 if light else 1, inertia=0 if light else 0.1, position=(k + 0.5, 0))
        links.add(Revolute(f"pin{k}", before, body, (0.5 if k else 0, 0), (-0.5, 0)))
        before = body
    model = build(links)
    assert model.system.fronts is not None
    values = values_of(model)
    expected = lapack(model, values)
    found = index1.solve_directly(model.system, values, model.system.right(values))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_a_singular_system_has_no_solution_and_leaves_the_others_alone():
    rows, columns = np.divmod(np.arange(9), 3)
    pattern = SparsePattern(rows, columns, np.arange(9), 3)
    matrix = np.random.default_rng(0).normal(size=(3, 3, 3))
    matrix[1, 2] = 0
    right = np.ones((3, 3))
    found = pattern.factorise(matrix.reshape(3, 9)).solve(right)
    assert np.isnan(found[1]).all()
    for k in (0, 2):
        np.testing.assert_allclose(found[k], np.linalg.solve(matrix[k], right[k]), rtol=1e-10)


def test_poor_pivots_are_noticed(models):
    """Accelerations of programs whose solution by blocks is wrong are replaced."""
    model = models[10]
    system, n = model.system, model.layout.coordinates
    wrong = replace(system.fronts, solution=np.roll(system.fronts.solution, 1))
    given = len(model.evaluators["acceleration"].targets)
    rights = [system.motion, system.motion, *np.where(system.drift < 0, -1, given + system.drift)]
    widths = [system.size, n, n, n]
    solve, accelerate, *back = (FrontalSolver(wrong, r[None], k) for r, k in zip(rights, widths, strict=True))
    programs = programs_of(model, solve, accelerate, tuple(back), system.programs.residual)
    q, v, parameters = states_of(model)
    s = np.zeros((len(q), 0))
    spoilt = programs.motion(q, s, v, np.zeros((1, 1)), np.zeros((1, 1)), parameters[:, : model.block_parameters])
    expected = lapack(model, values_of(model))
    size = np.abs(expected).max()
    assert np.abs(spoilt[:, : system.size] - expected).max() > 0.01 * size
    found = index1.accelerations(replace(model, system=replace(system, programs=programs)), q, s, v, 0.0, parameters)
    np.testing.assert_allclose(np.hstack(found[:2]), expected, rtol=0, atol=1e-10 * size)


@pytest.mark.thorough
def test_random_length_in_a_long_chain():
    """Eight four-bars of random cranks: collocation and Galerkin against the equation of the only degree of freedom."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.95, 1.05), units="m")
    study = uqmbd.Study("chain", chain(8, length), TIMES[:11], rtol=1e-7)
    assert study.model.system.fronts is not None
    nodes, weights = np.polynomial.legendre.leggauss(12)
    exact = np.array([swing(8, TIMES[:11], 1 + 0.05 * x) for x in nodes])
    mean = weights @ exact / 2
    std = np.sqrt(weights @ (exact - mean) ** 2 / 2)
    for method, way in ((Collocation(order=2), None), (Galerkin(order=2, nodes=4), "dop853")):
        node = study.propagate(method)
        if way:
            assert node.attrs["integrated_by"] == way
        np.testing.assert_allclose(node["statistics"]["mean"].sel(output="first"), mean, atol=1e-5)
        np.testing.assert_allclose(node["statistics"]["std"].sel(output="last"), std, atol=2e-5)
