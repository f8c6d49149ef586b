"""Events of many realisations, which run eight at once: times in closed form, and the same bits in any company."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.integrate
import sympy

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.integrators import integrator_class
from uqmbd_contact import PlaneImpact
from uqmbd_drivers import PositionDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import SpringDamper

G = 9.81


def number(name, low, high):
    return uqmbd.RandomVariable(name, chaospy.Uniform(low, high))


def values_of(mechanism, count, seed=0):
    return mechanism.inputs.from_uniform(np.random.default_rng(seed).uniform(size=(count, len(mechanism.inputs))))


def bouncing():
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -G)))
    body = mechanism.body("ball", mass=1, position=(0, number("h", 0.5, 1.5)))
    law = {"restitution": number("e", 0.3, 0.85)}
    mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), **law))
    return mechanism


def test_balls_bounce_when_they_should_and_come_to_rest():
    """Impacts at sqrt(2 h / g) (1 + 2 e + ... + 2 e^(n-1)), rest at their limit, and apexes of e^(2 n) h."""
    mechanism = bouncing()
    values, times = values_of(mechanism, 21), np.linspace(0, 8, 41)
    found = integrate(Ensemble(build(mechanism), values), times, 1e-6)
    assert not any(found.messages)
    h, e = (values[:, mechanism.inputs.names.index(name)] for name in ("h", "e"))
    first = np.sqrt(2 * h / G)
    for n in range(1, 8):
        expected = first * (1 + 2 * sum(e**k for k in range(1, n)))
        np.testing.assert_allclose(found.scalars[f"floor: impact {n}"], expected, rtol=1e-12)
    np.testing.assert_allclose(found.scalars["floor: rest 1"], first * (1 + e) / (1 - e), rtol=1e-5)
    assert np.abs(found.states[:, -1]).max() < 1e-11
    # between the first two impacts
    since = times[None] - first[:, None]
    flying = (since > 0) & (since < 2 * (e * first)[:, None])
    height = since * (e * G * first)[:, None] - G * since**2 / 2
    assert np.abs(found.states[..., 1] - height)[flying].max() < 1e-12


@pytest.mark.parametrize("name", ["disc", "rod", "corner", "ball"])
def test_nobody_depends_on_the_company(falling, name):
    """States and times of events, to the bit: alone, and among others in another order, which stick, slip or fly."""
    mechanism = falling(name)
    values, times = values_of(mechanism, 11, seed=3), np.linspace(0, 0.6, 13)
    model = build(mechanism)
    every = integrate(Ensemble(model, values), times, 1e-6)
    assert every.counters.events > 11
    order = np.random.default_rng(1).permutation(11)[:9]
    some = integrate(Ensemble(model, values[order]), times, 1e-6)
    assert some.states.tobytes() == every.states[order].tobytes()
    for name, moments in every.scalars.items():
        if name in some.scalars:
            np.testing.assert_array_equal(some.scalars[name], moments[order])
        else:
            assert np.isnan(moments[order]).all()
    for k in (0, 7):
        alone = integrate(Ensemble(model, values[k : k + 1]), times, 1e-6)
        assert alone.states.tobytes() == every.states[k : k + 1].tobytes()


def test_rods_come_to_lie_flat(falling):
    """With both ends on the ground, exactly along x, where a pivot of the elimination may vanish."""
    mechanism = falling("rod")
    values, times = values_of(mechanism, 24, seed=5), np.linspace(0, 1.5, 31)
    found = integrate(Ensemble(build(mechanism), values), times, 1e-6)
    assert not any(found.messages) and np.isfinite(found.states).all()
    flat = np.isfinite(found.scalars["end0: rest 1"]) & np.isfinite(found.scalars["end1: rest 1"])
    assert flat.sum() > 5
    lying = flat & (np.abs(found.states[:, -1, -2:]).max(axis=1) < 1e-9)
    assert lying.sum() > 5
    np.testing.assert_allclose(found.states[lying, -1, 1], 0, atol=1e-9)


def test_what_follows_a_failure_is_no_number():
    """A body is driven into another, which cannot yield: some realisations end there, the others go on."""
    mechanism = uqmbd.Mechanism("press", uqmbd.Translational())
    ram = mechanism.body("ram", mass=1, position=(0, 1))
    mechanism.add(Prismatic("guide", mechanism.ground, ram, (0, 0), (0, 0), (0, 1), (0, 1)))
    speed = number("v", 0.2, 2)
    mechanism.add(PositionDriver("drive", mechanism.ground, ram, (0, 0), (0, 0), (0, 1), 1 - speed * uqmbd.t))
    mechanism.add(PlaneImpact("anvil", mechanism.ground, ram, (0, 0), (0, 0), (0, 1), restitution=0.5))
    values, times = values_of(mechanism, 13), np.linspace(0, 1, 21)
    found = integrate(Ensemble(build(mechanism), values), times, 1e-6)
    for state, message, v in zip(found.states, found.messages, values[:, 0], strict=True):
        assert bool(message) == (v > 1)
        alive = times < 1 / v if v > 1 else np.full(21, True)
        np.testing.assert_allclose(state[alive, 1], (1 - v * times)[alive], atol=1e-9)
        assert np.isnan(state[~alive]).all()


class Crossing(uqmbd.Component):
    """Notes when a body passes a height downwards."""

    bodies = ("body",)

    def terms(self, p):
        """Yield the event."""
        yield uqmbd.Event(p.body.position[1], label="passing")


def swinging(*, noted):
    """A mass on a spring, which swings with q = a cos(w t)."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational())
    body = mechanism.body("mass", mass=1, position=(0, number("a", 0.5, 1.5)))
    stiffness = number("k", 10, 400)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, (0, 0), (0, 0), stiffness))
    if noted:
        mechanism.add(Crossing("line", body))
    return mechanism


