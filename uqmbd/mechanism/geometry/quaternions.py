"""Functions of vectors and rotations with random entries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism.expressions import as_symbolic, flatten, shown, t
from uqmbd.randomness import RandomVariable

__all__ = [
    "aligned",
    "joint_frames",
    "nominal",
    "perpendiculars",
    "quaternion_of_matrix",
    "quaternion_product",
    "relative_quaternion",
    "smallest_rotation",
    "turned",
    "unit",
]

OPPOSITE = 1e-9
"""Versine of pi minus the angle of two vectors (4.5e-5 rad), below which the smallest rotation has a fixed axis."""

PARALLEL = 1e-12
"""Difference up to which two unit vectors are parallel in the given pose."""


@typechecked(values=False)
def nominal(expression: Any) -> float:
    """Return the value of an expression at the means of its random variables and at time zero.

    Parameters
    ----------
    expression : expression
        Expression in random variables and time.

    Returns
    -------
    float
        Value in the units of the expression.

    Raises
    ------
    uqmbd.StudyError
        If the expression contains other symbols, or has no finite value.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> nominal(2 * uqmbd.RandomVariable("m", chaospy.Normal(3, 1)))
    6.0
    """
    value = as_symbolic(expression)
    means: dict[sympy.Symbol, sympy.Expr] = {
        s: sympy.Float(s.mean) for s in value.free_symbols if isinstance(s, RandomVariable)
    }
    result = value.xreplace({**means, t: sympy.Float(0)}).doit()
    try:
        number = float(result)
    except TypeError:
        strangers = ", ".join(sorted(map(str, result.free_symbols)))
        if strangers:
            raise StudyError(f"{value} contains {strangers}; expected only numbers and random variables.") from None
        number = math.nan
    if not math.isfinite(number):
        raise StudyError(
            f"{value} is {result} at the means of the random variables; expected a finite real number "
            "(look for divisions by zero, and for roots, logarithms and inverse trigonometric functions outside of "
            "their range)."
        )
    return number


def _entries(vector: Any, what: str = "the vector", sizes: tuple[int, ...] = ()) -> list[Any]:
    """Return the components of a given vector as SymPy numbers and expressions.

    Raises `uqmbd.StudyError` if a component is invalid or not finite, or if their number is not in `sizes`.
    """
    entries = [as_symbolic(x) for x in flatten(vector)]
    wrong = next((x for x in entries if not isinstance(x, sympy.Expr) or x.is_finite is False or x is sympy.nan), None)
    # a column is a vector, but nested rows of other lengths are not a vector
    nested = isinstance(vector, (list, tuple)) and any(isinstance(x, (list, tuple)) and len(x) != 1 for x in vector)
    if wrong is not None or (sizes and (len(entries) not in sizes or (nested and sizes != (9,)))):
        expected = " or ".join(map(str, sizes)) or "finite"
        within = "" if wrong is None else f", which contains {shown(wrong)}"
        raise StudyError(f"{what} is {shown(vector)}{within}; expected {expected} numbers or expressions.")
    return entries


ROTATION = (0, 2, 4)
"""Number of components of a rotation: none for point masses; cosine and sine of half the angle in planar space;
quaternion in three dimensions."""


def unit(vector: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Return a vector scaled to length one; the components remain numbers if they are numbers."""
    entries = _entries(vector)
    length = math.sqrt(sum(nominal(x) ** 2 for x in entries))
    if length < 1e-12:
        example = (0,) * (len(entries) - 1) + (1,)
        raise StudyError(
            f"the vector {tuple(vector)} has length zero, so it has no direction; give a non-zero vector, e.g. "
            f"{example}."
        )
    if all(x.is_number for x in entries):
        return tuple(sympy.Float(float(x) / length) if x != 0 else sympy.S.Zero for x in entries)
    root = sympy.sqrt(sum(x * x for x in entries))
    return tuple(x / root for x in entries)


@typechecked(values=False)
def perpendiculars(axis: Sequence[Any]) -> tuple[sympy.Matrix, sympy.Matrix]:
    """Return two unit vectors that form a right-handed frame with a unit axis of three components.

    The nominal values select the reference direction, so that the result is smooth in the random variables.

    Parameters
    ----------
    axis : sequence
        Unit axis, three components.

    Returns
    -------
    tuple of two matrices, shape (3, 1)
        First two axes of the frame.

    Examples
    --------
    >>> [tuple(map(float, n)) for n in perpendiculars((0, 0, 1))]
    [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    """
    axis = _entries(axis, "perpendiculars: axis", (3,))
    start = (int(np.argmax(np.abs([nominal(x) for x in axis]))) + 1) % 3
    helper = [0, 0, 0]
    helper[start] = 1
    a = sympy.Matrix(axis)
    along = a[start]
    first = sympy.Matrix(unit([h - along * x for h, x in zip(helper, axis, strict=True)]))
    return first, a.cross(first)


