"""Bodies: what is taken, and what a message says of what is not."""

from __future__ import annotations

import math
import re

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.mechanism import nominal

LENGTH = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")

PLANE = {
    "mass missing": ({"inertia": 1}, "body 'crank': the mass is missing", "kg"),
    "mass negative": ({"mass": -2, "inertia": 1}, "the mass is -2 kg; expected 0 or more"),
    "mass negative at the means": ({"mass": LENGTH - 3, "inertia": 1}, "-2 kg at the means of the random variables"),
    "mass infinite": ({"mass": math.inf, "inertia": 1}, "mass is inf", "not finite", "expected a number (kg)"),
    "mass not a number": ({"mass": math.nan, "inertia": 1}, "mass is nan", "not finite"),
    "mass infinite at the means": ({"mass": 1 / (LENGTH - 1), "inertia": 1}, "at the means", "divisions by zero"),
    "mass complex at the means": ({"mass": sympy.asin(2 * LENGTH), "inertia": 1}, "at the means", "inverse trigonometric"),
    "mass a text": ({"mass": "2 kg", "inertia": 1}, "mass is the text '2 kg'; expected a number (kg)"),
    "mass of two": ({"mass": (1, 2), "inertia": 1}, "mass has 2 numbers, expected 1"),
    "mass of a truth": ({"mass": True, "inertia": 1}, "mass is True; expected a number"),
    "mass in time": ({"mass": uqmbd.t, "inertia": 1}, "mass: the expression contains t, which changes during the motion"),
    "mass in a stranger": ({"mass": sympy.Symbol("m"), "inertia": 1}, "mass: the expression contains the symbol m, which is neither"),
    "inertia missing": ({"mass": 1}, "the inertia is missing", "one number", "kg m^2"),
    "inertia negative": ({"mass": 1, "inertia": -0.1}, "the inertia is -0.1 kg m^2; expected 0 or more"),
    "inertia spatial": ({"mass": 1, "inertia": (1, 2, 3)}, "inertia has 3 numbers, expected 1"),
    "com short": ({"mass": 1, "inertia": 1, "com": (1,)}, "com has 1 number, expected 2", "centre of mass, body frame"),
    "position long": ({"mass": 1, "inertia": 1, "position": (1, 2, 3)}, "position has 3 numbers, expected 2", "(1, 2, 3)"),
    "position nested": ({"mass": 1, "inertia": 1, "position": ((1, 2), (3, 4))}, "position is ((1, 2), (3, 4)), which is nested"),
    "position of texts": ({"mass": 1, "inertia": 1, "position": ("a", "b")}, "which contains the text 'a'", "expected 2 numbers"),
    "position complex": ({"mass": 1, "inertia": 1, "position": (1, 2j)}, "which contains 2j, which is not real"),
    "position complex expression": ({"mass": 1, "inertia": 1, "position": (1, sympy.I * LENGTH)}, "which is not real"),
    "position with a gap": ({"mass": 1, "inertia": 1, "position": (1, None)}, "(1, None), which contains None"),
    "position an iterator": ({"mass": 1, "inertia": 1, "position": iter((1, 2))}, "position has 1 number, expected 2"),
    "position a mapping": ({"mass": 1, "inertia": 1, "position": {"x": 1}}, "position has 1 number, expected 2"),
    "position in time": ({"mass": 1, "inertia": 1, "position": (uqmbd.t, 0)}, "position: the expression contains t"),
    "velocity short": ({"mass": 1, "inertia": 1, "velocity": 3}, "velocity has 1 number, expected 2"),
    "angular velocity long": ({"mass": 1, "inertia": 1, "angular_velocity": (0, 0, 1)}, "angular_velocity has 3 numbers, expected 1"),
    "angle a text": ({"mass": 1, "inertia": 1, "angle": "up"}, "angle is the text 'up'; expected a number (rad)"),
    "quaternion": ({"mass": 1, "inertia": 1, "quaternion": (1, 0, 0, 0)}, "quaternion is given, but in planar space", "angle= in rad"),
    "hold": ({"mass": 1, "inertia": 1, "hold": "yes"}, "hold is the text 'yes'; expected True or False"),
}  # fmt: skip

