"""Shapes of model files (URDF, MJCF) for the bodies of an imported mechanism."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import sympy

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.shapes import BodyShape, Box, Capsule, Cylinder, Mesh, Sphere
from uqmbd.typing import Array
from uqmbd_geometry.meshes import read_mesh

__all__ = ["add_model_shapes"]


@dataclass(frozen=True)
class ModelShape:
    """A shape in the frame of a link of a file, or the reason why it is not read."""

    link: str
    shape: BodyShape | None
    reason: str = ""


@typechecked
def add_model_shapes(
    mechanism: Any, path: str | os.PathLike[str] | None = None, which: str = "visual", folder: Any = None
) -> uqmbd.extend.Omissions:
    """Give the bodies of an imported mechanism the shapes of its model file.

    Parameters
    ----------
    mechanism : ImportedMechanism
        Result of `uqmbd.from_urdf` or `uqmbd.from_mjcf`.
    path : str or Path, optional
        Model file. Default: the file of the mechanism.
    which : {"visual", "collision"}
        Shapes for drawings, or simpler shapes for contact.
    folder : str or Path, optional
        Folder that contains all mesh files; a file outside is not read. Default: the folder of the model file. URDF
        files with ``package://`` names need the folder that contains the packages.

    Returns
    -------
    uqmbd.extend.Omissions
        Shapes that were not read, with the reasons.

    Raises
    ------
    uqmbd.StudyError
        If the file cannot be read, or an argument is invalid.

    Examples
    --------
    >>> import uqmbd, uqmbd_geometry
    >>> arm = uqmbd.from_urdf("arm.urdf")  # doctest: +SKIP
    >>> uqmbd_geometry.add_model_shapes(arm)  # doctest: +SKIP
    """
    file = Path(path if path is not None else getattr(mechanism, "source", ""))
    where = f"add_model_shapes: {file}"
    if which not in ("visual", "collision"):
        raise uqmbd.StudyError(f"{where}: which is {which!r}; expected 'visual' or 'collision'.")
    if not file.is_file():
        raise uqmbd.StudyError(f"{where}: there is no such file; expected the URDF or MJCF file of the mechanism.")
    inside = (file.parent if folder is None else Path(folder)).resolve()
    reader = _urdf_shapes if file.suffix.lower() == ".urdf" else _mjcf_shapes
    missing: dict[str, list[str]] = {}
    found: dict[str, list[BodyShape]] = {}
    for one in reader(file, which, inside, where):
        placed = None if one.shape is None else _in_body(mechanism, one)
        if placed is None:
            reason = one.reason or "the link is fixed to the ground, or is not part of the mechanism"
            missing.setdefault(reason, []).append(one.link)
        else:
            found.setdefault(placed[0], []).append(placed[1])
    for name, shapes in found.items():
        body = mechanism.bodies[name]
        body.shapes = (*body.shapes, *shapes)
    rows = [uqmbd.extend.Omission("shapes", tuple(links), reason) for reason, links in missing.items()]
    return uqmbd.extend.Omissions(rows)


def _in_body(mechanism: Any, one: ModelShape) -> tuple[str, BodyShape] | None:
    """Return the body of a link, and the shape in its frame; None if the link belongs to no body."""
    assert one.shape is not None
    if one.link in mechanism.bodies:
        return one.link, one.shape
    frame = mechanism.frames.get(one.link)
    if frame is None:
        return None
    position, rotation = sympy.Matrix(frame.position), sympy.Matrix(frame.rotation)
    symbols = position.free_symbols | rotation.free_symbols
    owners = {s.owner.name for s in symbols if hasattr(s, "owner")}
    if len(owners) != 1:
        return None
    name = owners.pop()
    body = mechanism.bodies[name]
    drawn = dict(zip(body.q, (0, 0, 0, 1, 0, 0, 0), strict=True))
    p = np.array(position.xreplace(drawn), dtype=float).ravel()
    r = np.array(rotation.xreplace(drawn), dtype=float)
    return name, _moved(one.shape, p, r)


def _moved(shape: BodyShape, position: Array, rotation: Array) -> BodyShape:
    """Return a shape in another frame; `position` and `rotation` refer to its present frame."""
    own = np.array([float(x) for x in shape.position])
    place = {"position": tuple((rotation @ own + position).tolist()), "rotation": rotation @ shape.rotation}
    if isinstance(shape, Mesh):
        return Mesh(shape.vertices, shape.faces, shape.scale, **place)
    numbers = [getattr(shape, name) for name in shape.lengths]
    moved: BodyShape = type(shape)(*numbers, **place)
    return moved


def _numbers(text: str | None, default: tuple[float, ...]) -> Array:
    return np.array(default if text is None else [float(x) for x in text.split()], dtype=float)


def _rpy(angles: Array) -> Array:
    """Return the rotation matrix of roll, pitch and yaw about fixed axes."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _urdf_shapes(file: Path, which: str, inside: Path, where: str) -> Iterator[ModelShape]:
    """Yield the shapes of the links of a URDF file."""
    from defusedxml import ElementTree

    try:
        root = ElementTree.fromstring(file.read_bytes())
    except Exception as error:  # noqa: BLE001 - XML that is refused for security has other types of errors
        raise uqmbd.StudyError(f"{where}: the file is not valid XML: {error}.") from None
    for link in root.findall("link"):
        name = link.get("name", "")
        for element in link.findall(which):
            origin, geometry = element.find("origin"), element.find("geometry")
            if geometry is None or not len(geometry):
                continue
            try:
                place = _numbers(None if origin is None else origin.get("xyz"), (0, 0, 0))
                turn = _rpy(_numbers(None if origin is None else origin.get("rpy"), (0, 0, 0)))
                yield ModelShape(name, _urdf_shape(geometry[0], place, turn, file, inside))
            except (uqmbd.StudyError, ValueError, TypeError) as error:
                yield ModelShape(name, None, str(error))


