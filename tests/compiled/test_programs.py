import pickle

import numpy as np
import pytest
import symengine as se
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.compiled import Columns, ProgramWriter, compile_kernel

X = se.symbols("x0:3")
KERNEL = compile_kernel(X[:2], [X[0] + X[1], 2 * X[0] - X[1] ** 2])


def program():
    """Two instances of the kernel, sums of their results, an empty sum, and a copy."""
    writer = ProgramWriter(3)
    found = writer.call(KERNEL, np.array([[0, 1], [2, 0]]))
    sums = writer.sums([[found[0, 0], found[1, 1], 2], [], [1]])
    return writer.program(np.concatenate([found.ravel(), sums]))


def expected(x):
    a, b, c = x.T
    first, second = (a + b, 2 * a - b**2), (c + a, 2 * c - a**2)
    return np.column_stack([*first, *second, first[0] + second[1] + c, 0 * a, b])


@given(st.integers(0, 30), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_program(count, seed):
    x = np.random.default_rng(seed).normal(size=(count, 3))
    np.testing.assert_allclose(program()(x), expected(x), rtol=1e-14, atol=1e-14)


@given(st.integers(0, 30), st.integers(1, 20), st.integers(1, 20), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_columns_pass_unchanged(count, inputs, results, seed):
    random = np.random.default_rng(seed)
    x, which = random.normal(size=(count, inputs)), random.integers(inputs, size=results)
    assert np.array_equal(ProgramWriter(inputs).program(which)(x), x[:, which])


def test_program_survives_pickling():
    before = program()
    x = np.random.default_rng(0).normal(size=(9, 3))
    found = before(x)
    assert np.array_equal(pickle.loads(pickle.dumps(before))(x), found)


@given(st.integers(1, 7), st.integers(1, 40), st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_arguments_from_several_arrays(members, times, seed):
    random = np.random.default_rng(seed)
    states, parameters, moments = (random.normal(size=(n, 1)) for n in (members * times, members, times))
    whole = np.column_stack([states, np.repeat(parameters, times, axis=0), np.tile(moments, (members, 1))])
    sources = states, Columns(parameters, times), Columns(moments)
    found = program()(*sources)
    np.testing.assert_allclose(found, expected(whole), rtol=1e-14, atol=1e-14)
    largest = program().largest(*sources, states=times)
    assert np.array_equal(largest, np.abs(found).reshape(members, times, -1).max(axis=1))


def test_wrong_number_of_arguments():
    with pytest.raises(ValueError, match="the program has 3 arguments, but 2 are given"):
        program()(np.zeros((4, 2)))


@pytest.mark.parametrize("rows", [2, 4, 6])
def test_arguments_of_another_length_are_refused(rows):
    """They would be taken again from the first on; that is what `Columns` says."""
    x, y = se.symbols("x y")
    writer = ProgramWriter(2)
    program = writer.program(writer.call(compile_kernel([x, y], [x * y]), np.array([[0, 1]])))
    with pytest.raises(ValueError, match=f"for 5 states, but {rows} rows"):
        program(np.ones((5, 1)), np.ones((rows, 1)))
    with pytest.raises(ValueError, match="for 5 states, but 2 rows of arguments are given, each for 2 states in a row"):
        program(np.ones((5, 1)), Columns(np.ones((2, 1)), 2))
    found = program(np.arange(6.0)[:, None], Columns(np.array([[1.0], [2.0], [3.0]]), 2))
    assert found.ravel().tolist() == [0, 1, 4, 6, 12, 15]
