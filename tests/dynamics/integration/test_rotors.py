"""What turns is as accurate as the tolerance says: errors in tolerances, over tolerances from 1e-4 to 1e-10.

A method of finite order damps a rotation that is stepped by the rates of a quaternion, by the same sign in each step.
In angular velocities a speed that is a straight line is one of the numbers, too.
"""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_springs import Torque, TorsionSpringDamper

TOLERANCES = [pytest.param(x, marks=pytest.mark.thorough) for x in (1e-4, 1e-5, 1e-7, 1e-9, 1e-10)] + [1e-6, 1e-8]


def space_of(name):
    return uqmbd.Spatial() if name == "space" else uqmbd.Planar()


def in_space(name, value):
    return (0, 0, value) if name == "space" else value


def rotor(space, radius, torque, times):
    """A rotor under a constant torque, its centre of mass beside the axis: speed and angle in closed form."""
    mechanism = uqmbd.Mechanism("rotor", space_of(space))
    spatial = space == "space"
    about = {"at": (0, 0, 0), "axis": (0, 0, 1)} if spatial else {"at": (0, 0)}
    body = mechanism.body(
        "rotor",
        mass=1,
        inertia=(0.02, 0.02, 0.03) if spatial else 0.03,
        position=(radius, 0, 0) if spatial else (radius, 0),
    )
    joint = mechanism.add(Revolute("bearing", mechanism.ground, body, **about))
    mechanism.add(Torque("drive", body, in_space(space, torque)))
    mechanism.output("speed", joint.speed, units="rad/s")
    mechanism.output("angle", joint.angle, units="rad")
    rate = torque / (0.03 + radius**2)
    return mechanism, {"speed": rate * times, "angle": rate * times**2 / 2}


def free(space, speed, times):
    """A body that spins freely, for many turns."""
    mechanism = uqmbd.Mechanism("spin", space_of(space))
    spatial = space == "space"
    inertia = (0.02, 0.02, 0.03) if spatial else 0.03
    body = mechanism.body("body", mass=1, inertia=inertia, angular_velocity=in_space(space, speed))
    mechanism.output("speed", body.angular_velocity[2] if spatial else body.angular_velocity, units="rad/s")
    mechanism.output("x", body.point((1, 0, 0) if spatial else (1, 0))[0], units="m")
    return mechanism, {"speed": speed + 0 * times, "x": np.cos(speed * times)}


def coil(times):
    mechanism = uqmbd.Mechanism("coil", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1, angular_velocity=20)
    mechanism.add(TorsionSpringDamper("coil", mechanism.ground, body, 4))
    mechanism.output("speed", body.angular_velocity, units="rad/s")
    return mechanism, {"speed": 20 * np.cos(2 * times)}


def errors(case, times, rtol, integrator="dop853"):
    """Errors over tolerance and largest value, by output."""
    mechanism, exact = case
    found = uqmbd.simulate(mechanism, times, rtol=rtol, integrator=integrator, check=False)
    return {
        name: float(np.abs(found[name] - value).max() / np.abs(value).max()) / rtol for name, value in exact.items()
    }


@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_a_rotor_under_constant_torque_has_a_straight_speed(space, rtol):
    """By rates of quaternions it was off by 25 to 170 tolerances after 11 turns, by up to 1,100 after 180."""
    times = np.linspace(0, 1, 11)
    for torque in (4.0, 64.0):  # 11 and 170 turns
        assert max(errors(rotor(space, 0.0, torque, times), times, rtol).values()) < 5


@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_the_centre_of_mass_may_be_beside_the_axis(space, rtol):
    """By rates of quaternions it was off by 4 to 10 tolerances."""
    times = np.linspace(0, 1, 11)
    assert max(errors(rotor(space, 0.3, 10.0, times), times, rtol).values()) < 4


@pytest.mark.thorough
@pytest.mark.parametrize("space", ["plane", "space"])
def test_no_tolerance_is_such_that_errors_grow_from_step_to_step(space):
    """With accelerations from before the states were put on the constraints, errors were up to 25 tolerances.

    Each step of one to three radians made the error of the one before larger by a half, with the other sign, until it
    was noticed: at tolerances of 2e-6 to 1e-5, with a few such steps at the end, and at others not.
    """
    times = np.linspace(0, 1, 11)
    for rtol in np.logspace(-3, -7, 25):
        assert max(errors(rotor(space, 0.3, 10.0, times), times, rtol).values()) < 5, rtol


@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_a_free_spin_keeps_its_speed_and_its_phase_grows_as_the_number_of_turns(space, rtol):
    """The speed is held to rounding; 160 turns are off by less than a tolerance for each radian (before: by twenty)."""
    times = np.linspace(0, 10, 101)
    found = errors(free(space, 100.0, times), times, rtol)
    assert found["speed"] * rtol < 1e-12
    assert found["x"] < 1000


@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_implicit_steps_keep_the_speed_of_a_free_spin_within_half_a_tolerance(space, rtol):
    """After 160 turns; before, the speed was off by up to one tolerance."""
    times = np.linspace(0, 10, 101)
    assert errors(free(space, 100.0, times), times, rtol, "radau")["speed"] < 0.5


@pytest.mark.thorough
def test_errors_fall_with_the_tolerance():
    """By at least five for each ten, over all tolerances."""
    times, tolerances = np.linspace(0, 1, 11), 10.0 ** np.arange(-4, -11, -1)
    long = np.linspace(0, 10, 101)
    for case, at in (
        (rotor("plane", 0.0, 4.0, times), times),
        (rotor("space", 0.3, 10.0, times), times),
        (free("space", 100.0, long), long),
        (coil(long), long),
    ):
        sizes = [max(errors(case, at, float(rtol)).values()) * rtol for rtol in tolerances]
        slope = np.polyfit(np.log10(tolerances), np.log10(sizes), 1)[0]
        assert slope > 0.7, sizes
        assert sizes[-1] < 1e-7, sizes


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(4))
def test_the_axes_of_a_body_are_of_no_account(seed):
    """Stated in other body axes, a motion is as accurate: a symmetric top by its closed form."""
    rng = np.random.default_rng(seed)
    frame = rng.normal(size=4)
    frame /= np.linalg.norm(frame)
    a, c, spin, tilt = 1.0, 1.5, 2 * np.pi, 0.4
    times = np.linspace(0, 10, 101)
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial())
    body = mechanism.body("top", mass=1, inertia=(a, a, c), quaternion=tuple(frame), angular_velocity=(tilt, 0, spin))
    e0, u = frame[0], frame[1:]
    turn = np.eye(3) * (e0**2 - u @ u) + 2 * np.outer(u, u) + 2 * e0 * np.cross(np.eye(3), u)
    momentum = turn @ np.array([a * tilt, 0, c * spin])
    axis, rate = turn @ np.array([0, 0, 1.0]), np.linalg.norm(momentum) / a
    n, angle = momentum / np.linalg.norm(momentum), (rate * times)[:, None]
    tip = axis * np.cos(angle) + np.cross(n, axis) * np.sin(angle) + n * (n @ axis) * (1 - np.cos(angle))
    for k, name in enumerate("xyz"):
        mechanism.output(name, body.point((0, 0, 1))[k], units="m")
    for rtol in (1e-5, 1e-7, 1e-9):
        found = errors((mechanism, dict(zip("xyz", tip.T, strict=True))), times, rtol)
        assert max(found.values()) < 100
