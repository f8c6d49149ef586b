"""Compliant contact against the closed forms of reference case A6."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_contact import ClearanceJoint, PlaneContact, RoadContact, SphereContact, distance

TIMES = np.linspace(0, 0.03, 1501)


def impact(speed=1.0, **law):
    """A point mass of 1 kg meets a plane at t = 0, without gravity."""
    mechanism = uqmbd.Mechanism("impact", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, velocity=(0, -speed))
    contact = mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), **law))
    mechanism.output("y", ball.position[1], units="m")
    mechanism.output("v", ball.velocity[1], units="m/s")
    mechanism.output("force", contact.reaction_force[1], units="N")
    return uqmbd.simulate(mechanism, TIMES, rtol=1e-9)


@pytest.mark.thorough
def test_hertz():
    """Depth, duration and greatest force; nothing is lost."""
    data = impact(law="hertz", stiffness=1e6)
    np.testing.assert_allclose(-data.y.min(), 0.00435275281648, rtol=1e-5)
    np.testing.assert_allclose(data.force.max(), 287.17458874925865, rtol=1e-5)
    np.testing.assert_allclose(data.v[-1], 1, rtol=1e-8)
    touching = data.time.values[data.force.values > 0]
    np.testing.assert_allclose(touching[-1], 0.0128113493, atol=2.5e-5)  # the spacing of the times


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("damping", "speed", "after", "depth"),
    [
        (0.1, 1, 0.9374755799498594, 0.0042425389),
        (0.5, 1, 0.7484349315974342, 0.0038925426),
        (1, 2, 0.8214393721220824, 0.0055098321),
    ],
)
def test_hunt_and_crossley(damping, speed, after, depth):
    """The restitution depends neither on stiffness nor on exponent."""
    data = impact(speed, law="hunt-crossley", stiffness=1e6, damping=damping)
    np.testing.assert_allclose(data.v[-1], after, rtol=1e-7)
    np.testing.assert_allclose(-data.y.min(), depth, rtol=1e-4)
    other = impact(speed, law="hunt-crossley", stiffness=3e5, damping=damping, exponent=1.2)
    np.testing.assert_allclose(other.v[-1], after, rtol=1e-6)


@pytest.mark.thorough
def test_kelvin_and_voigt_end_when_the_force_vanishes():
    """The convention without adhesion: restitution 0.744 and duration 0.02956 s, not 0.729."""
    data = impact(law="kelvin-voigt", stiffness=1e4, damping=20)
    np.testing.assert_allclose(data.v[-1], 0.7440793977217797, rtol=1e-7)
    assert float(data.force.min()) >= 0
    touching = data.time.values[data.force.values > 0]
    np.testing.assert_allclose(touching[-1], 0.02956075, atol=2.5e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_a_sliding_sphere_begins_to_roll(space):
    """v0 = 5 m/s, mu = 0.2, r = 0.1 m: time, speed and place at which sliding ends."""
    flat, radius, stiffness = space is uqmbd.Planar, 0.1, 1e6
    height, inertia = radius - 9.81 / stiffness, 0.4 * radius**2
    mechanism = uqmbd.Mechanism("bowling", space(gravity=(0, -9.81) if flat else (0, 0, -9.81)))
    ball = mechanism.body(
        "ball",
        mass=1,
        inertia=inertia if flat else (inertia,) * 3,
        position=(0, height) if flat else (0, 0, height),
        velocity=(5, 0) if flat else (5, 0, 0),
        angular_velocity=0 if flat else (0, 0, 0),
    )
    zero, up = ((0, 0), (0, 1)) if flat else ((0, 0, 0), (0, 0, 1))
    law = {"law": "linear", "stiffness": stiffness, "friction": 0.2, "slow": 1e-4}
    mechanism.add(PlaneContact("floor", mechanism.ground, ball, zero, zero, up, radius=radius, **law))
    mechanism.output("x", ball.position[0], units="m")
    mechanism.output("v", ball.velocity[0], units="m/s")
    spin = -ball.angular_velocity if flat else ball.angular_velocity[1]
    mechanism.output("rim", radius * spin, units="m/s")
    data = uqmbd.simulate(mechanism, [0, 0.7281199941750399, 1], rtol=1e-7)
    np.testing.assert_allclose(data.x[1], 3.1205142607501712, rtol=1e-5)
    np.testing.assert_allclose(data.v[1:], 3.5714285714285716, rtol=1e-4)
    np.testing.assert_allclose(data.rim[2], data.v[2], rtol=1e-5)


def test_spheres_exchange_their_velocities():
    """Equal masses, head on, by Hertz: the first stops, the second leaves with its speed.

    The corner at which contact begins costs accuracy: the error is some hundred times the tolerance (4e-7 at 1e-8).
    """
    mechanism = uqmbd.Mechanism("newton", uqmbd.Spatial())
    first = mechanism.body("first", mass=1, inertia=(1, 1, 1), velocity=(2, 0, 0))
    second = mechanism.body("second", mass=1, inertia=(1, 1, 1), position=(0.31, 0, 0))
    zero = (0, 0, 0)
    mechanism.add(SphereContact("touch", first, second, zero, zero, 0.1, 0.2, law="hertz", stiffness=1e7))
    mechanism.output("a", first.velocity[0], units="m/s")
    mechanism.output("b", second.velocity[0], units="m/s")
    mechanism.output("side", second.velocity[1], units="m/s")
    data = uqmbd.simulate(mechanism, [0, 0.05], rtol=1e-10)
    np.testing.assert_allclose([data.a[1] + data.b[1], data.side[1]], [2, 0], atol=1e-13)
    np.testing.assert_allclose([data.a[1], data.b[1], data.side[1]], [0, 2, 0], atol=1e-6)


def test_oblique_impact_with_friction_changes_spin_by_the_tangential_impulse():
    """While it slides throughout, the tangential impulse is mu times the normal one; and J w = r P_t.

    The corner at which contact begins costs accuracy: the error is up to some hundred times the tolerance.
    """
    radius, mu = 0.1, 0.1
    mechanism = uqmbd.Mechanism("spin", uqmbd.Planar())
    ball = mechanism.body("ball", mass=1, inertia=0.004, position=(0, radius), velocity=(3, -1), angular_velocity=0)
    law = {"law": "hertz", "stiffness": 1e7, "friction": mu, "slow": 1e-5}
    mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), radius=radius, **law))
    for name, x in (("vx", ball.velocity[0]), ("vy", ball.velocity[1]), ("w", ball.angular_velocity)):
        mechanism.output(name, x)
    data = uqmbd.simulate(mechanism, [0, 0.05], rtol=1e-10).isel(time=-1)
    np.testing.assert_allclose(data.vy, 1, rtol=1e-6)
    np.testing.assert_allclose(data.vx, 3 - mu * 2, rtol=1e-6)
    np.testing.assert_allclose(data.w, -mu * 2 * radius / 0.004, rtol=1e-6)


def test_a_bouncing_ball_meets_the_floor_at_the_right_times():
    """Elastic, k = 1e5 N/m: flights of the closed form, half a vibration in between; no output in any contact."""
    stiffness, g = 1e5, 9.81
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -g)))
    ball = mechanism.body("ball", mass=1, position=(0, 1))
    law = {"law": "linear", "stiffness": stiffness}
    mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), **law))
    mechanism.output("height", ball.position[1], units="m")
    w, v0, fall = np.sqrt(stiffness), np.sqrt(2 * g), np.sqrt(2 / g)
    period = 2 * fall + (np.pi + 2 * np.arctan(g / (w * v0))) / w
    for count in (4, 41):
        times = np.linspace(0, 2.4, count)
        phase = np.minimum(times % period, period - times % period)
        free = phase < fall
        data = uqmbd.simulate(mechanism, times)
        np.testing.assert_allclose(data.height.values[free], (1 - g * phase**2 / 2)[free], atol=1e-4)
        assert free.sum() >= count - 2


@pytest.mark.parametrize("integrator", ["ida", "dop853", "radau"])
@pytest.mark.parametrize("law", ["linear", "hertz"])
def test_implicit_and_explicit_integration_agree(integrator, law):
    """Conservative laws, out of contact and in it: speed returns, also where Jacobians are needed."""
    mechanism = uqmbd.Mechanism("impact", uqmbd.Translational())
    ball = mechanism.body("ball", mass=1, position=(0, 0.01), velocity=(0, -1))
    mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), law=law, stiffness=1e5))
    mechanism.output("v", ball.velocity[1], units="m/s")
    data = uqmbd.simulate(mechanism, np.linspace(0, 0.1, 101), rtol=1e-8, integrator=integrator)
    np.testing.assert_allclose(data.v[-1], 1, rtol=1e-5)


def test_a_point_on_a_road():
    """It settles in the valley of a road with random depth, at the depth of contact that carries its weight."""
    depth = uqmbd.RandomVariable("depth", chaospy.Uniform(0.1, 0.3), units="m")
    mechanism = uqmbd.Mechanism("valley", uqmbd.Translational(gravity=(0, -10)))
    ball = mechanism.body("ball", mass=2, position=(0.02, -0.1))
    law = {"law": "kelvin-voigt", "stiffness": 1e4, "damping": 200, "friction": 0.5}
    road = depth * (distance**2 / 2 - 1)
    mechanism.add(RoadContact("road", mechanism.ground, ball, (0, 0), road, **law))
    for name, x in (("x", ball.position[0]), ("y", ball.position[1]), ("v", ball.velocity[1])):
        mechanism.output(name, x)
    for value in (0.15, 0.25):
        data = uqmbd.simulate(mechanism, np.linspace(0, 3, 31), values={"depth": value}).isel(time=-1)
        # within the angle of friction it may rest beside the lowest point
        normal = 20 / np.sqrt(1 + (value * data.x) ** 2)
        sunk = (value * (data.x**2 / 2 - 1) - data.y) / np.sqrt(1 + (value * data.x) ** 2)
        np.testing.assert_allclose(sunk, normal / 1e4, rtol=1e-3)
        assert abs(float(data.v)) < 1e-4


def test_a_road_is_an_expression_of_the_distance():
    ball = uqmbd.Mechanism("x", uqmbd.Translational()).body("ball", mass=1)
    mechanism = uqmbd.Mechanism("valley", uqmbd.Translational())
    ball = mechanism.body("ball", mass=2)
    for road, told in ((sympy.Symbol("way") ** 2, "unknown symbol 'way'"), ("flat", "expected an expression in")):
        with pytest.raises(uqmbd.StudyError, match=told):
            mechanism.add(RoadContact(f"road {told}", mechanism.ground, ball, (0, 0), road))


@pytest.mark.parametrize("space", [uqmbd.Translational, uqmbd.Planar, uqmbd.Spatial])
def test_a_journal_swings_in_its_bearing(space):
    """Small swings of a mass in a smooth bearing: the pendulum of the length of the clearance (and the depth)."""
    clearance, g, stiffness, n = 0.2, 10.0, 1e5, space().dimension
    depth = g / stiffness
    angle = 0.02
    mechanism = uqmbd.Mechanism("bearing", space(gravity=(0,) * (n - 1) + (-g,)))
    arm = clearance + depth
    place = (arm * np.sin(angle), *(0,) * (n - 2), -arm * np.cos(angle))
    inertia = {} if n == 2 and space is uqmbd.Translational else {"inertia": 1 if n == 2 else (1, 1, 1)}
    mass = mechanism.body("mass", mass=1, position=place, velocity=(0,) * n, **inertia)
    law = {"law": "linear", "stiffness": stiffness}
    joint = mechanism.add(ClearanceJoint("pin", mechanism.ground, mass, (0,) * n, (0,) * n, 0.05, clearance, **law))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("force", joint.reaction_force[-1], units="N")
    times = np.linspace(0, 1, 21)
    data = uqmbd.simulate(mechanism, times)
    w = np.sqrt(g / arm)
    np.testing.assert_allclose(data.x, arm * angle * np.cos(w * times), atol=2e-6)
    np.testing.assert_allclose(data.force, g, rtol=5e-3)


def test_a_journal_flies_freely_within_the_clearance():
    mechanism = uqmbd.Mechanism("bearing", uqmbd.Planar(gravity=(0, -10)))
    pin = mechanism.body("journal", mass=1, inertia=1, velocity=(0, 0), angular_velocity=0)
    mechanism.add(ClearanceJoint("pin", mechanism.ground, pin, (0, 0), (0, 0), 0.05, 0.2, law="linear", stiffness=1e6))
    mechanism.output("y", pin.position[1], units="m")
    fall = np.sqrt(2 * 0.2 / 10)
    data = uqmbd.simulate(mechanism, [0, fall / 2, 2 * fall], rtol=1e-9)
    np.testing.assert_allclose(data.y[1], -0.05, rtol=1e-6)
    # thrown back with its speed, after half a vibration in the bearing
    w, v = 1e3, 10 * fall
    contact = (np.pi + 2 * np.arctan(10 / (w * v))) / w
    back = fall - contact
    np.testing.assert_allclose(data.y[2], -0.2 + v * back - 5 * back**2, atol=1e-6)
