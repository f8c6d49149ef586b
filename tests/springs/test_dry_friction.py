"""Friction of joints that sticks: closed forms, and a time-stepping reference for chains of masses."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import build
from uqmbd_contact import PlaneImpact
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, RotationalFriction, SlidingFriction, SpringDamper, Torque

G, LENGTH = 9.81, 0.5


def arm(share, space=uqmbd.Planar) -> uqmbd.Mechanism:
    """A horizontal arm at rest; the friction of its pin is a share of the moment of its weight."""
    flat = space is uqmbd.Planar
    down, turned = ((0, -G), {}) if flat else ((0, -G, 0), {"axis_i": (0, 0, 1)})
    mechanism = uqmbd.Mechanism("arm", space(gravity=down))
    zero = (0,) * len(down)
    still = {"velocity": zero, "angular_velocity": 0 if flat else zero}
    inertia = 0.1 if flat else (0.1,) * 3
    body = mechanism.body("arm", mass=1, inertia=inertia, position=(LENGTH, *zero[1:]), **still)
    axes = {} if flat else {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
    pin = mechanism.add(Revolute("pin", mechanism.ground, body, zero, (-LENGTH, *zero[1:]), **axes))
    mechanism.add(RotationalFriction("seal", mechanism.ground, body, friction=share * G * LENGTH, **turned))
    mechanism.output("angle", pin.angle, units="rad")
    return mechanism


@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_an_arm_below_its_friction_does_not_move(space) -> None:
    """At 82 % of its dry friction, for a minute; smooth friction creeps by 0.69 rad."""
    found = uqmbd.simulate(arm(1 / 0.82, space), [0, 60], check=False)
    assert abs(float(found["angle"][-1])) < 1e-10


@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_an_arm_above_its_friction_falls_until_its_energy_is_dissipated(space) -> None:
    """It stops where sin(angle) = 0.9 angle, and stays there."""
    stop = 1.0
    for _ in range(50):
        stop -= (np.sin(stop) - 0.9 * stop) / (np.cos(stop) - 0.9)
    found = uqmbd.simulate(arm(0.9, space), [0, 5, 20], rtol=1e-8, check=False)
    assert found["angle"].values[1:] == pytest.approx([-stop, -stop], abs=1e-7)


def test_a_growing_force_breaks_a_slide_away_at_the_limit() -> None:
    mechanism = uqmbd.Mechanism("pull", uqmbd.Translational())
    block = mechanism.body("block", mass=2, velocity=(0, 0))
    rail = {"at": (0, 0), "axis": (1, 0)}
    slide = mechanism.add(SlidingFriction("slide", mechanism.ground, block, **rail, friction=3, damping=0))
    mechanism.add(PointForce("pull", block, (0, 0), (4 * uqmbd.t, 0)))
    mechanism.output("x", block.position[0], units="m")
    mechanism.output("slip", slide.event_time("slip"), units="s")
    times = np.array([0, 0.7, 1.0, 2.0])
    found = uqmbd.simulate(mechanism, times, rtol=1e-9, check=False)
    assert float(found["slip"]) == pytest.approx(0.75, abs=1e-8)
    assert found["x"].values == pytest.approx(4 / 2 * np.maximum(times - 0.75, 0) ** 3 / 6, abs=1e-8)


def test_a_brake_is_released_and_applied_again() -> None:
    """A limit of max(0, 4 cos t) N m against a moment of 1 N m on a disc of 2 kg m^2."""
    mechanism = uqmbd.Mechanism("brake", uqmbd.Planar())
    disc = mechanism.body("disc", mass=1, inertia=2, position=(0, 0), velocity=(0, 0), angular_velocity=0)
    mechanism.add(Revolute("axle", mechanism.ground, disc, (0, 0), (0, 0)))
    mechanism.add(Torque("drive", disc, 1.0))
    limit = sympy.Max(0, 4 * sympy.cos(uqmbd.t))
    brake = mechanism.add(RotationalFriction("brake", mechanism.ground, disc, friction=limit))
    mechanism.output("rate", disc.angular_velocity, units="rad/s")
    for label, number in (("slip", 1), ("lift-off", 1), ("rest", 2), ("stick", 1)):
        mechanism.output(label, brake.event_time(label, number), units="s")
    slips, opens, closes = np.arccos(1 / 4), np.pi / 2, 3 * np.pi / 2
    freed = (opens - slips - 4 * (1 - np.sin(slips))) / 2  # rates in rad/s
    pressed = freed + (closes - opens) / 2

    def braked(t):
        return pressed + (t - closes - 4 * (np.sin(t) + 1)) / 2

    times = np.array([0, 1, opens, 3, closes, 5.2])
    found = uqmbd.simulate(mechanism, [*times, 7.5], rtol=1e-9, check=False)
    exact = [0, 0, freed, freed + (3 - opens) / 2, pressed, braked(5.2)]
    assert found["rate"].values[:-1] == pytest.approx(exact, abs=1e-7)
    assert [float(found[x]) for x in ("slip", "lift-off", "rest")] == pytest.approx([slips, opens, closes], abs=1e-7)
    low, high = 5.2, 7.5
    for _ in range(60):
        low, high = ((low + high) / 2, high) if braked((low + high) / 2) > 0 else (low, (low + high) / 2)
    assert float(found["stick"]) == pytest.approx(low, abs=1e-6)


def test_friction_has_no_impulse_at_an_impact() -> None:
    """A falling arm hits a stop with its tip and rebounds with the restitution, despite the friction of its pin."""
    mechanism = arm(0.3)
    tip = {"point_i": (0, -0.5), "point_j": (LENGTH, 0), "normal_i": (0, 1)}
    stop = mechanism.add(
        PlaneImpact("stop", mechanism.ground, mechanism.bodies["arm"], **tip, restitution=0.6, friction=0)
    )
    mechanism.output("first", stop.event_time("impact", 1), units="s")
    mechanism.output("rate", mechanism.bodies["arm"].angular_velocity, units="rad/s")
    first = float(uqmbd.simulate(mechanism, [0, 1], rtol=1e-9, check=False)["first"])
    found = uqmbd.simulate(mechanism, [0, first - 1e-7, first + 1e-7], rtol=1e-9, check=False)["rate"].values
    assert found[2] == pytest.approx(-0.6 * found[1], rel=1e-5)
    # the fall to the angle asin(1/2): energy of the weight without the work of friction
    fall = np.arcsin(0.5)
    exact = np.sqrt(2 * G * LENGTH * (np.sin(fall) - 0.3 * fall) / (0.1 + LENGTH**2))
    assert found[1] == pytest.approx(-exact, rel=1e-5)


def test_the_probability_of_holding_is_that_of_the_friction() -> None:
    """The arm holds with a friction above its weight's moment: 40 % of a uniform distribution."""
    share = uqmbd.RandomVariable("share", chaospy.Uniform(0.7, 1.2), units="1")
    method = MonteCarlo(samples=64, sampling="sobol", seed=2)
    study = uqmbd.Study("hold", arm(share), [0, 2], [method])
    node = study.propagate(method)
    assert np.mean(np.abs(node["samples"]["response"].values[..., -1]) < 1e-9) == pytest.approx(0.4, abs=0.04)


