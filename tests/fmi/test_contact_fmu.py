"""Contacts in FMUs of mechanisms: the driver decides about them, also at communication points and after changed inputs."""

from __future__ import annotations

import ctypes as c

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import LinearSpeedDriver
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
def test_feet_start_to_slide_together(tmp_path):
    """A push of 20 t overcomes the friction of two feet, 0.3 m g = 5.886 N, at 0.2943 s."""
    friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.1, 0.5))
    mechanism = uqmbd.Mechanism("table", uqmbd.Planar(gravity=(0, -G)))
    table = mechanism.body("table", mass=2, inertia=0.5, position=(0, 0.5))
    for name, x in (("left", -0.5), ("right", 0.5)):
        at = (mechanism.ground, table, (0, 0), (x, -0.5), (0, 1))
        mechanism.add(PlaneImpact(name, *at, restitution=0, friction=friction))
    mechanism.add(PointForce("push", table, (0, 0), (20 * uqmbd.t, 0)))
    mechanism.output("x", table.position[0], units="m")
    fmu = exported(mechanism, tmp_path, rtol=1e-9)
    found = fmu.along([0.0, 0.2, 1.0], {"friction": 0.3}, ["x"])[0]
    np.testing.assert_allclose(found, [0, 0, 10 * (1 - 0.3 * 2 * G / 20) ** 3 / 6], rtol=0, atol=1e-8)


