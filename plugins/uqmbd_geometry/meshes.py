"""Mesh files: their surface, and mass, centre of mass and inertia of the enclosed solid."""

from __future__ import annotations

import io
import math
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.shapes import Mesh
from uqmbd.typing import Array, Quantity, Vector

__all__ = ["formats", "from_mesh", "read_mesh", "read_surface"]

MOST_BYTES = 200_000_000
"""Largest mesh file, bytes."""

FORMATS = ("stl", "obj", "ply", "glb", "gltf", "off")
"""File extensions of the supported formats."""

FLAT = 1e-9
"""Volume, relative to the cube of the size of a mesh, that counts as zero."""


def formats() -> str:
    """Return the supported file extensions as text."""
    return ", ".join(f".{name}" for name in FORMATS)


def read_surface(path: str | os.PathLike[str], where: str) -> Any:
    """Return the mesh of a file as an object of trimesh, with merged vertices.

    Only the file itself is read: materials and buffers in other files are ignored or refused. Raise StudyError if the
    mesh cannot be read.
    """
    try:
        import trimesh
    except ImportError:
        raise uqmbd.StudyError(f"{where}: trimesh is not installed; install uqmbd[geometry].") from None
    file = Path(path)
    kind = file.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise uqmbd.StudyError(f"{where}: the format of {str(path)!r} is unknown; expected one of {formats()}.")
    try:
        size = file.stat().st_size
        if not file.is_file():
            raise uqmbd.StudyError(f"{where}: {str(path)!r} is not a file.")
        if size > MOST_BYTES:
            raise uqmbd.StudyError(f"{where}: {str(path)!r} has {size:,} bytes; expected at most {MOST_BYTES:,}.")
        content = file.read_bytes()
    except OSError as error:
        raise uqmbd.StudyError(f"{where}: {str(path)!r} cannot be read: {error.strerror or error}.") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # without a resolver, no other file is read
            found: Any = trimesh.load(io.BytesIO(content), file_type=kind, resolver=None, process=False, force="mesh")
            vertices, faces = np.asarray(found.vertices, dtype=float), np.asarray(found.faces)
            if not len(faces) or vertices.ndim != 2 or vertices.shape[1] != 3 or faces.shape[1] != 3:
                raise ValueError("it contains no triangles")
            if not np.isfinite(vertices).all():
                raise ValueError("it contains coordinates that are not finite")
            if faces.min() < 0 or faces.max() >= len(vertices):
                raise ValueError("its triangles refer to missing vertices")
            made = trimesh.Trimesh(vertices, faces.astype(np.int64), process=False)
            made.merge_vertices(merge_tex=True, merge_norm=True)
            made.update_faces(made.nondegenerate_faces())
            made.remove_unreferenced_vertices()
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001 - readers raise errors of any type for damaged files
        text = " ".join(str(error).split())[:200]
        raise uqmbd.StudyError(f"{where}: {str(path)!r} is not a readable {kind.upper()} mesh: {text}.") from error
    if not len(made.faces):
        raise uqmbd.StudyError(f"{where}: all triangles of {str(path)!r} have the area zero; expected a surface.")
    return made


@typechecked
def read_mesh(
    path: str | os.PathLike[str],
    scale: Quantity = 1.0,
    position: Vector = (0, 0, 0),
    rotation: Any = None,
) -> Mesh:
    """Read the surface of a mesh file as a shape for bodies.

    Parameters
    ----------
    path : str or Path
        File in the format STL, OBJ, PLY, glTF (``.glb``, or ``.gltf`` with embedded buffers) or OFF.
    scale : number or expression
        Metres per unit of the file: 0.001 for millimetres.
    position : sequence of 3 numbers or expressions
        Position of the origin of the file in the body frame, m.
    rotation : array_like, shape (3, 3), optional
        Rotation of the axes of the file, file to body.

    Returns
    -------
    uqmbd.shapes.Mesh
        Shape; an open surface is accepted.

    Raises
    ------
    uqmbd.StudyError
        If the file cannot be read, or contains no triangles.

    Examples
    --------
    >>> import uqmbd_geometry
    >>> uqmbd_geometry.read_mesh("rod.stl", scale=0.001)  # doctest: +SKIP
    Mesh(8 vertices, 12 faces)
    """
    found = read_surface(path, f"read_mesh({str(path)!r})")
    turned = np.eye(3) if rotation is None else rotation
    return Mesh(found.vertices, found.faces, scale, position=position, rotation=turned)


