"""Compiled equations: fused and typed kernels agree, and the Jacobian and its pattern are complete."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics import Ensemble, build
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Fixed, Prismatic, Revolute, Spherical
from uqmbd_springs import PointForce, SpringDamper, Torque, TorsionSpringDamper

t = uqmbd.t


def translational():
    """Particles with rods, springs and a drag."""
    mechanism = uqmbd.Mechanism("translational", uqmbd.Translational(gravity=(0.3, -9.81)))
    ground = mechanism.ground
    a = mechanism.body("a", mass=1.3, position=(1, 0))
    b = mechanism.body("b", mass=0.7, position=(2, 0.5))
    c = mechanism.body("c", mass=0.9, position=(0.5, 0.5))
    mechanism.add(Distance("r1", ground, a, (0, 0), (0, 0), 1))
    mechanism.add(Distance("r2", a, b, (0, 0), (0, 0), 1.118))
    mechanism.add(SpringDamper("s1", a, c, (0, 0), (0, 0), 30, 0.4, 0.3))
    mechanism.add(SpringDamper("s2", b, ground, (0, 0), (2, 2), 20))
    drag = [-0.2 * b.velocity[0] * b.velocity[1], c.position[0] * uqmbd.step(t, 0, 0, 1, 2)]
    mechanism.add(PointForce("f", b, (0, 0), drag))
    mechanism.output("x", a.position[0])
    return mechanism


def planar():
    """Everything there is in the plane."""
    mechanism = uqmbd.Mechanism("planar", uqmbd.Planar(gravity=(0, -9.81)))
    ground = mechanism.ground
    bodies = [
        mechanism.body(f"b{k}", mass=1 + 0.3 * k, inertia=0.2 + 0.1 * k, com=(0.1 * k, -0.05), position=(k, 0.2 * k), angle=0.3 * k)
        for k in range(5)
    ]  # fmt: skip
    a, b, c, d, e = bodies
    mechanism.add(Revolute("A", ground, a, (0, 0), (-0.3, 0.1)))
    mechanism.add(Revolute("B", a, b, (0.3, 0), (-0.3, 0.1)))
    mechanism.add(Prismatic("P", b, c, (0.1, 0), (0, 0), (1, 0.2), (1, 0)))
    mechanism.add(Fixed("F", c, d, (0.2, 0.1), (0, 0)))
    mechanism.add(Distance("L", d, e, (0.1, 0), (0.2, 0.1), 1.1))
    mechanism.add(Spherical("S", ground, e, (4, 1), (0.1, 0.1)))
    mechanism.add(RotationDriver("D", ground, a, 0.4 * t**2))
    mechanism.add(SpringDamper("k", a, c, (0.1, 0.2), (0.3, 0), 40, 0.7, 0.5))
    mechanism.add(TorsionSpringDamper("T", b, e, 3, 0.2, 0.1))
    mechanism.add(TorsionSpringDamper("T0", ground, e, 2, 0.1))
    mechanism.add(PointForce("f", c, (0.1, 0.2), (uqmbd.step(t, 0, 0, 1, 2), -0.3 * c.velocity[1])))
    mechanism.add(Torque("m", e, -0.2 * e.angular_velocity))
    mechanism.output("angle", a.angle)
    return mechanism


def spatial():
    """Everything there is in space."""
    mechanism = uqmbd.Mechanism("spatial", uqmbd.Spatial(gravity=(0.1, 0.2, -9.81)))
    ground = mechanism.ground
    rng = np.random.default_rng(1)
    bodies = []
    for k in range(5):
        q = rng.normal(size=4)
        full = (0.3, 0.25, 0.2, 0.03, -0.02, 0.01 * k)
        bodies.append(
            mechanism.body(f"b{k}", mass=1 + 0.3 * k, inertia=full, com=(0.1 * k, -0.05, 0.1), position=(0.5 * k, 0, 0.1), quaternion=q / np.linalg.norm(q))
        )  # fmt: skip
    a, b, c, d, e = bodies
    mechanism.add(Revolute("A", ground, a, (0, 0, 0), (-0.3, 0, 0.1), (1, 2, 3), (0, 1, 1)))
    mechanism.add(Prismatic("P", a, b, (0.1, 0, 0), (0, 0, 0.1), (1, 0.2, 0), (1, 0, 0)))
    mechanism.add(Fixed("F", b, c, (0.2, 0.1, 0), (0, 0.1, 0)))
    mechanism.add(Spherical("S", c, d, (0.2, 0.1, 0), (0, -0.2, 0.1)))
    mechanism.add(Distance("L", d, e, (0.1, 0, 0), (0.2, 0.1, 0), 1.1))
    mechanism.add(RotationDriver("D", ground, a, 0.4 * t**2, (1, 2, 3), (0, 1, 1)))
    mechanism.add(SpringDamper("k", a, d, (0.1, 0.2, 0), (0.3, 0, 0.1), 40, 0.7, 0.5))
    mechanism.add(TorsionSpringDamper("T", c, d, 3, 0.2, 0.1, (0, 0, 1), (0, 1, 0)))
    mechanism.add(PointForce("f", e, (0.1, 0.2, 0), (uqmbd.step(t, 0, 0, 1, 2), -0.3 * e.velocity[1], 1)))
    mechanism.add(Torque("m", e, (1, 2, t), frame="body"))
    mechanism.add(Torque("n", d, (1, 2, 1.0 * e.velocity[0]), frame="world"))
    mechanism.output("x", a.position[0])
    return mechanism


@pytest.fixture(scope="module", params=[translational, planar, spatial], ids=lambda f: f.__name__)
def pair(request):
    """The same mechanism with fused and with typed kernels."""
    mechanism = request.param()
    inputs = mechanism.inputs.means[None, :]
    return [Ensemble(build(mechanism, fuse=fuse), inputs) for fuse in (True, False)]


def random_state(ensemble, seed):
    """Time, unknowns, rates and coefficient, none of which satisfies anything."""
    rng = np.random.default_rng(seed)
    n = ensemble.model.layout.unknowns
    return 0.37 + 0.1 * seed, rng.normal(size=(1, n)), rng.normal(size=(1, n)), 7.3


def dense(ensemble, time, y, yp, c):
    """The Jacobian as a full matrix, from values and stored pattern."""
    rows, pointers = ensemble.model.pattern
    n = ensemble.model.layout.unknowns
    full = np.zeros((n, n))
    full[rows, np.repeat(np.arange(n), np.diff(pointers))] = ensemble.jacobian(time, y, yp, c)[0]
    return full


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
def test_fused_and_typed_kernels_agree(pair, seed):
    first, second = pair
    time, y, yp, c = random_state(first, seed)
    r = [e.residual(time, y, yp)[0] for e in pair]
    jacobian = [dense(e, time, y, yp, c) for e in pair]
    np.testing.assert_allclose(r[1], r[0], rtol=1e-12, atol=1e-12 * np.abs(r[0]).max())
    np.testing.assert_allclose(jacobian[1], jacobian[0], rtol=1e-12, atol=1e-12 * np.abs(jacobian[0]).max())
    for one, other in zip(first.model.pattern, second.model.pattern, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("seed", range(3))
def test_jacobian_and_its_pattern_agree_with_central_differences(pair, seed):
    """``dr/dy + c dr/dy'``: an entry that the stored pattern lacks would show as a difference."""
    ensemble = pair[seed % 2]
    time, y, yp, c = random_state(ensemble, seed)
    n, h = ensemble.model.layout.unknowns, 1e-6
    numeric = np.zeros((n, n))
    for k in range(n):
        step = np.zeros((1, n))
        step[0, k] = h
        up = ensemble.residual(time, y + step, yp + c * step)
        down = ensemble.residual(time, y - step, yp - c * step)
        numeric[:, k] = (up - down)[0] / (2 * h)
    exact = dense(ensemble, time, y, yp, c)
    scale = np.maximum(1.0, np.abs(exact).max(axis=1, keepdims=True))
    assert np.abs((numeric - exact) / scale).max() < 1e-6