def _row_lengths(matrix: Any) -> list[int]:
    """Return the number of entries of each row of a matrix; -1 for an object that is not a flat row."""
    if isinstance(matrix, sympy.MatrixBase):
        return [matrix.cols] * matrix.rows
    found = []
    for row in matrix:
        parts = list(row) if hasattr(row, "__iter__") else None
        found.append(-1 if parts is None or any(hasattr(part, "__iter__") for part in parts) else len(parts))
    return found


def _rows_in_words(lengths: list[int]) -> str:
    if -1 in lengths:
        return f"{len(lengths)} entries, not all of them rows of numbers"
    return f"{len(lengths)} row{'s' * (len(lengths) != 1)}, of {', '.join(map(str, lengths))}"


def quaternion_of_matrix(matrix: Any) -> tuple[sympy.Expr, ...]:
    """Return the quaternion of a 3 x 3 rotation matrix; raise `uqmbd.StudyError` if it is not a proper rotation.

    The function computes the component that is largest at the nominal values first.
    """
    entries = _entries(matrix, "the rotation matrix", (9,))
    if (lengths := _row_lengths(matrix)) != [3, 3, 3]:
        raise StudyError(
            f"the rotation matrix has {_rows_in_words(lengths)}; expected 3 rows and 3 columns of numbers."
        )
    r = sympy.Matrix(3, 3, entries)
    numbers = np.array([[nominal(x) for x in r.row(i)] for i in range(3)])
    within = bool((np.abs(numbers) <= 2).all())  # squares of larger numbers may overflow
    if not within or not np.allclose(numbers @ numbers.T, np.eye(3), atol=1e-8) or np.linalg.det(numbers) < 0:
        raise StudyError(
            f"the matrix {numbers.tolist()} is not a rotation matrix; expected perpendicular unit vectors as columns "
            "that form a right-handed set."
        )
    squares = [
        1 + r[0, 0] + r[1, 1] + r[2, 2],
        1 + r[0, 0] - r[1, 1] - r[2, 2],
        1 - r[0, 0] + r[1, 1] - r[2, 2],
        1 - r[0, 0] - r[1, 1] + r[2, 2],
    ]
    products = {
        (0, 1): r[2, 1] - r[1, 2],
        (0, 2): r[0, 2] - r[2, 0],
        (0, 3): r[1, 0] - r[0, 1],
        (1, 2): r[0, 1] + r[1, 0],
        (1, 3): r[0, 2] + r[2, 0],
        (2, 3): r[1, 2] + r[2, 1],
    }
    big = int(np.argmax([nominal(s) for s in squares]))
    twice = sympy.sqrt(squares[big])
    return tuple(twice / 2 if k == big else products[min(k, big), max(k, big)] / (2 * twice) for k in range(4))


@typechecked(values=False)
def relative_quaternion(e_i: Sequence[Any], e_j: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Return the quaternion of frame j relative to frame i, ``conj(e_i) e_j``; half-angle pairs in planar space.

    The result is empty in spaces without rotation, such as translational space.

    Parameters
    ----------
    e_i, e_j : sequence
        Quaternions of both frames, to the world.

    Returns
    -------
    tuple of expressions
        Relative quaternion, with the same number of components.

    Examples
    --------
    >>> relative_quaternion((1, 0), (0, 1))
    (0, 1)
    """
    i = _entries(e_i, "relative_quaternion: e_i", ROTATION)
    j = _entries(e_j, "relative_quaternion: e_j", (len(i),))
    if not i:
        return ()
    if len(i) == 2:
        return (i[0] * j[0] + i[1] * j[1], i[0] * j[1] - i[1] * j[0])
    a, b = sympy.Matrix(i[1:]), sympy.Matrix(j[1:])
    vector = i[0] * b - j[0] * a - a.cross(b)
    return (i[0] * j[0] + a.dot(b), *vector)


@typechecked(values=False)
def quaternion_product(a: Sequence[Any], b: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Return the product of two quaternions (half-angle pairs in planar space): the rotation `b`, followed by `a`.

    Parameters
    ----------
    a, b : sequence
        Quaternions of four components; half-angle pairs in planar space.

    Returns
    -------
    tuple of expressions
        Product, with the same number of components.

    Examples
    --------
    >>> quaternion_product((0, 1, 0, 0), (0, 0, 1, 0))
    (0, 0, 0, 1)
    """
    a = _entries(a, "quaternion_product: a", ROTATION)
    b = _entries(b, "quaternion_product: b", (len(a),))
    if not a:
        return ()
    if len(a) == 2:
        return (a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0])
    u, v = sympy.Matrix(a[1:]), sympy.Matrix(b[1:])
    return (a[0] * b[0] - u.dot(v), *(a[0] * v + b[0] * u + u.cross(v)))


