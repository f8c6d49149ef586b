"""What a URDF file may say: what cannot be is refused, what is not known or has no effect is told."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import uqmbd

__all__ = ["limits", "refuse", "several_roots", "unknown_words"]

LINK, JOINT = "link", "joint"

ATTRIBUTES = {
    "robot": {"name", "version"},
    LINK: {"name", "type"},
    JOINT: {"name", "type"},
    "inertial": set(),
    "origin": {"xyz", "rpy"},
    "mass": {"value"},
    "inertia": {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"},
    "parent": {"link"},
    "child": {"link"},
    "axis": {"xyz"},
    "dynamics": {"damping", "friction"},
    "limit": {"lower", "upper", "effort", "velocity"},
    "mimic": {"joint", "multiplier", "offset"},
}
"""Attributes of the elements that are read."""

ELEMENTS = {
    "robot": {LINK, JOINT, "material", "transmission", "gazebo", "ros2_control", "sensor", "mujoco"},
    LINK: {"inertial", "visual", "collision"},
    JOINT: {"origin", "parent", "child", "axis", "dynamics", "limit", "mimic", "calibration", "safety_controller"},
    "inertial": {"origin", "mass", "inertia"},
}
"""Elements inside of them; none inside the others."""


def refuse(root: Any, path: str) -> None:
    """Raise where a file is no robot: templates that were not expanded, repeated names, floating joints inside.

    Raises
    ------
    uqmbd.StudyError
        With what is wrong, and what to do.
    """
    for element in (x for tag in (LINK, JOINT) for x in root.findall(tag)):
        parts = [element, *(y for inner in element if inner.tag in ATTRIBUTES for y in inner.iter())]
        for key, value in ((key, value) for part in parts for key, value in part.attrib.items()):
            if "${" in value or "$(" in value:
                raise uqmbd.StudyError(
                    f"{path}: {element.tag} {element.get('name', '?')!r}: {key} is {value!r}, which xacro fills in; "
                    "expand the template first: xacro FILE.xacro > FILE.urdf"
                )
    for tag in (LINK, JOINT):
        for name, count in Counter(x.get("name", "") for x in root.findall(tag)).items():
            if count > 1:
                raise uqmbd.StudyError(
                    f"{path}: there are {count} {tag}s called {name!r}; expected each name once. Rename them."
                )
    children = {end.get("link") for joint in root.findall(JOINT) for end in joint.findall("child")}
    for joint in root.findall(JOINT):
        end = joint.find("parent")
        parent = "" if end is None else end.get("link", "")
        if joint.get("type") != "floating" or parent in ("", "world"):
            continue
        advice = f"Leave this joint and link {parent!r} out and use floating=True, or call that link world."
        if parent in children:
            advice = "Nothing in the middle of a robot may float here; give it another type."
        raise uqmbd.StudyError(
            f"{path}: joint {joint.get('name', '?')!r} floats under link {parent!r}; expected a floating joint under "
            f"a link called world alone. {advice}"
        )


def several_roots(root: Any, floating: bool) -> list[uqmbd.Omission]:
    """Tell links that no joint connects with the first one."""
    children = {end.get("link") for joint in root.findall(JOINT) for end in joint.findall("child")}
    roots = [x.get("name", "?") for x in root.findall(LINK) if x.get("name") not in {*children, "world"}]
    why = "no joint connects them with the others: each " + ("moves freely" if floating else "stands on the ground")
    return [uqmbd.Omission("robots in pieces", tuple(roots), why)] if len(roots) > 1 else []


def unknown_words(root: Any) -> list[uqmbd.Omission]:
    """Tell elements and attributes that are not read, as one that is misspelt."""
    found = tuple(dict.fromkeys(_unknown(root, "robot", "")))
    why = "they are not read; are they misspelt?"
    return [uqmbd.Omission("unknown elements and attributes", found, why)] if found else []


def _unknown(element: Any, tag: str, where: str) -> Iterator[str]:
    """Yield unknown words of an element and those inside it."""
    for key in element.attrib:
        if key not in ATTRIBUTES[tag]:
            yield f"{key} of <{tag}>{where}"
    for inner in element:
        if not isinstance(inner.tag, str):  # a comment
            continue
        if inner.tag not in ELEMENTS.get(tag, ()):
            yield f"<{inner.tag.rpartition('}')[2]}>{f' in <{tag}>' if tag not in (LINK, JOINT) else ''}{where}"
        elif inner.tag in ATTRIBUTES:
            named = f" of {inner.tag} {inner.get('name', '?')!r}" if inner.tag in (LINK, JOINT) else where
            yield from _unknown(inner, inner.tag, named)


def limits(root: Any) -> tuple[dict[str, tuple[float, float]], list[uqmbd.Omission]]:
    """Read the limits of joints, and tell those that leave no way between them: nothing comes of these.

    The lower or the upper one is zero where it is left out.
    """
    found: dict[str, tuple[float, float]] = {}
    void = []
    for joint in root.findall(JOINT):
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in ("revolute", "prismatic"):
            continue
        name = joint.get("name", "?")
        try:
            low, high = (float(limit.get(key, 0)) for key in ("lower", "upper"))
        except ValueError:  # the parser tells what is no number
            continue
        if low < high:
            found[name] = (low, high)
        else:
            void.append(f"{name} ({low:g} to {high:g})")
    why = "lower is not below upper: these joints have no limits here and no margin"
    return found, [uqmbd.Omission("limits without a range", tuple(void), why)] if void else []
