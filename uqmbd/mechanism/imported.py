"""Mechanisms that are read from files of other programs, with a list of omissions."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, Literal

import sympy

from uqmbd.arguments import OrInfinite, typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.components import Component
from uqmbd.mechanism.expressions import shown
from uqmbd.mechanism.geometry import Frame, Space
from uqmbd.mechanism.mechanism import Mechanism
from uqmbd.names import did_you_mean
from uqmbd.plugins import reader

__all__ = ["ImportedJoint", "ImportedMechanism", "Omission", "Omissions", "from_mjcf", "from_urdf"]

NAMED = 4
"""Most names of a row that are shown."""


@typechecked
@dataclass(frozen=True)
class ImportedJoint:
    """A joint of a model file.

    Attributes
    ----------
    name : str
        As in the file; made up where it has none there, and longer where something else has it, see
        `ImportedMechanism.joints`.
    kind : {"hinge", "slide", "ball", "free"}
        What it lets move.
    parent, child : str
        The bodies that it joins; ``ground`` is one.
    component : Component or None
        The joint of the mechanism; None where the body is free.
    position : expression or None
        Its angle, rad, or displacement, m, counted as the file counts it; None of a ball or free joint.
    speed : expression or None
        The rate of that.
    start : tuple of float
        Its position where the file lets it start: one number, of a ball joint a quaternion, of a free one the position
        and a quaternion.
    limits : tuple of float, or None
        Lowest and highest position, rad or m; of a ball joint zero and the largest angle.  The output ``NAME.margin``
        reports them; they do not limit the motion.

    Examples
    --------
    >>> import uqmbd
    >>> hinge = uqmbd.extend.ImportedJoint("elbow", "hinge", "upper", "lower", None, None, None, (0.0,), (-1.5, 1.5))
    >>> hinge.units, hinge.limits, hinge.margin is None
    ('rad', (-1.5, 1.5), True)
    """

    name: str
    kind: str
    parent: str
    child: str
    component: Component | None
    position: sympy.Expr | None
    speed: sympy.Expr | None
    start: tuple[float, ...]
    limits: tuple[OrInfinite, OrInfinite] | None

    @property
    def units(self) -> str:
        """Units of `position`."""
        return {"hinge": "rad", "slide": "m"}.get(self.kind, "")

    @property
    def margin(self) -> sympy.Expr | None:
        """Distance from the nearer limit, negative beyond; None without limits."""
        if self.limits is None or self.position is None:
            return None
        low, high = self.limits
        return sympy.Float((high - low) / 2) - sympy.Abs(self.position - sympy.Float((low + high) / 2))


@typechecked
@dataclass(frozen=True)
class Omission:
    """A part of a file that the mechanism omits or changes.

    Attributes
    ----------
    what : str
        The kind of it.
    names : tuple of str
        Which ones.
    why : str
        Why it was left out, or what became of it.

    Examples
    --------
    >>> import uqmbd
    >>> meshes = uqmbd.extend.Omission("meshes", ("hand.stl", "arm.stl"), "nothing is drawn from them")
    >>> meshes.count, meshes.listed
    (2, 'hand.stl, arm.stl')
    """

    what: str
    names: tuple[str, ...]
    why: str

    @property
    def count(self) -> int:
        """Number of such parts."""
        return len(self.names)

    @property
    def listed(self) -> str:
        """The first few names."""
        some = ", ".join(self.names[:NAMED])
        return some if self.count <= NAMED else f"{some} and {self.count - NAMED} more"


@typechecked
class Omissions(Sequence[Omission]):
    """A table of omissions and changes of an import, which prints itself.

    Parameters
    ----------
    rows : sequence of Omission
        In the order of the table.

    Examples
    --------
    >>> print(Omissions([Omission("actuators", ("motor", "brake"), "add drivers or torques")]))
    actuators, 2 (motor, brake): add drivers or torques
    """

    def __init__(self, rows: Sequence[Omission]) -> None:
        self.rows = tuple(rows)

    def __getitem__(self, index: Any) -> Any:
        return self.rows[index]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Omission]:
        return iter(self.rows)

    def __str__(self) -> str:
        lines = [f"{row.what}, {row.count} ({row.listed}): {row.why}" for row in self.rows]
        return "\n".join(lines) or "All was taken."

    def __repr__(self) -> str:
        return f"<{len(self)} rows of what was not taken>"

    def _repr_html_(self) -> str:
        lines = "".join(
            f"<tr><td>{row.count}</td><td>{escape(row.what)}</td><td>{escape(row.listed)}</td>"
            f"<td>{escape(row.why)}</td></tr>"
            for row in self.rows
        )
        head = "<tr><th></th><th>not taken</th><th>which</th><th>why</th></tr>"
        return f"<table>{head}{lines}</table>"


class JointsByName(dict[str, ImportedJoint]):
    """Joints by name, and by their name in the file where that differs.

    >>> joints = JointsByName(elbow=None)
    >>> joints["elbw"]
    Traceback (most recent call last):
    KeyError: "there is no joint 'elbw'; did you mean 'elbow'? There are: elbow."
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.renamed: dict[str, str] = {}

    def __missing__(self, name: str) -> ImportedJoint:
        """Return the joint that the file calls so."""
        if name in self.renamed:
            return self[self.renamed[name]]
        there = ", ".join(self) or "none"
        raise KeyError(f"there is no joint {name!r}{did_you_mean(str(name), list(self)) or '.'} There are: {there}.")