def _urdf_shape(element: Any, position: Array, rotation: Array, file: Path, inside: Path) -> BodyShape:
    place: dict[str, Any] = {"position": tuple(position.tolist()), "rotation": rotation}
    match element.tag:
        case "box":
            return Box(tuple(_numbers(element.get("size"), ()).tolist()), **place)
        case "sphere":
            return Sphere(float(element.get("radius")), **place)
        case "cylinder":
            return Cylinder(float(element.get("radius")), float(element.get("length")), **place)
        case "capsule":
            return Capsule(float(element.get("radius")), float(element.get("length")), **place)
        case "mesh":
            found = read_mesh(_mesh_path(element.get("filename", ""), file, inside), **place)
            scale = _numbers(element.get("scale"), (1, 1, 1))
            faces = found.faces if scale.prod() > 0 else found.faces[:, ::-1]
            return Mesh(found.vertices * scale, faces, **place)
    raise uqmbd.StudyError(f"the geometry <{element.tag}> is unknown")


def _mesh_path(name: str, file: Path, inside: Path) -> Path:
    """Return the path of a mesh file, which must be in a folder after symbolic links are resolved."""
    bare = name.removeprefix("file://")
    package = bare.startswith("package://")
    bare = bare.removeprefix("package://")
    candidates = [inside / bare, inside / Path(*Path(bare).parts[1:])] if package else [file.parent / bare]
    for one in candidates:
        place = one.resolve()
        if not place.is_relative_to(inside):
            raise uqmbd.StudyError(
                f"the mesh file {name!r} is outside of {inside}; give the folder of the meshes by folder="
            )
        if place.is_file():
            return place
    raise uqmbd.StudyError(f"the mesh file {name!r} is not in {inside}; give the folder of the meshes by folder=")


def _mjcf_shapes(file: Path, which: str, inside: Path, where: str) -> Iterator[ModelShape]:
    """Yield the shapes of the bodies of an MJCF file, as MuJoCo compiles them."""
    try:
        import mujoco
    except ImportError:
        raise uqmbd.StudyError(f"{where}: mujoco is not installed; install uqmbd[mujoco].") from None
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        folders = [Path(x) for x in (spec.meshdir, spec.modelfiledir) if x]
        for mesh in spec.meshes:
            if mesh.file:
                tried = [(file.parent / base / mesh.file).resolve() for base in (*folders, Path())]
                if not all(one.is_relative_to(inside) for one in tried if one.exists()):
                    raise uqmbd.StudyError(
                        f"{where}: the mesh file {mesh.file!r} is outside of {inside}; give the folder of the meshes "
                        "by folder=."
                    )
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise uqmbd.StudyError(f"{where}: {' '.join(str(error).split())}") from None
    for k in range(model.ngeom):
        colliding = bool(model.geom_contype[k] or model.geom_conaffinity[k])
        if model.geom_bodyid[k] == 0 or (which == "collision" and not colliding):
            continue
        yield _mjcf_shape(mujoco, model, k)


def _mjcf_shape(mujoco: Any, model: Any, k: int) -> ModelShape:
    kinds = mujoco.mjtGeom
    name = model.body(int(model.geom_bodyid[k])).name
    size, kind = model.geom_size[k].astype(float).tolist(), int(model.geom_type[k])
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, model.geom_quat[k])
    place: dict[str, Any] = {"position": tuple(model.geom_pos[k].tolist()), "rotation": turned.reshape(3, 3)}
    shape: BodyShape | None = None
    if kind == kinds.mjGEOM_BOX:
        shape = Box(tuple(2 * x for x in size), **place)
    elif kind == kinds.mjGEOM_SPHERE:
        shape = Sphere(size[0], **place)
    elif kind == kinds.mjGEOM_CYLINDER:
        shape = Cylinder(size[0], 2 * size[1], **place)
    elif kind == kinds.mjGEOM_CAPSULE:
        shape = Capsule(size[0], 2 * size[1], **place)
    elif kind == kinds.mjGEOM_MESH:
        mesh = int(model.geom_dataid[k])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        start, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        vertices = model.mesh_vert[first : first + count].astype(float)
        shape = Mesh(vertices, model.mesh_face[start : start + number].astype(int), **place)
    reason = "" if shape is not None else f"uqmbd.shapes has no shape for the geometry type {kinds(kind).name}"
    return ModelShape(name, shape, reason)
