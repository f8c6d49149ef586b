"""Contacts in FMUs of mechanisms: the driver decides about them, also at communication points and after changed inputs."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Prismatic
from uqmbd_springs import PointForce

from .test_mechanism_fmu import compare, compiled, exported, sliding

G = 9.81


def block(speed, push=0.0):
    """A block of 2 kg on a floor whose friction is an input."""
    friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.1, 0.5))
    mechanism = uqmbd.Mechanism("block", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("body", mass=2, velocity=(speed, 0))
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), friction=friction))
    mechanism.add(PointForce("push", body, (0, 0), (push, 0)))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


@compiled
@pytest.mark.thorough
def test_friction_that_an_input_adds_or_removes_acts_from_the_next_step(tmp_path):
    """3 m/s for 0.2 s without friction, then until rest with 0.3; a push of 4 N moves the block without friction only."""
    mechanism = block(3.0, sympy.Piecewise((0, uqmbd.t < 2), (4, True)))
    fmu = exported(mechanism, tmp_path, times=(0.0, 4.0), rtol=1e-9, inputs=("friction",))
    assert fmu.set(["friction"], [0.0]) == 0 and fmu.begin() == 0
    stopped, found = 0.6 + 3**2 / (2 * 0.3 * G), []
    for begin, end, friction in ((0, 0.2, 0), (0.2, 2, 0.3), (2, 3, 0.3), (3, 3.5, 0), (3.5, 3.6, 0.5)):
        assert fmu.set(["friction"], [friction]) == 0 and fmu.step(begin, end - begin) == 0, fmu.messages
        found.append(fmu.get(["x"])[0])
    pushed = stopped + 2 * 0.5**2 / 2
    slowed = pushed + 1.0 * 0.1 + (2 - 0.5 * G) * 0.1**2 / 2
    np.testing.assert_allclose(found, [0.6, stopped, stopped, pushed, slowed], rtol=0, atol=1e-8)


@compiled
@pytest.mark.thorough
def test_slides_that_stop_at_a_communication_point_stop(tmp_path):
    """Coulomb friction stops 3 m/s after 3 / (0.3 g) s; a push of 8 N overcomes 5.886 N from the next point on."""
    stop = 3 / (0.3 * G)
    mechanism = block(3.0, sympy.Piecewise((0, uqmbd.t < 2 * stop), (8, True)))
    fmu = exported(mechanism, tmp_path, times=(0.0, 4.0), rtol=1e-9, inputs=("friction",))
    found = fmu.along(np.arange(4) * stop, {"friction": 0.3}, ["x"])[0]
    rest = 3 * stop / 2
    np.testing.assert_allclose(found, [0, rest, rest, rest + (4 - 0.3 * G) * stop**2 / 2], rtol=0, atol=1e-8)


def guided():
    """A body in a vertical guide that falls onto a rough floor, along which it cannot move."""
    friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.1, 0.5))
    mechanism = uqmbd.Mechanism("guided", uqmbd.Planar(gravity=(0, -G)))
    body = mechanism.body("body", mass=2, inertia=0.1, position=(0, 0.5))
    mechanism.add(Prismatic("guide", mechanism.ground, body, (0, 0), (0, 0), (0, 1), (0, 1)))
    at = (mechanism.ground, body, (0, 0), (0, 0), (0, 1))
    mechanism.add(PlaneImpact("floor", *at, restitution=0.5, friction=friction))
    mechanism.output("y", body.position[1], units="m")
    return mechanism


@compiled
@pytest.mark.thorough
def test_friction_in_a_direction_without_motion_has_no_effect(tmp_path):
    """Bounces with restitution 0.5 from 0.5 m end at sqrt(2 h / g) (1 + 0.5) / (1 - 0.5) = 0.958 s, in rest."""
    times = np.linspace(0, 1.5, 16)
    fmu = exported(guided(), tmp_path, times=times, rtol=1e-9)
    found = fmu.along(times, {"friction": 0.3}, ["y"])[0]
    first = np.sqrt(2 * 0.5 / G)
    since = times[times < 2 * first] - first
    flight = np.where(since < 0, 0.5 - G * times[: len(since)] ** 2 / 2, since * (G * first / 2 - G * since / 2))
    np.testing.assert_allclose(found[: len(since)], flight, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found[times > 0.96], 0.0, rtol=0, atol=1e-10)


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("height", [0.0, 0.3])
def test_slides_and_impacts_in_space_are_those_of_simulate(height, tmp_path):
    """A spinning body that slides, turns its direction of sliding, and hits the floor with friction in space."""
    mechanism, times = sliding(uqmbd.Spatial, (1.0, 0.5, 0.0), height), np.linspace(0, 0.5, 41)
    fmu = exported(mechanism, tmp_path, times=times, rtol=1e-9)
    for friction in (0.1, 0.2, 0.3, 0.5):
        compare(fmu, mechanism, times, {"friction": friction})


def rod():
    """A slender rod of 2 m and 1 kg, inclined by 60 degrees, whose lower end slides at 1 m/s against the inclination."""
    spin = uqmbd.RandomVariable("spin", chaospy.Uniform(2, 5), units="rad/s")
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -G)))
    c, s = 0.5, np.sqrt(0.75)
    body = mechanism.body(
        "rod",
        mass=1,
        inertia=1 / 3,
        position=(c, s),
        angle=np.pi / 3,
        velocity=(-1 - spin * s, spin * c),
        angular_velocity=spin,
    )
    mechanism.add(PlaneImpact("tip", mechanism.ground, body, (0, 0), (-1, 0), (0, 1), restitution=0, friction=2.0))
    mechanism.output("rate", body.angular_velocity, units="rad/s")
    return mechanism


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("spin", [2.5, 4.5])
def test_a_wedged_rod_and_one_with_two_motions_end_with_an_error_that_names_the_contact(spin, tmp_path):
    """Painleve's rod: below sqrt(g / sin(60 deg)) = 3.37 rad/s no force satisfies the laws, above it two motions do."""
    fmu = exported(rod(), tmp_path)
    assert fmu.set(["spin"], [spin]) == 0 and fmu.begin() == 3
    assert "tip: the laws of contact and friction do not determine the motion at t = 0 s" in fmu.messages[-1][1]


@compiled
@pytest.mark.thorough
def test_feet_that_start_to_slide_together_end_with_an_error_that_names_them(tmp_path):
    """A push that grows to 20 N overcomes the friction of two feet, at most 0.5 m g = 9.81 N."""
    friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.1, 0.5))
    mechanism = uqmbd.Mechanism("table", uqmbd.Planar(gravity=(0, -G)))
    table = mechanism.body("table", mass=2, inertia=0.5, position=(0, 0.5))
    for name, x in (("left", -0.5), ("right", 0.5)):
        at = (mechanism.ground, table, (0, 0), (x, -0.5), (0, 1))
        mechanism.add(PlaneImpact(name, *at, restitution=0, friction=friction))
    mechanism.add(PointForce("push", table, (0, 0), (20 * uqmbd.t, 0)))
    mechanism.output("x", table.position[0], units="m")
    fmu = exported(mechanism, tmp_path)
    assert (fmu.begin() or fmu.step(0.0, 1.0)) == 3
    text = fmu.messages[-1][1]
    assert "left" in text and "right" in text and "touch at the same time" in text
