"""Solutions of smallest norm, held against NumPy's least squares."""

import chaospy
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.dynamics import Ensemble, build
from uqmbd.dynamics.assembly.least_norm import solve_least_norm
from uqmbd_joints import Revolute


def systems(count, rows, size, seed):
    """Rows, and right-hand sides that some x meets."""
    random = np.random.default_rng(seed)
    a, x = random.normal(size=(count, rows, size)), random.normal(size=(count, size, 1))
    return a, (a @ x)[:, :, 0]


@given(st.integers(1, 4), st.integers(1, 5), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_one_that_is_singular_changes_no_other(count, rows, seed):
    a, b = systems(count, rows, rows + 2, seed)
    alone = solve_least_norm(a, b, truncate=False)
    for k in range(count):
        expected = np.linalg.lstsq(a[k], b[k], rcond=None)[0]
        np.testing.assert_allclose(alone[k], expected, rtol=0, atol=1e-6 * (1 + np.abs(expected).max()))
    singular, none = np.zeros((1, *a.shape[1:])), np.ones((1, rows))
    beside = solve_least_norm(np.concatenate([a, singular]), np.concatenate([b, none]), truncate=False)
    assert np.array_equal(beside[:-1], alone)
    assert not beside[-1].any()


def test_an_assembly_depends_on_nothing_but_its_realisation():
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.5, 2), units="m")
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
    first = mechanism.body("first", mass=1, inertia=0.1, position=(0.5, 0.1), angle=0.3, angular_velocity=2)
    second = mechanism.body("second", mass=1, inertia=0.1, position=(1.5, 0.4), angle=-0.2)
    mechanism.add(Revolute("pin", mechanism.ground, first, (0, 0), (-length / 2, 0)))
    mechanism.add(Revolute("link", first, second, (length / 2, 0), (-0.5, 0)))
    model = build(mechanism)
    values = np.array([[0.7], [1.0], [1.3], [1e4], [0.9], [1.9], [np.nan], [1.1], [0.6], [1.7]])
    group = Ensemble(model, values).start
    for k in range(len(values)):
        alone = Ensemble(model, values[k : k + 1]).start
        assert alone.messages[0] == group.messages[k]
        for name in ("q", "v", "a", "multipliers"):
            assert np.array_equal(getattr(alone, name)[0], getattr(group, name)[k], equal_nan=True)
