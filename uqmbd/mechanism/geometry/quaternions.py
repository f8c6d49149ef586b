"""Functions of vectors and rotations whose entries may be random."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy

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
"""Difference of two unit vectors that are parallel as drawn."""


def nominal(expression: Any) -> float:
    """Value of an expression at the means of its random variables and at time zero.

    Parameters
    ----------
    expression : expression
        In random variables and time.

    Returns
    -------
    float
        In its units.

    Raises
    ------
    uqmbd.StudyError
        If the expression contains anything else, or has no finite value there.

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
            raise StudyError(
                f"{value} contains {strangers}; only numbers and random variables have a value here."
            ) from None
        number = math.nan
    if not math.isfinite(number):
        raise StudyError(
            f"{value} is {result} at the means of the random variables; expected a finite real number "
            "(look for divisions by zero, and for roots, logarithms and arcus functions outside of their range)."
        )
    return number


def _entries(vector: Any, what: str = "the vector", sizes: tuple[int, ...] = ()) -> list[Any]:
    """Return the components of a vector that a caller gives, as SymPy numbers and expressions.

    Raises `uqmbd.StudyError` if one is neither, or is not finite, or their number is none of `sizes`.
    """
    entries = [as_symbolic(x) for x in flatten(vector)]
    wrong = next((x for x in entries if not isinstance(x, sympy.Expr) or x.is_finite is False or x is sympy.nan), None)
    # a column is a vector, rows of several lengths are none
    nested = isinstance(vector, (list, tuple)) and any(isinstance(x, (list, tuple)) and len(x) != 1 for x in vector)
    if wrong is not None or (sizes and (len(entries) not in sizes or (nested and sizes != (9,)))):
        expected = " or ".join(map(str, sizes)) or "finite"
        within = "" if wrong is None else f", with {shown(wrong)} in it"
        raise StudyError(f"{what} is {shown(vector)}{within}; expected {expected} numbers or expressions.")
    return entries


ROTATION = (0, 2, 4)
"""Components of a rotation: none where nothing turns, a half-angle pair in the plane, a quaternion."""


