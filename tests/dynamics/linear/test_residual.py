"""How well solutions satisfy systems, row by row, held against NumPy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.compiled import ProgramWriter
from uqmbd.dynamics.linear.residual import RowResiduals


@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_residuals_by_rows(size, seed):
    random = np.random.default_rng(seed)
    rows, columns = np.nonzero(random.random((size, size)) < 0.5)
    entries, right = random.integers(7, size=len(rows)), random.integers(-1, 7, size=size)
    given_values, x = random.normal(size=(9, 7)), random.normal(size=(9, size))
    writer = ProgramWriter(7 + size)
    program = writer.program(
        RowResiduals(rows, columns, entries, right).write(writer, np.arange(7), np.arange(7, 7 + size))
    )
    expected = np.zeros(9)
    for k, (value, solution) in enumerate(zip(given_values, x, strict=True)):
        matrix = np.zeros((size, size))
        matrix[rows, columns] = value[entries]
        b = np.where(right < 0, 0, value[right])
        scale = np.abs(matrix) @ np.abs(solution) + np.abs(b)
        ratio = np.divide(matrix @ solution - b, scale, out=np.zeros(size), where=scale > 0)
        expected[k] = ratio @ ratio
    np.testing.assert_allclose(program(given_values, x)[:, 0], expected, rtol=1e-12, atol=1e-25)