@typechecked(values=False)
def smallest_rotation(start: Sequence[Any], end: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Return the quaternion of the smallest rotation from one unit vector to another.

    The result rotates `start` to `end` within rounding, for every angle between them.  If the angle is within 4.5e-5
    rad of half a turn, rounding errors would determine the axis of the smallest rotation.  In this range, the result is
    half a turn about a fixed axis, followed by the smallest rotation from ``-start`` to `end`.

    Parameters
    ----------
    start, end : sequence
        Unit vectors of three components.

    Returns
    -------
    tuple of expressions
        Quaternion of four components.

    Examples
    --------
    >>> [round(float(x), 3) for x in smallest_rotation((1, 0, 0), (0, 1, 0))]
    [0.707, 0.0, 0.0, 0.707]
    """
    a = sympy.Matrix(_entries(start, "smallest_rotation: start", (3,)))
    b = sympy.Matrix(_entries(end, "smallest_rotation: end", (3,)))
    if a == b:
        return (sympy.S.One, sympy.S.Zero, sympy.S.Zero, sympy.S.Zero)
    cosine = a.dot(b)
    if nominal(cosine) >= 0:
        return unit([1 + cosine, *a.cross(b)])
    # the sum a + b of numbers is exact and retains digits that 1 + a . b and a x b lose
    both = a + b
    square = both.dot(both)
    if nominal(square) / 2 < OPPOSITE:
        half_turn = (sympy.S.Zero, *perpendiculars(a)[0])
        return quaternion_product(smallest_rotation(-a, b), half_turn)
    # divide first: SymPy expands the product of a number and a sum, which also loses digits
    length = sympy.sqrt(square)
    return (length / 2, *a.cross(both / length))


def turned(turn: Sequence[Any], vector: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Rotate a vector of three components by a unit quaternion."""
    turn = _entries(turn)
    conjugate = (turn[0], *(-x for x in turn[1:]))
    return quaternion_product(quaternion_product(turn, (0, *vector)), conjugate)[1:]


@typechecked(values=False)
def joint_frames(axis_i: Sequence[Any], axis_j: Sequence[Any]) -> tuple[tuple[sympy.Expr, ...], tuple[sympy.Expr, ...]]:
    """Return frames fixed in two bodies with the given third axes, as quaternions relative to the bodies.

    The quaternions are equal if the axes have equal components.  Otherwise, the smallest rotation from `axis_i` to
    `axis_j` rotates frame i to frame j.  The angle between the frames is therefore zero if the body frames coincide.

    Parameters
    ----------
    axis_i, axis_j : sequence
        Unit vectors of three components, each in the axes of its body.

    Returns
    -------
    tuple of two tuples
        Quaternion of the frame in each body.

    Examples
    --------
    >>> i, j = joint_frames((0, 0, 1), (0, 0, 1))
    >>> i == j, [float(x) for x in i]
    (True, [1.0, 0.0, 0.0, 0.0])
    """
    axis_i, axis_j = (_entries(x, f"joint_frames: axis_{k}", (3,)) for k, x in (("i", axis_i), ("j", axis_j)))
    first, second = perpendiculars(axis_i)
    frame = quaternion_of_matrix(sympy.Matrix.hstack(first, second, sympy.Matrix(axis_i)))
    return frame, quaternion_product(smallest_rotation(axis_i, axis_j), frame)


@typechecked(values=False)
def aligned(turn: Sequence[Any], axis_i: Sequence[Any], axis_j: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Make two axes parallel by the smallest change of a relative rotation.

    Parameters
    ----------
    turn : sequence
        Quaternion of body j relative to body i (half-angle pair in planar space).
    axis_i, axis_j : sequence
        Axes, each in the frame of its body.

    Returns
    -------
    tuple
        Changed quaternion; `turn` itself if the axes are already parallel.

    Examples
    --------
    >>> [float(x) for x in aligned((1, 0, 0, 0), (0, 0, 1), (0, 0, 1))]
    [1.0, 0.0, 0.0, 0.0]
    """
    turn = _entries(turn, "aligned: turn", ROTATION)
    if not turn:
        return ()
    size = (2 if len(turn) == 2 else 3,)
    axis_i, axis_j = (_entries(x, f"aligned: axis_{k}", size) for k, x in (("i", axis_i), ("j", axis_j)))
    if len(turn) == 2:
        c, s = turn[0] ** 2 - turn[1] ** 2, 2 * turn[0] * turn[1]
        drawn: Sequence[Any] = [c * axis_j[0] - s * axis_j[1], s * axis_j[0] + c * axis_j[1]]
    else:
        drawn = turned(turn, axis_j)
    apart = [as_symbolic(a - b) for a, b in zip(drawn, axis_i, strict=True)]
    # random axes that are parallel at the means may not be parallel in a realisation
    if all(x.is_number and abs(x) < PARALLEL for x in apart):
        return tuple(turn)
    left = _smallest_in_plane(drawn, axis_i) if len(turn) == 2 else smallest_rotation(drawn, axis_i)
    return quaternion_product(left, turn)


def _smallest_in_plane(start: Sequence[Any], end: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Return the half-angle pair of the smallest rotation from one unit vector of the plane to another."""
    (a, b), (c, d) = start, end
    cosine, sine = a * c + b * d, a * d - b * c
    if nominal(cosine) >= 0:
        return unit([1 + cosine, sine])
    half_turn = (sympy.S.Zero, sympy.S.NegativeOne if nominal(sine) < 0 else sympy.S.One)
    return quaternion_product(_smallest_in_plane([-a, -b], end), half_turn)
