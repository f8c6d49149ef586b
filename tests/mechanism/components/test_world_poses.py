"""Joints given by one pose in the world, as drawn: the same as by two local frames, and what cannot be given so."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import (
    Cylindrical,
    Distance,
    Dot1,
    Fixed,
    Parallel1,
    PointOnPlane,
    Prismatic,
    RackAndPinion,
    Revolute,
    Screw,
    Spherical,
    Universal,
)
from uqmbd_springs import SpringDamper

LENGTH = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
POINT, AXIS = np.array([0.3, -0.7, 1.1]), np.array([2.0, -3.0, 6.0])
Q = {"i": np.array([0.5, -0.1, 0.7, 0.5]), "j": np.array([0.2, 0.9, -0.3, 0.1])}
PLACES = {"i": np.array([1.0, 2.0, -0.5]), "j": np.array([-0.4, 0.6, 0.2])}
BODIES = ("i", "j")


def rotation(q):
    a, (b, c, d) = q[0], q[1:]
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    ) / (a * a + b * b + c * c + d * d)


def two_bodies(**more):
    mechanism = uqmbd.Mechanism("pair", uqmbd.Spatial())
    for name in BODIES:
        pose = {"position": PLACES[name], "quaternion": Q[name] / np.linalg.norm(Q[name])} | more
        mechanism.body(name, mass=1, inertia=(1, 1, 1), **pose)
    return mechanism


def local(name, point=None, axis=None):
    """Point or axis in the frame of a body, by hand."""
    turned = rotation(Q[name]).T
    return turned @ (point - PLACES[name]) if axis is None else turned @ (axis / np.linalg.norm(axis))


@pytest.mark.parametrize(
    ("kind", "keywords", "more"),
    [
        (Revolute, ("at", "axis"), {}),
        (Prismatic, ("at", "axis"), {}),
        (Cylindrical, ("at", "axis"), {}),
        (Screw, ("at", "axis"), {"pitch": 0.1}),
        (Spherical, ("at",), {}),
        (Fixed, ("at",), {}),
        (Parallel1, ("axis",), {}),
        (PointOnPlane, ("at", "axis"), {}),
        (RotationDriver, ("axis",), {"angle": 1}),
        (PositionDriver, ("at", "axis"), {"displacement": 1}),
    ],
)
def test_one_pose_in_the_world_is_two_local_frames(kind, keywords, more):
    mechanism = two_bodies()
    bodies = [mechanism.bodies[name] for name in BODIES]
    given = {"at": POINT, "axis": AXIS}
    joint = mechanism.add(kind("joint", *bodies, **{key: given[key] for key in keywords}, **more))
    for name in BODIES:
        for key, expected in (("point", local(name, point=POINT)), ("axis", local(name, axis=AXIS))):
            if f"{key}_{name}" in kind.parameters():
                found = [float(x) for x in getattr(joint, f"{key}_{name}")]
                np.testing.assert_allclose(found, expected, atol=1e-14)


def test_in_the_plane_and_at_the_ground():
    mechanism = uqmbd.Mechanism("plane", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1, position=(1, 2), angle=0.6)
    joint = mechanism.add(Prismatic("joint", mechanism.ground, body, at=(3, -1), axis=(0, 2)))
    c, s = np.cos(0.6), np.sin(0.6)
    np.testing.assert_allclose([float(x) for x in joint.point_i], (3, -1))
    np.testing.assert_allclose([float(x) for x in joint.point_j], (c * 2 + s * -3, -s * 2 + c * -3), atol=1e-15)
    np.testing.assert_allclose([float(x) for x in joint.axis_i], (0, 1))
    np.testing.assert_allclose([float(x) for x in joint.axis_j], (s, c), atol=1e-15)


@pytest.mark.thorough
def test_a_four_bar_moves_alike(observe_four_bar):
    """A loop of four hinges: the same motion to rounding, given either way."""
    drawn, by_hand = (observe_four_bar(at) for at in (True, False))
    for name in ("x", "force"):
        np.testing.assert_allclose(drawn[name], by_hand[name], rtol=1e-6, atol=1e-8)


@pytest.fixture
def observe_four_bar():
    def run(at):
        points = np.array([(0, 0), (0.5, 1.0), (2.0, 1.5), (2.5, 0)])
        mechanism = uqmbd.Mechanism("four-bar", uqmbd.Planar(gravity=(0, -9.81)))
        links, poses = [mechanism.ground], [(np.zeros(2), 0.0)]
        for k in range(3):
            place, way = points[k : k + 2].mean(axis=0), points[k + 1] - points[k]
            angle = np.arctan2(way[1], way[0])
            links.append(mechanism.body(f"link {k}", mass=1, inertia=0.1, position=place, angle=angle))
            poses.append((place, angle))
        for k in range(4):
            one, two = k, (k + 1) % 4
            where = {"at": points[k]}
            if not at:
                where = {}
                for end, n in (("i", one), ("j", two)):
                    (x, y), a = points[k] - poses[n][0], poses[n][1]
                    where[f"point_{end}"] = (np.cos(a) * x + np.sin(a) * y, np.cos(a) * y - np.sin(a) * x)
            joint = mechanism.add(Revolute(f"hinge {k}", links[one], links[two], **where))
        mechanism.output("x", links[2].position[0], units="m")
        mechanism.output("force", joint.reaction_force[1], units="N")
        return uqmbd.simulate(mechanism, np.linspace(0, 1, 6), rtol=1e-9)

    return run


def refused(make, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        make()


def test_random_geometry_has_to_be_given_in_local_frames():
    mechanism = two_bodies()
    i, j = mechanism.bodies["i"], mechanism.bodies["j"]
    refused(
        lambda: mechanism.add(Spherical("S", i, j, at=(LENGTH, 0, 0))),
        r"Spherical 'S': at is .* depends on length; .*neither random.* Give point_i and point_j in the frames of the bodies",
    )
    refused(
        lambda: mechanism.add(Revolute("R", i, j, at=POINT, axis=(0, LENGTH, 1))),
        r"Revolute 'R': axis is .* depends on length; .* Give axis_i and axis_j in the frames of the bodies",
    )


def test_a_body_drawn_at_a_random_place_takes_an_axis_but_no_point():
    mechanism = two_bodies(position=(LENGTH, 0, 0))
    i, j = mechanism.bodies["i"], mechanism.bodies["j"]
    refused(
        lambda: mechanism.add(Spherical("S", i, j, at=POINT)),
        "Spherical 'S': at is given, but the given pose of body_i 'i' depends on length; .* Give point_i in",
    )
    joint = mechanism.add(Revolute("R", i, j, (0, 0, 0), (0, 0, 0), axis=AXIS))
    np.testing.assert_allclose([float(x) for x in joint.axis_j], local("j", axis=AXIS), atol=1e-14)
    turned = two_bodies(quaternion=(sympy.cos(LENGTH), 0, 0, sympy.sin(LENGTH)))
    bodies = [turned.bodies[name] for name in BODIES]
    refused(lambda: turned.add(Parallel1("P", *bodies, axis=AXIS)), "axis is given, but the given pose of body_i 'i'")


def test_what_cannot_be_given_in_the_world():
    mechanism = two_bodies()
    i, j = mechanism.bodies["i"], mechanism.bodies["j"]
    zero = (0, 0, 0)
    cases = [
        (
            lambda: Revolute("J", i, j, zero, at=POINT, axis=AXIS),
            "both at and point_i are given. Give either at in world axes",
        ),
        (lambda: Revolute("J", i, j, at=POINT, axis=AXIS, axis_j=AXIS), "both axis and axis_j are given"),
        (lambda: Revolute("J", i, j, at=(1, 2), axis=AXIS), "at has 2 numbers, expected 3"),
        (lambda: Revolute("J", i, j, at=POINT, axis=zero), "Revolute 'J': axis"),
        (lambda: Revolute("J", i, j, at=POINT), "'axis_i' is missing .* or axis= in world axes, for the given pose"),
        (lambda: Revolute("J", i, j, axis=AXIS), "'point_i' is missing .* or at= in world axes, for the given pose"),
        (lambda: Revolute("J", i, j, at=uqmbd.t, axis=AXIS), "at has 1 number, expected 3"),
        (lambda: Revolute("J", i, j, at=(uqmbd.t, 0, 0), axis=AXIS), "at is .* depends on t; .* nor time-dependent"),
        # where two points or axes do not coincide, one in the world makes no sense
        (lambda: Distance("J", i, j, at=POINT, length=1), "the class has no argument 'at'"),
        (lambda: SpringDamper("J", i, j, at=POINT, stiffness=1), "the class has no argument 'at'"),
        (lambda: Universal("J", i, j, at=POINT, axis=AXIS), "the class has no argument 'axis'"),
        (lambda: Dot1("J", i, j, axis=AXIS), "the class has no argument 'axis'"),
        (lambda: RackAndPinion("J", i, j, at=POINT, axis=AXIS, radius=1), "the class has no argument 'axis'"),
    ]
    for make, message in cases:
        refused(lambda make=make: mechanism.add(make()), message)
    plane = uqmbd.Mechanism("plane", uqmbd.Planar())
    body = plane.body("body", mass=1, inertia=1)
    refused(
        lambda: plane.add(Revolute("J", plane.ground, body, at=(0, 0), axis=(0, 0, 1))),
        "Revolute 'J': axis is given, but in planar space all rotations have the same axis; omit it",
    )
