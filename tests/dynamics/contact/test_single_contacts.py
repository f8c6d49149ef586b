"""Decisions of the driver about single contacts, as those in Python about any contacts, for random mechanisms."""

import chaospy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.contact.decisions import Decisions
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Revolute

from .python_decisions import compare

TIMES = np.linspace(0, 2, 41)
MODELS = {}
HEIGHT = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")


def double_pendulum(restitution, friction, level):
    """A double pendulum of random length whose tip falls onto a floor."""
    mechanism = uqmbd.Mechanism("double pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    upper = mechanism.body("upper", mass=1, inertia=0.1, position=(HEIGHT / 2, 0))
    lower = mechanism.body("lower", mass=1, inertia=0.1, position=(HEIGHT + 0.5, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, upper, (0, 0), (-HEIGHT / 2, 0)))
    mechanism.add(Revolute("elbow", upper, lower, (HEIGHT / 2, 0), (-0.5, 0)))
    floor = {"restitution": restitution, "friction": friction}
    mechanism.add(PlaneImpact("floor", mechanism.ground, lower, (0, level), (0.5, 0), (0, 1), **floor))
    mechanism.output("x", lower.position[0], units="m")
    return mechanism


def block_on_slope(friction, tilt):
    """A block that is thrown up a slope of angle `tilt`, from a random height above it; x points down the slope."""
    gravity = (9.81 * np.sin(tilt), -9.81 * np.cos(tilt))
    mechanism = uqmbd.Mechanism("block", uqmbd.Translational(gravity=gravity))
    block = mechanism.body("block", mass=2, position=(0, HEIGHT / 10), velocity=(-3.0, 0))
    mechanism.add(
        PlaneImpact("slope", mechanism.ground, block, (0, 0), (0, 0), (0, 1), restitution=0, friction=friction)
    )
    mechanism.output("x", block.position[0], units="m")
    return mechanism


def slid(height, friction, tilt, times):
    """Return the exact motion (T,) along the slope: flight, inelastic impact, slide up, then rest or slide down."""
    along, normal = 9.81 * np.sin(tilt), 9.81 * np.cos(tilt)
    lands = np.sqrt(2 * height / 10 / normal)
    place, speed = -3.0 * lands + along * lands**2 / 2, -3.0 + along * lands + friction * normal * lands
    slower = along + friction * normal
    stops = lands - speed / slower
    top = place - speed**2 / (2 * slower)
    down = max(0.0, along - friction * normal)
    late = times - lands
    sliding = np.where(
        times < stops, place + speed * late + slower * late**2 / 2, top + down * np.maximum(times - stops, 0) ** 2 / 2
    )
    return np.where(times < lands, -3.0 * times + along * times**2 / 2, sliding)


@pytest.mark.parametrize("friction", [0.8, 0.25], ids=["rests", "slides back"])
def test_a_block_on_a_slope_has_the_exact_motion(friction):
    """The slope of 0.4 rad holds the block if the coefficient of friction exceeds 0.42."""
    heights = np.linspace(0.9, 1.1, 11)
    ensemble = Ensemble(build(block_on_slope(friction, 0.4)), heights[:, None])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Decisions, "after", lambda *given: pytest.fail("Python decided about a realisation"))
        found = integrate(ensemble, TIMES, 1e-10, "dop853")
    assert not any(found.messages)
    exact = np.array([slid(height, friction, 0.4, TIMES) for height in heights])
    np.testing.assert_allclose(found.states[:, :, 0], exact, rtol=0, atol=1e-8)


@pytest.mark.thorough
@given(st.floats(0, 0.9), st.sampled_from([0.0, 0.1, 0.3, 0.8]), st.floats(-1.9, -0.3))
@settings(max_examples=12, deadline=None)
def test_double_pendula_on_a_floor(restitution, friction, level):
    ensemble = Ensemble(build(double_pendulum(restitution, friction, level)), np.linspace(0.9, 1.1, 6)[:, None])
    compare(ensemble, TIMES[:25], 1e-5)


@pytest.mark.parametrize("name", ["disc", pytest.param("ball", marks=pytest.mark.thorough)])
def test_drops_of_other_bodies(falling, name):
    mechanism = falling(name)
    values = mechanism.inputs.from_uniform(np.random.default_rng(3).uniform(size=(5, len(mechanism.inputs))))
    compare(Ensemble(build(mechanism), values), TIMES[:15], 1e-5)


def thrown_block():
    """A point-like block, thrown from a random height onto a level floor in space."""
    mechanism = uqmbd.Mechanism("block", uqmbd.Spatial(gravity=(0, 0, -10)))
    block = mechanism.body("block", mass=1, inertia=(1, 1, 1), position=(0, 0, HEIGHT / 10), velocity=(3.0, -4.0, 0))
    floor = {"restitution": 0, "friction": 0.5}
    mechanism.add(PlaneImpact("floor", mechanism.ground, block, (0, 0, 0), (0, 0, 0), (0, 0, 1), **floor))
    for k, name in enumerate("xyz"):
        mechanism.output(name, block.position[k], units="m")
    return mechanism


