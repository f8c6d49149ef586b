"""Contacts whose friction comes to its limit at the same instant are decided together."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.optimize
import sympy

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.contact.coulomb import Touch
from uqmbd.dynamics.contact.evaluator import ContactQuantities
from uqmbd.dynamics.contact.limits import contacts_at_limit, slipping_together
from uqmbd.dynamics.contact.persistent import ContactModes, contact_motion
from uqmbd.dynamics.contact.redundant import HELD, forces_with_largest_reserve, motionless_combinations, reserves
from uqmbd_contact import PlaneContact, PlaneImpact
from uqmbd_springs import PointForce

from .stacks import random_stack, sliding_stack

G, RATE = 9.81, 10.0


def pushed_way(mu, times, rate=RATE):
    """Displacement of a mass of 1 kg that a force `rate` t pushes over a floor: it begins to slip at mu g / rate."""
    start = mu * G / rate
    late = np.maximum(0, times - start)
    return rate * (late**3 / 6 + start * late**2 / 2) - mu * G * late**2 / 2


def particles(frictions):
    mechanism = uqmbd.Mechanism("particles", uqmbd.Translational(gravity=(0, -G)))
    for k, mu in enumerate(frictions):
        body = mechanism.body(f"b{k}", mass=1, position=(k, 0), velocity=(0, 0))
        law = {"restitution": 0, "friction": mu}
        floor = mechanism.add(PlaneImpact(f"c{k}", mechanism.ground, body, (0, 0), (0, 0), (0, 1), **law))
        mechanism.add(PointForce(f"F{k}", body, (0, 0), (RATE * uqmbd.t, 0)))
        mechanism.output(f"slip{k}", floor.event_time("slip"), units="s")
    return mechanism


def box(mu=0.5, restitution=0.0, height=0.0, velocity=(0, 0), feet=(-0.1, 0.1), force=None, contact=PlaneImpact, **law):
    mechanism = uqmbd.Mechanism("box", uqmbd.Planar(gravity=(0, -G)))
    start = {"position": (0, 0.1 + height), "velocity": velocity, "angular_velocity": 0}
    body = mechanism.body("box", mass=1, inertia=0.01, **start)
    law |= {"restitution": restitution} if contact is PlaneImpact else {}
    for k, x in enumerate(feet):
        mechanism.add(contact(f"foot{k}", mechanism.ground, body, (0, 0), (x, -0.1), (0, 1), friction=mu, **law))
    mechanism.add(PointForce("F", body, (0, -0.1), (RATE * uqmbd.t if force is None else force, 0)))
    mechanism.output("x", body.position[0], units="m")
    mechanism.output("y", body.position[1] - 0.1, units="m")
    return mechanism


@pytest.mark.parametrize("difference", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_particles_with_nearly_equal_limits(difference):
    """Each begins to slip when its own friction is at the limit, however close the others are."""
    frictions, times = 0.5 * (1 + difference * np.array([0, 1, -1])), np.linspace(0, 1, 5)
    mechanism = particles(frictions)
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, 1e-8)
    assert found.messages == ("",)
    for k, mu in enumerate(frictions):
        np.testing.assert_allclose(found.states[0, :, 2 * k], k + pushed_way(mu, times), atol=1e-8)
        np.testing.assert_allclose(found.scalars[f"c{k}: slip 1"], mu * G / RATE, rtol=1e-8)
        assert f"c{k}: slip 2" not in found.scalars


def test_a_box_on_two_feet_slips_with_both():
    times = np.linspace(0, 1, 5)
    found = integrate(Ensemble(build(box()), np.zeros((1, 0))), times, 1e-8)
    np.testing.assert_allclose(found.states[0, :, 0], pushed_way(0.5, times), atol=1e-9)
    slips = {name: float(time[0]) for name, time in found.scalars.items() if "slip" in name}
    assert slips == pytest.approx({f"foot{k}: slip 1": 0.5 * G / RATE for k in range(2)}, rel=1e-8)


def stick_slip(force, rate, mu, end):
    """Times of slip and stick of a mass of 1 kg under ``force sin(rate t)``, by the momentum of each slide."""
    slips, sticks, sense, now = [], [], 1.0, 0.0
    while True:
        phase = np.arcsin(mu * G / force) + (0 if sense > 0 else np.pi)
        turns = np.ceil((rate * now - phase) / (2 * np.pi) - 1e-12)
        now = (phase + 2 * np.pi * turns) / rate
        if now > end:
            return slips, sticks
        slips.append(now)

        def speed(t, start=now, sense=sense):
            return sense * force / rate * (np.cos(rate * start) - np.cos(rate * t)) - mu * G * (t - start)

        now = scipy.optimize.brentq(speed, now + 0.3 / rate, now + np.pi / rate, xtol=1e-13)
        if now > end:
            return slips, sticks
        sticks.append(now)
        sense = -sense


@pytest.mark.parametrize("integrator", ["dop853", "radau"])
@pytest.mark.parametrize("intervals", [1, 6])
def test_a_box_that_stops_and_slips_back_does_so_with_all_feet(integrator, intervals):
    """An oscillating force: all feet stick and slip together, as often and at the times as a mass in closed form."""
    mechanism = box(0.5, feet=(-0.1, 0.02, 0.1), force=8 * sympy.sin(4 * uqmbd.t))
    times = np.linspace(0, 3, 1 + intervals)
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, 1e-8, integrator)
    assert found.messages == ("",)
    for label, expected in zip(("slip", "stick"), stick_slip(8, 4, 0.5, 3), strict=True):
        for k in range(3):
            moments = [t[0] for name, t in found.scalars.items() if name.startswith(f"foot{k}: {label}")]
            np.testing.assert_allclose(moments, expected, atol=1e-7)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_box_dropped_flat_on_its_feet(restitution):
    """Friction brakes the box by mu times the impulse across in each impact; it does not turn."""
    mu, drop, speed = 0.1, 0.2, 2.0
    times = np.linspace(0, 0.8, 33)
    mechanism = box(mu, restitution, drop, (speed, 0), feet=(-0.5, 0.5), force=0)
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, 1e-8)
    assert found.messages == ("",)
    x, now, hit, v = np.zeros_like(times), np.sqrt(2 * drop / G), np.sqrt(2 * drop * G), speed
    x[:] = speed * times
    while restitution and hit > 1e-9 and now < times[-1]:
        x -= mu * (1 + restitution) * hit * np.maximum(0, times - now)
        v -= mu * (1 + restitution) * hit
        hit *= restitution
        now += 2 * hit / G
    if not restitution:
        x -= mu * hit * np.maximum(0, times - now)
        v -= mu * hit
    late = np.maximum(0, times - now)
    x -= mu * G * late**2 / 2
    assert v > mu * G * late[-1], "it slides to the end"
    np.testing.assert_allclose(found.states[0, :, 0], x, atol=2e-6)
    np.testing.assert_allclose(found.states[0, :, 2:4], [[1, 0]] * len(times), atol=1e-9)
    impacts = [[t[0] for name, t in found.scalars.items() if name.startswith(f"foot{k}: impact")] for k in range(2)]
    np.testing.assert_allclose(*impacts, rtol=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("rtol", [1e-5, 3e-6, 1e-6, 1e-7])
@pytest.mark.parametrize("legs", [3, 4, 5])
def test_a_table_that_is_pushed_obliquely(legs, rtol):
    """However the load is shared among the legs, the table slips when all of them are at their limit."""
    rng, mu, times = np.random.default_rng(legs), 0.5, np.linspace(0, 1, 5)
    mechanism = uqmbd.Mechanism("table", uqmbd.Spatial(gravity=(0, 0, -G)))
    start = {"position": (0, 0, 0.1), "velocity": (0, 0, 0), "angular_velocity": (0, 0, 0)}
    body = mechanism.body("top", mass=1, inertia=(0.01,) * 3, **start)
    angles = 2 * np.pi * np.arange(legs) / legs + rng.uniform(0, 0.5, legs)
    for k, (a, r) in enumerate(zip(angles, rng.uniform(0.2, 0.3, legs), strict=True)):
        place = (r * np.cos(a), r * np.sin(a), -0.1)
        law = {"restitution": 0, "friction": mu}
        mechanism.add(PlaneImpact(f"leg{k}", mechanism.ground, body, (0, 0, 0), place, (0, 0, 1), **law))
    along = np.array([np.cos(0.7), np.sin(0.7), 0])
    mechanism.add(PointForce("F", body, (0, 0, -0.05), tuple(x * RATE * uqmbd.t for x in along.tolist())))
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, rtol)
    assert found.messages == ("",) and found.counters.steps < 5000
    # the direction of sliding is stiff where it begins
    expected = pushed_way(mu, times)[:, None] * along + [0, 0, 0.1]
    np.testing.assert_allclose(found.states[0, :, :3], expected, atol=100 * rtol)
    for k in range(legs):
        np.testing.assert_allclose(found.scalars[f"leg{k}: slip 1"], mu * G / RATE, rtol=1e-8)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["ramp", "wave", "together", "shaken"])
@pytest.mark.parametrize(
    ("space", "count"),
    [(uqmbd.Translational, 3), (uqmbd.Planar, 2), pytest.param(uqmbd.Spatial, 1, marks=pytest.mark.slow)],
)
def test_random_stacks_move_as_by_another_method(space, count, kind):
    rng, times = np.random.default_rng(7), np.linspace(0, 1.2, 13)
    for _ in range(count):
        stack = random_stack(space, rng, 1 if space is uqmbd.Spatial else int(rng.integers(1, 4)), 3, kind)
        found = integrate(Ensemble(build(stack.mechanism), np.zeros((1, 0))), times, 1e-8)
        assert found.messages == ("",)
        moved = stack.displacements(found.states[0])
        np.testing.assert_allclose(moved - moved[0], sliding_stack(stack, times), atol=1e-5)


def test_realisations_with_equal_and_with_other_limits():
    """Random frictions, some of them equal: each realisation as in closed form, and to the bit as alone."""
    names = [uqmbd.RandomVariable(f"mu{k}", chaospy.Uniform(0.2, 0.6)) for k in range(2)]
    mechanism, times = particles(names), np.linspace(0, 1, 5)
    values = np.random.default_rng(3).uniform(0.2, 0.6, (12, 2))
    values[::2, 1] = values[::2, 0] * (1 + np.array([0, 0, 1e-14, 1e-12, 1e-10, 1e-8]))
    values = values[:, [mechanism.inputs.names.index(f"mu{k}") for k in range(2)]]
    model = build(mechanism)
    found = integrate(Ensemble(model, values), times, 1e-8)
    assert not any(found.messages)
    for k in range(2):
        ways = [pushed_way(mu, times) for mu in values[:, mechanism.inputs.names.index(f"mu{k}")]]
        np.testing.assert_allclose(found.states[:, :, 2 * k] - k, ways, atol=1e-8)
    for m in (0, 5):
        alone = integrate(Ensemble(model, values[m : m + 1]), times, 1e-8)
        assert alone.states.tobytes() == found.states[m : m + 1].tobytes()


@pytest.mark.thorough
def test_compliant_feet_slide_together():
    """With friction by `PlaneContact`, which creeps: the same way within the speed below which friction is viscous."""
    times, slow = np.linspace(0, 1, 5), 1e-4
    mechanism = box(0.5, contact=PlaneContact, law="kelvin-voigt", stiffness=1e4, damping=100, slow=slow)
    found = uqmbd.simulate(mechanism, times)
    np.testing.assert_allclose(found["x"], pushed_way(0.5, times), atol=5e-3)


# -- the problems behind -----------------------------------------------------------------------------------------------
def test_roomiest_forces_are_those_of_linear_programming():
    """Bodies on feet in the plane: the least reserve, over the size of each contact, is nearly the largest one."""
    rng, inside = np.random.default_rng(2), 0
    for _ in range(40):
        count = int(rng.integers(2, 6))
        touches = [Touch(2 * k, (2 * k + 1,), rng.uniform(0.1, 1)) for k in range(count)]
        mu = np.array([x.friction for x in touches])
        rows = np.array([r for x in rng.normal(size=count) for r in ((0, 1, x), (1, 0, -1))])
        given, scale = np.zeros(2 * count), 10 ** rng.uniform(-3, 3)
        given[::2] = scale * rng.uniform(0.1, 2, count)
        given[1::2] = mu * given[::2] * rng.uniform(0.6, 1.2, count)
        ways = motionless_combinations(rows @ rows.T, np.eye(2 * count))
        np.testing.assert_allclose(rows.T @ ways, 0, atol=1e-9)
        least = given - ways @ np.linalg.lstsq(ways, given, rcond=None)[0]
        force = forces_with_largest_reserve(touches, least, ways)
        np.testing.assert_allclose(rows.T @ force, rows.T @ given, atol=1e-7 * scale)
        sizes = mu * np.maximum(np.abs(least[::2]), 1e-6 * np.abs(least).max())
        limits = [
            np.append(sense * ways[2 * k + 1] - HELD * mu[k] * ways[2 * k], HELD * sizes[k])
            for k in range(count)
            for sense in (1, -1)
        ]
        most = [HELD * mu[k] * least[2 * k] - sense * least[2 * k + 1] for k in range(count) for sense in (1, -1)]
        bounds = [(None, None)] * ways.shape[1] + [(None, 1)]
        best = scipy.optimize.linprog([*np.zeros(ways.shape[1]), -1], limits, most, bounds=bounds).x[-1]
        room = (reserves(touches, force) / sizes).min()
        if best > 1e-8:
            inside += 1
            assert room > 0.4 * best
        else:
            assert room < 1e-8
    assert 10 < inside < 40


def contacts_of(delassus, free, mu):
    """Contacts in the plane at one state, of which only forces and accelerations matter."""
    count = len(mu)
    zero = np.zeros((1, 2 * count))
    law = np.column_stack([np.zeros(count), mu])[None]
    first = tuple(range(0, 2 * count + 1, 2))
    n = len(free)
    return ContactQuantities(
        np.zeros((1, count)), first, law, zero, zero, np.eye(n)[None], np.array(free, dtype=float)[None],
        np.array(delassus, dtype=float)[None], np.array(delassus, dtype=float)[None],
    )  # fmt: skip


@pytest.mark.parametrize("coupled", [0.0, 0.9])
def test_which_of_two_contacts_slip_follows_from_the_rates(coupled):
    """Brute force over sticking and slipping, a short time after both have come to their limits."""
    rng, mu, counts = np.random.default_rng(4), np.array([0.5, 0.5]), {}
    along = np.array([[1, coupled], [coupled, 1]])
    delassus = np.zeros((4, 4))
    delassus[np.ix_([0, 2], [0, 2])], delassus[np.ix_([1, 3], [1, 3])] = np.eye(2), along
    held = ContactModes({0: "stick", 1: "stick"}, {})
    for _ in range(60):
        normal, rates = np.array([2.0, 3.0]), rng.normal(size=4)
        force = np.array([normal[0], -HELD * mu[0] * normal[0], normal[1], -HELD * mu[1] * normal[1]])
        free = -delassus @ force
        now, ahead = contacts_of(delassus, free, mu), contacts_of(delassus, free + 1e-7 * rates, mu)
        motion = contact_motion(now, held)
        assert contacts_at_limit(now, held, motion.force[0]) == [0, 1]
        found = slipping_together(now, ahead, held, motion, [0, 1], ())
        # rates of the normal forces are known; friction acts against a sliding along the first direction
        drive = rates[[1, 3]] + along @ (mu * rates[[0, 2]])
        fits = []
        for slips in ([], [0], [1], [0, 1]):
            sticks = [k for k in range(2) if k not in slips]
            reserve = np.zeros(2)
            reserve[sticks] = np.linalg.solve(along[np.ix_(sticks, sticks)], -drive[sticks])
            if (reserve >= 0).all() and ((drive + along @ reserve)[slips] >= 0).all():
                fits.append(slips)
        (expected,) = fits
        # an event has told that something slips: where nothing does, all are let go
        assert list(found) == (expected or [0, 1])
        assert all(x == pytest.approx([1.0]) for x in found.values())
        counts[tuple(expected)] = counts.get(tuple(expected), 0) + 1
    assert len(counts) == 4


def test_no_combination_that_satisfies_the_laws_is_reported():
    """Friction that accelerates what it should brake: neither sticking nor slipping is consistent."""
    delassus = np.diag([1.0, -1.0, 1.0, -1.0])
    mu, force = np.array([0.5, 0.5]), np.array([2.0, -1.0, 2.0, -1.0])
    held, free = ContactModes({0: "stick", 1: "stick"}, {}), -delassus @ force
    now = contacts_of(delassus, free, mu)
    ahead = contacts_of(delassus, free - 1e-7 * np.array([0, 1.0, 0, 1.0]), mu)
    assert slipping_together(now, ahead, held, contact_motion(now, held), [0, 1], ()) is None
