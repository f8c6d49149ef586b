"""Rotations between vectors, of numbers and of random vectors, against exact arithmetic; many close to half a turn."""

from __future__ import annotations

import chaospy
import mpmath
import numpy as np
import pytest
import sympy
from scipy.spatial.transform import Rotation

import uqmbd
from uqmbd.dynamics.drawn_pose import moves
from uqmbd.dynamics.equations import ParameterMap
from uqmbd.mechanism import aligned, joint_frames, smallest_rotation
from uqmbd.mechanism.geometry import quaternion_of_matrix, unit

EXACT = 2e-15
"""Errors of a few operations in double precision."""

FIXED = 4.5e-5
"""Angle to half a turn, rad, within which the axis is a fixed one."""


def matrix(q):
    """Rotation matrix of a quaternion, of numbers of any precision."""
    a, b, c, d = q
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    )


def exact_smallest(start, end):
    """Quaternion of the smallest rotation, with 60 digits, of the directions of two vectors of doubles."""
    with mpmath.workdps(60):
        a, b = ([mpmath.mpf(float(x)) for x in v] for v in (start, end))
        a, b = ([x / mpmath.sqrt(sum(y * y for y in v)) for x in v] for v in (a, b))
        scalar = 1 + sum(x * y for x, y in zip(a, b, strict=True))
        cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        size = mpmath.sqrt(scalar**2 + sum(x * x for x in cross))
        return [float(x / size) for x in (scalar, *cross)]


def axis(random):
    vector = random.standard_normal(3)
    return vector / np.linalg.norm(vector)


def pair(random, number):
    """Two unit vectors; of three pairs one is at any angle, one within 1e-9 to 1e-3 of zero and one of half a turn."""
    a = axis(random)
    across = np.cross(a, axis(random))
    small = 10 ** random.uniform(-9, -3)
    angle = [random.uniform(0, np.pi), small, np.pi - small][number % 3]
    b = Rotation.from_rotvec(angle * across / np.linalg.norm(across)).apply(a)
    return a, b, angle


def numbers(expressions):
    return np.array([float(x) for x in expressions])


def require_smallest_rotations(seed, count):
    random = np.random.default_rng(seed)
    for k in range(count):
        a, b, angle = pair(random, k)
        found = numbers(smallest_rotation(a, b))
        np.testing.assert_allclose(matrix(found) @ a, b, rtol=0, atol=EXACT)
        assert abs(np.linalg.norm(found) - 1) < EXACT
        left = np.pi - angle
        if left > FIXED * 1.01:  # rounding of the vectors turns the axis by as much, and no more
            np.testing.assert_allclose(found, exact_smallest(a, b), rtol=0, atol=EXACT + 1e-15 / left)
        else:
            assert abs(found[0]) <= left / 2 + EXACT


def test_smallest_rotations():
    require_smallest_rotations(1, 30)


@pytest.mark.thorough
def test_many_smallest_rotations():
    require_smallest_rotations(2, 600)


def test_opposite_vectors_are_turned_about_the_same_axis_with_and_without_rounding():
    """So the zero of a joint's angle does not depend on rounding."""
    random = np.random.default_rng(3)
    for _ in range(20):
        a = axis(random)
        exact = numbers(smallest_rotation(a, -a))
        for small in (1e-16, 1e-12, 1e-6):
            b = Rotation.from_rotvec(small * axis(random)).apply(-a)
            np.testing.assert_allclose(numbers(smallest_rotation(a, b)), exact, rtol=0, atol=small + EXACT)


def require_random_vectors(seed, count):
    """Frames of random axes, compiled as parameters of a joint are: their axes are the given ones."""
    random = np.random.default_rng(seed)
    x, y = (uqmbd.RandomVariable(name, chaospy.Normal(0, 1)) for name in "xy")
    for k in range(count):
        a, b, _ = pair(random, k)
        small = 10 ** random.uniform(-8, -1)
        shifts = [small * axis(random) for _ in range(3)]
        moved = [float(b[i]) + float(shifts[0][i]) * x + float(shifts[1][i]) * y for i in range(3)]
        fixed = [float(a[i]) + (float(shifts[2][i]) * x if k % 2 else 0) for i in range(3)]
        end, start = unit(moved), unit(fixed)
        frame_i, frame_j = joint_frames(start, end)
        kept = aligned((1, 0, 0, 0), start, end)
        parts = [*start, *end, *smallest_rotation(start, end), *frame_i, *frame_j, *kept]
        map_ = ParameterMap.of([sympy.sympify(part) for part in parts], [x, y])
        for row in map_(random.standard_normal((8, 2))):
            start_at, end_at = row[:3], row[3:6]
            turn, first, second, slide = row[6:].reshape(4, 4)
            np.testing.assert_allclose(matrix(turn) @ start_at, end_at, rtol=0, atol=EXACT)
            np.testing.assert_allclose(matrix(first)[:, 2], start_at, rtol=0, atol=EXACT)
            np.testing.assert_allclose(matrix(second)[:, 2], end_at, rtol=0, atol=EXACT)
            np.testing.assert_allclose(matrix(slide) @ end_at, start_at, rtol=0, atol=EXACT)


