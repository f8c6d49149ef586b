"""Shapes of bodies: for drawings, and for distances between bodies; they do not affect the motion.

Length: five public classes, whose docstrings list all their attributes.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import sympy
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import as_symbolic, flatten, numbers, shown
from uqmbd.typing import Array

__all__ = ["Box", "Capsule", "Cylinder", "Mesh", "BodyShape", "Sphere", "check_shapes"]

ROUND = 32
"""Number of corners of the polygon that approximates a circle of a round shape."""

MOST = 10_000_000
"""Largest number of rows of an array."""

LARGEST = 1e-6
"""Largest deviation of a rotation matrix from orthogonality."""

Faces = NDArray[np.int64]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyShape(ABC):
    """Base class of the shapes of bodies.

    Attributes
    ----------
    position : sequence of 3 numbers or expressions
        Position of the shape's frame in the body frame, m.
    rotation : array, shape (3, 3)
        Rotation of the shape's frame, shape to body; constant.

    Raises
    ------
    uqmbd.StudyError
        If a number is not in its range, or an argument has another shape.

    Examples
    --------
    >>> from uqmbd.shapes import BodyShape, Sphere
    >>> isinstance(Sphere(0.1), BodyShape)
    True
    """

    position: Any = (0, 0, 0)
    rotation: Any = field(default_factory=lambda: np.eye(3))

    lengths: ClassVar[tuple[str, ...]] = ()
    """Names of the fields with lengths, m, or vectors of lengths."""

    def __post_init__(self) -> None:
        where = type(self).__name__
        object.__setattr__(self, "position", tuple(numbers(where, "position", self.position, 3, "body frame, m")))
        rotation = _array(self.rotation)
        if (
            rotation.shape != (3, 3)
            or not np.isfinite(rotation).all()
            or not abs(rotation @ rotation.T - np.eye(3)).max() < LARGEST
        ):
            raise StudyError(f"{where}: rotation is {shown(self.rotation)}; expected a constant 3 x 3 rotation matrix.")
        if np.linalg.det(rotation) < 0:
            raise StudyError(f"{where}: rotation is a reflection (determinant -1); expected a rotation matrix.")
        object.__setattr__(self, "rotation", rotation)
        for name in self.lengths:
            given = getattr(self, name)
            many = isinstance(given, (tuple, list, np.ndarray))
            found = numbers(where, name, given, len(flatten(given)) if many else 1, "m", scalar=not many)
            for value in found:
                if value.is_number and not float(value) > 0:
                    raise StudyError(f"{where}: {name} is {shown(given)}; expected positive lengths in m.")
            object.__setattr__(self, name, tuple(found) if many else found[0])

    @property
    def expressions(self) -> tuple[sympy.Expr, ...]:
        """Numbers of the shape that may be random: its position, then its lengths, m.

        Examples
        --------
        >>> from uqmbd.shapes import Sphere
        >>> Sphere(0.5, position=(1, 0, 0)).expressions
        (1, 0, 0, 0.500000000000000)
        """
        parts = [as_symbolic(x) for name in self.lengths for x in flatten(getattr(self, name))]
        return (*(as_symbolic(x) for x in self.position), *parts)

    def surface(self, values: ArrayLike) -> tuple[Array, Faces]:
        """Return a surface of triangles in the body frame; round shapes are approximated by inscribed polygons.

        Parameters
        ----------
        values : array_like, shape (N,)
            Values of `expressions`, m.

        Returns
        -------
        vertices : array, shape (V, 3)
            Corners, m.
        faces : array of int, shape (F, 3)
            Corners of each triangle, anticlockwise from outside.

        Raises
        ------
        uqmbd.StudyError
            If `values` are not N finite numbers.

        Examples
        --------
        >>> from uqmbd.shapes import Box
        >>> vertices, faces = Box((1, 2, 3)).surface([0, 0, 0, 1, 2, 3])
        >>> vertices.max(axis=0).tolist(), faces.shape
        ([0.5, 1.0, 1.5], (12, 3))
        """
        found, count = _array(values), len(self.expressions)
        if found.shape != (count,) or not np.isfinite(found).all():
            raise StudyError(
                f"{type(self).__name__}.surface: values is {shown(values)}; expected {count} finite numbers."
            )
        vertices, faces = self._surface(found[3:])
        return vertices @ self.rotation.T + found[:3], faces

    @abstractmethod
    def _surface(self, lengths: Array) -> tuple[Array, Faces]:
        """Return vertices (V, 3), m, and faces in the frame of the shape."""

    @property
    def bounds(self) -> tuple[tuple[sympy.Expr, ...], tuple[sympy.Expr, ...]]:
        """Lowest and highest coordinates of the shape in the axes of its frame, relative to `position`, m.

        Examples
        --------
        >>> from uqmbd.shapes import Cylinder
        >>> Cylinder(1, 4).bounds
        ((-1, -1, -2), (1, 1, 2))
        """
        half = self._half()
        return tuple(-x for x in half), half

    def _half(self) -> tuple[sympy.Expr, ...]:
        """Return half of the extent along each axis, m, of shapes that are symmetric about their centre."""
        raise NotImplementedError(f"{type(self).__name__} has another extent")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={_text(getattr(self, name))}' for name in self.lengths)})"


@typechecked(values=False)
@dataclass(frozen=True, eq=False, repr=False)
class Box(BodyShape):
    """Box with its centre at `position` and its edges along the axes of its frame.

    Attributes
    ----------
    size : sequence of 3 numbers or expressions
        Lengths of the edges, m.
    position : sequence of 3 numbers or expressions
        Position of the shape's frame in the body frame, m.
    rotation : array, shape (3, 3)
        Rotation of the shape's frame, shape to body; constant.

    Raises
    ------
    uqmbd.StudyError
        If a number is not in its range, or an argument has another shape.

    Examples
    --------
    >>> from uqmbd.shapes import Box
    >>> Box((0.1, 0.2, 0.3))
    Box(size=(0.1, 0.2, 0.3))
    """

    size: Any

    lengths: ClassVar[tuple[str, ...]] = ("size",)

    def __post_init__(self) -> None:
        if not isinstance(self.size, (tuple, list, np.ndarray)) or len(flatten(self.size)) != 3:
            raise StudyError(f"Box: size is {shown(self.size)}; expected three lengths in m.")
        super().__post_init__()

    def _half(self) -> tuple[sympy.Expr, ...]:
        return tuple(as_symbolic(x) / 2 for x in flatten(self.size))

    def _surface(self, lengths: Array) -> tuple[Array, Faces]:
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
        squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return signs * lengths / 2, np.array([t for a, b, c, d in squares for t in ((a, b, c), (a, c, d))])


@typechecked(values=False)
@dataclass(frozen=True, eq=False, repr=False)
class Sphere(BodyShape):
    """Sphere about `position`.

    Attributes
    ----------
    radius : number or expression
        Radius, m.
    position : sequence of 3 numbers or expressions
        Position of the shape's frame in the body frame, m.
    rotation : array, shape (3, 3)
        Rotation of the shape's frame, shape to body; constant.

    Raises
    ------
    uqmbd.StudyError
        If a number is not in its range, or an argument has another shape.

    Examples
    --------
    >>> from uqmbd.shapes import Sphere
    >>> Sphere(0.1)
    Sphere(radius=0.1)
    """

    radius: Any

    lengths: ClassVar[tuple[str, ...]] = ("radius",)

    def _half(self) -> tuple[sympy.Expr, ...]:
        return (as_symbolic(self.radius),) * 3

    def _surface(self, lengths: Array) -> tuple[Array, Faces]:
        angle = np.linspace(0, np.pi, ROUND // 2 + 1)
        return _revolved(lengths[0] * np.sin(angle), -lengths[0] * np.cos(angle))


@typechecked(values=False)
@dataclass(frozen=True, eq=False, repr=False)
class Cylinder(BodyShape):
    """Circular cylinder with its centre at `position` and its axis along the third axis of its frame.

    Attributes
    ----------
    radius, length : number or expression
        Radius and length, m.
    position : sequence of 3 numbers or expressions
        Position of the shape's frame in the body frame, m.
    rotation : array, shape (3, 3)
        Rotation of the shape's frame, shape to body; constant.

    Raises
    ------
    uqmbd.StudyError
        If a number is not in its range, or an argument has another shape.

    Examples
    --------
    >>> from uqmbd.shapes import Cylinder
    >>> Cylinder(0.1, 0.5)
    Cylinder(radius=0.1, length=0.5)
    """

    radius: Any
    length: Any

    lengths: ClassVar[tuple[str, ...]] = ("radius", "length")

    def _half(self) -> tuple[sympy.Expr, ...]:
        radius = as_symbolic(self.radius)
        return radius, radius, as_symbolic(self.length) / 2

    def _surface(self, lengths: Array) -> tuple[Array, Faces]:
        radius, half = lengths[0], lengths[1] / 2
        return _revolved(np.array([0, radius, radius, 0]), np.array([-half, -half, half, half]))


@typechecked(values=False)
@dataclass(frozen=True, eq=False, repr=False)
class Capsule(BodyShape):
    """Cylinder with half spheres at its ends; `length` is the distance of their centres.

    Attributes
    ----------
    radius, length : number or expression
        Radius, and distance of the centres of the half spheres along the third axis, m.
    position : sequence of 3 numbers or expressions
        Position of the shape's frame in the body frame, m.
    rotation : array, shape (3, 3)
        Rotation of the shape's frame, shape to body; constant.

    Raises
    ------
    uqmbd.StudyError
        If a number is not in its range, or an argument has another shape.

    Examples
    --------
    >>> from uqmbd.shapes import Capsule
    >>> Capsule(0.1, 0.5)
    Capsule(radius=0.1, length=0.5)
    """

    radius: Any
    length: Any

    lengths: ClassVar[tuple[str, ...]] = ("radius", "length")

    def _half(self) -> tuple[sympy.Expr, ...]:
        radius = as_symbolic(self.radius)
        return radius, radius, as_symbolic(self.length) / 2 + radius

    def _surface(self, lengths: Array) -> tuple[Array, Faces]:
        radius, half = lengths[0], lengths[1] / 2
        angle = np.linspace(0, np.pi / 2, ROUND // 4 + 1)
        out, up = radius * np.sin(angle), radius * np.cos(angle)
        return _revolved(np.concatenate([out, out[::-1]]), np.concatenate([-half - up, half + up[::-1]]))


@typechecked(values=False)
@dataclass(frozen=True, eq=False, repr=False)
class Mesh(BodyShape):
    """Surface of triangles, multiplied by `scale`.

    Attributes
    ----------
    vertices : array, shape (V, 3)
        Corners in the frame of the shape, m.
    faces : array of int, shape (F, 3)
        Corners of each triangle, anticlockwise from outside.
    scale : number or expression
        Factor of the corners.
    position : sequence of 3 numbers or expressions
        Position of the shape's frame in the body frame, m.
    rotation : array, shape (3, 3)
        Rotation of the shape's frame, shape to body; constant.

    Raises
    ------
    uqmbd.StudyError
        If a number is not in its range, or an argument has another shape.

    Examples
    --------
    >>> from uqmbd.shapes import Mesh
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> Mesh(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    Mesh(4 vertices, 4 faces)
    """

    vertices: Any
    faces: Any
    scale: Any = 1

    lengths: ClassVar[tuple[str, ...]] = ("scale",)

    def __post_init__(self) -> None:
        super().__post_init__()
        vertices, numbered = _array(self.vertices), _array(self.faces)
        faces = np.round(np.nan_to_num(numbered, posinf=-1, neginf=-1)).astype(np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all() or not len(vertices):
            raise StudyError(f"Mesh: vertices have the shape {vertices.shape}; expected finite numbers (V, 3), m.")
        good = faces.ndim == 2 and faces.shape[1] == 3 and len(faces) > 0 and bool((faces == numbered).all())
        if not good or faces.min() < 0 or faces.max() >= len(vertices):
            raise StudyError(
                f"Mesh: faces have the shape {faces.shape}; expected numbers (F, 3) from 0 to {len(vertices) - 1}."
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @property
    def bounds(self) -> tuple[tuple[sympy.Expr, ...], tuple[sympy.Expr, ...]]:
        """Lowest and highest coordinates of the shape in the axes of its frame, relative to `position`, m.

        Examples
        --------
        >>> from uqmbd.shapes import Mesh
        >>> Mesh([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]], scale=2).bounds
        ((0, 0, 0), (2.00000000000000, 4.00000000000000, 0))
        """
        scale = as_symbolic(self.scale)
        low, high = (tuple(scale * sympy.Float(x) for x in end) for end in (self._low, self._high))
        return low, high

    @property
    def _low(self) -> Array:
        low: Array = self.vertices.min(axis=0)
        return low

    @property
    def _high(self) -> Array:
        high: Array = self.vertices.max(axis=0)
        return high

    def _surface(self, lengths: Array) -> tuple[Array, Faces]:
        return lengths[0] * self.vertices, self.faces

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.faces)} faces)"


def _array(given: Any) -> Array:
    """Return a list, tuple or array as an array of numbers; NaN, without a dimension, for anything else."""
    if not isinstance(given, (list, tuple, np.ndarray)):
        return np.array(np.nan)
    try:
        return np.array(given, dtype=float) if len(given) <= MOST else np.array(np.nan)
    except (TypeError, ValueError, OverflowError, AttributeError):
        return np.array(np.nan)


def _text(value: Any) -> str:
    """Return a length or a vector of lengths as text, with at most six digits."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))})"
    return f"{float(value):g}" if as_symbolic(value).is_number else str(value)