class ImportedMechanism(Mechanism):
    """A mechanism that was read from a file: one like any other, to which more may be added.

    Parameters
    ----------
    name : str
        As `Mechanism`.
    space : Space
        As `Mechanism`.
    source : str
        The file.
    read_by : str
        Who parsed it, with the version.

    Attributes
    ----------
    joints : dict of ImportedJoint
        The joints of the file, by name; ``joints[name]`` also finds one by its name in the file where that is another,
        as of a joint called like a link.
    frames : dict of Frame
        Links that are fixed to a body and have been merged with it, by name: their positions, rotations and velocities
        are expressions for outputs, like those of a body.
    not_taken : Omissions
        What the file says and the mechanism does not, or otherwise; `print` it.

    Examples
    --------
    >>> import uqmbd
    >>> robot = uqmbd.extend.ImportedMechanism("robot", uqmbd.Spatial(), source="robot.urdf", read_by="MuJoCo")
    >>> robot.source, dict(robot.joints), len(robot.not_taken)
    ('robot.urdf', {}, 0)
    """

    def __init__(self, name: str, space: Space, source: str = "", read_by: str = "") -> None:
        super().__init__(name, space)
        self.source = source
        self.read_by = read_by
        self.joints = JointsByName()
        self.frames: dict[str, Frame] = {}
        self.not_taken = Omissions(())


@typechecked
def from_urdf(
    path: str | os.PathLike[str],
    *,
    floating: bool = False,
    fuse: bool = True,
    outputs: bool = True,
    inertia: Literal["refuse", "as stated", "repair"] = "refuse",
) -> ImportedMechanism:
    """Read a robot from a URDF file: links, inertia, joints, limits, damping, friction, mimic joints.

    Nothing in the file is executed, no other file is opened, and no mesh is needed.

    Parameters
    ----------
    path : path
        The file; a xacro template must be expanded first.
    floating : bool
        Whether the first link moves freely; else it is fixed to the ground.
    fuse : bool
        Whether links that are fixed to another become one body with it, whose mass, centre of mass and inertia are
        those of both; else each is a body of its own, held by `uqmbd_joints.Fixed`.
    outputs : bool
        Whether to record each joint's position, and its margin to the nearer limit.
    inertia : {"refuse", "as stated", "repair"}
        What to do with an inertia tensor that no body has, one whose largest principal moment exceeds the sum of the
        others.  ``"refuse"``: raise an error where the excess is more than 1 %.  ``"repair"``: take the nearest tensor
        that a body can have.  ``"as stated"``: keep the kinetic energy of the file by a rotor of the body,
        ``NAME_excess``, with the part that the body cannot have.

    Returns
    -------
    ImportedMechanism
        Its `not_taken` lists what was left out or changed.

    Raises
    ------
    uqmbd.StudyError
        If the file cannot be read or used; the message has the line and the element.

    Notes
    -----
    A link without ``<inertial>`` has no mass, as URDF defines it; nothing is inferred from its shape.

    ``inertia="repair"`` keeps the mass and the centre of mass. It takes the matrix of second moments of mass about that
    centre, ``tr(J) / 2 1 - J``, and sets its negative eigenvalues to zero. This is the nearest matrix in the Frobenius
    norm.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.from_urdf("no_such_robot.urdf")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: from_urdf: no_such_robot.urdf: there is no such file; expected the path of a URDF file.
    """
    return _read("urdf", path, floating=floating, fuse=fuse, outputs=outputs, inertia=inertia)


@typechecked
def from_mjcf(
    path: str | os.PathLike[str], *, keyframe: str | int | None = None, fuse: bool = True, outputs: bool = True
) -> ImportedMechanism:
    """Read a mechanism from an MJCF file of MuJoCo: bodies, joints, springs, friction, rotor inertia, loops.

    The file is parsed and compiled by MuJoCo (``pip install "uqmbd[mujoco]"``); nothing in it is executed.  Equality
    constraints close loops; they are rigid here.

    Parameters
    ----------
    path : path
        The file.
    keyframe : str or int, optional
        Name or number of the keyframe to start from, with its velocities; None: the pose in which the model is written
        (``qpos0``), at rest.
    fuse : bool
        Whether bodies without a joint become one with that to which they are fixed, see `from_urdf`.
    outputs : bool
        Whether to record each joint's position, and its margin to the nearer limit.

    Returns
    -------
    ImportedMechanism
        Its `not_taken` lists what was left out.

    Raises
    ------
    uqmbd.StudyError
        If MuJoCo is not installed, or the file cannot be read or used.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.from_mjcf("no_such_model.xml")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: from_mjcf: no_such_model.xml: there is no such file; expected the path of a MJCF file.
    """
    return _read("mjcf", path, keyframe=keyframe, fuse=fuse, outputs=outputs)


def _read(form: str, path: Any, **options: Any) -> ImportedMechanism:
    """Call the reader of a format."""
    where = f"from_{form}"
    if not isinstance(path, (str, os.PathLike)) or isinstance(os.fspath(path), bytes):
        raise StudyError(f"{where}: path is {shown(path)}; expected the path of a file, a text or pathlib.Path.")
    for key, value in options.items():
        if key not in ("keyframe", "inertia") and not isinstance(value, bool):
            raise StudyError(f"{where}: {key} is {shown(value)}; expected True or False.")
    found: Any = reader(form)()
    read: ImportedMechanism = found.read(os.fspath(path), **options)
    return read
