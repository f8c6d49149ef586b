"""Systems of linear equations that are solved together without pivots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uqmbd.dynamics.statics.rest_equations import solve_definite


@given(st.integers(1, 6), st.integers(0, 3), st.integers(0, 10**6))
def test_definite_and_other_systems_have_the_solution_of_lapack(n, columns, seed):
    """Some systems are indefinite or have a zero on the diagonal; rows differ by orders of magnitude."""
    generator = np.random.default_rng(seed)
    root = generator.normal(size=(9, n, n))
    scale = 10.0 ** generator.uniform(-4, 4, (9, n))
    matrices = (root @ root.transpose(0, 2, 1) + 0.1 * np.eye(n)) * scale[:, :, None] * scale[:, None, :]
    matrices[:3] = ((root + root.transpose(0, 2, 1)) * scale[:, :, None] * scale[:, None, :])[:3]
    matrices[0, 0, 0] = 0.0 if n > 1 else 1.0
    expected = generator.normal(size=(9, n, columns)) / scale[:, :, None]
    found = solve_definite(matrices, matrices @ expected)
    condition = np.linalg.cond(matrices * (1 / scale)[:, :, None] * (1 / scale)[:, None, :]) * 1e-14
    wrong = np.abs((found - expected) * scale[:, :, None]).max(axis=(1, 2), initial=0.0)
    assert (wrong <= 100 * condition * 10).all()
    # the solution of a system does not depend on the others
    one = solve_definite(matrices[4:5], (matrices @ expected)[4:5])
    assert n > 4 or np.array_equal(one, found[4:5])


def test_a_singular_system_is_an_error():
    with pytest.raises(np.linalg.LinAlgError):
        solve_definite(np.zeros((2, 2, 2)), np.ones((2, 2, 1)))
