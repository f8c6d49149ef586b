"""Mechanism from links and joints: bodies, joints, springs, friction, rotors, loops, outputs."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

import uqmbd
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import Fixed, Prismatic, Revolute, Spherical
from uqmbd_models.forces import add_forces
from uqmbd_models.fusing import Fused, fuse
from uqmbd_models.gaps import list_gaps
from uqmbd_models.inertia import Settled, excess, settle
from uqmbd_models.motion import PlacedJoint, place
from uqmbd_models.names import Names
from uqmbd_models.tree import Coupling, Inertial, Link, LoopClosure, Tree
from uqmbd_springs import Gravity, RotorInertia

__all__ = ["build"]

MASSLESS = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
"""Inertia of the massless bodies between the joints of one link."""

NEGLIGIBLE = 1e-15
"""Entries of an inertia tensor below this multiple of the largest entry are rounding errors of a rotation of axes."""

LOG = logging.getLogger("uqmbd.derivation")
"""Log of the built parts of a mechanism; commands display it as progress."""

CORRECT = "This number is from the model file; correct it in that file."


@dataclass(frozen=True)
class Built:
    """Mechanism under construction, with the used names and the body of each link."""

    mechanism: uqmbd.extend.ImportedMechanism
    names: Names
    bodies: dict[int, Any]


def build(tree: Tree, *, fuse_all: bool, outputs: bool, inertia: str = "refuse") -> uqmbd.extend.ImportedMechanism:
    """Return the mechanism of a model.

    `tree`: content of the file; `fuse_all`: whether links fixed to others are merged with them; `outputs`: whether to
    record positions of joints and margins to their limits; `inertia`: treatment of physically impossible inertia
    tensors.
    """
    count, before = len(tree.links) - 1, tree
    tree, fused = fuse(tree, every=fuse_all)
    if len(tree.links) == 1:
        raise uqmbd.StudyError(
            f"{tree.source}: the model cannot move: none of its links ({count} without the ground) has a joint that "
            "permits motion. Expected at least one such joint; for a robot that is not fixed to the ground, use "
            "from_urdf(path, floating=True)."
        )
    settled = settle(tree, inertia, fused, before)
    try:
        return _built(settled, fused, fuse_all=fuse_all, outputs=outputs)
    except uqmbd.StudyError as error:
        if str(error).startswith(tree.source):
            raise
        raise uqmbd.StudyError(f"{tree.source}: {error} {CORRECT}") from None


def _built(
    settled: Settled, fused: tuple[Fused, ...], *, fuse_all: bool, outputs: bool
) -> uqmbd.extend.ImportedMechanism:
    tree = settled.tree
    space = uqmbd.Spatial(gravity=tuple(map(float, tree.gravity)))
    mechanism = uqmbd.extend.ImportedMechanism(Names().take(tree.name or "model"), space, tree.source, tree.read_by)
    # links and joints keep their names; generated names avoid them
    built = Built(mechanism, Names(), {0: mechanism.ground})
    labels = {k: built.names.take(link.name, "link") for k, link in enumerate(tree.links) if k}
    placed = place(tree, built.names.take_all([joint.name for joint in tree.joints], "joint"))
    by_link: dict[int, list[PlacedJoint]] = {k: [] for k in range(len(tree.links))}
    for joint in placed.joints:
        by_link[joint.joint.link].append(joint)
    for k, link in enumerate(tree.links[1:], 1):
        try:
            _add_link(built, tree, k, labels[k], by_link[k], placed.poses)
        except uqmbd.StudyError as error:
            raise _located_error(tree, link, error) from None
        if k in settled.rotors:
            more, axis = settled.rotors[k]
            rotor = built.names.take(f"{labels[k]}_excess")
            ends = built.bodies[k], mechanism.ground
            mechanism.add(RotorInertia(rotor, *ends, float(more), axis_i=tuple(map(float, axis))))
        LOG.debug("%s: %d of %d", "making bodies of links", k, len(tree.links) - 1)
        if link.compensation:
            name = built.names.take(f"{labels[k]}_compensation")
            mechanism.add(Gravity(name, built.bodies[k], tuple(map(float, -link.compensation * tree.gravity))))
    for loop in tree.loops:
        _close(built, loop)
    for coupling in tree.couplings:
        _couple(built, placed.joints, coupling)
    _add_frames(built, fused)
    rows = [*tree.omissions, *settled.rows, *list_gaps(tree, placed.poses), *_merged(fused, fuse_all)]
    mechanism.not_taken = uqmbd.extend.Omissions([*rows, *_renamed(built, tree, labels, placed.joints)])
    if outputs:
        _record(built)
    return mechanism


def _located_error(tree: Tree, link: Link, error: uqmbd.StudyError) -> uqmbd.StudyError:
    """Return the error of a link with invalid numbers, with the place in the file and a remedy."""
    line = f"line {link.line}: " if link.line else ""
    advice = CORRECT
    if link.line and excess(link.inertial.inertia) > 0:
        advice = (
            'Correct the file, or use inertia="repair" for the nearest physically possible inertia. inertia="as '
            'stated" gives the possible part to the body, and the rest to a RotorInertia.'
        )
    return uqmbd.StudyError(f"{tree.source}: {line}{error} {advice}")


def _add_link(built: Built, tree: Tree, k: int, name: str, joints: list[PlacedJoint], poses: Any) -> None:
    """Add the body of a link, with massless bodies between its joints, and the forces in the joints."""
    mechanism, link = built.mechanism, tree.links[k]
    parent = built.bodies[link.parent]
    if not joints:
        built.bodies[k] = body = _body(mechanism, name, link.inertial, poses[k])
        point = tuple(map(float, link.position))
        weld = Fixed(
            built.names.take(f"{name}_weld"), parent, body, point, (0, 0, 0), tuple(map(float, link.quaternion))
        )
        mechanism.add(weld)
        return
    for n, joint in enumerate(joints):
        if n == len(joints) - 1:
            body = _body(mechanism, name, link.inertial, joint.pose)
            built.bodies[k] = body
        else:
            between = built.names.take(f"{name}_after_{joint.name}")
            body = _body(mechanism, between, MASSLESS, joint.pose)
        _join(built, joint, parent, body)
        parent = body


def _body(mechanism: Any, name: str, inertial: Inertial, pose: Any) -> Any:
    """Add a body at its place, with its velocity if it moves at the start."""
    tensor = (inertial.inertia + inertial.inertia.T) / 2
    tensor[abs(tensor) < NEGLIGIBLE * abs(tensor).max()] = 0.0
    entries = [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    stated: dict[str, Any] = {}
    if pose.moves:
        stated = {"velocity": tuple(map(float, pose.velocity)), "angular_velocity": tuple(map(float, pose.spin))}
    return mechanism.body(
        name,
        mass=float(inertial.mass),
        inertia=tuple(map(float, entries)),
        com=tuple(map(float, inertial.com)),
        position=tuple(map(float, pose.position)),
        quaternion=tuple(map(float, pose.quaternion)),
        **stated,
    )


def _join(built: Built, placed: PlacedJoint, parent: Any, body: Any) -> None:
    """Add a joint and its forces, and store it by its name."""
    joint, mechanism = placed.joint, built.mechanism
    points = {"point_i": placed.point_i, "point_j": placed.point_j}
    axes = {"axis_i": placed.axis_i, "axis_j": placed.axis_j}
    component: Any = None
    if joint.kind == "hinge":
        component = mechanism.add(Revolute(placed.name, parent, body, **points, **axes))
    elif joint.kind == "slide":
        component = mechanism.add(Prismatic(placed.name, parent, body, **points, **axes))
    elif joint.kind == "ball":
        component = mechanism.add(Spherical(placed.name, parent, body, **points))
    zero = _zero_position(placed, component)
    add_forces(mechanism, built.names, placed, parent, body, zero)
    mechanism.joints[placed.name] = uqmbd.extend.ImportedJoint(
        placed.name,
        joint.kind,
        parent.name,
        body.name,
        component,
        None if zero is None else (component.angle if joint.kind == "hinge" else component.displacement) + zero,
        None if zero is None else component.speed,
        tuple(map(float, joint.start)),
        joint.limits,
    )


def _zero_position(placed: PlacedJoint, component: Any) -> float | None:
    """Return the position, as in the file, of a hinge or slide whose component is at zero; None for other joints."""
    if placed.joint.kind == "hinge":
        return float(placed.joint.start[0] - component.joint_angle().near)
    return float(placed.joint.reference[0]) if placed.joint.kind == "slide" else None


def _close(built: Built, loop: LoopClosure) -> None:
    """Close a loop; do nothing for a loop of the ground alone."""
    i, j = built.bodies[loop.link_i], built.bodies[loop.link_j]
    name = built.names.take(loop.name, "loop")
    points = tuple(map(float, loop.point_i)), tuple(map(float, loop.point_j))
    if loop.rotation is None:
        built.mechanism.add(Spherical(name, i, j, *points))
    else:
        built.mechanism.add(Fixed(name, i, j, *points, rotation=tuple(map(float, loop.rotation))))


def _couple(built: Built, joints: tuple[PlacedJoint, ...], coupling: Coupling) -> None:
    """Couple the position of a joint to the position of another joint."""
    by_name = {placed.joint.name: placed for placed in joints}
    first = by_name[coupling.joint]
    value: Any = sympy.Float(coupling.coefficients[0] + first.joint.reference[0])
    if coupling.other is not None:
        other = by_name[coupling.other]
        moved = built.mechanism.joints[other.name].position - sympy.Float(other.joint.reference[0])
        value += sum(sympy.Float(c) * moved**k for k, c in enumerate(coupling.coefficients) if k and c)
    known = built.mechanism.joints[first.name]
    i, j = (built.mechanism.bodies.get(name, built.mechanism.ground) for name in (known.parent, known.child))
    name = built.names.take(coupling.name, "coupling")
    axes = {"axis_i": first.axis_i, "axis_j": first.axis_j}
    if first.joint.kind == "hinge":
        zero = sympy.Float(_zero_position(first, known.component))
        driver: Any = RotationDriver(name, i, j, angle=value - zero, **axes)
    else:
        points = {"point_i": first.point_i, "point_j": first.point_j}
        driver = PositionDriver(
            name, i, j, **points, axis_i=first.axis_i, displacement=value - sympy.Float(first.joint.reference[0])
        )
    built.mechanism.add(driver)


def _add_frames(built: Built, fused: tuple[Fused, ...]) -> None:
    """Add frames for links that were merged with others."""
    names = Names(built.mechanism.bodies)
    for part in fused:
        body = built.bodies[part.link]
        offset, turn = tuple(map(float, part.position)), tuple(map(float, part.quaternion))
        q = (*body.point(offset), *body.attitude(turn))
        v = (*body.point_velocity(offset), *uqmbd.extend.quaternion_product(body.quaternion_rate, turn))
        a = (*body.point_acceleration(offset), *uqmbd.extend.quaternion_product(body.quaternion_acceleration, turn))
        built.mechanism.frames[names.take(part.name)] = uqmbd.extend.Frame(built.mechanism.space, q, v, a)


def _merged(fused: tuple[Fused, ...], every: bool) -> list[uqmbd.extend.Omission]:
    """Return remarks on links that are not separate bodies."""
    grounded = tuple(part.name for part in fused if part.link == 0)
    others = tuple(part.name for part in fused if part.link)
    rows = []
    if grounded:
        rows.append(
            uqmbd.extend.Omission(
                "links fixed to the ground", grounded, "they do not move; their frames are in mechanism.frames, by name"
            )
        )
    if others:
        why = "merged with the bodies that they are fixed to; their frames are in mechanism.frames, by name"
        more = "" if not every else " (fuse=False retains links with mass as separate bodies)"
        rows.append(uqmbd.extend.Omission("links without a joint", others, why + more))
    return rows


def _renamed(
    built: Built, tree: Tree, labels: dict[int, str], joints: tuple[PlacedJoint, ...]
) -> list[uqmbd.extend.Omission]:
    """Return remarks on names that differ from the file, and make joints available by both names."""
    changed = [(placed.joint.name, placed.name) for placed in joints if placed.joint.name != placed.name]
    built.mechanism.joints.renamed.update(changed)
    names = [f"link {tree.links[k].name!r}: {label!r}" for k, label in labels.items() if tree.links[k].name != label]
    names += [f"joint {old!r}: {new!r}" for old, new in changed]
    why = "names must be unique, without line breaks and slashes; the new names follow the old ones"
    return [uqmbd.extend.Omission("names that changed", tuple(names), why)] if names else []


def _record(built: Built) -> None:
    """Record the position of each joint, and its distances from the limits."""
    mechanism = built.mechanism
    names = Names(mechanism.outputs)
    for joint in mechanism.joints.values():
        if joint.position is not None:
            mechanism.output(names.take(joint.name), joint.position, units=joint.units)
        if joint.margin is not None:
            mechanism.output(names.take(f"{joint.name}.margin"), joint.margin, units=joint.units)
        if joint.kind == "free":
            body = mechanism.bodies[joint.child]
            for axis, value in zip("xyz", body.position, strict=True):
                mechanism.output(names.take(f"{joint.name}.{axis}"), value, units="m")
