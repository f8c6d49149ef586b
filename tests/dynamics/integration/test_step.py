"""Break points of `uqmbd.step` are hit exactly, wherever they lie among the output times."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce

t = uqmbd.t


def rise(times, x0, x1):
    """First and second integral of the unit step from x0 to x1 over time."""
    width = x1 - x0
    s = np.clip((np.asarray(times) - x0) / width, 0, 1)
    after = np.maximum(np.asarray(times) - x1, 0)
    once = width * (s**3 - s**4 / 2) + after
    twice = width**2 * (s**4 / 4 - s**5 / 10) + width / 2 * after + after**2 / 2
    return once, twice


def pushed(force, mass=1.0):
    """A mass on which a force along x acts."""
    mechanism = uqmbd.Mechanism("pushed", uqmbd.Translational())
    body = mechanism.body("mass", mass=mass)
    mechanism.add(PointForce("push", body, (0, 0), (force, 0)))
    mechanism.output("x", body.position[0])
    mechanism.output("v", body.velocity[0])
    mechanism.output("a", body.acceleration[0])
    return mechanism


def errors(force, parts, times, rtol=1e-8):
    """Largest errors of velocity and position for a force that is a sum of (size, x0, x1) steps."""
    data = uqmbd.simulate(pushed(force), times, rtol=rtol)
    v, x = (sum(size * rise(times, a, b)[k] for size, a, b in parts) for k in (0, 1))
    return float(np.abs(data.v - v).max()), float(np.abs(data.x - x).max())


def test_driven_force_gives_its_double_integral():
    force = 3 * uqmbd.step(t, 0.5, 0, 1.1, 1) - 5 * uqmbd.step(t, 1.7, 0, 2.0, 1)
    v, x = errors(force, [(3, 0.5, 1.1), (-5, 1.7, 2.0)], np.linspace(0, 3, 31))
    assert v < 1e-6
    assert x < 1e-6


@pytest.mark.parametrize("shift", [0.0, 0.01, 0.0333, 0.05, 0.0999])
def test_error_does_not_depend_on_where_the_break_points_lie(shift):
    """Output times every 0.1 s; the break points on them, between them, just before them."""
    force = 3 * uqmbd.step(t, 0.5 + shift, 0, 1.1 + shift, 1) - 5 * uqmbd.step(t, 1.7 + shift, 0, 2.0 + shift, 1)
    parts = [(3, 0.5 + shift, 1.1 + shift), (-5, 1.7 + shift, 2.0 + shift)]
    v, x = errors(force, parts, np.linspace(0, 3, 31))
    assert v < 1e-6
    assert x < 1e-6


@pytest.mark.parametrize("times", [[0, 5], [0, 2.5, 5], [0, 1.9999, 2.0005, 2.003, 5], np.linspace(0, 5, 101)])
def test_pulse_that_is_shorter_than_any_step_is_not_missed(times):
    """2 ms wide, with nothing before it that would make the integrator careful: the impulse is 1e-3 N s."""
    force = uqmbd.step(t, 2, 0, 2.001, 1) - uqmbd.step(t, 2.001, 0, 2.002, 1)
    v, x = errors(force, [(1, 2, 2.001), (-1, 2.001, 2.002)], np.array(times, dtype=float), rtol=1e-6)
    assert v < 1e-6
    assert x < 3e-6


def test_break_points_may_be_random(close):
    start = uqmbd.RandomVariable("start", chaospy.Uniform(0.5, 2), units="s")
    mechanism = pushed(4 * uqmbd.step(t, start, 0, start + 0.01, 1))
    times = np.linspace(0, 3, 7)
    for value in (0.61, 1.25, 1.99):
        data = uqmbd.simulate(mechanism, times, values={"start": value}, rtol=1e-8)
        close(data.v, 4 * rise(times, value, value + 0.01)[0], relative=1e-6)


def test_break_points_of_a_scaled_time_are_found():
    """step(2 t - 1, ...) breaks at t = (x + 1) / 2."""
    force = uqmbd.step(2 * t - 1, 3, 0, 3.002, 1)
    v, x = errors(force, [(1, 2, 2.001)], np.array([0, 1, 4.0]), rtol=1e-7)
    assert v < 1e-6
    assert x < 1e-6


def test_break_point_on_the_first_and_the_last_time():
    v, x = errors(2 * uqmbd.step(t, 0, 0, 1, 1), [(2, 0, 1)], np.linspace(0, 1, 5))
    assert v < 1e-7
    assert x < 1e-7


def test_late_start_after_a_break_point():
    times = np.array([3.0, 3.5, 4.0])
    data = uqmbd.simulate(pushed(2 * uqmbd.step(t, 0.5, 0, 1, 1)), times, rtol=1e-8)
    np.testing.assert_allclose(data.v, 2 * (times - 3), atol=1e-6)


def test_acceleration_is_that_of_the_exact_time(close):
    times = np.linspace(0, 2, 41)
    data = uqmbd.simulate(pushed(3 * uqmbd.step(t, 0.52, 0, 1.17, 1), mass=2), times, rtol=1e-8)
    s = np.clip((times - 0.52) / 0.65, 0, 1)
    close(data.a, 1.5 * s**2 * (3 - 2 * s), relative=1e-12)


def test_jump_of_a_force_is_hit():
    """A Heaviside-like force through a piecewise condition on time."""
    force = sympy.Piecewise((0, t < 1.2345), (2, True))
    times = np.array([0, 1, 1.5, 4.0])
    data = uqmbd.simulate(pushed(force), times, rtol=1e-8)
    after = np.maximum(times - 1.2345, 0)
    np.testing.assert_allclose(data.v, 2 * after, atol=1e-6)
    np.testing.assert_allclose(data.x, after**2, atol=1e-6)


@pytest.mark.parametrize("start", [0.5, 0.537])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_driver_follows_a_step_in_its_angle(space, start, close):
    """Angle 2.5 rad within 0.8 s: angle, rate and torque of a body of inertia 0.7 about the axis."""
    angle = uqmbd.step(t, start, 0.2, start + 0.8, 2.7)
    if space == "planar":
        mechanism = uqmbd.Mechanism("rod", uqmbd.Planar())
        body = mechanism.body("rod", mass=1, inertia=0.7, angle=0.2)
        mechanism.add(Revolute("pivot", mechanism.ground, body, (0, 0), (0, 0)))
        drive = mechanism.add(RotationDriver("drive", mechanism.ground, body, angle))
        rate, moment = body.angular_velocity, drive.reaction_moment
    else:
        mechanism = uqmbd.Mechanism("rod", uqmbd.Spatial())
        axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
        q = (float(np.cos(0.1)), 0, 0, float(np.sin(0.1)))
        body = mechanism.body("rod", mass=1, inertia=(0.1, 0.65, 0.7), quaternion=q)
        mechanism.add(Revolute("pivot", mechanism.ground, body, (0, 0, 0), (0, 0, 0), **axes))
        drive = mechanism.add(RotationDriver("drive", mechanism.ground, body, angle, **axes))
        rate, moment = body.angular_velocity[2], drive.reaction_moment[2]
    mechanism.output("cos", body.rotation[0, 0])
    mechanism.output("rate", rate)
    mechanism.output("moment", moment)
    times = np.setdiff1d(np.round(np.linspace(0, 2, 41), 3), [0.5, 1.3])  # the moment jumps there
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    s = np.clip((times - start) / 0.8, 0, 1)
    close(data.cos, np.cos(0.2 + 2.5 * s**2 * (3 - 2 * s)))
    close(data.rate, 2.5 / 0.8 * 6 * s * (1 - s))
    close(data.moment, 0.7 * 2.5 / 0.8**2 * np.where((s > 0) & (s < 1), 6 - 12 * s, 0))


def test_break_points_that_differ_by_rounding_only():
    """0.1 + 0.2 and 0.3, 0.7 + 0.4 and 1.1, against output times that come from a sum as well."""
    force = (
        uqmbd.step(t, 0.1, 0, 0.1 + 0.2, 1) + uqmbd.step(t, 0.3, 0, 0.8 + 0.3, 1) - 2 * uqmbd.step(t, 1.1, 0, 1.7, 1)
    )
    parts = [(1, 0.1, 0.3), (1, 0.3, 1.1), (-2, 1.1, 1.7)]
    v, x = errors(force, parts, np.cumsum(np.full(30, 0.1)) - 0.1)
    assert v < 1e-6
    assert x < 1e-6


def test_every_sample_hits_its_own_break_point():
    start = uqmbd.RandomVariable("start", chaospy.Uniform(0.5, 2), units="s")
    mechanism = pushed(4 * uqmbd.step(t, start, 0, start + 0.01, 1))
    times = np.linspace(0, 3, 7)
    study = uqmbd.Study("pushed", mechanism, times, [MonteCarlo(samples=20, seed=3)])
    samples = study.propagate(study.propagators[0])["samples"]
    for k, begin in enumerate(samples["inputs"].values[:, 0]):
        exact = 4 * rise(times, begin, begin + 0.01)[0]
        np.testing.assert_allclose(samples["response"][k].sel(output="v"), exact, atol=1e-4)


def test_step_takes_a_random_variable(close):
    """Not only time: a mass that depends on an input through a step."""
    x = uqmbd.RandomVariable("x", chaospy.Uniform(0, 2))
    mechanism = pushed(3, mass=uqmbd.step(x, 0, 1, 2, 5))
    times = np.array([0, 1, 2.0])
    for value, mass in ((-1, 1), (0.5, 1 + 4 * 0.15625), (1, 3), (2.5, 5)):
        data = uqmbd.simulate(mechanism, times, values={"x": value}, rtol=1e-8)
        close(data.v, 3 / mass * times, relative=1e-6)


def test_gravity_may_change_with_time():
    mechanism = uqmbd.Mechanism("fall", uqmbd.Planar(gravity=(0, -10 * uqmbd.step(t, 2, 0, 2.001, 1))))
    body = mechanism.body("stone", mass=3, inertia=1)
    mechanism.output("v", body.velocity[1])
    data = uqmbd.simulate(mechanism, [0, 5], rtol=1e-8)
    np.testing.assert_allclose(data.v, -10 * rise([0, 5], 2, 2.001)[0], atol=1e-5)


def test_rod_may_change_its_length_with_time(close):
    """A particle pushed along a line by a rod of length 1 + t^2: the rod carries 2 N."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Translational())
    body = mechanism.body("mass", mass=1, position=(1, 0))
    rod = mechanism.add(Distance("rod", mechanism.ground, body, (0, 0), (0, 0), 1 + t**2))
    mechanism.output("x", body.position[0])
    mechanism.output("force", rod.reaction_force[0])
    times = np.linspace(0, 2, 9)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    close(data.x, 1 + times**2, relative=1e-6)
    close(data.force, np.full(9, 2.0), relative=1e-5)
