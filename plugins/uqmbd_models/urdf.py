"""What is read from a URDF file itself: masses as they are stated, and what MuJoCo's parser leaves out, as mimics."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import uqmbd
from uqmbd_models.files import Loaded
from uqmbd_models.names import Names
from uqmbd_models.tree import Array, Coupling, Inertial

__all__ = ["floating_base", "links_without_mass", "mimics", "read_inertials", "unread"]


def read_inertials(loaded: Loaded) -> None:
    """Read mass, centre of mass and inertia of the links, as the file states them; none where it states none."""
    for link in loaded.root.findall("link"):
        name = link.get("name", "")
        given = link.find("inertial")
        where = f"{loaded.path}: link {name!r}: its inertial"
        if given is None:
            loaded.inertials[name] = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
            continue
        origin, mass, inertia = (given.find(tag) for tag in ("origin", "mass", "inertia"))
        com, turn = _vector(where, origin, "xyz"), _vector(where, origin, "rpy")
        xx, yy, zz, xy, xz, yz = (
            _number(where, inertia, f"i{axes}", 0.0) for axes in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
        axes = Rotation.from_euler("xyz", turn).as_matrix()
        tensor = axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
        loaded.inertials[name] = Inertial(_number(where, mass, "value", 0.0), com, tensor)


def floating_base(loaded: Loaded) -> None:
    """Let the first links move freely; one that is called world, or that has no mass nor anything on it, stays."""
    names = Names(joint.name for joint in loaded.spec.joints)
    for body in list(loaded.spec.worldbody.bodies):
        light = loaded.inertials[body.name].mass == 0
        if list(body.joints) or body.name == "world" or (light and not list(body.bodies)):
            continue
        joint = body.add_freejoint()
        joint.name = names.take(f"{body.name}_free")


def mimics(loaded: Loaded) -> tuple[list[Coupling], list[uqmbd.Omission]]:
    """Read joints that follow others: ``q = multiplier q_other + offset``."""
    kinds = {joint.get("name"): joint.get("type") for joint in loaded.root.findall("joint")}
    found: list[Coupling] = []
    still: list[str] = []
    absent: list[str] = []
    for joint in loaded.root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is None:
            continue
        name, other = joint.get("name", ""), mimic.get("joint")
        where = f"{loaded.path}: joint {name!r} mimics {other!r}"
        if kinds.get(name) == "fixed":
            still.append(name)
            continue
        if other not in kinds:
            absent.append(name)
            continue
        for x in (name, other):
            if kinds[x] not in ("revolute", "continuous", "prismatic"):
                raise uqmbd.StudyError(
                    f"{where}: expected two joints that are revolute, continuous or prismatic; {x!r} is {kinds[x]}."
                )
        if other == name:
            raise uqmbd.StudyError(f"{where}: itself; expected another joint.")
        factors = [_number(where, mimic, key, default) for key, default in (("offset", 0.0), ("multiplier", 1.0))]
        found.append(Coupling(f"{name}_mimic", name, other, tuple(factors)))
    rows = [("mimics of fixed joints", still, "these joints do not move")]
    rows.append(("mimics of joints that the file does not have", absent, "these joints move freely"))
    return found, [uqmbd.Omission(what, tuple(names), why) for what, names, why in rows if names]


def _vector(where: str, element: Any, key: str) -> Array:
    """Three numbers of an attribute, zero where it is left out."""
    given = "0 0 0" if element is None else element.get(key, "0 0 0")
    try:
        found = np.array([float(x) for x in given.split()])
    except ValueError:
        found = np.array([])
    if found.shape != (3,) or not np.isfinite(found).all():
        raise uqmbd.StudyError(f"{where}: {key} is {given!r}; expected three numbers.")
    return found


def _number(where: str, element: Any, key: str, default: float) -> float:
    """Return the number of an attribute."""
    given = None if element is None else element.get(key)
    try:
        value = default if given is None else float(given)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise uqmbd.StudyError(f"{where}: {key} is {given!r}; expected a number.")
    return value


def links_without_mass(loaded: Loaded) -> list[uqmbd.Omission]:
    """Tell links that have a shape, but no mass."""
    shaped = tuple(
        link.get("name", "?")
        for link in loaded.root.findall("link")
        if link.find("inertial") is None and (link.find("collision") is not None or link.find("visual") is not None)
    )
    why = "they have no <inertial>: no mass, as URDF says; none is made up from their shapes"
    return [uqmbd.Omission("links with a shape only", shaped, why)] if shaped else []


def unread(loaded: Loaded) -> list[uqmbd.Omission]:
    """Tell what is in the file and in no mechanism: visual shapes, transmissions, limits of effort and speed."""
    rows = []
    for tag, what, why in (
        ("transmission", "transmissions", "add drivers or torques in their place"),
        ("gazebo", "settings of Gazebo", "they concern another program"),
        ("ros2_control", "settings of ros2_control", "they concern another program"),
        ("sensor", "sensors", "record outputs in their place"),
    ):
        names = tuple(x.get("name") or x.get("reference") or tag for x in loaded.root.findall(tag))
        if names:
            rows.append(uqmbd.Omission(what, names, why))
    limited = tuple(
        joint.get("name", "?")
        for joint in loaded.root.findall("joint")
        if (limit := joint.find("limit")) is not None and (limit.get("effort") or limit.get("velocity"))
    )
    if limited:
        rows.append(uqmbd.Omission("limits of effort and speed", limited, "nothing drives the joints"))
    for tag in ("safety_controller", "calibration"):
        names = tuple(j.get("name", "?") for j in loaded.root.findall("joint") if j.find(tag) is not None)
        if names:
            rows.append(uqmbd.Omission(f"{tag} of joints", names, "it concerns a controller"))
    return rows
