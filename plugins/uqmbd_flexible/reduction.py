"""Reduction of finite element models to few modes (Craig and Bampton, AIAA Journal 6, 1968)."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.typing import Array
from uqmbd_flexible.integrals import NodalLayout, shape_integrals
from uqmbd_flexible.modal_model import ModalModel, NodeShape

__all__ = ["basis_of", "craig_bampton", "diagonal_modes", "reduced_model"]

RIGID = 1e-7
"""Largest elastic energy of a rigid motion, relative to the energy of an equal motion of the stiffest degree of
freedom."""

TORSION = 1e-3
"""Largest displacement, relative to the largest rotation times the size of the body, in a mode that is a torsion."""

DENSE = 600
"""Number of degrees of freedom up to which modes are computed by dense matrices."""

SHIFT = 1e-9
"""Shift of the eigenvalues of a free body, relative to the ratio of the traces of stiffness and mass."""

DEPENDENT = 1e-12
"""Smallest eigenvalue of the mass of a basis of unit columns, relative to the largest, of independent columns."""


@typechecked
def craig_bampton(
    mass: Any,
    stiffness: Any,
    nodes: Any,
    interfaces: Sequence[Hashable],
    modes: Annotated[int, uqmbd.extend.Bounds(0, 10**6)] = 6,
    names: Sequence[Hashable] | None = None,
    highest: float | None = None,
    stresses: Mapping[str, Any] | None = None,
    stress_units: str = "Pa",
    free_modes: Annotated[int, uqmbd.extend.Bounds(0, 10**6)] = 0,
) -> ModalModel:
    """Reduce a finite element model to constraint modes, and modes with fixed or free interfaces.

    The basis contains the static deformations due to unit displacements of the interface nodes. It also contains the
    lowest modes with fixed interfaces (`modes`) and of the free body (`free_modes`). Static loads at interfaces deform
    the body exactly as the full model. The reduced model is diagonalised, and its rigid motions are removed: the frame
    of the body carries them. The remaining modes are orthogonal to rigid motions (mean axes), so that most integrals of
    the coupling vanish.

    Parameters
    ----------
    mass, stiffness : sparse or dense matrix (dof, dof)
        Symmetric matrices of the free model, kg and N/m. Degrees of freedom are numbered node by node: translations
        first, then rotations (in the plane one), rad, if nodes have them.
    nodes : array (node, d)
        Coordinates of the nodes, m, in the frame of the body; d = 2 in the plane, 3 in space.
    interfaces : sequence
        Nodes where joints and forces act, by their names.
    modes : int
        Number of modes with fixed interfaces. They suit bodies that heavy or fixed neighbours hold at the interfaces.
    names : sequence, optional
        Names of the nodes. Default: numbers from 0.
    highest : float, optional
        Highest frequency of retained modes, Hz. Static loads are then no longer exact. Default: all modes.
    stresses : mapping of str to array (dof,), optional
        Rows that recover a stress or strain from the displacements, per m or rad.
    stress_units : str
        Units of the recovered values.
    free_modes : int
        Number of elastic modes of the free body. They suit bodies with light neighbours; the reduced model has exactly
        their frequencies.

    Returns
    -------
    ModalModel
        Reduced model. A unit of a coordinate, 1 m, is the largest displacement of its shape; of a torsion, it is the
        largest rotation times the size of the body.

    Raises
    ------
    uqmbd.StudyError
        If a matrix is not symmetric, does not fit the nodes, is not the matrix of a free body, or no mode remains.

    Examples
    --------
    Two masses on a line of stiffness, in the plane, with a single elastic mode:

    >>> import numpy as np
    >>> import uqmbd_flexible
    >>> stiffness = np.zeros((4, 4))
    >>> stiffness[np.ix_([0, 2], [0, 2])] = [[8, -8], [-8, 8]]
    >>> model = uqmbd_flexible.craig_bampton(np.eye(4), stiffness, [(0, 0), (1, 0)], interfaces=[0, 1], modes=0)
    >>> model.modes, round(float(2 * np.pi * model.frequencies[0]), 6)  # sqrt(2 k / m)
    (1, 4.0)
    """
    where = "craig_bampton"
    heavy, stiff = _matrix(where, "mass", mass), _matrix(where, "stiffness", stiffness)
    fields = _fields(where, nodes, heavy.shape[0])
    if stiff.shape != heavy.shape:
        raise uqmbd.StudyError(
            f"{where}: the mass matrix has the shape {heavy.shape}, the stiffness matrix {stiff.shape}; expected equal "
            "shapes."
        )
    known: list[Hashable] = list(range(len(fields.nodes))) if names is None else list(names)
    if len(known) != len(fields.nodes) or len(set(known)) != len(known):
        raise uqmbd.StudyError(
            f"{where}: {len(set(known))} different names of nodes are given; expected {len(fields.nodes)}."
        )
    unknown = [x for x in interfaces if x not in known]
    if unknown or not len(interfaces):
        what = f"contain {unknown[0]!r}, which is not a node" if unknown else "are empty; give at least one node"
        raise uqmbd.StudyError(f"{where}: interfaces {what}.")
    _require_free(where, fields, stiff)
    fixed = np.concatenate([known.index(x) * fields.width + np.arange(fields.width) for x in dict.fromkeys(interfaces)])
    basis = basis_of(where, heavy, stiff, fixed, modes)
    if free_modes:
        basis = _independent(heavy, np.column_stack([_free_modes(where, fields, heavy, stiff, free_modes), basis]))
    return reduced_model(
        where, fields, heavy, stiff, basis, known, highest=highest, stresses=stresses, stress_units=stress_units
    )


def reduced_model(
    where: str,
    fields: NodalLayout,
    mass: Any,
    stiffness: Any,
    basis: Array,
    names: Sequence[Hashable],
    *,
    highest: float | None = None,
    stresses: Mapping[str, Any] | None = None,
    stress_units: str = "Pa",
    length: float | None = None,
) -> ModalModel:
    """Diagonalise a basis that contains the rigid motions, remove the rigid motions, and return the model."""
    shapes, values = diagonal_modes(where, fields, mass, stiffness, basis, highest=highest)
    found = shape_integrals(fields, lambda x: np.asarray(mass @ x), shapes)
    moved, turned = fields.parts(shapes)
    nodes = {
        name: NodeShape(place, moved[k], None if turned is None else turned[k])
        for k, (name, place) in enumerate(zip(names, fields.nodes, strict=True))
    }
    modal_mass = np.diag(np.diag(_symmetric(found["modal_mass"])))
    rows = {}
    for name, row in (stresses or {}).items():
        given = np.asarray(row, dtype=float)
        if given.shape != (len(shapes),):
            raise uqmbd.StudyError(
                f"{where}: stresses[{name!r}] has the shape {given.shape}; expected ({len(shapes)},), one per degree "
                "of freedom."
            )
        rows[name] = given @ shapes
    return ModalModel(
        **{**found, "inertia": _symmetric(found["inertia"]), "modal_mass": modal_mass},
        stiffness=np.diag(np.diag(modal_mass) * values),
        nodes=nodes,
        length=float(np.linalg.norm(np.ptp(fields.nodes, axis=0))) if length is None else length,
        stresses=rows,
        stress_units=stress_units,
    )


def diagonal_modes(
    where: str, fields: NodalLayout, mass: Any, stiffness: Any, basis: Array, *, highest: float | None = None
) -> tuple[Array, Array]:
    """Return elastic modes (dof, mode) of a basis, scaled to a largest displacement of 1 m, and their eigenvalues."""
    small, soft = (_symmetric(basis.T @ (x @ basis)) for x in (mass, stiffness))
    values, vectors = scipy.linalg.eigh(soft, small)
    rigid = fields.dimension + fields.rotations
    kept = np.arange(rigid, len(values))
    if highest is not None:
        kept = kept[np.sqrt(np.maximum(values[kept], 0.0)) <= 2 * np.pi * highest]
    if not len(kept):
        raise uqmbd.StudyError(
            f"{where}: no elastic mode remains: {rigid} of the {len(values)} modes are rigid"
            + (
                ""
                if highest is None
                else f"; the lowest elastic frequency is {_hertz(values[rigid:])}, and the limit is "
                f"highest={highest:g} Hz"
            )
            + ". Give more modes or interfaces."
        )
    shapes = basis @ vectors[:, kept]
    moved, turned = fields.parts(shapes)
    # one for the largest displacement, so that coordinates are displacements; signs do not depend on the solver
    flat = moved.reshape(-1, moved.shape[2])
    largest = flat[np.abs(flat).argmax(axis=0), np.arange(flat.shape[1])]
    if turned is not None:  # torsion: the largest rotation times the size of the body
        flat = turned.reshape(-1, turned.shape[2]) * float(np.linalg.norm(np.ptp(fields.nodes, axis=0)))
        twist = flat[np.abs(flat).argmax(axis=0), np.arange(flat.shape[1])]
        largest = np.where(np.abs(largest) < TORSION * np.abs(twist), twist, largest)
    return np.asarray(shapes / largest), np.asarray(values[kept])


def _hertz(values: Array) -> str:
    return f"{np.sqrt(max(float(values[0]), 0.0)) / (2 * np.pi):.4g} Hz" if len(values) else "unknown"


def _symmetric(matrix: Any) -> Array:
    dense = np.asarray(matrix, dtype=float)
    found: Array = (dense + dense.T) / 2
    return found


def _matrix(where: str, name: str, value: Any) -> Any:
    """Return a symmetric sparse matrix."""
    try:
        found = scipy.sparse.csc_array(value, dtype=float)
    except (TypeError, ValueError):
        raise uqmbd.StudyError(
            f"{where}: {name} is a {type(value).__name__}; expected a sparse or dense matrix of numbers."
        ) from None
    if found.ndim != 2 or found.shape[0] != found.shape[1]:
        raise uqmbd.StudyError(f"{where}: {name} has the shape {found.shape}; expected a square matrix.")
    if not np.isfinite(found.data).all():
        raise uqmbd.StudyError(f"{where}: {name} contains a number that is not finite.")
    largest = float(np.abs(found.data).max(initial=0.0))
    off = float(np.abs((found - found.T).data).max(initial=0.0))
    if off > 1e-8 * largest:
        raise uqmbd.StudyError(
            f"{where}: {name} differs from its transpose by {off:.3g}, and its largest entry is {largest:.3g}; "
            "expected a symmetric matrix. Files in symmetric storage contain one triangle only: read them by "
            "uqmbd_flexible.read_matrix."
        )
    return found


def _fields(where: str, nodes: Any, size: int) -> NodalLayout:
    try:
        places = np.array(nodes, dtype=float)
    except (TypeError, ValueError):
        raise uqmbd.StudyError(
            f"{where}: nodes is {nodes!r:.80}; expected an array (node, d) of coordinates, m."
        ) from None
    if places.ndim != 2 or places.shape[1] not in (2, 3) or not np.isfinite(places).all():
        raise uqmbd.StudyError(
            f"{where}: nodes has the shape {places.shape}; expected finite coordinates (node, 2) in the plane or "
            "(node, 3) in space."
        )
    for turns in (False, True):
        fields = NodalLayout(places, turns)
        if len(places) * fields.width == size:
            return fields
    d, r = NodalLayout(places, turns=True).dimension, NodalLayout(places, turns=True).rotations
    raise uqmbd.StudyError(
        f"{where}: the matrices have {size} degrees of freedom, and there are {len(places)} nodes in {d} dimensions; "
        f"expected {len(places) * d} (translations) or {len(places) * (d + r)} (with rotations)."
    )


def _require_free(where: str, fields: NodalLayout, stiffness: Any) -> None:
    """Raise if a rigid motion deforms the model: the model is then supported, or its nodes do not fit."""
    size = float(np.abs(stiffness.diagonal()).max(initial=0.0))
    for name, motion in (("translation", fields.translations()), ("rotation", fields.turnings())):
        force = np.abs(np.asarray(stiffness @ motion)).max(axis=0)
        limit = RIGID * size * np.maximum(np.abs(motion).max(axis=0), 1e-300)
        if (force > limit).any():
            raise uqmbd.StudyError(
                f"{where}: the rigid {name} for axis {int(np.argmax(force / limit)) + 1} causes forces up to "
                f"{force.max():.3g}, and the largest stiffness is {size:.3g}; expected a model without supports, in "
                "which rigid motions cause no force. Remove supports, and check the order of degrees of freedom and "
                "nodes."
            )


def basis_of(where: str, mass: Any, stiffness: Any, fixed: Array, modes: int) -> Array:
    """Return constraint modes, and fixed-interface modes, as columns (dof, mode)."""
    mass, stiffness = scipy.sparse.csc_array(mass), scipy.sparse.csc_array(stiffness)
    size = mass.shape[0]
    inner = np.setdiff1d(np.arange(size), fixed)
    if modes > len(inner):
        raise uqmbd.StudyError(
            f"{where}: modes is {modes}, but the model has only {len(inner)} degrees of freedom that are not at "
            f"interfaces. Use modes={len(inner)} or less, or a finer model."
        )
    basis = np.zeros((size, len(fixed) + modes))
    basis[fixed, np.arange(len(fixed))] = 1.0
    if not len(inner):
        return basis
    stiff = stiffness[inner][:, inner].tocsc()
    try:
        solve = scipy.sparse.linalg.splu(stiff)
    except RuntimeError:
        raise uqmbd.StudyError(
            f"{where}: the stiffness matrix is singular while the interfaces are fixed; the model is in several parts, "
            "or has a mechanism. Add interfaces, or connect the parts."
        ) from None
    basis[inner, : len(fixed)] = -solve.solve(stiffness[inner][:, fixed].toarray())
    if modes:
        basis[inner, len(fixed) :] = _lowest(where, stiff, mass[inner][:, inner].tocsc(), modes, 0.0)
    return basis


def _free_modes(where: str, fields: NodalLayout, mass: Any, stiffness: Any, modes: int) -> Array:
    """Return the lowest modes of the free body (dof, mode), its rigid motions included."""
    size, rigid = mass.shape[0], fields.dimension + fields.rotations
    if modes > size - rigid:
        raise uqmbd.StudyError(
            f"{where}: free_modes is {modes}, but the free body has only {size - rigid} elastic modes. Use "
            f"free_modes={size - rigid} or less, or a finer model."
        )
    # the stiffness of a free body is singular, so the shift is negative
    shift = -SHIFT * float(stiffness.diagonal().sum() / mass.diagonal().sum())
    return _lowest(where, stiffness, mass, rigid + modes, shift)


def _lowest(where: str, stiffness: Any, mass: Any, count: int, shift: float) -> Array:
    """Return the lowest modes (dof, mode) of sparse matrices; the stiffness minus `shift` times the mass is regular."""
    size = mass.shape[0]
    if size > DENSE and count <= size - 2:
        start = np.random.default_rng(0).normal(size=size)
        _, found = scipy.sparse.linalg.eigsh(stiffness, count, mass, sigma=shift, v0=start)
        return np.asarray(found)
    try:
        _, found = scipy.linalg.eigh(stiffness.toarray(), mass.toarray(), subset_by_index=(0, count - 1))
    except scipy.linalg.LinAlgError:
        raise uqmbd.StudyError(
            f"{where}: the mass matrix is not positive definite, as with masses without rotational inertia; condense "
            "the massless degrees of freedom (Guyan), or give them a small inertia."
        ) from None
    return np.asarray(found)


def _independent(mass: Any, basis: Array) -> Array:
    """Return an orthonormal basis (dof, mode) with regard to the mass, without dependent columns."""
    scaled = basis / np.sqrt(np.einsum("dk,dk->k", basis, mass @ basis))
    values, vectors = scipy.linalg.eigh(_symmetric(scaled.T @ (mass @ scaled)))
    kept = values > DEPENDENT * values[-1]
    return np.asarray(scaled @ (vectors[:, kept] / np.sqrt(values[kept])))
