"""What is no start condition is refused where it is stated, with what to write instead."""

from __future__ import annotations

import chaospy
import pytest
import sympy

import uqmbd
from uqmbd_joints import Revolute


@pytest.fixture
def parts():
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar())
    a, b = (mechanism.body(name, mass=1, inertia=1) for name in "ab")
    pin = mechanism.add(Revolute("pin", a, b, (0, 0), (0, 0)))
    return mechanism, a, b, pin


CASES = {
    "compared": (
        lambda a, b, pin: (a.angle == b.angle, None),
        r"condition is False; expected an equation.*sympy.Eq.*Python evaluates == at once",
    ),
    "inequality": (lambda a, b, pin: (a.angle < 3, None), "expected an equation"),
    "no value": (lambda a, b, pin: (a.angle, None), r"without a value; write mechanism.start\(expression, value\)"),
    "two values": (lambda a, b, pin: (sympy.Eq(a.angle, 3), 3), "both an equation and the value 3 are given"),
    "vector": (lambda a, b, pin: (a.position, 3), "2 components; record them one by one"),
    "vectors": (lambda a, b, pin: (a.angle, (3, 4)), "the value"),
    "acceleration": (lambda a, b, pin: (a.acceleration[0], 3), r"a.x'', which is a result of the initial state"),
    "reaction": (lambda a, b, pin: (pin.reaction_force[0], 3), "which is a result of the initial state"),
    "mode": (lambda a, b, pin: (uqmbd.eigenfrequency(1), 3), "which is a result of the initial state"),
    "number": (lambda a, b, pin: (sympy.Integer(2), 3), "so it has no effect"),
    "quadratic": (lambda a, b, pin: (a.velocity.dot(a.velocity), 3), "not linear in the velocities"),
    "symbol": (lambda a, b, pin: (a.angle - sympy.Symbol("k"), 3), "the symbol k, which is neither"),
    "body": (lambda a, b, pin: (a, 3), "body 'a'> itself"),
    "text": (lambda a, b, pin: (a.angle, "3"), "the text '3'"),
    "nan": (lambda a, b, pin: (a.angle, float("nan")), "nan"),
}


@pytest.mark.parametrize("name", CASES)
def test_refused(parts, name):
    mechanism, *others = parts
    make, message = CASES[name]
    with pytest.raises(uqmbd.StudyError, match=message):
        mechanism.start(*make(*others))
    assert not mechanism.conditions


def test_bodies_of_another_mechanism_are_refused(parts):
    other = uqmbd.Mechanism("other", uqmbd.Planar())
    with pytest.raises(uqmbd.StudyError, match="body 'a' is not in mechanism 'other'"):
        other.start(parts[1].angle, 1)


def test_the_same_twice_is_refused(parts):
    mechanism, a, *_ = parts
    mechanism.start(a.angle, 1)
    with pytest.raises(uqmbd.StudyError, match=r"a.angle = 1 is stated twice"):
        mechanism.start(sympy.Eq(a.angle, 1))


def test_random_variables_of_conditions_are_inputs(parts):
    mechanism, a, *_ = parts
    angle = uqmbd.RandomVariable("angle", chaospy.Uniform(0, 1))
    mechanism.start(a.angle, angle)
    assert mechanism.inputs.names == ("angle",)
    assert mechanism.used_inputs() == {"angle"}


def test_check_names_them(parts):
    mechanism, a, b, _ = parts
    mechanism.start(a.angle, 1)
    mechanism.start(sympy.Eq(a.angular_velocity, 2 * b.angular_velocity))
    found = dict(uqmbd.check(mechanism).conditions)
    assert found == {"a.angle = 1": "position", "a.angular_velocity = 2*b.angular_velocity": "velocity"}


def test_an_equation_of_sympy_that_is_always_or_never_true_is_named():
    mechanism = uqmbd.Mechanism("eq", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1)
    for right, told in ((body.angle, "sympy.Eq is True"), (body.angle + 1, "sympy.Eq is False")):
        with pytest.raises(uqmbd.StudyError, match=told):
            mechanism.start(sympy.Eq(body.angle, right))
