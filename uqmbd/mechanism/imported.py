"""Mechanisms from files of other programs, with lists of omitted and changed elements."""

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
"""Largest number of names that a row shows."""


@typechecked
@dataclass(frozen=True)
class ImportedJoint:
    """A joint of a model file.

    Attributes
    ----------
    name : str
        Name in the file. A missing name is generated, and a name that is already used is extended, see
        `ImportedMechanism.joints`.
    kind : {"hinge", "slide", "ball", "free"}
        Kind of the joint.
    parent, child : str
        Names of the connected bodies; ``ground`` is a valid name.
    component : Component or None
        Joint of the mechanism; None for a free body.
    position : expression or None
        Angle, rad, or displacement, m, with the sign and zero of the file. None for a ball or free joint.
    speed : expression or None
        Rate of `position`.
    start : tuple of float
        Initial position in the file: one number; a quaternion for a ball joint; position and quaternion for a free
        joint.
    limits : tuple of float, or None
        Lowest and highest position, rad or m; for a ball joint zero and the largest angle. The limits do not restrict
        the motion. The output ``NAME.margin`` is the distance from the nearer limit.

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
        """Distance from the nearer limit, negative outside the limits; None without limits."""
        if self.limits is None or self.position is None:
            return None
        low, high = self.limits
        return sympy.Float((high - low) / 2) - sympy.Abs(self.position - sympy.Float((low + high) / 2))


@typechecked
@dataclass(frozen=True)
class Omission:
    """Elements of a file, of one kind, that the mechanism omits or changes.

    Attributes
    ----------
    what : str
        Kind of the omitted or changed elements.
    names : tuple of str
        Names of the elements.
    why : str
        Reason for the omission, or description of the change.

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
        """Number of omitted or changed elements."""
        return len(self.names)

    @property
    def listed(self) -> str:
        """First few names of the elements, as text."""
        some = ", ".join(self.names[:NAMED])
        return some if self.count <= NAMED else f"{some} and {self.count - NAMED} more"


@typechecked
class Omissions(Sequence[Omission]):
    """Printable table of omissions and changes of an import.

    Parameters
    ----------
    rows : sequence of Omission
        Omissions and changes, in the order of the table.

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
        return "\n".join(lines) or "Everything was imported."

    def __repr__(self) -> str:
        return f"<{len(self)} rows of omitted or changed parts>"

    def _repr_html_(self) -> str:
        lines = "".join(
            f"<tr><td>{row.count}</td><td>{escape(row.what)}</td><td>{escape(row.listed)}</td>"
            f"<td>{escape(row.why)}</td></tr>"
            for row in self.rows
        )
        head = "<tr><th></th><th>omitted or changed</th><th>names</th><th>reason</th></tr>"
        return f"<table>{head}{lines}</table>"


class JointsByName(dict[str, ImportedJoint]):
    """Dictionary of joints by name, which also accepts the name in the file if it differs.

    >>> joints = JointsByName(elbow=None)
    >>> joints["elbw"]
    Traceback (most recent call last):
    KeyError: "the model has no joint 'elbw'; did you mean 'elbow'? Its joints are: elbow."
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.renamed: dict[str, str] = {}

    def __missing__(self, name: str) -> ImportedJoint:
        """Return the joint whose name in the file is the key."""
        if name in self.renamed:
            return self[self.renamed[name]]
        there = ", ".join(self) or "none"
        raise KeyError(
            f"the model has no joint {name!r}{did_you_mean(str(name), list(self)) or '.'} Its joints are: {there}."
        )


class ImportedMechanism(Mechanism):
    """Mechanism from a file; bodies, components and outputs can be added to it as to any mechanism.

    Parameters
    ----------
    name : str
        Name of the mechanism.
    space : Space
        Space of the motion, with its gravity.
    source : str
        Path of the file.
    read_by : str
        Name and version of the parser.

    Attributes
    ----------
    joints : dict of ImportedJoint
        Joints of the file by name. ``joints[name]`` also accepts the name in the file if it differs, as for a joint
        with the same name as a link.
    frames : dict of Frame
        Links that are fixed to a body and merged with this body, by name. Positions, rotations and velocities of the
        links are expressions for outputs, as for a body.
    not_taken : Omissions
        Elements of the file that the mechanism omits or changes; `print` shows the table.

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
        Path of the URDF file. Expand a xacro template first.
    floating : bool
        Whether the first link moves freely. Default: the first link is fixed to the ground.
    fuse : bool
        Whether to merge links that are fixed to each other into one body, with their total mass, common centre of mass
        and total inertia. Otherwise each link is a separate body, and `uqmbd_joints.Fixed` joints connect the bodies.
    outputs : bool
        Whether to add outputs for the position of each joint and for its distance from the nearer limit.
    inertia : {"refuse", "as stated", "repair"}
        Treatment of an impossible inertia tensor, whose largest principal moment exceeds the sum of the others.
        ``"refuse"``: raise an error if the excess is more than 1 % of the largest moment. ``"repair"``: use the nearest
        possible tensor. ``"as stated"``: keep the kinetic energy defined in the file, with a rotor ``NAME_excess`` for
        the impossible part of the tensor.

    Returns
    -------
    ImportedMechanism
        Imported mechanism; its attribute `not_taken` lists omissions and changes.

    Raises
    ------
    uqmbd.StudyError
        If the file cannot be read or used; the message states the line and the element.

    Notes
    -----
    As in the URDF specification, a link without ``<inertial>`` has no mass; the import infers nothing from its shape.

    ``inertia="repair"`` keeps the mass and the centre of mass. The second moments of mass about the centre of mass form
    the matrix ``(tr(J) / 2) I - J``. The repair sets its negative eigenvalues to zero. The result is the nearest
    positive semi-definite matrix in the Frobenius norm.

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

    MuJoCo (``pip install "uqmbd[mujoco]"``) parses and compiles the file; nothing in the file is executed.  Equality
    constraints, which close loops, are rigid in uqmbd.

    Parameters
    ----------
    path : path
        Path of the MJCF file.
    keyframe : str or int, optional
        Name or number of the keyframe that defines the initial pose and velocities. Default: the pose ``qpos0`` of the
        model, at rest.
    fuse : bool
        Whether to merge every body without a joint with its parent body, see `from_urdf`.
    outputs : bool
        Whether to add outputs for the position of each joint and for its distance from the nearer limit.

    Returns
    -------
    ImportedMechanism
        Imported mechanism; its attribute `not_taken` lists omissions.

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
    uqmbd.errors.StudyError: from_mjcf: no_such_model.xml: there is no such file; expected the path of an MJCF file.
    """
    return _read("mjcf", path, keyframe=keyframe, fuse=fuse, outputs=outputs)


def _read(form: str, path: Any, **options: Any) -> ImportedMechanism:
    """Call the reader of a format."""
    where = f"from_{form}"
    if not isinstance(path, (str, os.PathLike)) or isinstance(os.fspath(path), bytes):
        raise StudyError(f"{where}: path is {shown(path)}; expected the path of a file, a string or pathlib.Path.")
    for key, value in options.items():
        if key not in ("keyframe", "inertia") and not isinstance(value, bool):
            raise StudyError(f"{where}: {key} is {shown(value)}; expected True or False.")
    found: Any = reader(form)()
    read: ImportedMechanism = found.read(os.fspath(path), **options)
    return read