def test_a_block_slides_in_space_to_its_exact_place():
    """An inelastic impact of normal speed v takes 0.5 v of 5 m/s; friction of 5 m/s^2 stops the rest."""
    heights = np.linspace(0.9, 1.1, 9)
    ensemble = Ensemble(build(thrown_block()), heights[:, None])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Decisions, "after", lambda *given: pytest.fail("Python decided about a realisation"))
        found = integrate(ensemble, TIMES, 1e-10, "dop853")
    assert not any(found.messages)
    lands = np.sqrt(2 * heights / 10 / 10)
    way = 5 * lands + (5 - 0.5 * 10 * lands) ** 2 / (2 * 5)
    ends = ensemble.outputs(found.times, found.states)[:, :, -1]
    np.testing.assert_allclose(ends, way[:, None] * [0.6, -0.8, 0], rtol=0, atol=1e-8)


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 10_000), st.floats(-0.5, 0.5), st.floats(0, 0.9), st.floats(0, 0.9))
@pytest.mark.parametrize("name", ["disc", "ball"])
def test_first_impacts_of_other_bodies(falling, name, seed, tilt, friction, restitution):
    """Discs and balls fall 1 cm with random velocities."""
    if name not in MODELS:
        mechanism = falling(name)
        MODELS[name] = build(mechanism), list(mechanism.inputs.names)
    model, names = MODELS[name]
    values, random = np.zeros((6, len(names))), np.random.default_rng(seed)
    given = {"tilt": tilt, "mu": friction, "e": restitution, "height": 0.01}
    for key, value in (given | ({"angle": 0.3} if name == "disc" else {})).items():
        values[:, names.index(key)] = value
    for key, size in {"vx": 3, "vy": 3, "spin": 30}.items():
        values[:, names.index(key)] = size * random.uniform(-1, 1, 6)
    compare(Ensemble(model, values), np.linspace(0, 0.05, 6), 1e-6)


RANGES = {"x": (-1, 1), "y": (-1, 1), "z": (-0.6, -0.2), "jx": (0.02, 0.5), "jy": (0.02, 0.5), "jz": (0.02, 0.5)}
RANGES |= {name: (-2, 2) for name in ("vx", "vy", "wx", "wy", "wz")} | {"vz": (-3, -1), "mu": (0.05, 1)}


def body_with_a_foot():
    """A body in space of 1 kg, whose foot falls from 1 micrometre above the floor."""
    n = {name: uqmbd.RandomVariable(name, chaospy.Uniform(*limits)) for name, limits in RANGES.items()}
    mechanism = uqmbd.Mechanism("foot", uqmbd.Spatial(gravity=(0, 0, 0)))
    velocity, spin = (tuple(n[a + b] for b in "xyz") for a in "vw")
    place, inertia = (0, 0, 1e-6 - n["z"]), (n["jx"], n["jy"], n["jz"])
    body = mechanism.body("body", mass=1, inertia=inertia, position=place, velocity=velocity, angular_velocity=spin)
    foot = (n["x"], n["y"], n["z"])
    law = {"restitution": 0.4, "friction": n["mu"]}
    mechanism.add(PlaneImpact("foot", mechanism.ground, body, (0, 0, 0), foot, (0, 0, 1), **law))
    return mechanism


def distances(x):
    """Angles between neighbouring directions of slip of the impact of a foot, by the roots of a polynomial in exp(i a)."""
    arm, spin = np.array([x["x"], x["y"], x["z"]]), np.array([x["wx"], x["wy"], x["wz"]])
    cross = np.cross(np.eye(3), arm)
    matrix = np.eye(3) + cross.T @ np.diag(1 / np.array([x["jx"], x["jy"], x["jz"]])) @ cross
    before = np.array([x["vx"], x["vy"], x["vz"]]) + np.cross(spin, arm)
    if before[2] > -0.5:
        return None
    a = 2 * np.pi * np.arange(5) / 5
    d = np.array([np.cos(a), np.sin(a)])
    slide = before[:2, None] * (matrix[2, 2] - x["mu"] * matrix[2, :2] @ d)
    slide = slide - 1.4 * before[2] * (matrix[:2, 2:] - x["mu"] * matrix[:2, :2] @ d)
    h = np.fft.fft(d[0] * slide[1] - d[1] * slide[0]) / 5
    z = np.roots([h[2], h[1], h[0], h[4], h[3]])
    found = np.sort(np.angle(z[np.abs(np.abs(z) - 1) < 1e-7]))
    return np.diff(np.append(found, found[:1] + 2 * np.pi))


def nearly_equal_directions(rng, apart):
    """Inputs between two random ones with different numbers of directions, next to where two directions coincide."""
    low, high = rng.uniform(size=(2, len(RANGES)))
    limits = np.array(list(RANGES.values())).T

    def at(part):
        values = limits[0] + (low + part * (high - low)) * (limits[1] - limits[0])
        return values, distances(dict(zip(RANGES, values.tolist(), strict=True)))

    ends = [at(part)[1] for part in (0.0, 1.0)]
    if any(x is None for x in ends) or len(ends[0]) == len(ends[1]):
        return None
    left, right = 0.0, 1.0
    for _ in range(50):
        middle = (left + right) / 2
        found = at(middle)[1]
        if found is None:
            return None
        left, right = (middle, right) if len(found) == len(ends[0]) else (left, middle)
    more = -1 if len(ends[0]) > len(ends[1]) else 1
    values, found = at(min(max(0.0, left + more * apart), 1.0))
    return values if found is not None and len(found) == max(map(len, ends)) else None


@pytest.mark.thorough
def test_impacts_with_close_directions_of_slip(count=150):
    """Two of at most four directions of slip nearly coincide: half of the distances are below 3e-3 rad."""
    mechanism, rng, rows = body_with_a_foot(), np.random.default_rng(3), []
    while len(rows) < count:
        if (one := nearly_equal_directions(rng, 10 ** rng.uniform(-12, -2))) is not None:
            rows.append(one)
    order = [list(RANGES).index(name) for name in mechanism.inputs.names]
    least = [distances(dict(zip(RANGES, row.tolist(), strict=True))).min() for row in rows]
    assert np.median(least) < 3e-3 and min(least) < 1e-4
    ensemble = Ensemble(build(mechanism), np.array(rows)[:, order])
    compare(ensemble, np.linspace(0, 1e-5, 3), 1e-6)
