"""Sparse equations solved by the driver, held against NumPy's least squares and against closed forms."""

import numpy as np
import pytest
import symengine as se
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from uqmbd.compiled import EquationPrograms, Gradients, ProgramWriter, RotationCoordinates, compile_kernel

NONE = np.zeros(0, dtype=np.int64)
STILL = RotationCoordinates(np.zeros((0, 0), dtype=np.int64), NONE, 0)


def linear(pattern, certain, solved=None):
    """Equations ``A x + b = 0`` whose entries and values are arguments: x, then the entries, then b."""
    rows, columns = np.nonzero(pattern)
    equations, unknowns = pattern.shape
    writer = ProgramWriter(unknowns + len(rows) + equations)
    return EquationPrograms(
        program=writer.program(NONE),
        values=unknowns + len(rows) + np.arange(equations),
        gradients=Gradients(rows, columns, unknowns + np.arange(len(rows)), np.ones(len(rows))),
        solved=np.arange(equations) if solved is None else solved,
        certain=certain,
        unknowns=unknowns,
        shortest=1e-12,
    )


def systems(draw_seed, count, held, stated, size, density):
    """Sparse rows, of which the last half of the stated ones follow from those before; right-hand sides that they meet."""
    random = np.random.default_rng(draw_seed)
    pattern = random.uniform(size=(held + stated, size)) < density
    pattern[np.arange(held), random.permutation(size)[:held]] = True
    a = random.normal(size=(count, held + stated, size)) * pattern
    for k in range(held + stated // 2, held + stated):
        weights = random.normal(size=(count, k))
        a[:, k] = np.einsum("ki,kij->kj", weights, a[:, :k])
        pattern[k] = pattern[:k].any(axis=0)
    b = np.einsum("kij,kj->ki", a, random.normal(size=(count, size)))
    return pattern, a, b


@given(st.integers(1, 11), st.integers(1, 12), st.integers(0, 6), st.floats(0.05, 1.0), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_least_solutions_are_those_of_least_squares(count, held, stated, density, seed):
    pattern, a, b = systems(seed, count, held, stated, held + 4, density)
    lengths = np.linalg.norm(a, axis=2, keepdims=True)
    values = np.linalg.svd(a / np.where(lengths > 0, lengths, 1), compute_uv=False)
    assume(not ((values > 1e-9) & (values < 2e-2)).any())  # whether rows follow from others is certain
    assume((np.linalg.svd((a / np.where(lengths > 0, lengths, 1))[:, :held], compute_uv=False) > 2e-2).all())
    equations = linear(pattern, held)
    rows, columns = np.nonzero(pattern)
    found, undecided = equations.least(np.zeros((1, held + 4)), a[:, rows, columns], -b, count=count)
    # what follows from other rows may be left to others, where these are next to dependent; it is never wrong
    for k in np.flatnonzero(~undecided)[::3].tolist():
        expected = np.linalg.lstsq(a[k], b[k], rcond=1e-8)[0]
        np.testing.assert_allclose(found[k], expected, rtol=0, atol=1e-8 * (1 + np.abs(expected).max()))
        one = slice(k, k + 1)
        alone, _ = equations.least(np.zeros((1, held + 4)), a[one, rows, columns], -b[one], count=1)
        assert np.array_equal(alone[0], found[k])
    closed, undecided = equations.close(
        STILL, NONE, np.zeros((count, held + 4)), a[:, rows, columns], np.zeros_like(b), count=count
    )
    assert not closed[~undecided].any()


def test_few_are_left_to_others():
    """Of systems whose rows are as well apart as those above."""
    left = []
    for seed in range(60):
        pattern, a, b = systems(seed, 4, 7, 6, 11, 0.5)
        lengths = np.linalg.norm(a, axis=2, keepdims=True)
        rows = a / np.where(lengths > 0, lengths, 1)
        values = np.linalg.svd(rows, compute_uv=False)
        apart = ~((values > 1e-9) & (values < 2e-2)).any(axis=1)
        apart &= (np.linalg.svd(rows[:, :7], compute_uv=False) > 2e-2).all(axis=1)
        where = np.nonzero(pattern)
        _, undecided = linear(pattern, 7).least(np.zeros((1, 11)), a[:, where[0], where[1]], -b, count=4)
        left += undecided[apart].tolist()
    assert len(left) > 100 and np.mean(left) < 0.05


def test_contradictions_and_what_is_nearly_dependent_are_left_to_others():
    pattern = np.ones((3, 3), dtype=bool)
    a = np.repeat(np.eye(3)[None], 5, axis=0)
    b = np.ones((5, 3))
    a[1, 2] = a[1, 0]  # follows from the first
    a[2, 2], b[2, 2] = a[2, 0], 2.0  # contradicts it
    a[3, 2] = [1, 0, 1e-5]  # nearly follows
    a[4, 1] = a[4, 0]  # certain rows are dependent
    found, undecided = linear(pattern, 2).least(np.zeros((1, 3)), a.reshape(5, 9), -b, count=5)
    assert undecided.tolist() == [False, False, True, True, True]
    np.testing.assert_allclose(found[:2], [[1, 1, 1], [1, 1, 0]], rtol=0, atol=1e-15)


def test_what_is_only_looked_at_is_looked_at():
    equations = linear(np.ones((2, 2), dtype=bool), 1, np.array([0]))
    entries = np.tile([1.0, 0.0, 2.0, 0.0], (2, 1))
    _, undecided = equations.least(np.zeros((1, 2)), entries, -np.array([[1.0, 2.0], [1.0, 3.0]]), count=2)
    assert undecided.tolist() == [False, True]


@pytest.fixture(scope="module")
def spheres():
    """Points of dimension three on unit spheres, whose distance from the other is looked at, and their first entries."""
    x = [se.Symbol(f"_x{k}") for k in range(6)]
    values = [sum(e * e for e in x[:3]) - 1, sum(e * e for e in x[3:]) - 1]
    kernel = compile_kernel(x, [*values, *(2 * e for e in x)])
    writer = ProgramWriter(6)
    results = writer.call(kernel, np.arange(6)[None]).ravel()
    gradients = Gradients(np.repeat([0, 1], 3), np.arange(6), results[2:], np.ones(6))
    return EquationPrograms(writer.program(NONE), results[:2], gradients, np.arange(2), 2, 6, 1e-9)


@given(st.integers(1, 20), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_steps_along_the_gradients_end_on_the_spheres_below(spheres, count, seed):
    """Gradients are radial, so is each step: the pose that is found is the drawn one over its distance from the centre."""
    random = np.random.default_rng(seed)
    drawn = random.normal(size=(count, 6)) * np.exp(random.uniform(-3, 3, size=(count, 1)))
    found, undecided = spheres.close(STILL, NONE, drawn, count=count)
    assert not undecided.any()
    below = drawn.reshape(count, 2, 3)
    below = below / np.linalg.norm(below, axis=2, keepdims=True)
    np.testing.assert_allclose(found, below.reshape(count, 6), rtol=0, atol=1e-11)
    for k in range(count):
        assert np.array_equal(spheres.close(STILL, NONE, drawn[k : k + 1], count=1)[0][0], found[k])


def test_poses_that_want_a_decision_are_distinguished(spheres):
    """A centre, where gradients vanish; what is no number; a mirror image; one that is closed, and is not moved."""
    drawn = np.tile([1.0, 0, 0, 0, 1.0, 0], (4, 1))
    drawn[0, :3], drawn[1, 0], drawn[2, 0] = 0, np.nan, -1
    found, undecided = spheres.close(STILL, np.array([0]), drawn, count=4)
    assert undecided.tolist() == [True, True, True, False]
    assert np.array_equal(found[3], drawn[3])


def test_turns_are_bounded_and_brought_to_length_one(spheres):
    """Quaternions: the same, in steps of at most 0.3, each of which ends at length one."""
    turns = RotationCoordinates(np.array([[0, 1, 2], [3, 4, 5]]), np.ones(2, dtype=np.int64), 0)
    drawn = np.array([[3.0, 4, 0, 0, 0, 0.2]])
    found, undecided = spheres.close(turns, NONE, drawn, count=1)
    assert not undecided.any()
    np.testing.assert_allclose(found, [[0.6, 0.8, 0, 0, 0, 1]], rtol=0, atol=1e-12)
