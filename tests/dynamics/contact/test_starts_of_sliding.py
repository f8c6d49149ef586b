"""Decisions of the driver about lift-off, starts of sliding, and dry friction of joints, with several closed contacts."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd.dynamics.contact.decisions import Decisions
from uqmbd_contact import PlaneImpact
from uqmbd_springs import PointForce, SlidingFriction

from .python_decisions import one_by_one
from .stacks import random_stack, sliding_stack

G = 9.81


@pytest.fixture
def driver_alone(monkeypatch):
    def after(self, member, guard, time, z, contacts):
        raise AssertionError(f"guard {guard} at {time} s was left to Python")

    monkeypatch.setattr(Decisions, "after", after)


@pytest.mark.usefixtures("driver_alone")
@pytest.mark.parametrize("kind", ["ramp", "wave", "together", "shaken"])
@pytest.mark.parametrize(
    ("space", "most"),
    [
        (uqmbd.Translational, 3),
        *(pytest.param(uqmbd.Planar, x, marks=pytest.mark.thorough) for x in (1, 3)),
    ],
)
def test_stacks_move_as_by_another_method(space, most, kind):
    """Blocks on each other, in the plane each on three feet, whose forces are not unique."""
    rng, times = np.random.default_rng(7), np.linspace(0, 1.2, 13)
    stack = random_stack(space, rng, most, 3, kind)
    found = integrate(Ensemble(build(stack.mechanism), np.zeros((1, 0))), times, 1e-8)
    assert found.messages == ("",)
    moved = stack.displacements(found.states[0])
    np.testing.assert_allclose(moved - moved[0], sliding_stack(stack, times), atol=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["ramp", "wave", "together", "shaken"])
def test_stacks_on_feet_move_as_by_decisions_in_python(kind):
    """Forces of three feet in a line are not unique: their choice in the driver decides when they slip."""
    stack = random_stack(uqmbd.Planar, np.random.default_rng(12), 1, 3, kind)
    ensemble, times = Ensemble(build(stack.mechanism), np.zeros((1, 0))), np.linspace(0, 1.2, 5)
    found, alone = integrate(ensemble, times, 1e-9, "dop853"), one_by_one(ensemble, times, 1e-9)
    assert found.scalars.keys() == alone.scalars.keys()
    for name, moments in found.scalars.items():
        np.testing.assert_allclose(moments, alone.scalars[name], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found.states, alone.states, rtol=0, atol=1e-7)


def tipping(joint):
    """A block of 1 kg on two rough feet, 0.2 m apart and 0.1 m below its centre, on a rail or on the ground."""
    mechanism = uqmbd.Mechanism("tipping", uqmbd.Planar(gravity=(0, -G)))
    still = {"velocity": (0, 0), "angular_velocity": 0}
    block = mechanism.body("block", mass=1, inertia=0.01, position=(0, 0.1), **still)
    for k, x in enumerate((-0.1, 0.1)):
        law = {"restitution": 0, "friction": 0.5 if joint else 2.0}
        mechanism.add(PlaneImpact(f"foot{k}", mechanism.ground, block, (0, 0), (x, -0.1), (0, 1), **law))
    if joint:
        mechanism.add(SlidingFriction("rail", mechanism.ground, block, (0, 0), (0, -0.1), (1, 0), friction=2))
    mechanism.add(PointForce("push", block, (0, -0.1 if joint else 0.1), (10 * uqmbd.t, 0)))
    mechanism.output("x", block.position[0], units="m")
    return mechanism


@pytest.mark.usefixtures("driver_alone")
def test_a_foot_lifts_off_while_another_one_sticks():
    """The block tips about its right foot: 0.2 m times the push is 0.1 m times the weight."""
    found = integrate(Ensemble(build(tipping(joint=False)), np.zeros((1, 0))), np.array([0, 0.51]), 1e-9)
    assert found.messages == ("",)
    np.testing.assert_allclose(found.scalars["foot0: lift-off 1"], 0.1 * G / (0.2 * 10), rtol=1e-8)
    assert not found.scalars.keys() & {"foot1: slip 1", "foot1: lift-off 1"}


@pytest.mark.usefixtures("driver_alone")
def test_friction_of_feet_and_of_a_joint_reach_their_limits_together():
    """Break-away at 0.5 m g + 2 N, then a slide against this force."""
    times = np.linspace(0, 1, 5)
    found = integrate(Ensemble(build(tipping(joint=True)), np.zeros((1, 0))), times, 1e-9)
    assert found.messages == ("",)
    most = 0.5 * G + 2
    late = np.maximum(0, times - most / 10)
    np.testing.assert_allclose(found.states[0, :, 0], 10 * late**3 / 6, atol=1e-8)
    for name in ("foot0", "foot1", "rail"):
        np.testing.assert_allclose(found.scalars[f"{name}: slip 1"], most / 10, rtol=1e-7)


@pytest.mark.usefixtures("driver_alone")
def test_dry_friction_turns_sticks_and_starts_again():
    """A mass on a spring under dry friction: each half swing loses 2 f / k, until the spring holds less than f."""
    stiffness, limit, begin = 100.0, 4.0, 0.3
    mechanism = uqmbd.Mechanism("spring", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=begin, velocity=0)
    mechanism.add(SlidingFriction("rail", mechanism.ground, mass, 0, 0, 1, friction=limit))
    mechanism.add(PointForce("spring", mass, 0, -stiffness * mass.position[0]))
    mechanism.output("x", mass.position[0], units="m")
    half = np.pi / np.sqrt(stiffness)
    ends = [begin]
    while stiffness * abs(ends[-1]) > limit:
        ends.append(-np.sign(ends[-1]) * (abs(ends[-1]) - 2 * limit / stiffness))
    times = np.array([half * k for k in range(len(ends))] + [2.0, 3.0])
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, 1e-9)
    np.testing.assert_allclose(found.states[0, :, 0], [*ends, ends[-1], ends[-1]], atol=1e-7)


@pytest.mark.usefixtures("driver_alone")
def test_joints_with_dry_friction_start_together_as_each_alone():
    """Five equal masses without contact to each other, pushed at the same time: more combinations than are enumerated."""
    mechanism, limits = uqmbd.Mechanism("masses", uqmbd.Line()), [2.0, 2.0, 2.0 + 1e-9, 3.0, 3.0]
    for k, limit in enumerate(limits):
        mass = mechanism.body(f"m{k}", mass=1, position=0, velocity=0)
        mechanism.add(SlidingFriction(f"rail{k}", mechanism.ground, mass, 0, 0, 1, friction=limit))
        mechanism.add(PointForce(f"push{k}", mass, 0, 10 * uqmbd.t))
        mechanism.output(f"x{k}", mass.position[0], units="m")
    times = np.linspace(0, 1, 5)
    found = integrate(Ensemble(build(mechanism), np.zeros((1, 0))), times, 1e-9)
    assert found.messages == ("",)
    for k, limit in enumerate(limits):
        late = np.maximum(0, times - limit / 10)
        np.testing.assert_allclose(found.states[0, :, k], 10 * late**3 / 6, atol=1e-8)
        np.testing.assert_allclose(found.scalars[f"rail{k}: slip 1"], limit / 10, rtol=1e-8)
        assert f"rail{k}: slip 2" not in found.scalars
