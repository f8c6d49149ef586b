"""Bodies that rest on more contacts than hold them: forces are not unique, and those that the laws allow are found."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize

import uqmbd
from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.persistent import persistent_contacts
from uqmbd_contact import PlaneImpact
from uqmbd_springs import Torque

MASS, RADIUS, INERTIA, GRAVITY = 2.0, 0.1, 0.008, (-4.0, -9.0)


def holding(rows, applied, mu):
    """Force at rest, by linear programming, with the most room inside the cones: forces and that room, N."""
    size = rows.shape[0]
    limits, most = [], []
    for k, friction in enumerate(mu):
        for sense in (1, -1):
            limit = np.zeros(size + 1)
            limit[2 * k], limit[2 * k + 1], limit[-1] = -friction, sense, 1
            limits.append(limit)
            most.append(0.0)
    bounds = [(0, 1e3) if k % 2 == 0 else (None, None) for k in range(size)] + [(None, 1.0)]
    goal = np.append(np.zeros(size), -1.0)
    balance = np.column_stack([rows.T, np.zeros(3)])
    found = scipy.optimize.linprog(goal, limits, most, balance, -applied, bounds)
    return (found.x[:-1], found.x[-1]) if found.status == 0 else (None, -np.inf)


@pytest.mark.thorough
def test_forces_on_a_disc_in_a_vee_satisfy_the_laws():
    """At rest, with any load: balance, cones, no penetration; a disc that stays could do so by linear programming."""
    rng, rests, wedged, mass = np.random.default_rng(5), 0, 0, np.diag([MASS, MASS, INERTIA])
    for _ in range(400):
        slopes, mu = rng.uniform([0.1, 1.7], [1.4, 3.0]), rng.uniform(0.05, 0.9, 2)
        rows = np.array([r for a in slopes for r in ((np.cos(a), np.sin(a), 0), (np.sin(a), -np.cos(a), -RADIUS))])
        applied = np.append(rng.normal(size=2) * 20, rng.normal() * 0.5) + (0, -20, 0)
        free, answer = np.linalg.solve(mass, applied), np.linalg.solve(mass, rows.T)
        found = persistent_contacts(
            ContactQuantities(
                np.zeros((1, 2)), (0, 2, 4), np.column_stack([0 * mu, mu])[None], np.zeros((1, 4)), np.zeros((1, 4)),
                rows[None], free[None], answer[None], (rows @ answer)[None],
            ),
            [0, 1], 1e-6,
        )  # fmt: skip
        assert found is not None
        (modes, headings, _), motion, _ = found
        force, rate, size = motion.force[0], rows @ motion.motion[0], np.abs(applied).max()
        # internal forces move nothing
        np.testing.assert_allclose(mass @ motion.motion[0] - applied, rows.T @ force, atol=1e-8 * size)
        for k in range(2):
            normal, friction = force[2 * k], force[2 * k + 1]
            assert normal >= 0 and rate[2 * k] >= -1e-8 * size
            assert abs(friction) <= mu[k] * normal * (1 + 1e-8) + 1e-9 * size
            if modes.get(k) == "stick":
                assert abs(rate[2 * k + 1]) < 1e-7 * size
            elif k in modes:
                assert rate[2 * k + 1] * headings[k][0] > -1e-7 * size
                np.testing.assert_allclose(friction, -mu[k] * normal * headings[k][0], atol=1e-8 * size)
        _, room = holding(rows, applied, mu)
        if list(modes.values()) == ["stick", "stick"]:
            assert room > -1e-6 * size
            rests += 1
            least = np.linalg.lstsq(rows.T, -applied, rcond=1e-11)[0]
            wedged += bool(np.any(np.abs(least[1::2]) > mu * least[::2]))
        else:
            assert np.abs(motion.motion[0]).max() > 1e-7 * size
    assert rests > 50 and wedged > 20, "some rest only since they are wedged"


# -- a disc and a ball in a right-angled corner that a growing torque turns ------------------------------------------
def turned(space, torque, mu):
    """A disc, or a ball between two planes, at rest in a corner; `torque` is counter-clockwise."""
    flat = space is uqmbd.Planar
    mechanism = uqmbd.Mechanism("turned", space(gravity=GRAVITY if flat else (GRAVITY[0], 0, GRAVITY[1])))
    place = (RADIUS, RADIUS) if flat else (RADIUS, 0, RADIUS)
    body = mechanism.body("body", mass=MASS, inertia=INERTIA if flat else (INERTIA,) * 3, position=place)
    mechanism.add(Torque("motor", body, torque if flat else (0, -torque, 0)))
    zero, contacts = (0, 0) if flat else (0, 0, 0), []
    for name, up in (("floor", (0, 1)), ("wall", (1, 0))):
        up = up if flat else (up[0], 0, up[1])
        contacts.append(PlaneImpact(name, mechanism.ground, body, zero, zero, up, RADIUS, restitution=0.3, friction=mu))
        mechanism.add(contacts[-1])
        mechanism.output(name, contacts[-1].event_time("slip"), units="s")
    mechanism.output("spin", body.angular_velocity if flat else -body.angular_velocity[1], units="rad/s")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
@pytest.mark.parametrize(("sense", "mu"), [(1, 0.2), (1, 0.7), (-1, 0.3)])
def test_a_body_in_a_corner_turns_when_no_friction_holds_it(space, sense, mu):
    """Both contacts slip when both are at the limit of friction: two equations for their normal forces."""
    floor, wall = np.linalg.solve([[1, sense * mu], [-sense * mu, 1]], [-GRAVITY[1] * MASS, -GRAVITY[0] * MASS])
    most, rate = mu * RADIUS * (floor + wall), 2.0
    when, end = most / rate, 1.3 * most / rate
    data = uqmbd.simulate(turned(space, sense * rate * uqmbd.t, mu), np.linspace(0, end, 14), rtol=1e-8)
    np.testing.assert_allclose([data.floor, data.wall], when, rtol=1e-6)
    late = np.maximum(0, data.time - when)
    np.testing.assert_allclose(data.spin, sense * rate * late**2 / 2 / INERTIA, atol=1e-5)