SPACE = {
    "inertia missing": ({}, "the inertia is missing", "3 x 3 matrix"),
    "inertia of four": ({"inertia": (1, 2, 3, 4)}, "inertia is (1, 2, 3, 4); expected a 3 x 3 matrix"),
    "inertia negative": ({"inertia": (1, 1, -1)}, "not positive semi-definite", "-1, 1, 1 kg m^2"),
    "inertia indefinite": ({"inertia": (1, 1, 1, 0, 2, 0)}, "not positive semi-definite", "J[0, 2] is +Jxz"),
    "inertia indefinite at the means": ({"inertia": (LENGTH, 1, 1, 0, 2, 0)}, "kg m^2 at the means of the random variables"),
    "inertia unsymmetric": ({"inertia": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, "is not symmetric"),
    "inertia a text": ({"inertia": ("a", 1, 1)}, "inertia is", "which contains the text 'a'"),
    "angle": ({"inertia": (1, 1, 1), "angle": 1}, "angle is given, but in three dimensions", "quaternion=(e0, e1, e2, e3)"),
    "both": ({"inertia": (1, 1, 1), "quaternion": (1, 0, 0, 0), "rotation": np.eye(3)}, "both quaternion and rotation"),
    "quaternion long": ({"inertia": (1, 1, 1), "quaternion": (2, 0, 0, 0)}, "quaternion (2, 0, 0, 0) has the length 2", "expected the length 1"),
    "quaternion short": ({"inertia": (1, 1, 1), "quaternion": (1, 0, 0)}, "quaternion has 3 numbers, expected 4 (scalar first)"),
    "quaternion of zeros": ({"inertia": (1, 1, 1), "quaternion": (0, 0, 0, 0)}, "has the length 0"),
    "rotation scaled": ({"inertia": (1, 1, 1), "rotation": 2 * np.eye(3)}, "is not a rotation", "perpendicular unit vectors"),
    "rotation mirrored": ({"inertia": (1, 1, 1), "rotation": np.diag([1, 1, -1])}, "is not a rotation", "right-handed"),
    "rotation planar": ({"inertia": (1, 1, 1), "rotation": np.eye(2)}, "rotation has 4 numbers, expected 9"),
    "rotation in a row": ({"inertia": (1, 1, 1), "rotation": (1, 0, 0, 0, 1, 0, 0, 0, 1)}, "3 rows and 3 columns"),
}  # fmt: skip

POINTS = {
    "inertia": ({"mass": 1, "inertia": 1}, "inertia is given, but bodies in Translational space are point masses"),
    "angle": ({"mass": 1, "angle": 1}, "angle is given, but bodies in Translational space do not rotate"),
    "angular velocity": ({"mass": 1, "angular_velocity": 1}, "angular_velocity is given, but", "do not rotate"),
}


def refused(make, *words):
    """What `make` raises is one `StudyError` that says all of these (alternatives by a bar)."""
    with pytest.raises(uqmbd.StudyError) as caught:
        make()
    for word in words:
        assert any(choice in str(caught.value) for choice in word.split("|")), f"{word!r} not in {caught.value}"
    assert caught.value.__suppress_context__ or caught.value.__context__ is None


@pytest.mark.parametrize(("given", "words"), [(g, w) for g, *w in PLANE.values()], ids=PLANE)
def test_what_is_wrong_in_the_plane(plane, given, words):
    refused(lambda: plane.body("crank", **given), "body 'crank'", *words)
    assert "crank" not in plane.bodies


@pytest.mark.parametrize(("given", "words"), [(g, w) for g, *w in SPACE.values()], ids=SPACE)
def test_what_is_wrong_in_space(space, given, words):
    refused(lambda: space.body("crank", mass=1, **given), "body 'crank'", *words)


@pytest.mark.parametrize(("given", "words"), [(g, w) for g, *w in POINTS.values()], ids=POINTS)
def test_what_is_wrong_with_a_point_mass(given, words):
    mechanism = uqmbd.Mechanism("machine", uqmbd.Translational())
    refused(lambda: mechanism.body("crank", **given), "body 'crank'", *words)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("rod", ["the body 'rod' has the same name"]),
        ("ground", ["the name 'ground' is reserved"]),
        ("", ["the name is empty"]),
        ("a/b", ["cannot contain '/'"]),
        ("time", ["reserved for the time axis"]),
        (None, ["the name is None", "expected a string"]),
        (3, ["the name is 3 (int)"]),
    ],
)
def test_names(plane, name, words):
    refused(lambda: plane.body(name, mass=1, inertia=1), *words)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: uqmbd.Mechanism("m", uqmbd.Planar), ["the space is the class Planar", "expected e.g. uqmbd.Spatial"]),
        (lambda: uqmbd.Mechanism("m", "planar"), ["the space is the text 'planar'", "uqmbd.Planar(gravity="]),
        (lambda: uqmbd.Mechanism(uqmbd.Planar(), "m"), ["the name is Planar(", "expected a string"]),
        (lambda: uqmbd.Planar(gravity=(0, 0, -9.81)), ["Planar: gravity has 3 numbers, expected 2", "m/s^2"]),
        (lambda: uqmbd.Planar(gravity=9.81), ["Planar: gravity has 1 number, expected 2", "(0.0, -9.81)"]),
        (lambda: uqmbd.Spatial(gravity="down"), ["gravity is the text 'down'"]),
        (lambda: uqmbd.Mechanism("m", uqmbd.Planar((0, sympy.Symbol("g")))), ["gravity", "the symbol g"]),
    ],
)
def test_spaces(make, words):
    refused(make, *words)