def ramp():
    """A point mass that slides at v along an inclined plane, 2 mm in front of a wall."""
    v = uqmbd.RandomVariable("v", chaospy.Uniform(0.5, 100), units="m/s")
    tilt = uqmbd.RandomVariable("tilt", chaospy.Uniform(-1, 1), units="rad")
    c, s, way = sympy.cos(tilt), sympy.sin(tilt), 2e-3
    mechanism = uqmbd.Mechanism("ramp", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("body", mass=1e-3, position=(-way * c, -way * s), velocity=(v * c, v * s))
    at = (mechanism.ground, body, (0, 0), (0, 0))
    mechanism.add(PlaneImpact("floor", *at, (-s, c), restitution=0))
    mechanism.add(PlaneImpact("wall", *at, (-c, -s), restitution=0.5))
    mechanism.output("way", body.position[0] * c + body.position[1] * s, units="m")
    return mechanism


@compiled
@pytest.mark.thorough
def test_rounding_errors_of_normal_speeds_do_not_end_motions_of_millimetres(tmp_path):
    """A uniformly accelerated slide of 2 mm at 0.5 to 100 m/s, and the way back at half the speed of the impact."""
    fmu, generator = exported(ramp(), tmp_path, times=(0.0, 0.01), rtol=1e-9), np.random.default_rng(1)
    for speed, tilt in zip(10 ** generator.uniform(-0.3, 2, 150), generator.uniform(-1, 1, 150), strict=True):
        a, end = -G * np.sin(tilt), 4e-3 / speed
        hit = (np.sqrt(speed**2 + 4e-3 * a) - speed) / a
        way = -(speed + a * hit) / 2 * (end - hit) + a * (end - hit) ** 2 / 2
        if hit > end:
            way = -2e-3 + speed * end + a * end**2 / 2
        found = fmu.along([0.0, end], {"v": speed, "tilt": tilt}, ["way"])[0, -1]
        assert found == pytest.approx(way, rel=0, abs=1e-10)


def lift(feet):
    """A block on a platform, whose speed is an input, with contacts without rebound at its feet."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(-2, 2), units="m/s")
    mechanism = uqmbd.Mechanism("lift", uqmbd.Planar(gravity=(0, -G)))
    platform = mechanism.body("platform", mass=50, inertia=1)
    at = (mechanism.ground, platform, (0, 0), (0, 0), (0, 1))
    mechanism.add(Prismatic("guide", *at, (0, 1)))
    mechanism.add(LinearSpeedDriver("drive", *at, speed))
    block = mechanism.body("block", mass=2, inertia=0.1)
    for x in feet:
        foot = (platform, block, (0, 0), (x, 0), (0, 1))
        mechanism.add(PlaneImpact(f"foot at {x}", *foot, restitution=0.5, friction=0.2))
    mechanism.output("block", block.position[1], units="m")
    mechanism.output("platform", platform.position[1], units="m")
    return mechanism


@compiled
@pytest.mark.thorough
@pytest.mark.parametrize("feet", [(0.0,), (-0.5, 0.5)])
def test_speeds_of_supports_that_are_inputs_push_bodies_or_leave_them(feet, tmp_path):
    """The block rises with the platform, flies on as it returns, lands, bounces with 0.5, and stops with it."""
    fmu = exported(lift(feet), tmp_path, times=(0.0, 2.0), rtol=1e-10, inputs=("speed",))
    assert fmu.set(["speed"], [0.0]) == 0 and fmu.begin() == 0
    found = []
    # the first flight ends 3 / g = 0.306 s after the return, the last one 3 times later
    for begin, end, speed in (
        (0, 0.2, 0),
        (0.2, 0.3, 1),
        (0.3, 0.5, 1),
        (0.5, 0.7, -0.5),
        (0.7, 1.8, -0.5),
        (1.8, 2, 0),
    ):
        assert fmu.set(["speed"], [speed]) == 0 and fmu.step(begin, end - begin) == 0, fmu.messages
        found.append(fmu.get(["block", "platform"]))
    flight = 0.3 + 0.2 - G * 0.2**2 / 2
    block, platform = [0, 0.1, 0.3, flight, -0.35, -0.35], [0, 0.1, 0.3, 0.2, -0.35, -0.35]
    np.testing.assert_allclose(found, np.transpose([block, platform]), rtol=0, atol=1e-8)


def between_walls():
    """A body without gravity that bounces elastically at 1 m/s between walls with a distance of 0.1 mm."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(0.5, 2), units="m/s")
    mechanism = uqmbd.Mechanism("between", uqmbd.Line())
    body = mechanism.body("body", mass=1, velocity=speed)
    mechanism.add(PlaneImpact("left", mechanism.ground, body, 0, 0, 1, restitution=1))
    mechanism.add(PlaneImpact("right", mechanism.ground, body, 1e-4, 0, -1, restitution=1))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


@compiled
@pytest.mark.thorough
def test_more_than_ten_thousand_impacts_in_a_step_end_with_one_error(tmp_path):
    """Impacts every 0.1 ms: 4,000 in each of three steps of 0.4 s, and more than 10,000 in one of 1.2 s."""
    fmu = exported(between_walls(), tmp_path, times=(0.0, 2.0), rtol=1e-9)
    times = np.array([0.0, 0.4, 0.8, 1.2]) + 3.4e-5
    times[0] = 0.0
    found = fmu.along(times, {"speed": 1.0}, ["x"])[0]
    np.testing.assert_allclose(found[1:], 3.4e-5, rtol=0, atol=1e-9)
    assert fmu.reset() == 0 and fmu.set(["speed"], [1.0]) == 0 and fmu.begin() == 0
    fmu.messages.clear()
    assert fmu.step(0.0, 1.2) == 3
    (message,) = fmu.messages
    assert "More than 10000 events of contacts occur in a step at t = 1.000" in message[1]


@compiled
@pytest.mark.thorough
def test_restored_states_whose_bodies_overlap_end_with_an_error(tmp_path):
    """A stored state that is changed to a height below the floor, without changes of inputs."""
    fmu = exported(guided(), tmp_path, times=(0.0, 1.0), rtol=1e-9)
    assert fmu.begin() == 0 and fmu.step(0.0, 0.1) == 0
    (height,) = fmu.get(["y"])
    state, size, again = c.c_void_p(), c.c_size_t(), c.c_void_p()
    assert fmu.call("GetFMUstate", c.byref(state)) == 0
    assert fmu.call("SerializedFMUstateSize", state, c.byref(size)) == 0
    stored = (c.c_ubyte * size.value)()
    assert fmu.call("SerializeFMUstate", state, stored, size) == 0
    before, below = np.array([height]).tobytes(), np.array([-0.01]).tobytes()
    changed = bytes(stored).replace(before, below)
    assert changed != bytes(stored)
    stored = (c.c_ubyte * size.value)(*changed)
    assert fmu.call("DeSerializeFMUstate", stored, size, c.byref(again)) == 0
    assert fmu.call("SetFMUstate", again) == 0
    assert fmu.step(0.1, 0.1) == 3
    assert "floor: the bodies overlap by 0.01 m at t = 0.1 s" in fmu.messages[-1][1]
