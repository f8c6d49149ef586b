"""Reactions and accelerations satisfy Newton and Euler, body by body, whatever the order of the bodies."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Fixed, Revolute, Spherical
from uqmbd_springs import SpringDamper, TorsionSpringDamper

G = 9.81
INERTIA = (0.30, 0.25, 0.20, 0.03, -0.02, 0.04)
COM = np.array([0.1, -0.3, 0.2])
TIMES = np.linspace(0, 2, 11)
ZERO = (0, 0, 0)


def tensor():
    xx, yy, zz, xy, xz, yz = INERTIA
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def two_bodies(joint, swap):
    """A driven upper body and a lower one on `joint` and a spring; `swap` gives the joint its bodies in reverse."""
    mechanism = uqmbd.Mechanism("two", uqmbd.Spatial(gravity=(0, 0, -G)))
    q = np.array([0.8, 0.3, -0.4, 0.2])
    q /= np.linalg.norm(q)
    upper = mechanism.body("upper", mass=1.5, inertia=INERTIA, com=(0.4, 0.1, -0.2), quaternion=q)
    lower = mechanism.body("lower", mass=0.8, inertia=INERTIA, com=COM, quaternion=q, position=(0.5, 0.1, 0))
    mechanism.add(Spherical("A", mechanism.ground, upper, ZERO, ZERO))
    mechanism.add(SpringDamper("S", mechanism.ground, lower, (1, 0, 0), (0.2, 0, 0), 15, 0.5, 0.3))
    mechanism.add(TorsionSpringDamper("T", mechanism.ground, upper, 0, 0.2, 0, (0, 0, 1), (0, 0, 1)))
    on_upper, on_lower = (0.8, 0, 0), (-0.1, 0, 0.2)
    axis = (1, 0, 1)
    ends = ((lower, upper), (on_lower, on_upper)) if swap else ((upper, lower), (on_upper, on_lower))
    if joint is Revolute:
        part = mechanism.add(Revolute("B", *ends[0], *ends[1], axis, axis))
    elif joint is Distance:
        part = mechanism.add(Distance("B", *ends[0], *ends[1], 0.7))
    else:
        part = mechanism.add(joint("B", *ends[0], *ends[1]))
    return mechanism, lower, part, (lower if swap else upper).point(on_lower if swap else on_upper)


@pytest.mark.thorough
@pytest.mark.parametrize("swap", [False, True], ids=["upper first", "lower first"])
@pytest.mark.parametrize("joint", [Revolute, Fixed, Spherical, Distance])
def test_newton_and_euler_hold_for_a_body_between_a_joint_and_a_spring(joint, swap, observe, series):
    """m a = sum of forces, d(J w)/dt = sum of moments about the centre of mass."""
    mechanism, lower, part, point = two_bodies(joint, swap)
    spring = mechanism.components["S"]
    observe(
        mechanism, r=lower.position, a=lower.acceleration, w=lower.angular_velocity, alpha=lower.angular_acceleration,
        R=lower.rotation, F=part.reaction_force, M=part.reaction_moment, S=spring.reaction_force,
        N=spring.reaction_moment, point=point,
    )  # fmt: skip
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-7)
    columns = (series(data, n) for n in ("r", "a", "w", "alpha", "F", "M", "S", "N", "point"))
    for k, (r, a, w, alpha, f, m, s, n, at) in enumerate(zip(*columns, strict=True)):
        rotation = series(data, "R")[k].reshape(3, 3)
        arm, inertia = rotation @ COM, rotation @ tensor() @ rotation.T
        if swap:  # the reaction is exerted on body j: here the upper one
            f, m = -f, -m
        force = f + s + np.array([0, 0, -0.8 * G])
        moment = m + np.cross(at - r - arm, f) + n + np.cross(np.array([1, 0, 0]) - r - arm, s)
        acceleration = a + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
        np.testing.assert_allclose(0.8 * acceleration, force, atol=1e-6)
        np.testing.assert_allclose(inertia @ alpha + np.cross(w, inertia @ w), moment, atol=1e-6)


def test_reaction_acts_on_body_j():
    """A weight on a hinge: the ground pulls it up, and it pulls the ground down."""
    found = {}
    for first in ("ground", "weight"):
        mechanism = uqmbd.Mechanism("hanging", uqmbd.Planar(gravity=(0, -G)))
        body = mechanism.body("weight", mass=2, inertia=1, position=(0, -1))
        bodies = (mechanism.ground, body) if first == "ground" else (body, mechanism.ground)
        points = ((0, 0), (0, 1)) if first == "ground" else ((0, 1), (0, 0))
        pin = mechanism.add(Revolute("pin", *bodies, *points))
        mechanism.output("force", pin.reaction_force[1])
        found[first] = float(uqmbd.simulate(mechanism, [0, 1]).force[-1])
    assert found == {"ground": pytest.approx(2 * G), "weight": pytest.approx(-2 * G)}


def test_driver_between_two_bodies_transmits_its_moment():
    """Two wheels in the plane, driven against each other: the moment on j is J_j theta_j'', on i the opposite."""
    mechanism = uqmbd.Mechanism("wheels", uqmbd.Planar())
    a = mechanism.body("a", mass=1, inertia=2)
    b = mechanism.body("b", mass=1, inertia=3)
    drive = mechanism.add(RotationDriver("drive", a, b, uqmbd.t**2))
    mechanism.output("moment", drive.reaction_moment)
    mechanism.output("alpha_a", a.angular_acceleration)
    mechanism.output("alpha_b", b.angular_acceleration)
    data = uqmbd.simulate(mechanism, np.linspace(0, 3, 7), rtol=1e-8)
    np.testing.assert_allclose(data.moment, 2 * 6 / 5, atol=1e-5)
    np.testing.assert_allclose(data.alpha_b, 2 * 2 / 5, atol=1e-5)
    np.testing.assert_allclose(data.alpha_a, -2 * 3 / 5, atol=1e-5)


@pytest.mark.parametrize("angle", [0.3, 3.0, -3.0, 5.0, 7.0, -10.0])
def test_angle_starts_as_it_is_drawn(angle):
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=1, angle=angle, angular_velocity=2)
    mechanism.output("angle", wheel.angle)
    data = uqmbd.simulate(mechanism, [0, 1, 4], rtol=1e-8)
    np.testing.assert_allclose(data.angle, angle + 2 * np.array([0, 1, 4]), atol=1e-5)
