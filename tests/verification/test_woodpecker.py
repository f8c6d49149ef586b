"""The woodpecker toy: three unilateral contacts with friction that close and open in turn.

The equations and numbers are those of C. Glocker and F. Pfeiffer, as in R. I. Leine, C. Glocker, D. H. van Campen,
Nonlinear dynamics of the woodpecker toy, Proceedings of DETC 2001: a sleeve with play on a vertical pole, and a bird on
a spring; the coordinates are the height and two small angles.
"""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_joints import PointOnLine, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import TorsionSpringDamper

M_SLEEVE, M_BIRD, J_SLEEVE, J_BIRD = 3e-4, 4.5e-3, 5e-9, 7e-7
SPRING, G, FRICTION, BEAK = 0.0056, 9.81, 0.3, 0.5
R_POLE, R_SLEEVE, H_SLEEVE = 0.0025, 0.0031, 0.0058
L_HINGE, L_BIRD, H_BEAK, L_BEAK = 0.010, 0.015, 0.02, 0.0201
TOLERANCES = [1e-4, 1e-6, 1e-8, 1e-10]
LITTLE = 1e-7
"""Masses of the points that carry the coordinates; they are taken off again."""


class Toy(uqmbd.Component):
    """The toy in its three coordinates: height and angle of the sleeve are those of one point, the bird's of another."""

    bodies = ("sleeve", "bird")
    inertia_sleeve = uqmbd.Parameter("kg m^2", "of the sleeve")
    inertia_bird = uqmbd.Parameter("kg m^2", "of the bird")

    def terms(self, p):
        (height, tilt), bow = p.sleeve.position, p.bird.position[0]
        (speed, tilting), bowing = p.sleeve.velocity, p.bird.velocity[0]
        bird = speed + L_HINGE * tilting + L_BIRD * bowing
        spurious = LITTLE * (speed**2 + tilting**2 + bowing**2)
        turning = p.inertia_sleeve * tilting**2 + p.inertia_bird * bowing**2
        yield uqmbd.Kinetic((M_SLEEVE * speed**2 + M_BIRD * bird**2 + turning - spurious) / 2)
        weight = G * (M_SLEEVE * height + M_BIRD * (height + L_HINGE * tilt + L_BIRD * bow))
        yield uqmbd.Potential(SPRING * (tilt - bow) ** 2 / 2 + weight)
        play, below = R_SLEEVE - R_POLE, speed + R_SLEEVE * tilting
        beak = speed + L_HINGE * tilting + (L_BIRD - L_BEAK) * bowing
        for label, gap, sliding, restitution in (
            ("beak", L_HINGE + L_BIRD - L_BEAK - R_POLE - H_BEAK * bow, beak, BEAK),
            ("lower", play + H_SLEEVE * tilt, below, 0),
            ("upper", play - H_SLEEVE * tilt, below, 0),
        ):
            yield uqmbd.Event(gap, uqmbd.extend.Impact(p.rate_of(gap), restitution, [sliding], FRICTION), label)


def inertia(name, mean, spread):
    return uqmbd.RandomVariable(name, chaospy.Uniform((1 - spread) * mean, (1 + spread) * mean))


def small_angles(spread=0.1, strokes=0):
    """Equations of the paper, from nearly its point of the limit cycle; with times at which the beak strikes."""
    mechanism = uqmbd.Mechanism("woodpecker", uqmbd.Translational())
    sleeve = mechanism.body("sleeve", mass=LITTLE, position=(0, -0.1034), velocity=(-0.3411, 0))
    bird = mechanism.body("bird", mass=LITTLE, position=(-0.2788, 0), velocity=(-7.4583, 0))
    toy = mechanism.add(Toy("toy", sleeve, bird, inertia("J_M", J_SLEEVE, spread), inertia("J_S", J_BIRD, spread)))
    mechanism.output("height", sleeve.position[0], units="m")
    mechanism.output("tilt", sleeve.position[1])
    mechanism.output("bow", bird.position[0])
    for k in range(1, strokes + 1):
        mechanism.output(f"stroke{k}", toy.event_time("beak", k), units="s")
    return mechanism


def large_angles(spread=0.1):
    """The same toy of bodies, joints and impacts, with its true kinematics."""
    tilt = -0.1
    mechanism = uqmbd.Mechanism("woodpecker of bodies", uqmbd.Planar(gravity=(0, -G)))
    sleeve = mechanism.body(
        "sleeve",
        mass=M_SLEEVE,
        inertia=inertia("J_M", J_SLEEVE, spread),
        position=(0, 0),
        angle=tilt,
        velocity=(0, -0.3411),
        angular_velocity=0,
    )
    bird = mechanism.body(
        "bird",
        mass=M_BIRD,
        inertia=inertia("J_S", J_BIRD, spread),
        com=(L_BIRD, 0),
        position=(L_HINGE * np.cos(tilt), L_HINGE * np.sin(tilt)),
        angle=-0.25,
        velocity=(0, -0.3411),
        angular_velocity=-7.4583,
    )
    ground, pole, right = mechanism.ground, (R_POLE, 0), (1, 0)
    mechanism.add(PointOnLine("pole", ground, sleeve, (0, 0), (0, 0), (0, 1)))
    mechanism.add(Revolute("hinge", sleeve, bird, (L_HINGE, 0), (0, 0)))
    mechanism.add(TorsionSpringDamper("spring", sleeve, bird, stiffness=SPRING))
    for name, body, point, restitution in (
        ("beak", bird, (L_BIRD - L_BEAK, H_BEAK), BEAK),
        ("lower", sleeve, (R_SLEEVE, -H_SLEEVE), 0),
        ("upper", sleeve, (R_SLEEVE, H_SLEEVE), 0),
    ):
        law = {"restitution": restitution, "friction": FRICTION}
        mechanism.add(PlaneImpact(name, ground, body, pole, point, right, **law))
    mechanism.output("height", sleeve.position[1], units="m")
    mechanism.output("tilt", sleeve.angle)
    mechanism.output("bow", bird.angle)
    return mechanism


