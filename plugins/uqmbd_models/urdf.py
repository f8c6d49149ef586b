"""Content of a URDF file as numbers: links, joints, mimics, and omitted parts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import uqmbd
from uqmbd_models.documents import Document, XmlElement, parse, prefix
from uqmbd_models.grammar import JOINT, LINK, OPAQUE, number, place, refuse, unknown_words, vector
from uqmbd_models.names import Names
from uqmbd_models.rotations import across, from_rpy, matrix
from uqmbd_models.tree import Array, Coupling, Inertial, Link, Tree, TreeJoint, remarks

__all__ = ["read_urdf"]

MOVING = ("revolute", "continuous", "prismatic")
TYPES = (*MOVING, "fixed", "planar", "floating")

WORLD = "world"
"""Name of a first link that is the ground."""

GRAVITY = (0.0, 0.0, -9.81)
"""Gravity of imported robots, m/s^2; a URDF file does not state it."""

ONE = (1.0, 0.0, 0.0, 0.0)

CONTACTS = "contacts are not imported; add contact components of uqmbd_contact"

ELSEWHERE = "they concern another program"


@dataclass(frozen=True)
class Robot:
    """Parsed file, with its links and joints by name."""

    document: Document
    # links, joints: by name, in the order of the file
    links: dict[str, XmlElement]
    joints: dict[str, XmlElement]
    above: dict[str, str] = field(default_factory=dict)  # name of the parent joint, by the name of the link
    parents: dict[str, str] = field(default_factory=dict)  # name of the parent link, by the name of the link
    rows: list[uqmbd.extend.Omission] = field(default_factory=list)  # omitted parts

    @property
    def roots(self) -> list[str]:
        """Names of links without a parent joint."""
        return [name for name in self.links if name not in self.parents]

    def where(self, element: XmlElement, owner: XmlElement | None = None) -> str:
        """Return the place of an element in the file."""
        return place(self.document.path, element, owner)

    def note(self, what: str, names: list[str], why: str) -> None:
        """Add an omission, unless it has no names."""
        if names:
            self.rows.append(uqmbd.extend.Omission(what, tuple(names), why))


def read_urdf(path: str, floating: bool = False) -> Tree:
    """Return the content of a URDF file.

    `path`: path of the file; `floating`: whether the first links move freely. Raise StudyError with file, line and
    element if it is not a robot.
    """
    where = f"from_urdf: {path}"
    document = parse(where, path, "urdf", OPAQUE)
    _require_robot(where, document)
    refuse(document)
    root = document.root
    links, joints = ({x.get("name"): x for x in root.findall(tag)} for tag in (LINK, JOINT))
    robot = Robot(document, links, joints)
    _connect(robot)
    inertials = {name: _inertial(robot, link) for name, link in robot.links.items()}
    order = _order(robot)
    bodies, moving = _tree(robot, order, inertials, floating)
    couplings = _mimics(robot)
    _note_links(robot, floating)
    _list_unread(robot)
    rows = [*robot.rows, *unknown_words(document), *remarks(moving)]
    by = f"uqmbd {uqmbd.__version__}"
    return Tree(
        root.get("name"), path, by, np.array(GRAVITY), tuple(bodies), tuple(moving), (), tuple(couplings), tuple(rows)
    )


def _require_robot(where: str, document: Document) -> None:
    """Raise StudyError if the root is not the root of a robot, or is a template."""
    root = document.root
    declared = {key.partition(":")[2] for key, x in root.attrib.items() if key.startswith("xmlns:") and "xacro" in x}
    templates = {"xacro", *declared}
    found = next((x for x in root.everything() if prefix(x.tag) in templates), None)
    if found is not None:
        raise uqmbd.StudyError(
            f"{where} is a xacro template (line {found.line}: <{found.tag}>); expand it first: "
            "xacro FILE.xacro > FILE.urdf"
        )
    if root.tag != "robot":
        hint = "; it is MJCF: use uqmbd.from_mjcf" if root.tag == "mujoco" else ""
        raise uqmbd.StudyError(f"{where}: line {root.line}: the root element is <{root.tag}>; expected <robot>{hint}.")


def _connect(robot: Robot) -> None:
    """Store the parent joint and the parent link of each link."""
    for name, joint in robot.joints.items():
        kind = joint.get("type")
        if kind not in TYPES:
            raise uqmbd.StudyError(f"{robot.where(joint)}: the type is {kind!r}; expected one of {', '.join(TYPES)}.")
        parent, child = (_end(robot, joint, tag) for tag in ("parent", "child"))
        if parent == child:
            raise uqmbd.StudyError(
                f"{robot.where(joint)}: the joint connects link {parent!r} to itself; expected two different links."
            )
        if child in robot.above:
            raise uqmbd.StudyError(
                f"{robot.where(joint)}: link {child!r} is already the child of joint {robot.above[child]!r}; a link "
                "can be the child of one joint only, because URDF has no loops."
            )
        robot.above[child], robot.parents[child] = name, parent
    for joint in robot.joints.values():
        parent = _end(robot, joint, "parent")
        if joint.get("type") != "floating" or parent == WORLD:
            continue
        advice = f"Delete this joint and link {parent!r} and pass floating=True, or rename that link to world."
        if parent in robot.parents:
            advice = "A floating joint inside a robot is not supported; change the type of the joint."
        raise uqmbd.StudyError(
            f"{robot.where(joint)}: the floating joint has the parent link {parent!r}; expected a link "
            f"called world. {advice}"
        )


def _end(robot: Robot, joint: XmlElement, tag: str) -> str:
    """Return the name of the link at one end of a joint."""
    end = joint.find(tag)
    if end is None:
        raise uqmbd.StudyError(f'{robot.where(joint)}: it has no <{tag}>; expected <{tag} link="..."/>.')
    name = end.get("link")
    if name not in robot.links:
        raise uqmbd.StudyError(
            f"{robot.where(end, joint)}: the file has no link {name!r}; expected the name of one of its "
            f"{len(robot.links)} links."
        )
    return name


def _order(robot: Robot) -> list[str]:
    """Return the links in an order with each parent first, branch by branch."""
    children: dict[str, list[str]] = {name: [] for name in robot.links}
    for name, parent in robot.parents.items():  # in the order of the joints
        children[parent].append(name)
    found: list[str] = []
    waiting = robot.roots[::-1]
    while waiting:
        found.append(waiting.pop())
        waiting.extend(reversed(children[found[-1]]))
    reached = set(found)
    circle = [name for name in robot.links if name not in reached]
    if circle:
        joint = robot.joints[robot.above[circle[0]]]
        raise uqmbd.StudyError(
            f"{robot.where(joint)}: link {circle[0]!r} is its own ancestor, because the joints form a cycle. Each "
            "chain of joints must start at a link that is not a child."
        )
    return found


def _inertial(robot: Robot, link: XmlElement) -> Inertial:
    """Return mass, centre of mass and inertia of a link as the file states them; zero if it states none."""
    given = link.find("inertial")
    if given is None:
        return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    origin, mass, inertia = (given.find(tag) for tag in ("origin", "mass", "inertia"))
    at_origin, at_mass, at_inertia = (robot.where(x or given, link) for x in (origin, mass, inertia))
    com, turn = vector(at_origin, origin, "xyz"), vector(at_origin, origin, "rpy")
    heavy = number(at_mass, mass, "value", 0.0, low=0.0)
    xx, yy, zz, xy, xz, yz = (number(at_inertia, inertia, f"i{x}", 0.0) for x in ("xx", "yy", "zz", "xy", "xz", "yz"))
    axes = matrix(from_rpy(turn))
    tensor = axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
    if not np.isfinite(tensor).all():
        raise uqmbd.StudyError(f"{at_inertia}: the moments of inertia are too large; expected values in kg m^2.")
    return Inertial(heavy, com, tensor)


def _tree(
    robot: Robot, order: list[str], inertials: dict[str, Inertial], floating: bool
) -> tuple[list[Link], list[TreeJoint]]:
    """Return links and joints in order; the ground is the first link."""
    links = [Link(WORLD, 0, np.zeros(3), np.array(ONE), Inertial(0.0, np.zeros(3), np.zeros((3, 3))))]
    joints: list[TreeJoint] = []
    number_of: dict[str, int] = {}
    names = Names(robot.joints)
    carrying = set(robot.parents.values())
    freed: list[str] = []
    for name in order:
        if name == WORLD and name in robot.roots:
            number_of[name] = 0
            continue
        number_of[name] = k = len(links)
        stated: list[TreeJoint] = []
        parent, position, turn = 0, np.zeros(3), np.array(ONE)
        if name in robot.above:
            joint = robot.joints[robot.above[name]]
            parent, origin = number_of[robot.parents[name]], joint.find("origin")
            where = robot.where(origin or joint, joint if origin is not None else None)
            position, turn = vector(where, origin, "xyz"), from_rpy(vector(where, origin, "rpy"))
            stated = _joints(robot, joint, k, np.concatenate([position, turn]), names)
        links.append(Link(name, parent, position, turn, inertials[name], line=robot.links[name].line))
        if floating and not parent and not stated and (inertials[name].mass or name in carrying):
            stated = [_free(names.take(f"{name}_free"), k, np.concatenate([position, turn]))]
            freed += [robot.above[name]] if name in robot.above else []
        joints.extend(stated)
    robot.note("fixed joints to the world", freed, "ignored because of floating=True: their child links move freely")
    return links, joints


def _joints(robot: Robot, element: XmlElement, link: int, pose: Array, names: Names) -> list[TreeJoint]:
    """Return the joints of a link: none, one, or the three of a planar joint."""
    name, kind = element.get("name"), element.get("type")
    if kind == "fixed":
        return []
    found = element.find("dynamics")
    where = robot.where(found or element, element if found is not None else None)
    damping, friction = (number(where, found, key, 0.0, low=0.0) for key in ("damping", "friction"))
    if kind == "floating":
        return [_free(name, link, pose, damping, friction)]
    stated = element.find("axis")
    where = robot.where(stated or element, element if stated is not None else None)
    axis = vector(where, stated, "xyz", (1, 0, 0))
    largest = np.abs(axis).max()
    if largest == 0:
        raise uqmbd.StudyError(f"{where}: xyz is zero; expected a direction, such as '0 0 1'.")
    axis = axis / largest
    axis = axis / np.linalg.norm(axis)

    def one(suffix: str, form: str, along: Array, limits: tuple[float, float] | None = None) -> TreeJoint:
        zero = np.zeros(1)
        return TreeJoint(
            names.take(name + suffix) if suffix else name,
            form,
            link,
            np.zeros(3),
            along,
            zero,
            zero,
            zero,
            limits,
            damping=damping,
            friction=friction,
        )

    if kind == "planar":
        x, y = across(axis)
        return [one("_TX", "slide", x), one("_TY", "slide", y), one("_RZ", "hinge", axis)]
    form = "slide" if kind == "prismatic" else "hinge"
    if kind == "continuous":
        limit = element.find("limit")
        if limit is not None and (limit.get("lower") is not None or limit.get("upper") is not None):
            robot.note(
                "limits of continuous joints",
                [name],
                "they are ignored, because continuous joints have no limits in URDF",
            )
        return [one("", form, axis)]
    return [one("", form, axis, _limits(robot, element))]


def _free(name: str, link: int, pose: Array, damping: float = 0.0, friction: float = 0.0) -> TreeJoint:
    """Return the joint of a link that moves freely, with its reference pose."""
    return TreeJoint(
        name, "free", link, np.zeros(3), np.array([0.0, 0, 1]), pose, pose, np.zeros(6), rest=pose, damping=damping,
        friction=friction,
    )  # fmt: skip


def _limits(robot: Robot, joint: XmlElement) -> tuple[float, float] | None:
    """Return the limits of a joint, where a missing limit is zero; None if they leave no range."""
    limit = joint.find("limit")
    if limit is None:
        robot.note(
            "joints without <limit>", [str(joint.get("name"))], "they have no limits and no margin in the mechanism"
        )
        return None
    low, high = (number(robot.where(limit, joint), limit, key, 0.0) for key in ("lower", "upper"))
    if low < high:
        return low, high
    why = "lower is not below upper, so these joints have no limits and no margin in the mechanism"
    robot.note("limits without a range", [f"{joint.get('name')} ({low:g} to {high:g})"], why)
    return None


def _mimics(robot: Robot) -> list[Coupling]:
    """Return couplings of joints that follow others: ``q = multiplier q_other + offset``."""
    found: list[Coupling] = []
    still: list[str] = []
    absent: list[str] = []
    for name, joint in robot.joints.items():
        mimic = joint.find("mimic")
        if mimic is None:
            continue
        other, where = mimic.get("joint"), robot.where(mimic, joint)
        if joint.get("type") == "fixed":
            still.append(name)
            continue
        if other not in robot.joints:
            absent.append(name)
            continue
        for x in (name, other):
            kind = robot.joints[x].get("type")
            if kind not in MOVING:
                raise uqmbd.StudyError(
                    f"{where}: joint {name!r} mimics {other!r}, but {x!r} is {kind}. Both joints must be revolute, "
                    "continuous or prismatic."
                )
        if other == name:
            raise uqmbd.StudyError(f"{where}: joint {name!r} mimics itself; expected another joint.")
        factors = tuple(number(where, mimic, key, given) for key, given in (("offset", 0.0), ("multiplier", 1.0)))
        found.append(Coupling(f"{name}_mimic", name, other, factors))
    robot.note("mimics of fixed joints", still, "these joints do not move")
    robot.note("mimics of joints that the file does not have", absent, "these joints move freely")
    _require_no_circle(robot, {coupling.joint: str(coupling.other) for coupling in found})
    return found


def _require_no_circle(robot: Robot, leaders: dict[str, str]) -> None:
    """Raise StudyError if joints follow each other in a circle."""
    done: set[str] = set()
    for first in leaders:
        way: list[str] = []
        name = first
        while name in leaders and name not in done and name not in way:
            way.append(name)
            name = leaders[name]
        if name in way:
            joint = robot.joints[name]
            circle = " -> ".join([*way[way.index(name) :], name])
            raise uqmbd.StudyError(
                f"{robot.where(joint.find('mimic') or joint, joint)}: joints mimic each other in a cycle ({circle}). "
                "Remove <mimic> from one of these joints."
            )
        done.update(way)


def _note_links(robot: Robot, floating: bool) -> None:
    """List massless links, and parts that their <inertial> omits."""
    bare: list[str] = []
    shaped: list[str] = []
    missing: dict[str, list[str]] = {"mass": [], "inertia": [], "moments": []}
    weightless: list[str] = []
    for name, link in robot.links.items():
        given = link.find("inertial")
        if given is None:
            (bare if link.find("collision") is None and link.find("visual") is None else shaped).append(name)
            continue
        for tag in ("mass", "inertia"):
            if given.find(tag) is None:
                missing[tag].append(name)
        mass, inertia = given.find("mass"), given.find("inertia")
        if mass is not None and "value" not in mass.attrib:
            missing["mass"].append(name)
        if inertia is not None:
            left_out = [key for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz") if key not in inertia.attrib]
            missing["moments"] += [f"{' '.join(left_out)} of {name}"] if left_out else []
        if mass is not None and "value" in mass.attrib and not float(mass.get("value")):
            weightless.append(name)
    none = "they have no <inertial>, so their mass is zero"
    robot.note("links without mass and shape", bare, none)
    robot.note("links with a shape only", shaped, f"{none}; uqmbd does not derive a mass from shapes")
    robot.note("links whose mass is zero", weightless, "the file states this value")
    robot.note("links without <mass>", missing["mass"], "their <inertial> has no mass, so their mass is zero")
    robot.note("links without <inertia>", missing["inertia"], "they are point masses without moments of inertia")
    robot.note("missing moments of inertia", missing["moments"], "they are set to zero")
    why = "no joint connects these root links: each " + ("moves freely" if floating else "is fixed to the ground")
    pieces = [name for name in robot.roots if name != WORLD]
    robot.note("robots of several parts", pieces if len(pieces) > 1 else [], why)


def _list_unread(robot: Robot) -> None:
    """List parts of the file that no mechanism has: shapes, transmissions, limits of effort and speed."""
    root = robot.document.root
    colliding = [f"of {name}" for name, link in robot.links.items() for _ in link.findall("collision")]
    robot.note("shapes that collide", colliding, CONTACTS)
    for tag, what, why in (
        ("transmission", "transmissions", "they are not imported; add drivers or torques"),
        ("gazebo", "settings of Gazebo", ELSEWHERE),
        ("ros2_control", "settings of ros2_control", ELSEWHERE),
        ("mujoco", "settings of MuJoCo", f"{ELSEWHERE}; gravity is 9.81 m/s^2 along -z, masses are as stated"),
        ("sensor", "sensors", "they are not imported; define outputs of the mechanism"),
    ):
        robot.note(what, [x.get("name") or x.get("reference") or tag for x in root.findall(tag)], why)
    limits = {name: limit for name, x in robot.joints.items() if (limit := x.find("limit")) is not None}
    driven = [name for name, limit in limits.items() if limit.get("effort") or limit.get("velocity")]
    robot.note("limits of effort and speed", driven, "they are not imported, because no driver acts on the joints")
    planar = [name for name in limits if robot.joints[name].get("type") in ("planar", "floating")]
    robot.note(
        "limits of planar and floating joints", planar, "they are ignored, because URDF does not define their direction"
    )
    for tag in ("safety_controller", "calibration"):
        names = [name for name, joint in robot.joints.items() if joint.find(tag) is not None]
        robot.note(f"{tag} of joints", names, "it concerns a controller and is not imported")
