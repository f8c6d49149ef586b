"""Flexible bodies: a body that carries a floating frame of reference, its modes, and frames at its nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

import uqmbd
from uqmbd.extend import typechecked
from uqmbd_flexible.drawn_nodes import NodeLines
from uqmbd_flexible.modal_model import ModalModel, NodeShape
from uqmbd_flexible.modes import FlexibleModes
from uqmbd_flexible.validity import SLOW, SMALL, largest_speed, relative_deflections

__all__ = ["FlexibleBody", "flexible_body"]

NEGLIGIBLE = 1e-12
"""Entries of an integral below this multiple of its largest entry are rounding errors, and become zero."""


@dataclass(frozen=True)
class FlexibleBody:
    """Flexible body of a mechanism, from `flexible_body`.

    Attributes
    ----------
    body : body
        Body that carries the floating frame; joints and outputs may use it as a rigid body.
    modes : FlexibleModes
        Component with the modal coordinates.
    model : ModalModel
        Model of the deformation.

    Examples
    --------
    >>> import uqmbd
    >>> import uqmbd_flexible
    >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
    >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
    >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam)
    >>> isinstance(rod, uqmbd_flexible.FlexibleBody), rod.body, rod.node("end")
    (True, <body 'rod'>, <frame "rod.node('end')" of body 'rod'>)
    """

    body: Any
    modes: FlexibleModes
    model: ModalModel

    @typechecked
    def node(self, node: Any) -> Any:
        """Return the frame of a node, or of a group of nodes, for joints, forces, contacts and outputs.

        Parameters
        ----------
        node : hashable, or tuple or list of these
            Node of the model. A group moves as the rigid body that fits its nodes best: its origin is their mean, and
            its rotation is their mean rotation by least squares.

        Returns
        -------
        uqmbd.extend.AttachedFrame
            Frame that moves with the node; in the undeformed body it is parallel to the frame of the body.

        Raises
        ------
        uqmbd.StudyError
            If the model has no such node, the node has no rotation, or the group determines none.

        Examples
        --------
        >>> import uqmbd
        >>> import uqmbd_flexible
        >>> from uqmbd_joints import Fixed
        >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
        >>> mechanism = uqmbd.Mechanism("cantilever", uqmbd.Planar())
        >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam)
        >>> clamp = mechanism.add(Fixed("clamp", mechanism.ground, rod.node("start"), (0, 0), (0, 0)))
        >>> mechanism.output("first", uqmbd.eigenfrequency(1), units="Hz")
        >>> mechanism.output("tip", rod.node("end").position[1], units="m")
        >>> exact = 1.8751040687**2 / (2 * 3.14159265) * (2e11 * 1e-9 / 7800e-4) ** 0.5
        >>> round(float(uqmbd.simulate(mechanism, [0, 1e-3])["first"]) / exact, 3)  # shear lowers it by 1e-4
        1.0
        """
        shape, name = self._shape(node), self._named(node)
        if shape.rotation is None:
            raise uqmbd.StudyError(
                f"{name}: the node has no rotation in the model. Give a group of nodes, as in node((1, 2, 3)), whose "
                "displacements determine a rotation; or use .node_point(...) for outputs of its position."
            )
        return uqmbd.extend.AttachedFrame(name, self.body, self._offset(shape), self._turned(shape.rotation))

    @typechecked
    def node_point(self, node: Any) -> sympy.Matrix:
        """Return the world position of a node in m, as a column for outputs.

        Parameters
        ----------
        node : hashable, or tuple or list of these
            Node of the model, or a group of nodes; the position of a group is the mean over its nodes.

        Examples
        --------
        >>> import uqmbd
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
        >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
        >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam, position=(2, 0))
        >>> mechanism.output("x", rod.node_point("end")[0], units="m")
        >>> float(uqmbd.simulate(mechanism, [0, 1e-3])["x"][0])
        3.0
        """
        return self.body.position + self.body.rotation * sympy.Matrix(self._offset(self._shape(node)))

    @typechecked
    def deflection(self, node: Any) -> sympy.Matrix:
        """Return the displacement of a node by deformation in m, in the axes of the body, as a column for outputs.

        Parameters
        ----------
        node : hashable, or tuple or list of these
            Node of the model, or a group of nodes.

        Examples
        --------
        >>> import uqmbd
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
        >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
        >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam)
        >>> mechanism.output("bending", rod.deflection("end")[1], units="m")
        >>> float(uqmbd.simulate(mechanism, [0, 1e-3])["bending"][0])
        0.0
        """
        return sympy.Matrix(self._shape(node).translation) * self._coordinates()

    @typechecked
    def stress(self, name: str) -> sympy.Expr:
        """Return a recovered stress of the model as an expression for outputs and requirements.

        Parameters
        ----------
        name : str
            Name in ``ModalModel.stresses``.

        Returns
        -------
        expression
            Sum of the rows of the recovery times the coordinates, in ``ModalModel.stress_units``.

        Raises
        ------
        uqmbd.StudyError
            If the model has no recovery of this name.

        Examples
        --------
        >>> import uqmbd
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(
        ...     length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800, depth=0.01
        ... )
        >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
        >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam)
        >>> mechanism.output("strain", rod.stress("bending strain at 0.5"), units="1")
        >>> float(uqmbd.simulate(mechanism, [0, 1e-3])["strain"][0])
        0.0
        """
        if name not in self.model.stresses:
            known = ", ".join(map(repr, self.model.stresses)) or "none"
            raise uqmbd.StudyError(f"{self.body.name!r}: the model has no stress {name!r}; its stresses are: {known}.")
        row = self.model.stresses[name]
        return sum((float(x) * q for x, q in zip(row, self._coordinates(), strict=True) if x), sympy.S.Zero)

    @typechecked
    def small_deflection(self, fraction: float = SMALL) -> Any:
        """Return a relation for `Mechanism.require`: deflections are at most a fraction of the length.

        `uqmbd.simulate` warns of larger deflections in a mode automatically. In a study, this requirement gives their
        probability.

        Parameters
        ----------
        fraction : float
            Largest deflection of a node relative to another node or to its tangent, over the length of the body. The
            deflections of the modes are combined as the root of their sum of squares.

        Examples
        --------
        >>> import uqmbd
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
        >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
        >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam)
        >>> mechanism.require("small deflection of the rod", rod.small_deflection())
        >>> bool(uqmbd.simulate(mechanism, [0, 1e-3])["requirement_met"].all())
        True
        """
        factors = relative_deflections(self.model).tolist()
        squares = [(f * q) ** 2 for f, q in zip(factors, self._coordinates(), strict=True)]
        return sympy.Add(*squares) <= (fraction * self.model.length) ** 2

    @typechecked
    def slow_rotation(self, fraction: float = SLOW) -> Any:
        """Return a relation for `Mechanism.require`: the angular speed is at most a fraction of the lowest frequency.

        Rotation stiffens bending modes, which the theory neglects. `uqmbd.simulate` warns of faster rotations
        automatically. In a study, this requirement gives their probability.

        Parameters
        ----------
        fraction : float
            Largest angular speed over the lowest natural frequency of the body held at one end, both in rad/s. Models
            of `Beam` and `craig_bampton` state frequencies of the free body; a factor of 0.157 converts the lowest, as
            for a uniform beam. With the default 0.25, the lowest frequency of a beam clamped on the
            axis of rotation is wrong by at most 3.7 %.

        Examples
        --------
        >>> import uqmbd
        >>> import uqmbd_flexible
        >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e11, density=7800)
        >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
        >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam, angular_velocity=10)
        >>> mechanism.require("slow rotation of the rod", rod.slow_rotation())
        >>> bool(uqmbd.simulate(mechanism, [0, 1e-3])["requirement_met"].all())
        True
        """
        speed = sympy.Matrix([self.body.angular_velocity])
        return speed.dot(speed) <= largest_speed(self.model, fraction) ** 2

    def _coordinates(self) -> sympy.Matrix:
        return sympy.Matrix([self.modes.coordinate(f"mode {k + 1}") for k in range(self.model.modes)])

    def _named(self, node: Any) -> str:
        return f"{self.body.name}.node({node!r})"

    def _offset(self, shape: NodeShape) -> list[sympy.Expr]:
        moved = sympy.Matrix(_cleaned(shape.translation)) * self._coordinates()
        return list(sympy.Matrix(list(map(float, shape.position))) + moved)

    def _turned(self, rotation: Any) -> list[sympy.Expr] | None:
        angles = sympy.Matrix(_cleaned(rotation)) * self._coordinates() / 2
        if all(x == 0 for x in angles):
            return None
        length = sympy.sqrt(1 + angles.dot(angles))
        return [1 / length, *(x / length for x in angles)]

    def _shape(self, node: Any) -> NodeShape:
        if isinstance(node, (tuple, list)):
            return _fitted(self._named(node), [self._shape(x) for x in node])
        try:
            found: NodeShape = self.model.nodes[node]
            return found
        except (KeyError, TypeError):
            names = list(map(repr, self.model.nodes))
            listed = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
            raise uqmbd.StudyError(
                f"{self._named(node)}: the model has no such node; its nodes are: {listed}."
            ) from None


def _is_diagonal(model: ModalModel) -> bool:
    """Return whether modal mass and stiffness are constant and diagonal, with ascending frequencies."""
    masses = np.array(_cleaned(model.modal_mass))
    if model.stiffness.free_symbols or np.count_nonzero(masses - np.diag(np.diag(masses))):
        return False
    stiffness = np.array(model.stiffness.tolist(), dtype=float)
    ratios = np.diag(stiffness) / np.diag(masses)
    return not np.count_nonzero(stiffness - np.diag(np.diag(stiffness))) and bool((np.diff(ratios) >= 0).all())


def _cleaned(values: Any) -> list[Any]:
    """Return rows of numbers, with rounding errors replaced by exact zeros."""
    array = np.array(values, dtype=float)
    limit = NEGLIGIBLE * float(np.abs(array).max(initial=0.0))
    return list(np.where(np.abs(array) <= limit, 0.0, array).tolist())


def _fitted(where: str, shapes: Sequence[NodeShape]) -> NodeShape:
    """Return the rigid motion of a group of nodes by least squares."""
    if not shapes:
        raise uqmbd.StudyError(f"{where}: the group is empty; give at least two nodes.")
    places = np.array([x.position for x in shapes])
    moved = np.array([x.translation for x in shapes])  # (node, d, mode)
    middle, d = places.mean(axis=0), places.shape[1]
    arms = places - middle
    if d == 2:
        rows = np.stack([-arms[:, 1], arms[:, 0]], axis=1)[:, :, None]
    else:
        x, y, z = arms.T
        o = np.zeros_like(x)
        rows = np.stack([np.stack([o, z, -y], 1), np.stack([-z, o, x], 1), np.stack([y, -x, o], 1)], axis=1)
    flat = rows.reshape(-1, rows.shape[2])
    sizes = np.linalg.svd(flat, compute_uv=False)
    if sizes[-1] <= 1e-9 * max(float(sizes[0]), 1e-300):
        raise uqmbd.StudyError(
            f"{where}: the displacements of these nodes determine no rotation; give at least "
            + ("two nodes at different places." if d == 2 else "three nodes that are not on a line.")
        )
    mean = moved.mean(axis=0)
    rest = (moved - mean).reshape(-1, moved.shape[2])
    return NodeShape(middle, mean, np.linalg.lstsq(flat, rest, rcond=None)[0])


@typechecked
def flexible_body(
    mechanism: uqmbd.Mechanism,
    name: str,
    model: ModalModel,
    position: Any = None,
    angle: Any = None,
    quaternion: Any = None,
    velocity: Any = None,
    angular_velocity: Any = None,
    initial: Any = (),
    rates: Any = (),
) -> FlexibleBody:
    """Add a flexible body to a mechanism: a body with a floating frame of reference, and its modes.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism in planar or spatial space.
    name : str
        Name of the body; its modes are the component ``NAME modes``.
    model : ModalModel
        Model from `craig_bampton`, `Beam`, or integrals.
    position : sequence of numbers or expressions, optional
        Origin of the frame of the body in the given pose, m.
    angle : number or expression, optional
        Angle of the frame in the given pose, in the plane, rad.
    quaternion : sequence of numbers or expressions, optional
        Quaternion of the frame in the given pose, in space, scalar first.
    velocity : sequence of numbers or expressions, optional
        Initial velocity of the origin of the frame, m/s. Default: the assembly solves for it.
    angular_velocity : number, expression or sequence, optional
        Initial angular velocity of the frame, body axes, rad/s. Default: the assembly solves for it.
    initial, rates : sequence of numbers or expressions, optional
        Modal coordinates in the given pose, m, and their rates at the start, m/s. Default: undeformed; the assembly
        solves for the rates.

    Returns
    -------
    FlexibleBody
        Body, modes, and frames at nodes.

    Raises
    ------
    uqmbd.StudyError
        If model and space have different dimensions, or a value is invalid.

    Examples
    --------
    A free beam that rotates stretches, and its angular momentum does not change:

    >>> import uqmbd
    >>> import uqmbd_flexible
    >>> beam = uqmbd_flexible.Beam(length=1, area=1e-4, second_moment=1e-9, youngs_modulus=2e9, density=7800, modes=1)
    >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
    >>> rod = uqmbd_flexible.flexible_body(mechanism, "rod", beam, angular_velocity=1)
    >>> rod.body.name, rod.modes.name, beam.modes
    ('rod', 'rod modes', 4)
    >>> mechanism.output("stretch", rod.deflection("end")[0], units="m")
    >>> float(uqmbd.simulate(mechanism, [0, 1e-3])["stretch"][-1]) > 0
    True
    """
    where = f"flexible_body {name!r}"
    space = mechanism.space
    if not space.turns or space.dimension != model.dimension:
        raise uqmbd.StudyError(
            f"{where}: the model has {model.dimension} dimensions, but the space of mechanism {mechanism.name!r} is "
            f"{type(space).__name__}; expected {'Planar' if model.dimension == 2 else 'Spatial'} space."
        )
    pose = {
        "position": position,
        "angle": angle,
        "quaternion": quaternion,
        "velocity": velocity,
        "angular_velocity": angular_velocity,
    }
    body = mechanism.body(
        name,
        mass=model.mass,
        com=tuple(map(float, model.com)),
        inertia=model.central_inertia,
        **{key: value for key, value in pose.items() if value is not None},
    )
    arrays = {
        key: _cleaned(getattr(model, key))
        for key in ("modal_mass", "translation", "rotation", "gyration", "linear", "quadratic")
    }
    given: dict[str, Any] = {key: tuple(np.ravel(x).tolist()) for key, x in arrays.items() if np.any(x)}
    if _is_diagonal(model):
        given |= {"stiffness": (), "frequencies": tuple(model.frequencies.tolist())}
    else:
        given["stiffness"] = tuple(model.stiffness)
    if model.damping is not None and any(x != 0 for x in model.damping):
        given["damping"] = tuple(model.damping)
    given |= {key: tuple(x) for key, x in (("initial", initial), ("rates", rates)) if len(tuple(x))}
    given["largest"] = tuple((SMALL * model.length / relative_deflections(model)).tolist())
    given["fastest"] = (largest_speed(model, SLOW),)
    modes = mechanism.add(FlexibleModes(f"{name} modes", body, **given))
    modes.lines = NodeLines.of(model)
    return FlexibleBody(body, modes, model)
