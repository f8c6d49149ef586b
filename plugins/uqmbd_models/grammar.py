"""Grammar of a URDF file: invalid contents are rejected, unknown or ineffective ones are listed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

import uqmbd
from uqmbd_models.documents import Document, XmlElement, prefix
from uqmbd_models.tree import Array

__all__ = ["JOINT", "LINK", "OPAQUE", "number", "place", "refuse", "unknown_words", "vector"]

LINK, JOINT = "link", "joint"

OPAQUE = frozenset(("visual", "collision", "gazebo", "transmission", "material", "ros2_control", "sensor", "mujoco"))
"""Elements whose content is not read."""

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
"""Allowed child elements, by the name of the parent element; elements that are not listed have no children."""

TURNED = 1e6
"""Largest angle, rad; beyond it, the digits of a number hardly determine a direction."""

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def place(path: str, element: XmlElement, owner: XmlElement | None = None) -> str:
    """Return the place of an element: file, line, tag, and its link or joint."""
    name = f" {element.get('name')!r}" if element.get("name") else ""
    of = f" of {owner.tag} {owner.get('name', '')!r}" if owner is not None else ""
    return f"{path}: line {element.line}: <{element.tag}>{name}{of}"


def number(where: str, element: XmlElement | None, key: str, default: float, low: float = -np.inf) -> float:
    """Return the number in an attribute, or the default if it is missing."""
    given = None if element is None else element.attrib.get(key)
    if given is None:
        return default
    found = float(given) if NUMBER.fullmatch(given.strip()) else np.nan
    if not np.isfinite(found):
        raise uqmbd.StudyError(f"{where}: {key} is {_shown(given)}; expected a finite number, such as 0.5.")
    if found < low:
        raise uqmbd.StudyError(f"{where}: {key} is {_shown(given)}; expected a number of at least {low:g}.")
    return found


def vector(where: str, element: XmlElement | None, key: str, default: tuple[float, float, float] = (0, 0, 0)) -> Array:
    """Return the three numbers in an attribute, or the default if it is missing."""
    given = None if element is None else element.attrib.get(key)
    if given is None:
        return np.array(default, dtype=float)
    parts = given.split()
    found = np.array([float(x) if NUMBER.fullmatch(x) else np.nan for x in parts])
    if found.shape != (3,) or not np.isfinite(found).all():
        raise uqmbd.StudyError(f"{where}: {key} is {_shown(given)}; expected three finite numbers, such as '0 0 0.5'.")
    if key == "rpy" and np.abs(found).max() > TURNED:
        raise uqmbd.StudyError(
            f"{where}: rpy is {_shown(given)}; expected three angles in rad, of magnitude up to {TURNED:g}."
        )
    return found


def _shown(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:60] + "...")


def refuse(document: Document) -> None:
    """Raise StudyError for an invalid robot: unexpanded templates, or missing or repeated names.

    The message states the error and a remedy.
    """
    path, root = document.path, document.root
    for element in (x for tag in (LINK, JOINT) for x in root.findall(tag)):
        parts = [element, *(y for inner in element if inner.tag in ATTRIBUTES for y in inner.everything())]
        for part, key, value in ((x, key, value) for x in parts for key, value in x.attrib.items()):
            if "${" in value or "$(" in value:
                raise uqmbd.StudyError(
                    f"{place(path, part, element if part is not element else None)}: {key} is {_shown(value)}, a "
                    "xacro expression. Expand the template first: xacro FILE.xacro > FILE.urdf"
                )
    for tag in (LINK, JOINT):
        first: dict[str, XmlElement] = {}
        for element in root.findall(tag):
            name = element.get("name", "")
            if not name.strip():
                raise uqmbd.StudyError(f'{place(path, element)}: it has no name; expected name="...".')
            if name in first:
                raise uqmbd.StudyError(
                    f"{place(path, element)}: line {first[name].line} already defines a {tag} of this name; expected "
                    "unique names. Rename one of them."
                )
            first[name] = element
    if root.find(LINK) is None:
        raise uqmbd.StudyError(
            f"{place(path, root)}: the robot has no <link>; expected at least two links and a <joint>."
        )


def unknown_words(document: Document) -> list[uqmbd.extend.Omission]:
    """Return a list of ignored elements and attributes, such as misspelt names."""
    unknown: dict[str, None] = {}
    foreign: dict[str, None] = {}
    twice: dict[str, None] = {}
    for kind, text in _unknown(document.root, "robot", ""):
        {"unknown": unknown, "foreign": foreign, "twice": twice}[kind][text] = None
    rows = [
        ("unknown elements and attributes", unknown, "uqmbd does not read them; check their spelling"),
        ("elements of other programs", foreign, "they concern another program"),
        ("repeated elements", twice, "only the first one is read"),
        ("deviations from XML", dict.fromkeys(document.slips), "uqmbd reads the file in spite of them"),
    ]
    return [uqmbd.extend.Omission(what, tuple(names), why) for what, names, why in rows if names]


def _unknown(element: XmlElement, tag: str, where: str) -> Iterator[tuple[str, str]]:
    """Yield unknown attributes and elements, and repeated elements, in an element and its descendants."""
    for key in element.attrib:
        if key not in ATTRIBUTES[tag] and prefix(key) not in ("xmlns", "xml") and key != "xmlns":
            yield ("foreign" if prefix(key) else "unknown"), f"{key} of <{tag}>{where}"
    if tag != "robot":
        for word, count in Counter(x.tag for x in element).items():
            if count > 1 and word in ATTRIBUTES:
                yield "twice", f"<{word}>{where}"
    for inner in element:
        if inner.tag not in ELEMENTS.get(tag, ()):
            inside = f" in <{tag}>" if tag not in (LINK, JOINT) else ""
            yield ("foreign" if prefix(inner.tag) else "unknown"), f"<{inner.tag}>{inside}{where}"
        elif inner.tag in ATTRIBUTES:
            named = f" of {inner.tag} {inner.get('name', '?')!r}" if inner.tag in (LINK, JOINT) else where
            yield from _unknown(inner, inner.tag, named)
