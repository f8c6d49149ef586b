"""Joints and drivers against closed forms and published numbers."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd_drivers import DistanceDriver, PositionDriver, RotationDriver
from uqmbd_joints import (
    Cylindrical,
    Dot1,
    Dot2,
    Parallel2,
    PointOnLine,
    PointOnPlane,
    Prismatic,
    Revolute,
    RevoluteSpherical,
    Spherical,
    Universal,
)

G = 9.80665
ORIGIN = (0, 0, 0)


@pytest.mark.parametrize(("tilt", "speed"), [(0.0, 1.0), (np.pi / 4, 0.5)], ids=["LinActuator 1", "LinActuator 2"])
def test_linear_actuator(tilt, speed, close):
    """Case A5: what the actuator and the slide carry of a weight of 1 kg at constant speed along an axis."""
    axis = (np.sin(tilt), 0.0, np.cos(tilt))
    mechanism = uqmbd.Mechanism("actuator", uqmbd.Spatial(gravity=(0, 0, -G)))
    body = mechanism.body("body", mass=1, inertia=(0.1, 0.1, 0.1))
    slide = mechanism.add(Prismatic("slide", mechanism.ground, body, ORIGIN, ORIGIN, axis, axis))
    driver = mechanism.add(
        PositionDriver("drive", mechanism.ground, body, ORIGIN, ORIGIN, axis, displacement=speed * uqmbd.t)
    )
    along = sum(a * f for a, f in zip(axis, driver.reaction_force, strict=True))
    mechanism.output("actuator", along, units="N")
    mechanism.output("slide", sum(f**2 for f in slide.reaction_force) ** 0.5, units="N")
    mechanism.output("way", sum(a * x for a, x in zip(axis, body.position, strict=True)), units="m")
    times = np.linspace(0, 1, 5)
    data = uqmbd.simulate(mechanism, times)
    close(data["way"], speed * times, relative=1e-9)
    close(data["actuator"], np.full(5, G * np.cos(tilt)), relative=1e-7)
    close(data["slide"], np.full(5, G * np.sin(tilt)), relative=1e-7, scale=G)


CARDAN = {
    0.0: (11.547005383792516, 0.0, 0.0),
    0.05: (10.725274708395798, -27.94250721487342, 0.5627705215653485),
    0.1: (9.34205239320907, -22.908673168533777, 1.0633059278066088),
    0.2: (9.052163353137358, 17.901799856252843, 1.9481462066807331),
    0.3: (11.470858549144744, 10.613331197714006, 2.978456850640348),
}


@pytest.mark.thorough
def test_cardan_joint(close):
    """Case A5: two shafts at 30 degrees, 10 rad/s into the first; speed, acceleration and torque of the second."""
    beta, inertia = np.pi / 6, 0.02
    second = (np.cos(beta), np.sin(beta), 0.0)
    mechanism = uqmbd.Mechanism("cardan", uqmbd.Spatial())
    ground = mechanism.ground
    shafts = [mechanism.body(name, mass=1, inertia=(inertia,) * 3) for name in ("one", "two")]
    for shaft, axis in zip(shafts, ((1, 0, 0), second), strict=True):
        mechanism.add(Revolute(f"bearing {shaft.name}", ground, shaft, ORIGIN, ORIGIN, axis, axis))
    # 11.547 rad/s at the start means: the input's cross-arm in the plane of the shafts, the output's perpendicular to it
    mechanism.add(Dot1("cross", *shafts, (0, 1, 0), (0, 0, 1)))
    driver = mechanism.add(RotationDriver("drive", ground, shafts[0], 10 * uqmbd.t, (1, 0, 0), (1, 0, 0)))
    for what, vector in (("w", shafts[1].angular_velocity), ("a", shafts[1].angular_acceleration)):
        mechanism.output(what, sum(x * y for x, y in zip(second, vector, strict=True)))
    mechanism.output("torque", driver.reaction_moment[0], units="N m")
    times = np.array(list(CARDAN))
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    w, a, _ = np.array(list(CARDAN.values())).T
    close(data["w"], w, relative=1e-6)
    close(data["a"], a, relative=1e-5)
    close(data["torque"], inertia * a * w / 10, relative=1e-5)


@pytest.mark.thorough
def test_universal_is_a_ball_and_a_cross(observe, series, close):
    """A body on a universal joint against the same on a ball with perpendicular axes; the cross really holds."""
    runs = []
    for whole in (True, False):
        mechanism = uqmbd.Mechanism("hung", uqmbd.Spatial(gravity=(0, 0, -G)))
        body = mechanism.body("body", mass=1, inertia=(0.1, 0.2, 0.3), position=(1, 0, 0), angular_velocity=(0, 2, 3))
        ends = (mechanism.ground, body, ORIGIN, (-1, 0, 0))
        if whole:
            mechanism.add(Universal("joint", *ends, (0, 1, 0), (0, 0, 1)))
        else:
            mechanism.add(Spherical("ball", *ends))
            mechanism.add(Dot1("cross", mechanism.ground, body, (0, 1, 0), (0, 0, 1)))
        observe(mechanism, r=body.position, arm=[body.rotation[1, 2]])
        runs.append(uqmbd.simulate(mechanism, np.linspace(0, 1, 11), rtol=1e-8))
    close(series(runs[0], "r"), series(runs[1], "r"), relative=1e-6)
    assert np.abs(series(runs[0], "arm")).max() < 1e-7
    assert np.ptp(series(runs[0], "r")[:, 2]) > 0.5


def test_cylindrical_slides_and_turns(close):
    """Under gravity along the axis and a spin about it: free fall and constant speed; across the axis nothing."""
    mechanism = uqmbd.Mechanism("bolt", uqmbd.Spatial(gravity=(0, 3, -G)))
    body = mechanism.body("body", mass=2, inertia=(0.1, 0.2, 0.3), angular_velocity=(0, 0, 4))
    joint = mechanism.add(
        Cylindrical("guide", mechanism.ground, body, ORIGIN, ORIGIN, axis_i=(0, 0, 1), axis_j=(0, 0, 1))
    )
    mechanism.output("z", body.position[2], units="m")
    mechanism.output("spin", body.angular_velocity[2], units="rad/s")
    mechanism.output("side", joint.reaction_force[1], units="N")
    mechanism.output("along", joint.reaction_force[2], units="N")
    times = np.linspace(0, 1, 11)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    close(data["z"], -G * times**2 / 2, relative=1e-8)
    close(data["spin"], np.full(11, 4.0), relative=1e-8)
    close(data["side"], np.full(11, -6.0), relative=1e-8)
    assert np.abs(data["along"]).max() < 1e-8


@pytest.mark.parametrize("kind", [Parallel2, PointOnLine])
@pytest.mark.parametrize("space", [uqmbd.Spatial, uqmbd.Planar])
def test_a_bead_on_a_tilted_wire(kind, space, close):
    """Acceleration g sin(30 degrees) along the wire, and the normal force m g cos(30 degrees)."""
    flat = space is uqmbd.Planar
    wire = (np.cos(np.pi / 6), -0.5) + (() if flat else (0.0,))
    down = (0, -G) if flat else (0, -G, 0)
    mechanism = uqmbd.Mechanism("wire", space(gravity=down))
    body = mechanism.body("bead", mass=1.5, inertia=0.1 if flat else (0.1, 0.1, 0.1))
    zero = (0,) * len(down)
    joint = mechanism.add(kind("wire", mechanism.ground, body, zero, zero, axis_i=wire))
    mechanism.output("s", sum(a * x for a, x in zip(wire, body.position, strict=True)), units="m")
    mechanism.output("n", sum(f**2 for f in joint.reaction_force) ** 0.5, units="N")
    times = np.linspace(0, 1, 6)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    close(data["s"], G * 0.5 * times**2 / 2, relative=1e-8)
    close(data["n"], np.full(6, 1.5 * G * np.cos(np.pi / 6)), relative=1e-8)


@pytest.mark.parametrize("kind", [Dot2, PointOnPlane])
def test_a_stone_on_a_slope(kind, close):
    """It slides down at g sin(30 degrees) and keeps its speed across."""
    normal = (0.0, 0.5, np.cos(np.pi / 6))
    mechanism = uqmbd.Mechanism("slope", uqmbd.Spatial(gravity=(0, 0, -G)))
    body = mechanism.body("stone", mass=1, inertia=(0.1, 0.1, 0.1), velocity=(2, 0, 0))
    mechanism.add(kind("slope", mechanism.ground, body, ORIGIN, ORIGIN, axis_i=normal))
    for k, letter in enumerate("xyz"):
        mechanism.output(letter, body.position[k], units="m")
    times = np.linspace(0, 1, 6)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    way = G * 0.5 * times**2 / 2
    close(data["x"], 2 * times, relative=1e-8)
    close(data["y"], way * np.cos(np.pi / 6), relative=1e-8)
    close(data["z"], -way * 0.5, relative=1e-8)


def test_revolute_spherical_is_a_massless_crank(close):
    """A point mass on the ball of a massless link swings like a pendulum in the plane of the hinge: case A1's period."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Spatial(gravity=(0, -9.81, 0)))
    body = mechanism.body("bob", mass=1, inertia=(1e-3, 1e-3, 1e-3), position=(-1, 0, 0))
    mechanism.add(RevoluteSpherical("link", mechanism.ground, body, ORIGIN, ORIGIN, (0, 0, 1), length=1))
    for k, letter in enumerate("xyz"):
        mechanism.output(letter, body.position[k], units="m")
    data = uqmbd.simulate(mechanism, [0, 0.5, 1, 2], rtol=1e-9)
    close(data["x"], [-1, -0.3910487915505464, 0.9862917511318753, -0.7935661953433217], relative=1e-6)
    close(data["y"], [0, -0.9203699487851922, -0.1650108531255412, -0.6084839304437915], relative=1e-6)
    assert np.abs(data["z"]).max() < 1e-9


def test_distance_driver_pulls_in_a_skater(close):
    """A point mass on a rope that is pulled in keeps its angular momentum."""
    mechanism = uqmbd.Mechanism("rope", uqmbd.Translational())
    body = mechanism.body("skater", mass=3, position=(2, 0), velocity=(-0.5, 1))
    mechanism.add(DistanceDriver("rope", mechanism.ground, body, (0, 0), (0, 0), length=2 - 0.5 * uqmbd.t))
    x, v = body.position, body.velocity
    mechanism.output("momentum", x[0] * v[1] - x[1] * v[0])
    mechanism.output("length", (x[0] ** 2 + x[1] ** 2) ** 0.5, units="m")
    times = np.linspace(0, 2, 9)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    close(data["momentum"], np.full(9, 2.0), relative=1e-7)
    close(data["length"], 2 - 0.5 * times, relative=1e-9)