def test_marks_are_noted_without_stops():
    """All passings of an oscillator, and no more evaluations of the motion than interpolation takes."""
    times, counters = np.array([0, 3.0]), []
    for noted in (False, True):
        mechanism = swinging(noted=noted)
        values = values_of(mechanism, 24)
        found = integrate(Ensemble(build(mechanism), values), times, 1e-9, "dop853")
        assert not any(found.messages)
        counters.append(found.counters)
    w = np.sqrt(values[:, mechanism.inputs.names.index("k")])
    for n in range(1, 12):
        expected = (2 * n - 1.5) * np.pi / w
        expected[expected > 3.0] = np.nan
        if np.isfinite(expected).any():
            np.testing.assert_allclose(found.scalars[f"line: passing {n}"], expected, atol=1e-8)
    assert np.isfinite(found.scalars["line: passing 9"]).any()
    assert counters[1].accelerations / counters[1].steps < 1.4 * counters[0].accelerations / counters[0].steps


def test_many_marks_of_one_realisation():
    """More than there is room for at once."""
    mechanism = uqmbd.Mechanism("ruler", uqmbd.Translational())
    body = mechanism.body("body", mass=1, position=(0.01, 0), velocity=(1, 0))

    class Ruler(uqmbd.Component):
        bodies = ("body",)

        def terms(self, p):
            yield uqmbd.Event(sympy.sin(2 * sympy.pi * p.body.position[0] / 0.025), label="line")

    mechanism.add(Ruler("ruler", body))
    ensemble = Ensemble(build(mechanism), np.zeros((1, 0)))
    for end in (1.0, 1.7):
        found = integrate(ensemble, np.linspace(0, end, 3), 1e-6)
        count = int((end + 0.01 - 0.0125) / 0.025) + 1
        moments = [float(found.scalars[f"ruler: line {k}"][0]) for k in range(1, count + 1)]
        np.testing.assert_allclose(moments, 0.0025 + 0.025 * np.arange(count), atol=1e-9)
        assert f"ruler: line {count + 1}" not in found.scalars


def hammer(restitution, friction, speed, height):
    """A pendulum whose end strikes a tilted wall."""
    mechanism = uqmbd.Mechanism("hammer", uqmbd.Planar(gravity=(0, -G)))
    rod = mechanism.body("rod", mass=2, inertia=0.3, position=(0.6, 0), angular_velocity=speed)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.6, 0)))
    law = {"restitution": restitution, "friction": friction}
    mechanism.add(PlaneImpact("wall", mechanism.ground, rod, (0, height), (0.4, 0), (0, 1), 0.05, **law))
    return mechanism


def test_impacts_of_a_pendulum_against_scipy():
    """Angles and times of impacts of a physical pendulum, whose speed at the wall is reversed by restitution."""
    restitution, height, end = 0.7, -0.5, 2.0
    mechanism = hammer(restitution, 0, number("w", -2, 0), height)
    values = values_of(mechanism, 9)
    found = integrate(Ensemble(build(mechanism), values), np.linspace(0, end, 11), 1e-10)
    assert not any(found.messages)
    inertia = 0.3 + 2 * 0.36

    def rate(_, z):
        return [z[1], -2 * G * 0.6 * np.cos(z[0]) / inertia]

    def gap(_, z):
        return np.sin(z[0]) - height - 0.05

    gap.terminal, gap.direction = True, -1
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "events": gap}
    for k, speed in enumerate(values[:, 0]):
        now, z, number_of = 0.0, np.array([0.0, speed]), 0
        while True:
            flown = scipy.integrate.solve_ivp(rate, (now, end), z, **options)
            if flown.status == 0 or number_of > 4:
                break
            now, z = flown.t[-1], flown.y[:, -1] * [1, -restitution]
            number_of += 1
            assert found.scalars[f"wall: impact {number_of}"][k] == pytest.approx(now, abs=1e-8)
        assert number_of > 0
        if flown.status == 0:
            assert found.states[k, -1, 2] == pytest.approx(flown.y[0, -1], abs=1e-7)


@pytest.mark.parametrize("name", ["bouncing", "disc"])
def test_pieces_are_the_motion(falling, name):
    """What `integrate_segments` says at times within its pieces is what an integration says at the same output times."""
    mechanism = bouncing() if name == "bouncing" else falling(name)
    values, model = values_of(mechanism, 1, seed=4), build(mechanism)
    ensemble, end = Ensemble(model, values), 2.0
    motion = integrator_class("dop853")().integrate_segments(ensemble, np.array([0, end]), 1e-8)
    assert motion.message == "" and len(motion.segments) > 2
    assert motion.segments[0].begin == 0 and motion.segments[-1].end == end
    for one, next_one in zip(motion.segments[:-1], motion.segments[1:], strict=True):
        assert one.end == next_one.begin and one.label
    inner = [s.begin + (s.end - s.begin) * np.array([0.2, 0.5, 0.9]) for s in motion.segments if s.end - s.begin > 1e-3]
    pieces = [s.states(x) for s, x in zip([s for s in motion.segments if s.end - s.begin > 1e-3], inner, strict=True)]
    found = integrate(ensemble, np.concatenate([[0.0], *inner, [end]]), 1e-8, "dop853")
    np.testing.assert_array_equal(found.states[0, 1:-1], np.concatenate(pieces))
    # right before and right after an impact
    hit = motion.segments[0]
    before, after = hit.states(np.array([hit.end]))[0], motion.segments[1].states(np.array([hit.end]))[0]
    n = model.layout.coordinates
    np.testing.assert_allclose(before[:n], after[:n], atol=1e-9)
    assert np.abs(before[n:] - after[n:]).max() > 0.1
