"""Forces, torques, springs and dampers against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_joints import Fixed, Revolute
from uqmbd_springs import PointForce, SpringDamper, Torque, TorsionSpringDamper

Z = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}


# -- torques ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("frame", ["body", "world"])
def test_torque_in_its_frame(frame, observe, series, close, turn):
    """With a spherical inertia the angular velocity grows by torque * t / J in the axes the torque is given in."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Spatial())
    start = (1.0, -2.0, 0.5)
    body = mechanism.body(
        "ball", mass=1, inertia=(0.5, 0.5, 0.5), quaternion=turn((1, 1, 0), 0.8), angular_velocity=start
    )
    mechanism.add(Torque("torque", body, (0.3, 0.1, -0.4), frame))
    observe(mechanism, world=body.angular_velocity, body=body.rotation.T * body.angular_velocity)
    times = np.linspace(0, 5, 26)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    w = series(data, frame)
    close(w, w[0] + np.outer(times, np.array([0.3, 0.1, -0.4]) / 0.5))
    np.testing.assert_allclose(series(data, "body")[0], start, atol=1e-12)


def test_body_torque_about_the_axis_of_a_symmetric_top(close):
    """w_z' = tau / Jz; the transverse part turns by the integral of (Jz - Jx)/Jx w_z."""
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial())
    top = mechanism.body("top", mass=1, inertia=(0.05, 0.05, 0.02), angular_velocity=(2, 0, 3))
    mechanism.add(Torque("motor", top, (0, 0, 0.01), frame="body"))
    w = top.rotation.T * top.angular_velocity
    for k in range(3):
        mechanism.output(f"w{k}", w[k])
    times = np.linspace(0, 4, 21)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    angle = 0.6 * (3 * times + 0.5 * times**2 / 2)
    close(data.w2, 3 + 0.5 * times)
    close(data.w0, 2 * np.cos(angle))
    close(data.w1, -2 * np.sin(angle))


def test_torque_in_the_plane(close):
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=2, com=(0, 0), angle=0.5)
    mechanism.add(Torque("motor", wheel, 3 * uqmbd.t))
    mechanism.output("angle", wheel.angle)
    times = np.linspace(0, 4, 9)
    close(uqmbd.simulate(mechanism, times, rtol=1e-8).angle, 0.5 + times**3 / 4, relative=1e-6)


# -- forces -------------------------------------------------------------------------------------------------------------
SPACES = {"translational": uqmbd.Translational, "planar": uqmbd.Planar, "spatial": uqmbd.Spatial}


def moving_body(space):
    """A body that starts with 3 m/s along x."""
    mechanism = uqmbd.Mechanism("drag", SPACES[space]())
    inertia = {"translational": {}, "planar": {"inertia": 1}, "spatial": {"inertia": (1, 1, 1)}}[space]
    d = 3 if space == "spatial" else 2
    body = mechanism.body("body", mass=2, velocity=(3, 0, 0)[:d], **inertia)
    mechanism.output("x", body.position[0])
    mechanism.output("v", body.velocity[0])
    return mechanism, body, d


@pytest.mark.parametrize("space", SPACES)
def test_linear_drag(space, close):
    """F = -c v: x = v0 m/c (1 - exp(-c t/m))."""
    mechanism, body, d = moving_body(space)
    mechanism.add(PointForce("drag", body, (0,) * d, [-0.8 * body.velocity[k] for k in range(d)]))
    times = np.linspace(0, 6, 25)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    close(data.x, 3 * 2 / 0.8 * (1 - np.exp(-0.4 * times)), relative=1e-6)
    close(data.v, 3 * np.exp(-0.4 * times), relative=1e-6)


@pytest.mark.parametrize("space", SPACES)
def test_quadratic_drag(space, close):
    """F = -c |v| v: v = v0 / (1 + c v0 t/m), x = m/c ln(1 + c v0 t/m)."""
    mechanism, body, d = moving_body(space)
    v = body.velocity[0]
    mechanism.add(PointForce("drag", body, (0,) * d, [-0.8 * v * sympy.Abs(v), *[0] * (d - 1)]))
    times = np.linspace(0, 6, 25)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    close(data.x, 2 / 0.8 * np.log(1 + 0.8 * 3 * times / 2), relative=1e-6)
    close(data.v, 3 / (1 + 0.8 * 3 * times / 2), relative=1e-6)