def test_all_forms_of_an_inertia_tensor_mean_the_same(space):
    matrix = [[2.5, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 1]]
    forms = [matrix, np.array(matrix), sympy.Matrix(matrix), (2.5, 2, 1, 0.1, 0.2, 0.3)]
    bodies = [space.body(f"b{k}", mass=1, inertia=form) for k, form in enumerate(forms)]
    entries = {tuple(map(float, body.terms.values["inertia"])) for body in bodies}
    assert entries == {(2.5, 2.0, 1.0, 0.1, 0.2, 0.3)}


@pytest.mark.parametrize("turn", [(0.5, 0.5, 0.5, 0.5), (0, 0, 0, -1), (0.1, -0.7, 0.7, math.sqrt(0.01))])
def test_rotation_and_quaternion_mean_the_same(space, turn):
    e = np.array(turn) / np.linalg.norm(turn)
    matrix = np.array(space.space.rotation(list(e)).tolist(), dtype=float)
    one = space.body("one", mass=1, inertia=(1, 1, 1), quaternion=e)
    two = space.body("two", mass=1, inertia=(1, 1, 1), rotation=matrix)
    first, second = ([nominal(x) for x in body.pose.q[3:]] for body in (one, two))
    assert abs(np.dot(first, second)) == pytest.approx(1, abs=1e-12)


def test_numbers_come_in_many_forms(plane):
    forms = [(1, 2), [1.0, 2], np.array([1, 2]), sympy.Matrix([1, 2]), np.array([[1], [2]]), ((1, 2),), range(1, 3)]
    for k, form in enumerate(forms):
        assert [float(x) for x in plane.body(f"b{k}", mass=1, inertia=1, position=form).pose.q[:2]] == [1, 2]


def test_zero_mass_and_inertia_are_numbers(plane):
    body = plane.body("light", mass=0, inertia=0)
    assert body.mass == 0


def test_every_number_may_be_random(plane):
    parts = {
        "mass": 1.0 * LENGTH,
        "inertia": 1.0 * LENGTH**3,
        "com": (LENGTH, 0),
        "position": (0, LENGTH),
        "angle": LENGTH / 2,
    }
    plane.body("crank", **parts, velocity=(1.0 * LENGTH, 0), angular_velocity=1.0 * LENGTH)
    assert plane.inputs.names == ("length",)


@pytest.mark.parametrize("quantity", ["angle", "angular_velocity", "angular_acceleration"])
def test_quantities_of_a_plane_body_are_single_symbols(plane, quantity):
    assert isinstance(getattr(plane.bodies["rod"], quantity), sympy.Symbol)


def test_angle_belongs_to_the_plane(space):
    with pytest.raises(AttributeError, match=re.escape("body 'block' has no .angle: only bodies in Planar space do")):
        _ = space.bodies["block"].angle
