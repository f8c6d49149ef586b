"""Friction in FMUs: dry friction of joints, feet with different friction, and marks that do not count as events."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_springs import PointForce, RotationalFriction, SlidingFriction, Torque

from .test_contact_fmu import between_walls
from .test_mechanism_fmu import compare, compiled, exported, rotor

G = 9.81


def on_spring():
    """A mass of 1 kg on a spring of 100 N/m under dry friction of 4 N, from 0.3 m."""
    mechanism = uqmbd.Mechanism("spring", uqmbd.Line())
    begin = uqmbd.RandomVariable("begin", chaospy.Uniform(0.1, 0.5), units="m")
    mass = mechanism.body("mass", mass=1, position=begin, velocity=0)
    mechanism.add(SlidingFriction("rail", mechanism.ground, mass, 0, 0, 1, friction=4))
    mechanism.add(PointForce("spring", mass, 0, -100 * mass.position[0]))
    mechanism.output("x", mass.position[0], units="m")
    return mechanism


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("parts", [1, 3])
def test_dry_friction_turns_and_sticks(parts, tmp_path):
    """Each half swing loses 2 f / k, until the spring holds less than f; turns are at communication points or not."""
    half, ends = np.pi / 10, [0.3]
    while 100 * abs(ends[-1]) > 4:
        ends.append(-np.sign(ends[-1]) * (abs(ends[-1]) - 0.08))
    fmu = exported(on_spring(), tmp_path, times=(0.0, 3.0), rtol=1e-10)
    times = np.append(np.arange(parts * (len(ends) - 1) + 1) * half / parts, [2.0, 3.0])
    found = fmu.along(times, {"begin": 0.3}, ["x"])[0]
    np.testing.assert_allclose(found[:-2:parts], ends, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found[-2:], ends[-1], rtol=0, atol=1e-8)


def braked():
    """A wheel of 0.5 kg m^2 that turns at 2 rad/s under a brake and a torque, which are inputs."""
    mechanism = uqmbd.Mechanism("braked", uqmbd.Planar())
    brake = uqmbd.RandomVariable("brake", chaospy.Uniform(0, 3), units="N m")
    torque = uqmbd.RandomVariable("torque", chaospy.Uniform(-3, 3), units="N m")
    wheel = mechanism.body("wheel", mass=1, inertia=0.5, angular_velocity=2)
    mechanism.add(RotationalFriction("brake", mechanism.ground, wheel, friction=brake))
    mechanism.add(Torque("motor", wheel, torque))
    mechanism.output("angle", wheel.angle, units="rad")
    return mechanism


@compiled
@pytest.mark.thorough
def test_a_brake_that_is_an_input_holds_and_releases(tmp_path):
    """Free, braked until rest, held against a torque below the limit, released, braked, and overcome."""
    fmu = exported(braked(), tmp_path, times=(0.0, 4.0), rtol=1e-10, inputs=("brake", "torque"))
    assert fmu.set(["brake", "torque"], [0.0, 0.0]) == 0 and fmu.begin() == 0
    found, angle, speed, expected = [], 0.0, 2.0, []
    # seconds, brake, torque, acceleration of the wheel
    for begin, end, brake, torque, a in (
        (0.0, 0.5, 0.0, 0.0, 0.0),
        (0.5, 1.5, 2.0, 0.0, -4.0),
        (1.5, 2.0, 2.0, 1.5, 0.0),
        (2.0, 2.5, 0.0, 1.5, 3.0),
        (2.5, 3.0, 1.0, 1.5, 1.0),
        (3.0, 3.5, 2.5, -1.5, -8.0),
        (3.5, 4.0, 1.0, -1.5, -1.0),
    ):
        assert fmu.set(["brake", "torque"], [brake, torque]) == 0
        assert fmu.step(begin, end - begin) == 0, fmu.messages
        span = end - begin if speed == 0 or a >= 0 else min(end - begin, -speed / a)
        angle, speed = angle + speed * span + a * span**2 / 2, speed + a * span
        speed = 0.0 if abs(speed) < 1e-9 else speed
        expected.append(angle)
        found.append(fmu.get(["angle"])[0])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


@compiled
@pytest.mark.thorough
def test_friction_of_feet_and_of_a_joint_act_together(tmp_path):
    """A block of 1 kg on two feet and a dry rail, pushed by 10 t: break-away at 0.5 m g + 2 N."""
    mechanism = uqmbd.Mechanism("block", uqmbd.Planar(gravity=(0, -G)))
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(0.5, 2), units="kg")
    still = {"velocity": (0, 0), "angular_velocity": 0}
    block = mechanism.body("block", mass=mass, inertia=0.01, position=(0, 0.1), **still)
    for k, x in enumerate((-0.1, 0.1)):
        foot = (mechanism.ground, block, (0, 0), (x, -0.1), (0, 1))
        mechanism.add(PlaneImpact(f"foot{k}", *foot, restitution=0, friction=0.5))
    mechanism.add(SlidingFriction("rail", mechanism.ground, block, (0, 0), (0, -0.1), (1, 0), friction=2))
    mechanism.add(PointForce("push", block, (0, -0.1), (10 * uqmbd.t, 0)))
    mechanism.output("x", block.position[0], units="m")
    fmu, times = exported(mechanism, tmp_path, times=(0.0, 1.0), rtol=1e-9), np.linspace(0, 1, 5)
    late = np.maximum(0, times - (0.5 * G + 2) / 10)
    np.testing.assert_allclose(fmu.along(times, {"mass": 1.0}, ["x"])[0], 10 * late**3 / 6, rtol=0, atol=1e-8)


def sledge(feet):
    """A block that slides at 1.5 m/s on feet (place, friction) in a line, whose forces are not unique."""
    mechanism = uqmbd.Mechanism("sledge", uqmbd.Planar(gravity=(0, -G)))
    v = uqmbd.RandomVariable("v", chaospy.Uniform(1, 2), units="m/s")
    block = mechanism.body("block", mass=2, inertia=0.5, position=(0, 0.2), velocity=(v, 0))
    for k, (x, friction) in enumerate(feet):
        foot = (mechanism.ground, block, (0, 0), (x, -0.2), (0, 1))
        mechanism.add(PlaneImpact(f"foot{k}", *foot, restitution=0, friction=friction))
    mechanism.output("x", block.position[0], units="m")
    return mechanism


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("feet", [[(-1, 0.1), (0.2, 0.4), (1, 0.3)], [(-1, 0.5), (-0.4, 0.1), (0.3, 0.6), (1, 0.2)]])
def test_feet_in_a_line_may_have_different_friction(feet, tmp_path):
    """The least forces are those of `simulate`: the motion starts, slows down and ends alike."""
    mechanism = sledge(feet)
    fmu, times = exported(mechanism, tmp_path, times=(0.0, 1.0), rtol=1e-9), np.linspace(0, 1, 11)
    compare(fmu, mechanism, times, {"v": 1.5})
    found = fmu.along(times, {"v": 1.5}, ["x"])[0]
    assert found[-1] == found[-2] > 0.1


class Place(uqmbd.Component):
    """Mark where a body passes a place to the left."""

    bodies = ("body",)
    spaces = (uqmbd.Line,)
    place = uqmbd.Parameter("m", "place")

    def terms(self, p):
        yield uqmbd.Event(p.body.position[0] - p.place, label="line")


@compiled
@pytest.mark.thorough
def test_marks_do_not_count_as_events_of_contacts(tmp_path):
    """4,000 impacts and 8,000 marks in a step: only 10,000 impacts are too many."""
    mechanism = between_walls()
    for k in range(4):
        mechanism.add(Place(f"line{k}", mechanism.bodies["body"], (2 + k) * 1e-5))
    fmu = exported(mechanism, tmp_path, times=(0.0, 2.0), rtol=1e-9)
    found = fmu.along([0.0, 0.4 + 3.4e-5], {"speed": 1.0}, ["x"])[0]
    np.testing.assert_allclose(found[1], 3.4e-5, rtol=0, atol=1e-9)


@compiled
@pytest.mark.thorough
def test_a_bearing_with_dry_friction_moves_as_in_simulate(tmp_path):
    mechanism = rotor()
    mechanism.add(RotationalFriction("friction", mechanism.ground, mechanism.bodies["wheel"], friction=0.1))
    fmu, times = exported(mechanism, tmp_path, times=(0.0, 2.0), rtol=1e-9), np.linspace(0, 2, 9)
    compare(fmu, mechanism, times, {"inertia": 0.45, "torque": 0.7})