def unit(vector: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Scale a vector to length one; numbers stay numbers."""
    entries = _entries(vector)
    length = math.sqrt(sum(nominal(x) ** 2 for x in entries))
    if length < 1e-12:
        example = (0,) * (len(entries) - 1) + (1,)
        raise StudyError(
            f"the vector {tuple(vector)} has no length; give a vector that points somewhere, e.g. {example}."
        )
    if all(x.is_number for x in entries):
        return tuple(sympy.Float(float(x) / length) if x != 0 else sympy.S.Zero for x in entries)
    root = sympy.sqrt(sum(x * x for x in entries))
    return tuple(x / root for x in entries)


def perpendiculars(axis: Sequence[Any]) -> tuple[sympy.Matrix, sympy.Matrix]:
    """Two unit vectors that make a right-handed frame with a unit axis of three components.

    The reference direction is chosen at the nominal values, so that the result is smooth in the random variables.

    Parameters
    ----------
    axis : sequence
        Three components.

    Returns
    -------
    tuple of two matrices, shape (3, 1)
        The first two axes of the frame.

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
    """Return how many entries the rows of a matrix have; -1 for a row that is none, or holds more than entries."""
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
    """Return the quaternion of a 3 x 3 rotation matrix; raise `uqmbd.StudyError` if it is no proper rotation.

    The largest component at the nominal values is computed first.
    """
    entries = _entries(matrix, "the rotation matrix", (9,))
    if (lengths := _row_lengths(matrix)) != [3, 3, 3]:
        raise StudyError(
            f"a rotation matrix has 3 rows and 3 columns of numbers; this one has {_rows_in_words(lengths)}."
        )
    r = sympy.Matrix(3, 3, entries)
    numbers = np.array([[nominal(x) for x in r.row(i)] for i in range(3)])
    within = bool((np.abs(numbers) <= 2).all())  # squares of larger ones may overflow
    if not within or not np.allclose(numbers @ numbers.T, np.eye(3), atol=1e-8) or np.linalg.det(numbers) < 0:
        raise StudyError(
            f"the matrix {numbers.tolist()} is no rotation: its columns must be perpendicular unit vectors "
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


def relative_quaternion(e_i: Sequence[Any], e_j: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Quaternion of frame j relative to frame i, ``conj(e_i) e_j``; half-angle pairs in the plane.

    Nothing where nothing turns, as in translational space.

    Parameters
    ----------
    e_i, e_j : sequence
        Of both frames, to the world.

    Returns
    -------
    tuple of expressions
        As many components.

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


def quaternion_product(a: Sequence[Any], b: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Product of two quaternions (half-angle pairs in the plane): the rotation `b`, then `a`.

    Parameters
    ----------
    a, b : sequence
        Four components each; in the plane two.

    Returns
    -------
    tuple of expressions
        As many components.

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


def smallest_rotation(start: Sequence[Any], end: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Quaternion of the smallest rotation that turns one unit vector into another.

    The result turns `start` into `end` to rounding, for every angle between them.  Within 4.5e-5 rad of half a turn,
    rounding would choose the axis of the smallest rotation.  There the result is half a turn about a fixed axis, then
    the smallest rotation from the opposite of `start` to `end`.

    Parameters
    ----------
    start, end : sequence
        Three components each.

    Returns
    -------
    tuple of expressions
        Four components.

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
    # the sum is exact where both are numbers, and 1 + a . b and a x b lose the digits that it keeps
    both = a + b
    square = both.dot(both)
    if nominal(square) / 2 < OPPOSITE:
        half_turn = (sympy.S.Zero, *perpendiculars(a)[0])
        return quaternion_product(smallest_rotation(-a, b), half_turn)
    # divided first: SymPy multiplies a number and a bare sum out, which loses them as well
    length = sympy.sqrt(square)
    return (length / 2, *a.cross(both / length))


def turned(turn: Sequence[Any], vector: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Turn a vector of three components by a unit quaternion."""
    turn = _entries(turn)
    conjugate = (turn[0], *(-x for x in turn[1:]))
    return quaternion_product(quaternion_product(turn, (0, *vector)), conjugate)[1:]


def joint_frames(axis_i: Sequence[Any], axis_j: Sequence[Any]) -> tuple[tuple[sympy.Expr, ...], tuple[sympy.Expr, ...]]:
    """Return frames fixed in two bodies whose third axes are the given ones, as quaternions relative to the bodies.

    The frames are equal where the axes have equal components; else frame j is frame i turned by the smallest rotation
    that takes `axis_i` to `axis_j`.  So the angle between them is zero where the body frames coincide.

    Parameters
    ----------
    axis_i, axis_j : sequence
        Unit vectors of three components, each in the axes of its body.

    Returns
    -------
    tuple of two tuples
        A quaternion for each body.

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


def aligned(turn: Sequence[Any], axis_i: Sequence[Any], axis_j: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Turn a relative rotation by as little as makes two axes parallel.

    Parameters
    ----------
    turn : sequence
        Quaternion of body j relative to body i (half-angle pair in the plane).
    axis_i, axis_j : sequence
        The axes, each in its body's frame.

    Returns
    -------
    tuple
        The quaternion `turn` itself where the axes are parallel already.

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
    # random axes that are parallel at the means are not parallel in each realisation
    if all(x.is_number and abs(x) < PARALLEL for x in apart):
        return tuple(turn)
    left = _smallest_in_plane(drawn, axis_i) if len(turn) == 2 else smallest_rotation(drawn, axis_i)
    return quaternion_product(left, turn)


def _smallest_in_plane(start: Sequence[Any], end: Sequence[Any]) -> tuple[sympy.Expr, ...]:
    """Half-angle pair of the smallest rotation that turns one unit vector of the plane into another."""
    (a, b), (c, d) = start, end
    cosine, sine = a * c + b * d, a * d - b * c
    if nominal(cosine) >= 0:
        return unit([1 + cosine, sine])
    half_turn = (sympy.S.Zero, sympy.S.NegativeOne if nominal(sine) < 0 else sympy.S.One)
    return quaternion_product(_smallest_in_plane([-a, -b], end), half_turn)