def test_every_entry_of_the_jacobian_is_used_somewhere(pair):
    """No entry of the pattern vanishes at all of some random states: the pattern is not padded."""
    ensemble = pair[0]
    largest = np.zeros(len(ensemble.model.pattern[0]))
    for seed in range(4):
        largest = np.maximum(largest, np.abs(ensemble.jacobian(*random_state(ensemble, seed))[0]))
    assert (largest == 0).mean() < 0.05


def test_realisations_together_are_the_same_as_one_by_one(pair):
    """The ensemble evaluates K states at once."""
    ensemble = Ensemble(pair[0].model, np.repeat(pair[0].values, 3, axis=0))
    states = [random_state(ensemble, seed) for seed in range(3)]
    y, yp = (np.concatenate([s[k] for s in states]) for k in (1, 2))
    together = ensemble.residual(0.4, y, yp)
    for k, (_, one, rate, _) in enumerate(states):
        np.testing.assert_allclose(pair[0].residual(0.4, one, rate)[0], together[k], rtol=1e-13, atol=1e-13)


def test_whole_motion_is_the_same_with_both(pair):
    """Integrated with fused and with typed kernels."""
    from uqmbd.dynamics import integrate

    times = np.linspace(0, 0.5, 6)
    found = [integrate(e, times, 1e-8) for e in pair]
    assert [f.messages for f in found] == [("",), ("",)]
    coordinates = slice(0, pair[0].model.layout.coordinates)
    np.testing.assert_allclose(found[0].states[..., coordinates], found[1].states[..., coordinates], atol=1e-6)
