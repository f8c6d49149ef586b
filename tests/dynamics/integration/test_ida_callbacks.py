"""What IDA is given is what the evaluators find, for one realisation and for stacks, in whichever arrays it asks."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
from scipy import sparse

import uqmbd
from uqmbd.dynamics import Ensemble, build
from uqmbd.dynamics.integration.ida import SPARSE_FROM, stack_callbacks
from uqmbd_joints import Revolute


def links(count):
    """A chain of pendulums, the first of which has a random mass."""
    mechanism = uqmbd.Mechanism("links", uqmbd.Planar(gravity=(0, -9.81)))
    mass, before = uqmbd.RandomVariable("m", chaospy.Uniform(1, 2), "kg"), mechanism.ground
    for k in range(count):
        body = mechanism.body(f"link {k}", mass=mass if k == 0 else 1, inertia=0.1, position=(k + 0.5, 0))
        mechanism.add(Revolute(f"pin {k}", before, body, at=(k, 0)))
        before = body
    return build(mechanism)


@pytest.mark.parametrize(("count", "stack"), [(1, 1), (1, 5), (3, 9), (12, 1)])
def test_callbacks_are_the_evaluators(count, stack):
    model = links(count)
    n, size = model.layout.unknowns, model.layout.unknowns * stack
    ensemble = Ensemble(model, np.linspace(1, 2, stack)[:, None])
    assert (size >= SPARSE_FROM) == ((count, stack) in [(3, 9), (12, 1)])
    residual, jacobian = stack_callbacks(ensemble)
    generator = np.random.default_rng(0)
    rows, pointers = model.pattern
    blocks = [sparse.csc_matrix((np.arange(1.0, len(rows) + 1), rows, pointers), shape=(n, n))] * stack
    entries = sparse.block_diag(blocks, format="csc")
    for _ in range(2):  # other arrays the second time
        y, yp, res = generator.normal(size=(3, size))
        jac = np.zeros(entries.nnz if size >= SPARSE_FROM else (size, size))
        for time, c in ((0.3, 2.0), (0.7, 5.0)):  # the same arrays with other numbers
            y += 0.1
            residual(time, y, yp, res)
            jacobian(time, y, yp, res, c, jac)
            given = y.reshape(stack, n), yp.reshape(stack, n)
            np.testing.assert_allclose(res, ensemble.residual(time, *given).ravel(), rtol=1e-13)
            expected = ensemble.jacobian(time, *given, c)
            found = jac if jac.ndim == 1 else jac.T[entries.T.toarray() > 0]
            np.testing.assert_allclose(found.reshape(stack, -1), expected, rtol=1e-13)
            assert jac.ndim == 1 or np.count_nonzero(jac) <= entries.nnz


def test_residuals_and_jacobians_agree_by_differences():
    model = links(2)
    ensemble, n = Ensemble(model, np.array([[1.0], [1.5]])), model.layout.unknowns
    residual, jacobian = stack_callbacks(ensemble)
    y, yp = np.random.default_rng(1).normal(size=(2, 2 * n))
    res, ahead, back, jac = np.empty(2 * n), np.empty(2 * n), np.empty(2 * n), np.zeros((2 * n, 2 * n))
    jacobian(0.0, y, yp, res, 3.0, jac)
    for column in range(2 * n):
        step = np.where(np.arange(2 * n) == column, 1e-6, 0.0)
        residual(0.0, y + step, yp + 3.0 * step, ahead)
        residual(0.0, y - step, yp - 3.0 * step, back)
        np.testing.assert_allclose((ahead - back) / 2e-6, jac[:, column], rtol=1e-6, atol=1e-6)