def test_force_may_depend_on_another_body(close):
    """The second body is pushed by the velocity of the first: x2'' = 3 exp(-0.4 t) / 5."""
    mechanism, body, d = moving_body("planar")
    mechanism.add(PointForce("drag", body, (0, 0), [-0.8 * body.velocity[0], 0]))
    other = mechanism.body("other", mass=5, inertia=1)
    mechanism.add(PointForce("push", other, (0, 0), [1.0 * body.velocity[0], 0]))
    mechanism.output("x2", other.position[0])
    times = np.linspace(0, 6, 25)
    exact = 3 / 5 * (times / 0.4 - (1 - np.exp(-0.4 * times)) / 0.16)
    close(uqmbd.simulate(mechanism, times, rtol=1e-8).x2, exact, relative=1e-6)


def test_force_may_depend_on_the_angular_velocity_of_a_body_in_the_plane(close):
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=2, angular_velocity=5)
    mechanism.add(Torque("drag", wheel, -0.6 * wheel.angular_velocity))
    mechanism.output("rate", wheel.angular_velocity)
    times = np.linspace(0, 6, 13)
    close(uqmbd.simulate(mechanism, times, rtol=1e-8).rate, 5 * np.exp(-0.3 * times), relative=1e-6)


@pytest.mark.thorough
def test_weld_carries_force_and_moment_in_space(turn, matrix):
    """Reaction = -(force + weight); moment about the joint's point = -sum of r x F - torque."""
    mechanism = uqmbd.Mechanism("bracket", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    q, com, at = turn((1, 2, 3), 1.1), (0.2, 0.1, -0.3), (0.5, -0.4, 0.2)
    force, torque, point = (3.0, -5.0, 7.0), (0.4, 0.3, -0.2), (1, 1, 1)
    body = mechanism.body("bracket", mass=2, inertia=(1, 1, 1), com=com, position=point, quaternion=q)
    weld = mechanism.add(Fixed("weld", mechanism.ground, body, point, (0, 0, 0)))
    mechanism.add(PointForce("load", body, at, force))
    mechanism.add(Torque("twist", body, torque, frame="body"))
    for k in range(3):
        mechanism.output(f"F{k}", weld.reaction_force[k])
        mechanism.output(f"M{k}", weld.reaction_moment[k])
    data = uqmbd.simulate(mechanism, [0, 0.5]).isel(time=-1)
    rotation, weight = matrix(q), np.array([0, 0, -2 * 9.81])
    moment = np.cross(rotation @ at, force) + np.cross(rotation @ com, weight) + rotation @ torque
    np.testing.assert_allclose([data[f"F{k}"] for k in range(3)], -(np.array(force) + weight), atol=1e-9)
    np.testing.assert_allclose([data[f"M{k}"] for k in range(3)], -moment, atol=1e-9)


def test_weld_carries_force_and_moment_in_the_plane():
    mechanism = uqmbd.Mechanism("bracket", uqmbd.Planar(gravity=(0, -9.81)))
    body = mechanism.body("bracket", mass=2, inertia=1, com=(0.3, 0), position=(1, 1), angle=0.5)
    weld = mechanism.add(Fixed("weld", mechanism.ground, body, (0.5, 1), (-0.5 * np.cos(0.5), 0.5 * np.sin(0.5))))
    mechanism.add(PointForce("load", body, (0.4, 0.2), (3, -5)))
    mechanism.add(Torque("twist", body, 0.7))
    mechanism.output("Fx", weld.reaction_force[0])
    mechanism.output("Fy", weld.reaction_force[1])
    mechanism.output("M", weld.reaction_moment)
    data = uqmbd.simulate(mechanism, [0, 0.5]).isel(time=-1)
    c, s = np.cos(0.5), np.sin(0.5)
    at = np.array([0.5 + 0.4 * c - 0.2 * s, 0.4 * s + 0.2 * c])
    moment = at[0] * -5 - at[1] * 3 + (0.5 + 0.3 * c) * -2 * 9.81 + 0.7
    assert [float(data.Fx), float(data.Fy), float(data.M)] == pytest.approx([-3, 5 + 19.62, -moment], abs=1e-9)


# -- springs ------------------------------------------------------------------------------------------------------------
def test_damped_spring_along_its_line(close):
    mechanism = uqmbd.Mechanism("spring", uqmbd.Planar())
    body = mechanism.body("body", mass=2, inertia=1, position=(1.5, 0))
    spring = mechanism.add(
        SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), stiffness=50, damping=3, free_length=1)
    )
    mechanism.output("x", body.position[0])
    mechanism.output("force", spring.reaction_force[0])
    times = np.linspace(0, 4, 41)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    decay, rate = 3 / 4, np.sqrt(25 - (3 / 4) ** 2)
    swing = 0.5 * np.exp(-decay * times) * (np.cos(rate * times) + decay / rate * np.sin(rate * times))
    speed = -0.5 * np.exp(-decay * times) * 25 / rate * np.sin(rate * times)
    close(data.x, 1 + swing, relative=1e-6)
    close(data.force, -50 * swing - 3 * speed, relative=1e-5)


