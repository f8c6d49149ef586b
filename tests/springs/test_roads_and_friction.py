"""Friction, tyres and roads against closed forms and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import sympy
from scipy.interpolate import CubicSpline

import uqmbd
from uqmbd_drivers import LinearSpeedDriver, SpeedDriver
from uqmbd_joints import PointOnLine, Prismatic, Revolute
from uqmbd_springs import (
    RadialTyre,
    RoadFollower,
    RotationalFriction,
    SlidingFriction,
    SpringDamper,
    distance,
    haversine_bump,
    sampled_road,
)

G = 9.81
SPACES = {"translational": uqmbd.Translational, "planar": uqmbd.Planar, "spatial": uqmbd.Spatial}
INERTIA = {"translational": {}, "planar": {"inertia": 1}, "spatial": {"inertia": (1, 1, 1)}}


# -- friction -----------------------------------------------------------------------------------------------------------
def braked(speeds, start, friction, mass, transition):
    """Time and way until a body brakes from `start` to each speed, against ``friction v / sqrt(v^2 + e^2)``."""

    def integrals(v):
        root = np.sqrt(v**2 + transition**2)
        time = root + transition * np.log(v / (root + transition))
        return time, (v * root + transition**2 * np.arcsinh(v / transition)) / 2

    return [(a - b) * mass / friction for a, b in zip(integrals(start), integrals(speeds), strict=True)]


def sliding(kind, **law):
    """A body of 2 kg on a rail along (0.6, 0.8), with 3 m/s along it, against friction."""
    space = SPACES[kind]()
    rail, zero = (0.6, 0.8, 0)[: space.dimension], (0, 0, 0)[: space.dimension]
    mechanism = uqmbd.Mechanism("slide", space)
    velocity = tuple(3 * x for x in rail)
    body = mechanism.body("block", mass=2, velocity=velocity, **INERTIA[kind])
    joint = PointOnLine if kind == "translational" else Prismatic
    mechanism.add(joint("rail", mechanism.ground, body, at=zero, axis=rail))
    mechanism.add(SlidingFriction("friction", mechanism.ground, body, at=zero, axis=rail, **law))
    mechanism.output("s", sum(a * x for a, x in zip(rail, body.position, strict=True)), units="m")
    mechanism.output("v", sum(a * x for a, x in zip(rail, body.velocity, strict=True)), units="m/s")
    return mechanism


@pytest.mark.parametrize("kind", SPACES)
def test_a_block_brakes_as_smooth_friction_does(kind, close):
    """Time and way to every speed, in closed form with the smoothing: m dv/dt = -F v / sqrt(v^2 + e^2)."""
    times = np.linspace(0, 1.4, 15)
    data = uqmbd.simulate(sliding(kind, friction=4, transition=0.05), times, rtol=1e-9)
    time, way = braked(data["v"].values, 3.0, 4.0, 2.0, 0.05)
    close(time, times, relative=1e-7)
    close(data["s"], way, relative=1e-7)


def test_a_block_stops_where_dry_friction_stops_it(close):
    """Coulomb and viscous: stop after m/c ln(1 + c v0/F), m v0/c - F (m/c^2) ln(1 + c v0/F) further; then it stays."""
    mass, rate, force, start = 2.0, 0.7, 4.0, 3.0
    mechanism = sliding("planar", friction=force, damping=rate, transition=1e-4)
    logarithm = np.log(1 + rate * start / force)
    stop, way = mass / rate * logarithm, mass * start / rate - force * mass / rate**2 * logarithm
    times = np.array([0, 0.5 * stop, stop - 0.01, stop + 0.01, 2 * stop])
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    slowing = np.exp(-rate * times[:3] / mass)
    close(data["v"][:3], slowing * start - force / rate * (1 - slowing), relative=1e-3)
    close(data["s"][3:], [way, way], relative=1e-3)
    assert np.abs(data["v"][3:]).max() < 1e-6


def test_viscous_friction_alone(close):
    times = np.linspace(0, 8, 17)
    data = uqmbd.simulate(sliding("spatial", friction=0, damping=0.9), times, rtol=1e-9)
    close(data["v"], 3 * np.exp(-0.45 * times), relative=1e-7)
    close(data["s"], 3 / 0.45 * (1 - np.exp(-0.45 * times)), relative=1e-7)


@pytest.mark.parametrize("transition", [0.01, 1e-4])
def test_a_block_sticks_on_an_incline_but_for_a_creep(transition, close):
    """F v / sqrt(v^2 + e^2) = m g sin: it creeps at e s / sqrt(1 - s^2), s = m g sin / F; above F it slides."""
    slope, mass = 0.3, 2.0
    pull = mass * G * np.sin(slope)
    down = (np.cos(slope), -np.sin(slope))
    for share, times in ((0.8, np.array([0, 5.0, 10.0])), (1.25, np.array([0, 1.0, 2.0]))):
        mechanism = uqmbd.Mechanism("incline", uqmbd.Planar(gravity=(0, -G)))
        block = mechanism.body("block", mass=mass, inertia=1, velocity=(0, 0))
        mechanism.add(Prismatic("incline", mechanism.ground, block, at=(0, 0), axis=down))
        law = {"friction": pull / share, "transition": transition}
        mechanism.add(SlidingFriction("friction", mechanism.ground, block, at=(0, 0), axis=down, **law))
        mechanism.output("v", down[0] * block.velocity[0] + down[1] * block.velocity[1], units="m/s")
        v = uqmbd.simulate(mechanism, times, rtol=1e-8)["v"].values
        if share < 1:
            close(v[1:], np.full(2, transition * share / np.sqrt(1 - share**2)), relative=1e-4)
        else:
            close(v[2] - v[1], (pull - pull / share) / mass, relative=1e-3)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_a_wheel_runs_down(kind, close):
    """J w' = -M w / sqrt(w^2 + e^2), and what the bearing's friction exerts on the wheel."""
    flat = kind == "planar"
    axis = np.array([2.0, -1.0, 2.0]) / 3
    mechanism = uqmbd.Mechanism("wheel", SPACES[kind]())
    spin = 6.0 if flat else 6 * axis
    wheel = mechanism.body("wheel", mass=1, inertia=0.5 if flat else (0.5,) * 3, angular_velocity=spin)
    turned = {} if flat else {"axis": axis}
    mechanism.add(Revolute("bearing", mechanism.ground, wheel, at=(0, 0) if flat else (0, 0, 0), **turned))
    law = {"friction": 0.4, "transition": 0.1}
    friction = mechanism.add(RotationalFriction("friction", mechanism.ground, wheel, **law, **turned))
    rate, moment = wheel.angular_velocity, friction.reaction_moment
    mechanism.output("w", rate if flat else sum(a * x for a, x in zip(axis, rate, strict=True)), units="rad/s")
    mechanism.output("m", moment if flat else sum(a * x for a, x in zip(axis, moment, strict=True)), units="N m")
    times = np.linspace(0, 7, 15)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    w = data["w"].values
    close(braked(w, 6.0, 0.4, 0.5, 0.1)[0], times, relative=1e-7)
    close(data["m"], -0.4 * w / np.hypot(w, 0.1), relative=1e-8)


def test_sliding_friction_turns_with_its_rail(close):
    """A bead on a rod that is turned at w, with viscous friction along the rod: m x'' = m w^2 x - c x'."""
    mass, rate, spin = 0.5, 0.8, 2.0
    mechanism = uqmbd.Mechanism("turnstile", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=1)
    bead = mechanism.body("bead", mass=mass, inertia=1, position=(1, 0))
    mechanism.add(SpeedDriver("motor", mechanism.ground, rod, spin))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, at=(0, 0)))
    mechanism.add(PointOnLine("rail", rod, bead, (0, 0), (0, 0), (1, 0)))
    mechanism.add(SlidingFriction("friction", rod, bead, (0, 0), (0, 0), (1, 0), friction=0, damping=rate))
    mechanism.output("x", sympy.sqrt(bead.position[0] ** 2 + bead.position[1] ** 2), units="m")
    times = np.linspace(0, 1.5, 7)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    roots = np.roots([1, rate / mass, -(spin**2)])
    weights = np.linalg.solve([[1, 1], roots], [1, 0])
    close(data["x"], np.exp(np.outer(times, roots)) @ weights, relative=1e-6)


