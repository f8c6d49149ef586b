"""IDA is as accurate as the tolerance says on what turns and swings without damping, and so is whoever is left to it.

Ten turns or ten seconds are wrong by a hundred tolerances at most.  Without its tighter steps they are wrong by thousands.
"""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Prismatic, Revolute

TOLERANCES = [pytest.param(1e-4, marks=pytest.mark.slow), 1e-6, pytest.param(1e-8, marks=pytest.mark.slow)]
TIMES = np.linspace(0, 10, 101)
MOST = 100
"""Errors that are allowed, in tolerances, relative to the largest value of an output."""


def resting(mechanism, count):
    """Bodies that lie still beside the others, whose errors are none."""
    for k in range(count):
        mechanism.body(f"still {k}", mass=1, inertia=(1, 1, 1), position=(k + 1, 0, 0))


def rotor(speed=2 * np.pi, still=0):
    """A free symmetrical rotor, which nutates."""
    mechanism = uqmbd.Mechanism("rotor", uqmbd.Spatial())
    body = mechanism.body("rotor", mass=1, inertia=(1, 1, 1.5), angular_velocity=(0.4, 0, speed))
    resting(mechanism, still)
    for axis, value in zip("xyz", body.angular_velocity, strict=True):
        mechanism.output(f"w{axis}", value, units="rad/s")
    mechanism.output("tip", body.point((0, 0, 1))[0], units="m")
    return mechanism


def nutation(times, speed=2 * np.pi):
    """Closed form of the symmetrical rotor: its axis precesses about the angular momentum.

    With moments A, A, C and the spin along the axis the angular velocity is that of the precession, L/A, about L, and
    the rest about the axis.
    """
    a, c, w1 = 1.0, 1.5, 0.4
    momentum = np.array([a * w1, 0.0, c * speed])
    rate = np.linalg.norm(momentum) / a
    n = momentum / np.linalg.norm(momentum)
    axis = np.array([0.0, 0.0, 1.0])
    turn = rate * times[:, None]
    turned = axis * np.cos(turn) + np.cross(n, axis) * np.sin(turn) + n * (n @ axis) * (1 - np.cos(turn))
    omega = momentum / a + (speed - c * speed / a) * turned
    return {"wx": omega[:, 0], "wy": omega[:, 1], "wz": omega[:, 2], "tip": turned[:, 0]}


def governor():
    """Two balls on hinged arms, on a shaft that turns freely."""
    mechanism = uqmbd.Mechanism("governor", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    shaft = mechanism.body("shaft", mass=1, inertia=(0.1, 0.1, 0.05), angular_velocity=(0, 0, 12.0))
    mechanism.add(Revolute("bearing", mechanism.ground, shaft, at=(0, 0, 0), axis=(0, 0, 1)))
    for side, sign in (("left", -1), ("right", 1)):
        at = np.array([sign * (0.1 + 0.3 * np.sin(0.6)), 0, -0.3 * np.cos(0.6)])
        ball = mechanism.body(side, mass=1, inertia=(0.01, 0.01, 0.01), position=tuple(at))
        mechanism.add(Revolute(f"{side} hinge", shaft, ball, at=(sign * 0.1, 0, 0), axis=(0, 1, 0)))
    mechanism.output("speed", shaft.angular_velocity[2], units="rad/s")
    mechanism.output("height", ball.position[2], units="m")
    mechanism.output("x", ball.position[0], units="m")
    return mechanism


def slider_crank():
    """A crank that turns freely, with a rod and a slider."""
    mechanism = uqmbd.Mechanism("slider crank", uqmbd.Planar(gravity=(0, -9.81)))
    crank = mechanism.body("crank", mass=1, inertia=0.0075, position=(0.075, 0), angular_velocity=20.0)
    rod = mechanism.body("rod", mass=0.5, inertia=0.0051, position=(0.325, 0))
    slider = mechanism.body("slider", mass=0.3, inertia=1, position=(0.5, 0))
    mechanism.add(Revolute("main", mechanism.ground, crank, (0, 0), (-0.075, 0)))
    mechanism.add(Revolute("pin", crank, rod, (0.075, 0), (-0.175, 0)))
    mechanism.add(Revolute("wrist", rod, slider, (0.175, 0), (0, 0)))
    mechanism.add(Prismatic("way", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.output("x", slider.position[0], units="m")
    mechanism.output("speed", crank.angular_velocity, units="rad/s")
    return mechanism


def pendulum():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0.5, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    mechanism.output("x", rod.position[0], units="m")
    mechanism.output("speed", rod.angular_velocity, units="rad/s")
    return mechanism


def largest(found, exact):
    """Return the largest error of all outputs, each over its largest value."""
    return max(float(np.abs(found[name] - np.asarray(exact[name])).max() / np.abs(exact[name]).max()) for name in exact)


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_free_rotor_in_ten_turns(rtol):
    found = uqmbd.simulate(rotor(), TIMES, rtol=rtol, integrator="ida", check=False)
    assert largest(found, nutation(TIMES)) < MOST * rtol


@pytest.mark.thorough
@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_rotor_is_as_accurate_beside_what_rests(rtol):
    """The norm of errors is an average, which bodies at rest must not lower."""
    found = uqmbd.simulate(rotor(still=12), TIMES, rtol=rtol, integrator="ida", check=False)
    assert largest(found, nutation(TIMES)) < MOST * rtol


@pytest.mark.thorough
@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("make", [governor, slider_crank, pendulum])
def test_mechanisms_that_turn_and_swing(make, rtol):
    """Against the explicit method, which is of order 8, at a tolerance far below."""
    times = TIMES if make is not slider_crank else TIMES / 2
    mechanism = make()
    exact = uqmbd.simulate(mechanism, times, rtol=1e-12, integrator="dop853", check=False)
    found = uqmbd.simulate(mechanism, times, rtol=rtol, integrator="ida", check=False)
    assert largest(found, exact.data_vars) < MOST * rtol


@pytest.mark.thorough
def test_the_projected_motion_of_a_random_rotor():
    """The mean of Galerkin by IDA: coefficients of higher terms, which are small, must not hide the errors of the first."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6.28, 6.29), units="rad/s")
    times, rtol = TIMES[:51], 1e-6
    study = uqmbd.Study("rotors", rotor(speed), times, rtol=rtol)
    node = study.propagate(Galerkin(order=4, integrator="ida", verify=0))
    assert node.attrs["integrated_by"] == "ida"
    points, weights = np.polynomial.legendre.leggauss(12)
    each = [nutation(times, 6.285 + 0.005 * x) for x in points]
    mean = node["statistics/mean"]
    exact = {name: sum(w / 2 * one[name] for w, one in zip(weights, each, strict=True)) for name in each[0]}
    assert largest({name: mean.sel(output=name).values for name in exact}, exact) < MOST * rtol