def check_none_lost(make, end, samples, rtol):
    times = np.linspace(0, end, 21)
    study = uqmbd.Study("toys", make(), times, MonteCarlo(samples=samples, seed=1), rtol=rtol)
    data = study.run()["monte-carlo/samples"].to_dataset()
    assert (data["status"] == 0).all()
    response = data["response"]
    assert np.isfinite(response).all()
    # it comes down in the end, and no part goes through the pole
    assert (response.sel(output="height").isel(time=-1) < -0.05 * end).all()
    play = (R_SLEEVE - R_POLE) / H_SLEEVE
    assert np.abs(response.sel(output="tilt")).max() < 1.02 * play


@pytest.mark.thorough
@pytest.mark.parametrize("rtol", [1e-4, pytest.param(1e-8, marks=pytest.mark.thorough)])
def test_no_sample_of_the_woodpecker_is_lost(rtol):
    check_none_lost(small_angles, 0.3, 2, rtol)


@pytest.mark.thorough
def test_no_sample_of_a_woodpecker_of_bodies_is_lost():
    check_none_lost(large_angles, 0.2, 2, 1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("make", [small_angles, large_angles])
def test_no_sample_of_many_woodpeckers_is_lost_in_a_second(make, rtol):
    check_none_lost(make, 1, 40, rtol)


def strokes(count):
    mechanism = small_angles(1e-9, count)
    data = uqmbd.simulate(mechanism, [0, 0.15 * count], rtol=1e-8)
    return np.array([float(data[f"stroke{k}"]) for k in range(1, count + 1)])


@pytest.mark.thorough
def test_the_woodpecker_comes_to_a_limit_cycle():
    """It pecks every 0.146 s, as time stepping says (see below), again and again."""
    np.testing.assert_allclose(np.diff(strokes(3)), 0.146, rtol=3e-3)


@pytest.mark.slow
def test_the_woodpecker_pecks_when_time_stepping_says():
    """Moreau's time stepping, whose error is of first order, knows neither events nor our laws of impact."""
    np.testing.assert_allclose(stepped(2e-5, 0.4), strokes(3), atol=1e-3)


def stepped(step, end):
    """Times of strokes of the beak, by Moreau's midpoint rule with sweeps of projections."""
    mass = np.array(
        [
            [M_SLEEVE + M_BIRD, M_BIRD * L_HINGE, M_BIRD * L_BIRD],
            [M_BIRD * L_HINGE, J_SLEEVE + M_BIRD * L_HINGE**2, M_BIRD * L_HINGE * L_BIRD],
            [M_BIRD * L_BIRD, M_BIRD * L_HINGE * L_BIRD, J_BIRD + M_BIRD * L_BIRD**2],
        ]
    )
    inverse = np.linalg.inv(mass)
    across = np.array([[0, 0, -H_BEAK], [0, H_SLEEVE, 0], [0, -H_SLEEVE, 0]])
    along = np.array([[1, L_HINGE, L_BIRD - L_BEAK], [1, R_SLEEVE, 0], [1, R_SLEEVE, 0]])
    gaps = np.array([L_HINGE + L_BIRD - L_BEAK - R_POLE, R_SLEEVE - R_POLE, R_SLEEVE - R_POLE])
    q, v, found, was = np.array([0, -0.1034, -0.2788]), np.array([-0.3411, 0, -7.4583]), [], False
    for k in range(round(end / step)):
        middle = q + step / 2 * v
        torque = SPRING * (middle[1] - middle[2])
        force = -np.array([M_SLEEVE + M_BIRD, M_BIRD * L_HINGE, M_BIRD * L_BIRD]) * G + [0, -torque, torque]
        new = v + step * inverse @ force
        closed = np.flatnonzero(gaps + across @ middle <= 0)
        if len(closed):
            count = len(closed)
            rows = np.vstack([across[closed], along[closed]])
            matrix, speed = rows @ inverse @ rows.T, rows @ new
            speed[:count] += np.array([BEAK, 0, 0])[closed] * (across[closed] @ v)
            impulse = np.zeros(2 * count)
            for _ in range(2000):
                old = impulse.copy()
                for j in range(count):
                    n, t = j, count + j
                    impulse[n] = max(0.0, impulse[n] - (speed[n] + matrix[n] @ impulse) / matrix[n, n])
                    most = FRICTION * impulse[n]
                    impulse[t] = np.clip(impulse[t] - (speed[t] + matrix[t] @ impulse) / matrix[t, t], -most, most)
                if np.abs(impulse - old).max() <= 1e-12 * np.abs(impulse).max():
                    break
            new = new + inverse @ rows.T @ impulse
        if 0 in closed and not was:
            found.append(k * step)
        was = 0 in closed
        q, v = middle + step / 2 * new, new
    return found