# -- tyre ---------------------------------------------------------------------------------------------------------------
def quarter_car(kind, **tyre):
    """Wheel (40 kg) on a tyre of 180 kN/m and radius 0.3 m, body (300 kg) on 20 kN/m above it."""
    space = SPACES[kind]
    d = space().dimension
    up, zero = (0,) * (d - 1) + (1,), (0,) * d
    mechanism = uqmbd.Mechanism("quarter car", space(gravity=tuple(-G * x for x in up)))
    wheel, body = (
        mechanism.body(name, mass=mass, position=tuple(height * x for x in up), **INERTIA[kind])
        for name, mass, height in (("wheel", 40, 0.3), ("body", 300, 0.9))
    )
    for part, height in ((wheel, 0.3), (body, 0.9)):
        joint = PointOnLine if kind == "translational" else Prismatic
        where = tuple(height * x for x in up)
        mechanism.add(joint(f"{part.name} guide", mechanism.ground, part, at=where, axis=up))
    mechanism.add(SpringDamper("spring", wheel, body, zero, zero, 20e3, 1500, free_length=0.7))
    given = {"road": 0, "radius": 0.3, "stiffness": 180e3, "damping": 200} | tyre
    made = mechanism.add(RadialTyre("tyre", mechanism.ground, wheel, zero, **given))
    mechanism.output("wheel", wheel.position[d - 1], units="m")
    mechanism.output("body", body.position[d - 1], units="m")
    mechanism.output("load", made.reaction_force[d - 1], units="N")
    return mechanism


