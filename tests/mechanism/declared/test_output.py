"""Outputs: scalars that depend on something."""

from __future__ import annotations

import math

import chaospy
import pytest
import sympy

import uqmbd
from uqmbd_joints import Revolute

LENGTH = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")

WRONG = {
    "a body": (lambda m, rod: rod, "is <body 'rod'> itself", "rod.position[0]"),
    "the ground": (lambda m, rod: m.ground, "itself; record one of its quantities"),
    "a joint": (lambda m, rod: m.components["pivot"], "record one of its reactions, e.g. pivot.reaction_force[0]"),
    "a vector": (lambda m, rod: rod.position, "has 2 components; record them one by one"),
    "a matrix": (lambda m, rod: rod.rotation, "has 4 components"),
    "a truth": (lambda m, rod: True, "the expression is True; expected a number"),
    "a text": (lambda m, rod: "rod.angle", "the expression is the text 'rod.angle'"),
    "nothing": (lambda m, rod: None, "the expression is missing"),
    "no entry": (lambda m, rod: [], "has 0 numbers, expected 1"),
    "a constant": (lambda m, rod: 3, "is the constant 3. Expected an expression in quantities"),
    "a constant of the ground": (lambda m, rod: m.ground.position[0], "Expected an expression in quantities"),
    "what vanishes": (lambda m, rod: rod.angle - rod.angle, "is the constant 0. Expected an expression in quantities"),
    "a condition": (lambda m, rod: rod.position[0] > 0, "is a relation or condition"),
    "a method": (lambda m, rod: rod.point, "the function point; record its result"),
    "a class": (lambda m, rod: Revolute, "is the function Revolute|is the class Revolute"),
    "infinite": (lambda m, rod: rod.angle * sympy.zoo, "not finite"),
    "complex": (lambda m, rod: sympy.I * rod.angle, "not real"),
    "a stranger": (lambda m, rod: sympy.Symbol("x"), "the symbol x, which is neither"),
}


@pytest.fixture
def machine(plane):
    plane.add(Revolute("pivot", plane.ground, plane.bodies["rod"], (0, 0), (0, 0)))
    return plane


@pytest.mark.parametrize(("make", "words"), [(m, w) for m, *w in WRONG.values()], ids=WRONG)
def test_what_cannot_be_recorded(machine, make, words):
    with pytest.raises(uqmbd.StudyError) as caught:
        machine.output("x", make(machine, machine.bodies["rod"]))
    assert str(caught.value).startswith("output 'x'")
    for word in words:
        assert any(choice in str(caught.value) for choice in word.split("|")), str(caught.value)
    assert not machine.outputs


def test_name_and_units(machine):
    angle = machine.bodies["rod"].angle
    machine.output("x", angle, units="rad")
    for name, words in (
        ("x", "an output with this name exists already"),
        ("", "empty"),
        ("time", "time axis"),
        (1, "expected a string"),
    ):
        with pytest.raises(uqmbd.StudyError, match=words):
            machine.output(name, angle)
    with pytest.raises(uqmbd.StudyError, match="output 'y': units is 5"):
        machine.output("y", angle, units=5)


@pytest.mark.parametrize("units", ["", "m", "degree", "RAD"])
def test_angle_has_units_of_an_angle(machine, units):
    x, y = machine.bodies["rod"].position
    with pytest.raises(uqmbd.StudyError) as caught:
        machine.output("x", sympy.atan2(y, x), units=units, angle=True)
    assert "output 'x': the output is declared as an angle" in str(caught.value) and "'rad' or 'deg'" in str(
        caught.value
    )
    with pytest.raises(uqmbd.StudyError, match="output 'x': angle is 'deg'|output 'x': angle is the text 'deg'"):
        machine.output("x", sympy.atan2(y, x), units="deg", angle="deg")
    assert not machine.outputs


def test_length_of_a_turn(machine):
    x, y = machine.bodies["rod"].position
    machine.output("plain", sympy.atan2(y, x), units="rad")
    machine.output("radians", sympy.atan2(y, x), units="rad", angle=True)
    machine.output("degrees", sympy.deg(sympy.atan2(y, x)), units="deg", angle=True)
    assert [o.turn for o in machine.outputs.values()] == [0, 2 * math.pi, 360]


def test_other_mechanisms_have_other_bodies(machine):
    other = uqmbd.Mechanism("other", uqmbd.Planar())
    rod = other.body("rod", mass=1, inertia=1)
    with pytest.raises(uqmbd.StudyError, match="this body 'rod' belongs to another mechanism than 'machine'"):
        machine.output("x", rod.position[0])
    pivot = Revolute("pivot", machine.ground, machine.bodies["rod"], (0, 0), (0, 0))
    with pytest.raises(uqmbd.StudyError, match="'pivot' was not added to mechanism 'machine'; call mechanism.add"):
        machine.output("x", pivot.reaction_force[0])


def test_everything_scalar_can_be_recorded(machine):
    rod, pivot = machine.bodies["rod"], machine.components["pivot"]
    quantities = [
        rod.position[0], rod.velocity[1], rod.acceleration[0], rod.rotation[0, 1], rod.quaternion[0], rod.angle,
        rod.angular_velocity, rod.angular_velocity[0], rod.angular_acceleration, rod.point((1, LENGTH))[0],
        rod.point_velocity((1, 0))[1], pivot.reaction_force[0], pivot.reaction_moment, pivot.reaction_moment[0],
        LENGTH, uqmbd.t, sympy.sqrt(rod.position[0] ** 2 + 1), [rod.angle], sympy.Matrix([rod.angle]),
    ]  # fmt: skip
    for k, quantity in enumerate(quantities):
        machine.output(f"x{k}", quantity)
    assert len(machine.outputs) == len(quantities)


def test_inputs_of_outputs_count(machine):
    machine.output("reach", LENGTH * machine.bodies["rod"].angle)
    assert machine.inputs.names == ("length",) and machine.used_inputs() == {"length"}


def test_two_random_variables_of_one_name(plane):
    other = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.1))
    plane.body("crank", mass=1.0 * LENGTH, inertia=other)
    with pytest.raises(uqmbd.StudyError) as caught:
        _ = plane.inputs
    assert "'length' exists twice" in str(caught.value) and "Normal(mu=1, sigma=0.1)" in str(caught.value)


@pytest.mark.parametrize("method", ["point", "direction", "point_velocity", "point_acceleration"])
def test_a_point_of_a_body_is_not_given_in_symbols_that_stand_for_nothing(plane, method):
    """It is refused there, also where nobody uses what is returned."""
    with pytest.raises(uqmbd.StudyError, match=r"its argument local contains the symbol k, which is neither"):
        getattr(plane.bodies["rod"], method)((sympy.Symbol("k"), 0))