@pytest.mark.thorough
def test_frames_of_random_axes():
    require_random_vectors(4, 3)


@pytest.mark.slow
def test_many_frames_of_random_axes():
    require_random_vectors(5, 40)


def test_slides_along_random_axes_are_aligned_where_they_are_parallel_at_the_means():
    """An axis that is tilted by a random angle of mean zero: body j is turned by that angle in each realisation."""
    tilt = uqmbd.RandomVariable("tilt", chaospy.Normal(0, 0.01))
    start = (sympy.sin(tilt), sympy.Integer(0), sympy.cos(tilt))
    turn = aligned((1, 0, 0, 0), start, (0, 0, 1))
    for value in (-0.02, 0.0, 1e-7, 0.03):
        found = numbers(x.subs(tilt, value) for x in map(sympy.sympify, turn))
        np.testing.assert_allclose(found, [np.cos(value / 2), 0, np.sin(value / 2), 0], rtol=0, atol=EXACT)
    flat = aligned((1, 0), (sympy.cos(tilt), sympy.sin(tilt)), (1, 0))
    found = numbers(x.subs(tilt, 0.03) for x in map(sympy.sympify, flat))
    np.testing.assert_allclose(found, [np.cos(0.015), np.sin(0.015)], rtol=0, atol=EXACT)


def test_vectors_of_the_plane_are_turned_in_the_plane():
    """By less than half a turn, and by exactly half a turn where they are opposite."""
    random = np.random.default_rng(6)
    for k in range(60):
        small = 10 ** random.uniform(-9, -3) * random.choice([-1, 1])
        first, angle = random.uniform(-3, 3), [random.uniform(-3, 3), small, np.pi - small, np.pi][k % 4]
        start, end = (np.array([np.cos(x), np.sin(x)]) for x in (first, first + angle))
        cosine, sine = numbers(aligned((1, 0), end, start))
        turned = np.array([[cosine**2 - sine**2, -2 * cosine * sine], [2 * cosine * sine, cosine**2 - sine**2]]) @ start
        np.testing.assert_allclose(turned, end, rtol=0, atol=EXACT)
        assert abs(np.hypot(cosine, sine) - 1) < EXACT and cosine >= -EXACT


def test_quaternions_of_matrices_near_half_a_turn():
    random = np.random.default_rng(7)
    for k in range(30):
        small = 10 ** random.uniform(-9, -3)
        about = axis(random) if k % 2 else np.eye(3)[k % 3]
        given = Rotation.from_rotvec((np.pi - small) * about).as_matrix()
        found = numbers(quaternion_of_matrix(sympy.Matrix(given)))
        np.testing.assert_allclose(matrix(found), given, rtol=0, atol=EXACT)


def test_small_turns_of_bodies_are_measured():
    """The angle between two poses, from 1e-12 rad to half a turn: the arc cosine of their product has half the digits."""
    random = np.random.default_rng(8)
    for turn in (1e-12, 1e-8, 1e-4, 1.0, 3.0, np.pi):
        first = Rotation.random(random_state=random)
        poses = [first, Rotation.from_rotvec(turn * axis(random)) * first]
        before, after = (np.array([[0, 0, 0, *pose.as_quat(scalar_first=True)]]) for pose in poses)
        (move,) = moves(["body"], 3, before, -after if turn == 1.0 else after)
        assert move.turn == pytest.approx(turn, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    "given",
    [
        [[1, 0], [0, 1, 0], [0, 0, 1, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, [1]]],
        [[1, 0, 0], [0, 1, 0], [0, 0]],
        [[1, 0, 0], [0, 1, 0], 0, 0, 1],
        [1, 0, 0, 0, 1, 0, 0, 0, 1],
        [[[1, 0, 0]], [[0, 1, 0]], [[0, 0, 1]]],
        [[1, 0, 0, 0, 1, 0, 0, 0, 1]],
        np.array([[1, 0], [0, 1, 0], [0, 0, 1, 0]], dtype=object),
        [[1, 0, 0], [0, 1, 0], [0, 0, np.array([1.0])]],
        [[1e200, 0, 0], [0, 1, 0], [0, 0, 1]],
        sympy.eye(4),
        np.ones(9),
    ],
    ids=repr,
)
def test_what_is_no_matrix_of_three_rows_is_refused(given):
    with pytest.raises(uqmbd.StudyError, match="rotation"):
        quaternion_of_matrix(given)


def test_rows_of_any_kind_are_a_matrix():
    rows = ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], ((1, 0, 0), [0, 1, 0], np.array([0, 0, 1])), np.eye(3), sympy.eye(3))
    for given in rows:
        assert [float(x) for x in quaternion_of_matrix(given)] == [1, 0, 0, 0]