@pytest.mark.parametrize("kind", SPACES)
def test_a_quarter_car_stands_and_swings(kind):
    """Static deflections m g / k, and the damped eigenvalues of the two masses (SciPy's quadratic eigenproblem)."""
    mechanism = quarter_car(kind, road=0.1)
    found = uqmbd.static_equilibrium(mechanism)
    load = 340 * G
    # f = (k c + sqrt((k c)^2 + (k e)^2)) / 2 of a compression c
    compression = load / 180e3 - 180e3 * 1e-8 / (4 * load)
    assert float(found["load"]) == pytest.approx(load, rel=1e-9)
    assert float(found["wheel"]) == pytest.approx(0.4 - compression, abs=1e-9)
    assert float(found["body"]) == pytest.approx(0.4 - compression + 0.7 - 300 * G / 20e3, abs=1e-9)
    mass = np.diag([40.0, 300.0])
    stiffness = np.array([[200e3, -20e3], [-20e3, 20e3]])
    damping = np.array([[1700.0, -1500.0], [-1500.0, 1500.0]])
    flow = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, np.hstack([stiffness, damping]))]])
    roots = scipy.linalg.eigvals(flow)
    roots = roots[roots.imag > 0]
    roots = roots[np.argsort(np.abs(roots))]
    modes = uqmbd.eigenfrequencies(mechanism)
    keep = modes["frequency"].values > 0.1
    # contact is smooth within e = 0.1 mm: (e / c)^2 / 4 of the stiffness
    np.testing.assert_allclose(modes["damping_ratio"].values[keep], -roots.real / np.abs(roots), rtol=1e-4)
    natural = np.abs(roots) / (2 * np.pi)
    np.testing.assert_allclose(modes["frequency"].values[keep], natural, rtol=1e-4)


def test_a_tyre_lands_and_bounces_off(close):
    """Dropped without damping: lowest where k c^2 / 2 = m g (h + c), and as high as before; in the air it weighs nothing."""
    mass, rate, drop = 5.0, 2e4, 0.2
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -G)))
    wheel = mechanism.body("wheel", mass=mass, position=(0, 0.3 + drop), velocity=(0, 0))
    tyre = RadialTyre("tyre", mechanism.ground, wheel, (0, 0), road=0, radius=0.3, stiffness=rate, transition=1e-6)
    mechanism.add(tyre)
    mechanism.output("y", wheel.position[1], units="m")
    mechanism.output("load", tyre.reaction_force[1], units="N")
    fall = np.sqrt(2 * drop / G)
    w = np.sqrt(rate / mass)
    # contact from y = r with speed g fall: c = g/w^2 (1 - cos) + g fall/w sin, lowest at half the contact
    half = (np.pi - np.arctan2(fall * w, 1)) / w
    times = [0, 0.5 * fall, fall + half, 2 * (fall + half)]
    data = uqmbd.simulate(mechanism, times, rtol=1e-9)
    deepest = mass * G / rate * (1 + np.sqrt(1 + 2 * rate * drop / (mass * G)))
    close(data["y"], [0.3 + drop, 0.3 + 0.75 * drop, 0.3 - deepest, 0.3 + drop], relative=2e-5)
    close(data["load"], [0, 0, rate * deepest, 0], relative=1e-4)