def chain(masses, limits, ground, stiffness, forces) -> uqmbd.Mechanism:
    """Masses on a line with dry friction to the ground and between neighbours, springs, and harmonic forces."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Line())
    before = None
    for k, mass in enumerate(masses):
        body = mechanism.body(f"m{k}", mass=mass, position=0, velocity=0)
        mechanism.add(SlidingFriction(f"floor{k}", mechanism.ground, body, 0, 0, 1, friction=ground[k]))
        mechanism.add(SpringDamper(f"spring{k}", mechanism.ground, body, -1, 0, stiffness=stiffness[k], free_length=1))
        if before is not None:
            mechanism.add(SlidingFriction(f"joint{k}", before, body, 0, 0, 1, friction=limits[k]))
        size, rate = forces[k]
        mechanism.add(PointForce(f"force{k}", body, 0, size * sympy.sin(rate * uqmbd.t)))
        mechanism.output(f"x{k}", body.position[0], units="m")
        before = body
    return mechanism


def stepped(masses, limits, ground, stiffness, forces, end, step=2e-4) -> np.ndarray:
    """Positions at the end by Moreau's time stepping; the friction impulses by projected Gauss-Seidel."""
    m, count = np.array(masses), len(masses)
    rows = [np.eye(count)[k] for k in range(count)]
    rows += [np.eye(count)[k] - np.eye(count)[k - 1] for k in range(1, count)]
    w, most = np.array(rows), np.array([*ground, *limits[1:]])
    delassus = w / m @ w.T
    x, v, impulse = np.zeros(count), np.zeros(count), np.zeros(len(w))
    for n in range(round(end / step)):
        middle = x + step / 2 * v
        t = (n + 0.5) * step
        force = np.array([size * np.sin(rate * t) for size, rate in forces]) - np.array(stiffness) * middle
        free = v + step * force / m
        for _ in range(200):
            old = impulse.copy()
            for k in range(len(w)):
                speed = w[k] @ free + delassus[k] @ impulse
                impulse[k] = np.clip(impulse[k] - speed / delassus[k, k], -most[k] * step, most[k] * step)
            if np.abs(impulse - old).max() < 1e-12:
                break
        v = free + w.T @ impulse / m
        x = middle + step / 2 * v
    return x