@typechecked
def from_mesh(
    path: str | os.PathLike[str],
    density: Quantity,
    scale: Quantity = 1.0,
    planar: bool = False,
) -> dict[str, Any]:
    """Return mass, centre of mass, inertia and shape of a solid from its surface, as arguments of `Mechanism.body`.

    The body frame is the frame of the file. The density is uniform.

    Parameters
    ----------
    path : str or Path
        Mesh file, as for `read_mesh`; its surface must be closed.
    density : number or expression
        Density, kg/m^3; it may be a random variable.
    scale : number or expression
        Metres per unit of the file: 0.001 for millimetres. It may be a random variable, such as a shrinkage.
    planar : bool
        Whether the body moves in the plane of the first two axes.

    Returns
    -------
    dict
        ``mass``, ``com``, ``inertia`` and ``shape``: ``mechanism.body("rod", **from_mesh("rod.stl", 7850, 0.001))``.

    Raises
    ------
    uqmbd.StudyError
        If the surface is open, or inverted, or intersects itself so that its volume is not positive. The message
        states the remedy.

    Notes
    -----
    The integrals over the polyhedron are exact (D. Eberly, Polyhedral mass properties, 2002; in trimesh).
    The error is therefore the error of the mesh: of second order in the length of the edges, for curved surfaces.

    Examples
    --------
    >>> import uqmbd_geometry
    >>> uqmbd_geometry.from_mesh("rod.stl", density=7850, scale=0.001)["mass"]  # doctest: +SKIP
    1.2
    """
    where = f"from_mesh({str(path)!r})"
    if isinstance(density, (int, float)) and not (math.isfinite(density) and density > 0):
        raise uqmbd.StudyError(f"{where}: density is {density!r}; expected a positive number in kg/m^3.")
    factor = uqmbd.extend.numbers(where, "scale", scale, 1, "m per unit of the file", scalar=True)[0]
    heavy = uqmbd.extend.numbers(where, "density", density, 1, "kg/m^3", scalar=True)[0]
    found = read_surface(path, where)
    volume, centre, tensor = _integrals(found, where)
    mass = heavy * factor**3 * volume
    moments = [mass * factor**2 * float(x) for x in tensor / volume]
    shape = Mesh(found.vertices, found.faces, scale)
    com = tuple(factor * float(x) for x in centre)
    if planar:
        return {"mass": mass, "com": com[:2], "inertia": moments[2], "shape": shape}
    return {"mass": mass, "com": com, "inertia": tuple(moments), "shape": shape}


def _integrals(found: Any, where: str) -> tuple[float, Array, Array]:
    """Return volume, centre and inertia (xx, yy, zz, xy, xz, yz) about it, at density 1 in units of the file."""
    if not found.is_watertight:
        edges = np.sort(found.edges, axis=1)
        _, counts = np.unique(edges, axis=0, return_counts=True)
        raise uqmbd.StudyError(
            f"{where}: the surface is open: {np.count_nonzero(counts == 1)} edges belong to one triangle, and "
            f"{np.count_nonzero(counts > 2)} to more than two. Close the holes in the CAD program or with "
            "trimesh.repair.fill_holes; or read the shape by read_mesh, and give mass, com and inertia."
        )
    if not found.is_winding_consistent:
        raise uqmbd.StudyError(
            f"{where}: some triangles are inverted: neighbours have opposite orientations. Repair them with "
            "trimesh.repair.fix_winding, and save the mesh."
        )
    with np.errstate(all="ignore"):  # without a volume, the centre is undefined
        volume = float(found.volume)
    size = float(np.linalg.norm(np.ptp(found.vertices, axis=0)))
    if volume < -FLAT * size**3:
        raise uqmbd.StudyError(
            f"{where}: the surface is inverted: its volume is {volume:.4g} cubic units of the file. Turn all triangles "
            "around, for example with Trimesh.invert(), and save the mesh."
        )
    if not volume > FLAT * size**3:
        raise uqmbd.StudyError(
            f"{where}: the volume of the surface is {volume:.4g} cubic units of the file, which is zero within "
            "rounding; expected a solid."
        )
    centre, matrix = np.asarray(found.center_mass, dtype=float), np.asarray(found.moment_inertia, dtype=float)
    return volume, centre, matrix[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