def test_rolling_over_waves_takes_no_energy():
    """Sine road without damping: kinetic, of weight and of the tyre, k (c^2 + c sqrt(c^2 + e^2) + e^2 asinh(c/e)) / 4."""
    mass, rate, smooth = 5.0, 2e3, 0.005
    mechanism = uqmbd.Mechanism("ball", uqmbd.Planar(gravity=(0, -G)))
    wheel = mechanism.body("wheel", mass=mass, inertia=1, position=(0, 0.3), velocity=(3, 0), angular_velocity=0)
    road = sympy.sin(3 * distance) / 20
    given = {"road": road, "radius": 0.3, "stiffness": rate, "transition": smooth}
    mechanism.add(RadialTyre("tyre", mechanism.ground, wheel, (0, 0), **given))
    (x, y), v = wheel.position, wheel.velocity
    c = road.subs(distance, x) + 0.3 - y
    spring = rate * (c**2 + c * sympy.sqrt(c**2 + smooth**2) + smooth**2 * sympy.asinh(c / smooth)) / 4
    mechanism.output("energy", mass * (v[0] ** 2 + v[1] ** 2) / 2 + mass * G * y + spring, units="J")
    mechanism.output("vx", v[0], units="m/s")
    data = uqmbd.simulate(mechanism, np.linspace(0, 2, 41), rtol=1e-9)
    assert np.ptp(data["vx"].values) > 0.2
    assert np.ptp(data["energy"].values) < 1e-6 * float(data["energy"][0])


# -- road ---------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", SPACES)
def test_a_wheel_follows_a_bump(kind, close):
    """At a prescribed speed: height r + h (1 - cos(2 pi (x - a)/l)) / 2 on the bump, and its weight is m (g + z'')."""
    space = SPACES[kind]
    d = space().dimension
    up, ahead, zero = (0,) * (d - 1) + (1,), (1,) + (0,) * (d - 1), (0,) * d
    mechanism = uqmbd.Mechanism("wheel", space(gravity=tuple(-G * x for x in up)))
    wheel = mechanism.body("wheel", mass=4, position=tuple(0.35 * x for x in up), **INERTIA[kind])
    road = haversine_bump(0.08, 0.9, start=1.0)
    road_joint = RoadFollower("road", mechanism.ground, wheel, zero, road, height=0.35)
    mechanism.add(road_joint)
    drive = mechanism.add(LinearSpeedDriver("drive", mechanism.ground, wheel, zero, zero, ahead, speed=2))
    mechanism.output("z", wheel.position[d - 1], units="m")
    mechanism.output("up", road_joint.reaction_force[d - 1], units="N")
    mechanism.output("level", road_joint.reaction_force[0] + drive.reaction_force[0], units="N")
    times = np.linspace(0, 1.2, 25) + 0.003
    data = uqmbd.simulate(mechanism, np.concatenate([[0], times]), rtol=1e-8).isel(time=slice(1, None))
    x = 2 * times
    on = (x > 1.0) & (x < 1.9)
    turn = 2 * np.pi / 0.9
    close(data["z"], 0.35 + on * 0.04 * (1 - np.cos(turn * (x - 1))), relative=1e-8)
    close(data["up"], 4 * (G + on * 0.04 * (2 * turn) ** 2 * np.cos(turn * (x - 1))), relative=1e-6)
    close(data["level"], 0, scale=4 * G, relative=1e-7)


RNG = np.random.default_rng(4)
KNOTS = np.cumsum(RNG.uniform(0.02, 0.2, 60))
HEIGHTS = RNG.normal(0, 0.02, 60)


@pytest.mark.thorough
def test_a_sampled_road_is_the_clamped_spline(close):
    """Height and both derivatives as SciPy's CubicSpline, between the samples; flat beyond them."""
    knots, heights = KNOTS[:18], HEIGHTS[:18]
    spline = CubicSpline(knots, heights, bc_type="clamped")
    road = sampled_road(knots, heights)
    x = np.linspace(knots[0], knots[-1], 301)[1:-1]
    for order in range(3):
        found = sympy.lambdify(distance, road.diff(distance, order) if order else road)
        close([float(found(s)) for s in x], spline(x, order), relative=1e-9)
        ends = [float(found(s)) for s in (knots[0] - 1, knots[-1] + 1)]
        close(ends, [0, 0] if order else heights[[0, -1]], scale=1, relative=1e-12)