@pytest.mark.thorough
@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 3))
def test_chains_agree_with_time_stepping(seed, count) -> None:
    rng = np.random.default_rng(seed)
    masses, stiffness = rng.uniform(0.5, 2, count).tolist(), rng.uniform(5, 30, count).tolist()
    ground, limits = rng.uniform(0.2, 2, count).tolist(), rng.uniform(0.2, 1.5, count).tolist()
    forces = list(zip(rng.uniform(0.5, 5, count).tolist(), rng.uniform(1, 6, count).tolist(), strict=True))
    mechanism = chain(masses, limits, ground, stiffness, forces)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = uqmbd.simulate(mechanism, [0, 2.0], check=False)
    exact = stepped(masses, limits, ground, stiffness, forces, 2.0)
    assert [float(found[f"x{k}"][-1]) for k in range(count)] == pytest.approx(list(exact), abs=2e-3)


@pytest.mark.parametrize("position", [0.0, 0.45, 3.0])
def test_accelerations_and_reactions_contain_dry_friction(position) -> None:
    """A held block, and one that slides: wherever the origin is."""
    mechanism = uqmbd.Mechanism("blocks", uqmbd.Line())
    for name, speed, force in (("held", 0, 2.0), ("sliding", 1, 0.0)):
        body = mechanism.body(name, mass=1, position=position, velocity=speed)
        friction = mechanism.add(SlidingFriction(f"{name} friction", mechanism.ground, body, 0, 0, 1, friction=3))
        mechanism.add(PointForce(f"{name} force", body, 0, force))
        mechanism.output(f"{name} a", body.acceleration[0], units="m/s^2")
        mechanism.output(f"{name} f", friction.reaction_force[0], units="N")
    found = uqmbd.simulate(mechanism, [0, 0.05, 0.1], check=False)
    exact = {"held a": 0, "held f": -2, "sliding a": -3, "sliding f": -3}
    for name, value in exact.items():
        assert found[name].values == pytest.approx([value] * 3, abs=1e-9), name


@pytest.mark.parametrize("lock", [10.0, 1e6])
def test_a_locked_joint_does_not_affect_decisions_on_others(lock) -> None:
    mechanism = uqmbd.Mechanism("locked", uqmbd.Line())
    for name, limit, force in (("block", 3, 3.005), ("other", lock, 0.0)):
        body = mechanism.body(name, mass=1, position=0, velocity=0)
        friction = mechanism.add(SlidingFriction(f"{name} friction", mechanism.ground, body, 0, 0, 1, friction=limit))
        mechanism.add(PointForce(f"{name} force", body, 0, force))
        mechanism.output(f"{name} f", friction.reaction_force[0], units="N")
        mechanism.output(f"{name} a", body.acceleration[0], units="m/s^2")
    found = uqmbd.simulate(mechanism, [0, 0.1], check=False)
    assert found["block a"].values == pytest.approx([0.005] * 2, rel=1e-9)
    assert found["block f"].values == pytest.approx([-3] * 2, rel=1e-9)
    assert found["other a"].values == pytest.approx([0, 0], abs=1e-12)


@pytest.mark.parametrize("kind", [SlidingFriction, RotationalFriction])
def test_a_random_transition_of_zero_states_place_value_and_remedy(kind) -> None:
    """By a value of the user, and in half of the realisations of a distribution that contains zero."""
    turning = kind is RotationalFriction
    speed = uqmbd.RandomVariable("speed", chaospy.DiscreteUniform(0, 1), units="rad/s" if turning else "m/s")
    mechanism = uqmbd.Mechanism("block", uqmbd.Planar() if turning else uqmbd.Line())
    block = mechanism.body("block", mass=1, **({"inertia": 1, "angular_velocity": 1} if turning else {"velocity": 1}))
    place = {} if turning else {"at": 0, "axis": 1}
    mechanism.add(kind("rub", mechanism.ground, block, friction=1, transition=speed, **place))
    mechanism.output("v", block.angular_velocity if turning else block.velocity[0])
    expected = (
        f"the transition of {kind.__name__} 'rub' is 0 .*: expected a distribution above 0 .with the constant 0, the"
    )
    with pytest.raises(uqmbd.AssemblyError, match=expected):
        uqmbd.simulate(mechanism, [0, 1], {"speed": 0.0})
    study = uqmbd.Study("s", mechanism, [0, 1], [MonteCarlo(samples=40, seed=1)])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        study.run()
    text = " ".join(str(x.message) for x in caught)
    assert "in 50 % of the realisations: these fail" in text and "Most frequent reason: the transition of" in text
    assert any("outside of its range (a distribution above 0" in x.message for x in uqmbd.findings(study))


def test_only_dry_friction_has_a_given_load() -> None:
    """Its term states it; a rigid contact has none, whatever the derivatives of its speed are."""
    mechanism = uqmbd.Mechanism("block", uqmbd.Line())
    block = mechanism.body("block", mass=1, velocity=1)
    mechanism.add(SlidingFriction("rub", mechanism.ground, block, at=0, axis=1, friction=1))
    mechanism.add(PlaneImpact("wall", mechanism.ground, block, 5, 0, -1))
    assert dict(zip([x for x, *_ in build(mechanism).events], build(mechanism).given_loads, strict=True)) == {
        "rub": True,
        "wall": False,
    }