def _revolved(radii: Array, heights: Array) -> tuple[Array, Faces]:
    """Return the surface of revolution about the third axis; the profile (radii, heights) rises from axis to axis."""
    turn = np.arange(ROUND) * (2 * math.pi / ROUND)
    rings = [
        np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(ROUND, z)])
        for r, z in zip(radii[1:-1], heights[1:-1], strict=True)
    ]
    low, high = 0, 1 + ROUND * len(rings)
    vertices = np.concatenate([[[0, 0, heights[0]]], *rings, [[0, 0, heights[-1]]]])
    here, after = np.arange(ROUND), (np.arange(ROUND) + 1) % ROUND
    faces = [np.column_stack([np.full(ROUND, low), 1 + after, 1 + here])]
    for k in range(len(rings) - 1):
        a, b = 1 + ROUND * k, 1 + ROUND * (k + 1)
        faces += [np.column_stack([a + here, a + after, b + after]), np.column_stack([a + here, b + after, b + here])]
    last = 1 + ROUND * (len(rings) - 1)
    faces.append(np.column_stack([last + here, last + after, np.full(ROUND, high)]))
    return vertices, np.concatenate(faces)


def check_shapes(where: str, shape: Any) -> tuple[BodyShape, ...]:
    """Return the shapes of a body from the argument `shape`: None, a shape, or a sequence of shapes."""
    given: Sequence[Any] = () if shape is None else shape if isinstance(shape, (list, tuple)) else (shape,)
    for one in given:
        if not isinstance(one, BodyShape):
            raise StudyError(
                f"{where}: shape is {shown(one)}; expected a shape such as uqmbd.shapes.Box((0.1, 0.2, 0.3)), or a "
                "sequence of shapes."
            )
    return tuple(given)