@pytest.mark.thorough
def test_a_wheel_follows_a_sampled_road(close):
    """Height, and force m (g + v^2 z'') + what the slope asks of nobody: the drive keeps the speed."""
    spline = CubicSpline(KNOTS, HEIGHTS, bc_type="clamped")
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Translational(gravity=(0, -G)))
    wheel = mechanism.body("wheel", mass=4, position=(KNOTS[0], 0.3))
    joint = RoadFollower("road", mechanism.ground, wheel, (0, 0), sampled_road(KNOTS, HEIGHTS), height=0.3)
    mechanism.add(joint)
    mechanism.add(LinearSpeedDriver("drive", mechanism.ground, wheel, (0, 0), (0, 0), (1, 0), speed=2))
    mechanism.output("z", wheel.position[1], units="m")
    mechanism.output("up", joint.reaction_force[1], units="N")
    times = np.linspace(0, 2, 81)[1:]
    data = uqmbd.simulate(mechanism, np.concatenate([[0], times]), rtol=1e-8).isel(time=slice(1, None))
    x = KNOTS[0] + 2 * times
    close(data["z"], 0.3 + spline(x), relative=1e-7)
    close(data["up"], 4 * (G + 4 * spline(x, 2)), relative=1e-5)


def test_a_road_may_be_random_and_of_time(close):
    """A tyre that stands still on ground that is shaken, z_r = a sin wt: the closed form of the forced oscillator."""
    import chaospy

    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9e-3, 1.1e-3), units="m")
    mechanism = uqmbd.Mechanism("shaker", uqmbd.Translational(gravity=(0, -G)))
    mass, rate, damping, w = 40.0, 180e3, 300.0, 30.0
    wheel = mechanism.body("wheel", mass=mass, position=(0, 0.3 - mass * G / rate), velocity=(0, 0))
    mechanism.add(PointOnLine("guide", mechanism.ground, wheel, at=(0, 0), axis=(0, 1)))
    given = {"radius": 0.3, "stiffness": rate, "damping": damping, "transition": 1e-7}
    mechanism.add(RadialTyre("tyre", mechanism.ground, wheel, (0, 0), height * sympy.sin(w * uqmbd.t), **given))
    mechanism.output("y", wheel.position[1], units="m")
    times = np.linspace(0, 0.5, 26)
    data = uqmbd.simulate(mechanism, times, rtol=1e-9, values={"height": 1.05e-3})
    forced = 1.05e-3 * (rate + 1j * w * damping) / (rate - mass * w**2 + 1j * w * damping)
    decay = damping / 2 / mass
    own = np.sqrt(rate / mass - decay**2)
    a = -forced.imag
    b = (-(forced * 1j * w).imag + decay * a) / own
    free = np.exp(-decay * times) * (a * np.cos(own * times) + b * np.sin(own * times))
    close(data["y"] - data["y"][0], (forced * np.exp(1j * w * times)).imag + free, relative=1e-4)


@pytest.mark.parametrize(
    ("x", "z"), [([0, 1, 1], [0, 0, 0]), ([0], [1]), ([0, 1], [0, np.nan]), ([0, 1, 2], [0, 1]), ([[0, 1]], [[0, 1]])]
)
def test_samples_that_make_no_road(x, z):
    with pytest.raises(uqmbd.StudyError, match="expected two lists of equal length with at least two finite numbers"):
        sampled_road(x, z)


@pytest.mark.parametrize("road", ["bump", None, lambda x: x, [0, 1], float("inf"), True, sympy.Symbol("x") / 10])
def test_what_is_no_road(road):
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=1)
    message = (
        r"RoadFollower 'road': road .*; expected (an expression in uqmbd_springs.distance, uqmbd.t and random|a number)"
    )
    with pytest.raises(uqmbd.StudyError, match=message):
        mechanism.add(RoadFollower("road", mechanism.ground, wheel, (0, 0), road))


def test_a_bump_without_length():
    with pytest.raises(uqmbd.StudyError, match="haversine_bump: the length is 0; expected a positive number"):
        haversine_bump(0.1, 0)