def torsional_oscillator(space, spin, stiffness, damping, free_angle):
    """A body of inertia 1 about the axis that is spun by `spin` against a torsion spring."""
    if space == "planar":
        mechanism = uqmbd.Mechanism("coil", uqmbd.Planar())
        body = mechanism.body("body", mass=1, inertia=1, angular_velocity=spin)
        mechanism.add(Revolute("pivot", mechanism.ground, body, (0, 0), (0, 0)))
        coil = mechanism.add(TorsionSpringDamper("coil", mechanism.ground, body, stiffness, damping, free_angle))
        mechanism.output("rate", body.angular_velocity)
        mechanism.output("moment", coil.reaction_moment)
    else:
        mechanism = uqmbd.Mechanism("coil", uqmbd.Spatial())
        body = mechanism.body("body", mass=1, inertia=(1, 1, 1), angular_velocity=(0, 0, spin))
        mechanism.add(Revolute("pivot", mechanism.ground, body, (0, 0, 0), (0, 0, 0), **Z))
        coil = mechanism.add(TorsionSpringDamper("coil", mechanism.ground, body, stiffness, damping, free_angle, **Z))
        mechanism.output("rate", body.angular_velocity[2])
        mechanism.output("moment", coil.reaction_moment[2])
    mechanism.output("cos", body.rotation[0, 0])
    return mechanism, body


@pytest.mark.parametrize("spin", [12, -12])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_torsion_spring_counts_several_turns(space, spin, close):
    """k = 0.16, c = 0.1, free angle 0.5 rad, spun with 12 rad/s: more than four turns out and back."""
    mechanism, body = torsional_oscillator(space, spin, 0.16, 0.1, 0.5)
    times = np.linspace(0, 16, 161)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    decay, rate = 0.05, np.sqrt(0.16 - 0.05**2)
    fade, cos, sin = np.exp(-decay * times), np.cos(rate * times), np.sin(rate * times)
    start = -0.5
    swing = fade * (start * cos + (spin + decay * start) / rate * sin)
    speed = fade * (spin * cos - (decay * spin + 0.16 * start) / rate * sin)
    assert np.abs(swing).max() > 4 * 2 * np.pi * 0.9
    close(data.rate, speed)
    close(data.moment, -0.16 * swing - 0.1 * speed)
    close(data.cos, np.cos(swing + 0.5), relative=5e-4)


def test_torsion_spring_angle_is_that_of_the_body(close):
    mechanism, body = torsional_oscillator("planar", 20, 0.16, 0, 0)
    mechanism.output("angle", body.angle)
    times = np.linspace(0, 8, 33)
    close(uqmbd.simulate(mechanism, times, rtol=1e-8).angle, 50 * np.sin(0.4 * times), relative=1e-5)


def test_torsion_spring_between_two_free_bodies(close):
    """Relative swing with the reduced inertia 2 * 3 / 5, both spun alike over many turns."""
    mechanism = uqmbd.Mechanism("shaft", uqmbd.Planar())
    first = mechanism.body("first", mass=1, inertia=2, angular_velocity=10)
    second = mechanism.body("second", mass=1, inertia=3, angular_velocity=12)
    mechanism.add(TorsionSpringDamper("shaft", first, second, stiffness=4.8))
    mechanism.output("twist", second.angle - first.angle)
    mechanism.output("mean", (2 * first.angle + 3 * second.angle) / 5)
    times = np.linspace(0, 8, 41)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    close(data.twist, np.sin(2 * times), relative=1e-4)
    close(data["mean"], 11.2 * times, relative=1e-6)


def test_torsional_damper_alone(close):
    mechanism, _ = torsional_oscillator("spatial", 30, 0, 0.5, 0)
    times = np.linspace(0, 6, 25)
    close(uqmbd.simulate(mechanism, times, rtol=1e-8).rate, 30 * np.exp(-0.5 * times), relative=1e-5)
