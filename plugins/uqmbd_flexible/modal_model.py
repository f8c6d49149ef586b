"""Modal models: inertia shape integrals, stiffness, damping and mode shapes at nodes of a flexible body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import scipy.linalg
import sympy

import uqmbd
from uqmbd.extend import numbers, typechecked
from uqmbd.typing import Array

__all__ = ["ModalModel", "NodeShape"]

SYMMETRIC = 1e-8
"""Largest difference of a matrix from its transpose, relative to its largest entry."""


@typechecked(values=False)
@dataclass(frozen=True)
class NodeShape:
    """Place of a node, and its displacement and rotation in each mode.

    Attributes
    ----------
    position : array, shape (d,)
        Place in the undeformed body, in the frame of the body, m.
    translation : array, shape (d, mode)
        Displacement for a unit value of each coordinate.
    rotation : array, shape (r, mode), or None
        Rotation, rad, for a unit value of each coordinate, with r = 1 in the plane and 3 in space. None: the node has
        no rotation, so that only its point is known.

    Examples
    --------
    The tip of a rod of 1 m, which one mode moves by 1 and turns by 1.4 for each metre of its coordinate:

    >>> import uqmbd_flexible
    >>> tip = uqmbd_flexible.NodeShape((1, 0), [[0], [1]], [[1.4]])
    >>> tip.position
    (1, 0)
    """

    position: Array
    translation: Array
    rotation: Array | None = None


@typechecked
@dataclass(frozen=True)
class ModalModel:
    """Flexible body in modal coordinates: all integrals of a floating frame of reference.

    `craig_bampton` and `Beam` make such models. Create a model directly if its integrals are from another source. The
    displacement in the frame of the body is ``u = sum_k shape_k(x) q_k``. The dimension of the space is ``d``, and the
    number of rotations is ``r``, 1 in the plane and 3 in space. Integrals extend over the undeformed body.

    Parameters
    ----------
    mass : float
        Mass, kg.
    com : sequence, length d
        Centre of mass of the undeformed body, m.
    inertia : float, or matrix (3, 3)
        Inertia of the undeformed body about the origin of its frame, kg m^2.
    modal_mass : matrix (mode, mode)
        Integral of ``rho shape_j . shape_k``, kg.
    stiffness : matrix (mode, mode)
        Modal stiffness, N/m.
    translation : matrix (d, mode)
        Integral of ``rho shape_k``, kg.
    rotation : matrix (r, mode)
        Integral of ``rho x cross shape_k``, kg m.
    gyration : array (r, mode, mode)
        Integral of ``rho shape_j cross shape_k``, kg.
    linear : array (r, r, mode)
        Integral of ``rho (e_a cross x) . (e_b cross shape_k)``, kg m: half of the first-order change of inertia.
    quadratic : array (r, r, mode, mode)
        Integral of ``rho (e_a cross shape_j) . (e_b cross shape_k)``, kg: second-order change of inertia.
    nodes : mapping of node to NodeShape
        Shapes at nodes.
    damping : matrix (mode, mode), optional
        Modal damping, N s/m.
    length : float
        Size of the body, m; a deflection of more than a tenth of it counts as large.
    stresses : mapping of str to array (mode,), optional
        Recovery of stresses or strains: value for a unit of each coordinate, by name, with `stress_units`.
    stress_units : str
        Units of the recovered values, such as ``"Pa"``, for a coordinate in metres.
    lines : sequence of sequence of nodes, optional
        Lines along which drawings show the body. Default: drawings show the nodes as dots.

    Raises
    ------
    uqmbd.StudyError
        If shapes do not fit, a matrix is not symmetric, the mass matrix is not positive definite, or the stiffness
        matrix is not positive. The error also occurs if a line contains an unknown node.

    Examples
    --------
    A rigid rod with one longitudinal mode, whose shape is the distance from its left end:

    >>> import uqmbd_flexible
    >>> tip = uqmbd_flexible.NodeShape([1, 0], [[1], [0]])
    >>> rod = uqmbd_flexible.ModalModel(
    ...     mass=3, com=(0.5, 0), inertia=1, modal_mass=[[1]], stiffness=[[1e4]], translation=[[1.5], [0]],
    ...     rotation=[[0]], gyration=[[[0]]], linear=[[[1]]], quadratic=[[[[1]]]], nodes={"tip": tip}, length=1,
    ... )
    >>> [round(float(f), 3) for f in rod.frequencies]  # of the modes with a frame that does not move, Hz
    [15.915]
    """

    mass: float
    com: Any
    inertia: Any
    modal_mass: Any
    stiffness: Any
    translation: Any
    rotation: Any
    gyration: Any
    linear: Any
    quadratic: Any
    nodes: Mapping[Any, Any] = field(default_factory=dict)
    damping: Any = None
    length: float = 1.0
    stresses: Mapping[str, Any] = field(default_factory=dict)
    stress_units: str = "Pa"
    lines: Sequence[Sequence[Any]] = ()

    def __post_init__(self) -> None:
        where = "ModalModel"
        com = _array(where, "com", self.com)
        d = len(com)
        if com.ndim != 1 or d not in (2, 3):
            raise uqmbd.StudyError(
                f"{where}: com has the shape {com.shape}; expected 2 numbers in the plane, 3 in space."
            )
        r = 1 if d == 2 else 3
        mass = _array(where, "modal_mass", self.modal_mass)
        if mass.ndim != 2 or mass.shape[0] != mass.shape[1] or not len(mass):
            raise uqmbd.StudyError(f"{where}: modal_mass has the shape {mass.shape}; expected a square matrix.")
        m = len(mass)
        shapes = {
            "inertia": (r, r), "modal_mass": (m, m), "translation": (d, m), "rotation": (r, m), "gyration": (r, m, m),
            "linear": (r, r, m), "quadratic": (r, r, m, m),
        }  # fmt: skip
        found = {"com": com}
        for name, shape in shapes.items():
            given = _array(where, name, getattr(self, name))
            if name == "inertia" and given.ndim == 0:
                given = given.reshape(1, 1)
            if given.shape != shape:
                raise uqmbd.StudyError(
                    f"{where}: {name} has the shape {given.shape}; expected {shape} for {m} modes in {d} dimensions."
                )
            found[name] = given
        for name in ("modal_mass", "inertia"):
            _require_symmetric(where, name, found[name])
        lowest = float(np.linalg.eigvalsh(found["modal_mass"])[0])
        for what, least in (("the mass", self.mass), ("the smallest eigenvalue of modal_mass", lowest)):
            if not least > 0:
                raise uqmbd.StudyError(f"{where}: {what} is {least:.3g} kg; expected a positive value.")
        for name in ("stiffness", "damping"):
            given = getattr(self, name)
            if given is None:
                continue
            matrix = sympy.Matrix(given)
            if matrix.shape != (m, m):
                raise uqmbd.StudyError(f"{where}: {name} has the shape {matrix.shape}; expected {(m, m)}.")
            if not matrix.free_symbols:
                values = np.array(matrix.tolist(), dtype=float)
                _require_symmetric(where, name, values)
                if float(np.linalg.eigvalsh(values)[0]) < -SYMMETRIC * max(float(np.abs(values).max()), 1e-300):
                    raise uqmbd.StudyError(
                        f"{where}: {name} has the negative eigenvalue {np.linalg.eigvalsh(values)[0]:.3g}; expected a "
                        "positive semi-definite matrix."
                    )
            object.__setattr__(self, name, matrix)
        for name, value in found.items():
            object.__setattr__(self, name, value)
        checked: dict[int, NodeShape] = {}  # a node with two names remains one object
        for key, node in self.nodes.items():
            if id(node) not in checked:
                checked[id(node)] = _node(where, key, node, d, m)
        object.__setattr__(self, "nodes", {key: checked[id(node)] for key, node in self.nodes.items()})
        for line in self.lines:
            if isinstance(line, str) or not isinstance(line, Sequence):
                raise uqmbd.StudyError(f"{where}: lines contains {line!r:.80}; expected a sequence of names of nodes.")
        names = tuple(self.nodes)
        for name in (x for line in self.lines for x in line):
            if name not in names:
                raise uqmbd.StudyError(f"{where}: lines contains {name!r:.80}, which is not a node.")
        stresses = {name: _array(where, f"stresses[{name!r}]", x) for name, x in self.stresses.items()}
        for name, row in stresses.items():
            if row.shape != (m,):
                raise uqmbd.StudyError(f"{where}: stresses[{name!r}] has the shape {row.shape}; expected {(m,)}.")
        object.__setattr__(self, "stresses", stresses)

    @property
    def modes(self) -> int:
        """Number of modal coordinates."""
        return len(self.modal_mass)

    @property
    def dimension(self) -> int:
        """Dimension of the space: 2 or 3."""
        return len(self.com)

    @property
    def random(self) -> bool:
        """Whether the stiffness or the damping contains random variables."""
        return any(x is not None and bool(x.free_symbols) for x in (self.stiffness, self.damping))

    @property
    def frequencies(self) -> Array:
        """Natural frequencies of the modal coordinates, Hz, ascending, while the frame of the body does not move.

        Random variables have their means.
        """
        stiffness = self.at_means().stiffness
        values = scipy.linalg.eigvalsh(np.array(stiffness.tolist(), dtype=float), self.modal_mass)
        return np.asarray(np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi))

    @property
    def central_inertia(self) -> Any:
        """Inertia about the centre of mass, kg m^2, in the form of the argument of `Mechanism.body`."""
        c = self.com
        if self.dimension == 2:
            return float(self.inertia[0, 0] - self.mass * (c @ c))
        central = self.inertia - self.mass * ((c @ c) * np.eye(3) - np.outer(c, c))
        return tuple(float(central[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))

    def scaled(self, stiffness: Any = 1, damping: Any = 1) -> ModalModel:
        """Return the model with stiffness and damping multiplied by one factor, or by a factor for each mode.

        Factors ``f_k`` of the modes multiply the matrix entries by ``sqrt(f_j f_k)``, so that the matrix remains
        positive. Random factors make random frequencies: a frequency is proportional to the square root of its factor.

        Parameters
        ----------
        stiffness, damping : number, expression, or sequence with one of these for each mode
            Factors; they may contain random variables.

        Returns
        -------
        ModalModel
            Scaled model.

        Raises
        ------
        uqmbd.StudyError
            If the number of factors differs from the number of modes.

        Examples
        --------
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
        >>> softer = beam.scaled(stiffness=0.81)
        >>> round(float(softer.frequencies[0] / beam.frequencies[0]), 6)
        0.9
        """
        found = {}
        for name, factor in (("stiffness", stiffness), ("damping", damping)):
            matrix = getattr(self, name)
            if matrix is None:
                if isinstance(factor, (int, float)) and factor == 1:
                    continue
                raise uqmbd.StudyError("ModalModel.scaled: damping is given, but the model has no damping.")
            factors = list(factor) if isinstance(factor, (list, tuple, np.ndarray)) else [factor] * self.modes
            if len(factors) != self.modes:
                raise uqmbd.StudyError(
                    f"ModalModel.scaled: {name} has {len(factors)} factors; expected 1, or one per mode ({self.modes})."
                )
            factors = numbers("ModalModel.scaled", name, factors, self.modes)
            roots = sympy.diag(*map(sympy.sqrt, factors))
            found[name] = matrix * factors[0] if len(set(factors)) == 1 else roots * matrix * roots
        return self.replaced(**found)

    def with_frequencies(self, frequencies: Any) -> ModalModel:
        """Return the model with other natural frequencies of its modes and the same shapes.

        Parameters
        ----------
        frequencies : sequence of numbers or expressions
            Frequency of each mode of the free body, Hz, such as random variables. The modal mass must be diagonal.

        Returns
        -------
        ModalModel
            Model with the stiffness ``m_k (2 pi f_k)^2``.

        Raises
        ------
        uqmbd.StudyError
            If the number of frequencies differs from the number of modes, or the modal mass is not diagonal.

        Examples
        --------
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(
        ...     length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800, modes=0
        ... )
        >>> [round(float(x), 6) for x in beam.with_frequencies([60, 240, 2500]).frequencies]
        [60.0, 240.0, 2500.0]
        """
        given = list(frequencies) if isinstance(frequencies, (list, tuple, np.ndarray)) else [frequencies]
        if len(given) != self.modes:
            raise uqmbd.StudyError(
                f"ModalModel.with_frequencies: {len(given)} frequencies are given; expected {self.modes}, one per mode."
            )
        masses = np.diag(self.modal_mass)
        if np.abs(self.modal_mass - np.diag(masses)).max() > 1e-9 * masses.max():
            raise uqmbd.StudyError("ModalModel.with_frequencies: the modal mass is not diagonal; use scaled().")
        given = numbers("ModalModel.with_frequencies", "frequencies", given, self.modes, "Hz")
        entries = [float(m) * (2 * np.pi) ** 2 * f**2 for m, f in zip(masses, given, strict=True)]
        return self.replaced(stiffness=sympy.diag(*entries))

    def damped(self, ratios: Any) -> ModalModel:
        """Return the model with modal damping ``D = sum_k 2 zeta_k omega_k M v_k v_k^T M``; natural modes are ``v_k``.

        Parameters
        ----------
        ratios : number or sequence
            Damping ratio of each mode, ascending by frequency, or one for all modes; may contain random variables. The
            frequencies are computed at the means.

        Returns
        -------
        ModalModel
            Damped model.

        Raises
        ------
        uqmbd.StudyError
            If the number of ratios differs from the number of modes, or the stiffness is random.

        Examples
        --------
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
        >>> beam.damped(0.01).damping.shape == (beam.modes, beam.modes)
        True
        """
        if self.stiffness.free_symbols:
            raise uqmbd.StudyError(
                "ModalModel.damped: the stiffness is random; call damped() first, then scaled(stiffness=...)."
            )
        given = list(ratios) if isinstance(ratios, (list, tuple, np.ndarray)) else [ratios] * self.modes
        if len(given) != self.modes:
            raise uqmbd.StudyError(
                f"ModalModel.damped: {len(given)} ratios are given; expected 1, or one per mode ({self.modes})."
            )
        given = numbers("ModalModel.damped", "ratios", given, self.modes)
        values, vectors = scipy.linalg.eigh(np.array(self.stiffness.tolist(), dtype=float), self.modal_mass)
        shapes = self.modal_mass @ vectors
        parts = np.sqrt(np.maximum(values, 0.0))
        found = sympy.zeros(self.modes, self.modes)
        for ratio, omega, shape in zip(given, parts, shapes.T, strict=True):
            found += 2 * ratio * float(omega) * sympy.Matrix(np.outer(shape, shape))
        return self.replaced(damping=found)

    def at_means(self) -> ModalModel:
        """Return the model with random variables at their means."""
        found = {}
        for name in ("stiffness", "damping"):
            matrix = getattr(self, name)
            if matrix is not None and matrix.free_symbols:
                joint = uqmbd.extend.JointInput.of(
                    {s for s in matrix.free_symbols if isinstance(s, uqmbd.RandomVariable)}
                )
                found[name] = matrix.subs(dict(zip(joint.variables, map(float, joint.means), strict=True)))
        return self.replaced(**found)

    def replaced(self, **changed: Any) -> ModalModel:
        """Return the model with new values of the given fields."""
        return ModalModel(**{x.name: getattr(self, x.name) for x in fields(self)} | changed)


def _array(where: str, name: str, value: Any) -> Array:
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise uqmbd.StudyError(f"{where}: {name} is {value!r:.80}; expected an array of numbers.") from None
    if not np.isfinite(found).all():
        raise uqmbd.StudyError(f"{where}: {name} contains a number that is not finite.")
    return found


def _require_symmetric(where: str, name: str, matrix: Array) -> None:
    off = float(np.abs(matrix - matrix.T).max(initial=0.0))
    if off > SYMMETRIC * max(float(np.abs(matrix).max(initial=0.0)), 1e-300):
        raise uqmbd.StudyError(f"{where}: {name} differs from its transpose by {off:.3g}; expected a symmetric matrix.")


def _node(where: str, key: Any, node: Any, d: int, m: int) -> NodeShape:
    if not isinstance(node, NodeShape):
        raise uqmbd.StudyError(f"{where}: nodes[{key!r}] is {node!r:.80}; expected a NodeShape.")
    expected: Sequence[tuple[str, tuple[int, ...]]] = (
        ("position", (d,)),
        ("translation", (d, m)),
        ("rotation", (1 if d == 2 else 3, m)),
    )
    found = {}
    for name, shape in expected:
        value = getattr(node, name)
        if value is None and name == "rotation":
            continue
        array = _array(where, f"nodes[{key!r}].{name}", value)
        if array.shape != shape:
            raise uqmbd.StudyError(f"{where}: nodes[{key!r}].{name} has the shape {array.shape}; expected {shape}.")
        found[name] = array
    return NodeShape(**found)
