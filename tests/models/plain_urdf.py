"""A second reading of URDF, written for the tests: homogeneous matrices and the parser of the standard library alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np


@dataclass
class Plain:
    """A robot at its zero pose.

    Attributes
    ----------
    frames : dict
        Pose (4 x 4) of each link in the world.
    masses : dict
        Mass, centre of mass and inertia about it, world axes, of each link.
    joints : dict
        Type, point and axis in the world, damping, friction, of each joint that moves.
    mimics : dict
        Leader, multiplier and offset.
    """

    frames: dict = field(default_factory=dict)
    masses: dict = field(default_factory=dict)
    joints: dict = field(default_factory=dict)
    mimics: dict = field(default_factory=dict)


def elements(text):
    """Parse bytes without a look at namespaces."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.Parse(text.lstrip(), True)
    return builder.close()


def numbers(element, key, default):
    """Numbers of an attribute."""
    return [float(x) for x in (default if element is None else element.get(key, default)).split()]


def turn(roll, pitch, yaw):
    """Rotation about the fixed axes x, y, z, as the specification writes it."""
    (a, b), (c, d), (e, f) = ((math.cos(x), math.sin(x)) for x in (roll, pitch, yaw))
    x = np.array([[1, 0, 0], [0, a, -b], [0, b, a]])
    y = np.array([[c, 0, d], [0, 1, 0], [-d, 0, c]])
    z = np.array([[e, -f, 0], [f, e, 0], [0, 0, 1]])
    return z @ y @ x


def frame(origin):
    """Pose of an origin."""
    found = np.eye(4)
    found[:3, :3] = turn(*numbers(origin, "rpy", "0 0 0"))
    found[:3, 3] = numbers(origin, "xyz", "0 0 0")
    return found


def plain(text):
    """Read a robot."""
    root = elements(text)
    found = Plain()
    by_child = {joint.find("child").get("link"): joint for joint in root.findall("joint")}

    def pose(name):
        if name not in found.frames:
            joint = by_child.get(name)
            above = np.eye(4) if joint is None else pose(joint.find("parent").get("link"))
            found.frames[name] = above if joint is None else above @ frame(joint.find("origin"))
        return found.frames[name]

    for link in root.findall("link"):
        at, inertial = pose(link.get("name")), link.find("inertial")
        mass, com, tensor = 0.0, np.zeros(3), np.zeros((3, 3))
        if inertial is not None:
            (mass,) = numbers(inertial.find("mass"), "value", "0")
            stated = inertial.find("inertia")
            xx, yy, zz, xy, xz, yz = (numbers(stated, f"i{x}", "0")[0] for x in ("xx", "yy", "zz", "xy", "xz", "yz"))
            inside = frame(inertial.find("origin"))
            com = inside[:3, 3]
            tensor = inside[:3, :3] @ [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] @ inside[:3, :3].T
        found.masses[link.get("name")] = (
            mass, at[:3, :3] @ com + at[:3, 3], at[:3, :3] @ tensor @ at[:3, :3].T,
        )  # fmt: skip
    for joint in root.findall("joint"):
        if joint.get("type") in ("fixed", "floating"):
            continue
        at = found.frames[joint.find("child").get("link")]
        axis = np.array(numbers(joint.find("axis"), "xyz", "1 0 0"))
        dynamics = joint.find("dynamics")
        found.joints[joint.get("name")] = (
            joint.get("type"), at[:3, 3], at[:3, :3] @ axis / math.hypot(*axis),
            *numbers(dynamics, "damping", "0"), *numbers(dynamics, "friction", "0"),
        )  # fmt: skip
        mimic = joint.find("mimic")
        if mimic is not None and mimic.get("joint") in {x.get("name") for x in root.findall("joint")}:
            found.mimics[joint.get("name")] = (
                mimic.get("joint"), *numbers(mimic, "multiplier", "1"), *numbers(mimic, "offset", "0"),
            )  # fmt: skip
    return found
