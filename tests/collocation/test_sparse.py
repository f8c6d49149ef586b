"""Sparse regression: the few terms that there are, found among many by fewer samples than terms."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import eval_legendre

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_collocation.sparse import sparse_regression

# degrees in ten inputs, and coefficients
TRUE = {
    (): 2.0,
    ((0, 1),): 3.0,
    ((3, 2),): -1.0,
    ((7, 3),): 0.5,
    ((1, 1), (4, 1)): 0.8,
    ((2, 1), (5, 1), (9, 1)): -0.4,
    ((6, 1), (8, 1)): 0.3,
}
TERMS = {tuple(dict(term).get(k, 0) for k in range(10)): value for term, value in TRUE.items()}


def legendre(degree, x):
    """Orthonormal polynomials of a uniform germ, written out."""
    return [1, 3**0.5 * x, 5**0.5 * (3 * x**2 - 1) / 2, 7**0.5 * (5 * x**3 - 3 * x) / 2][degree]


def polynomial(*x):
    return sum(value * np.prod([legendre(k, x[i]) for i, k in term] or [1]) for term, value in TRUE.items())


@pytest.mark.parametrize("method", ["omp", "lars"])
@pytest.mark.parametrize("seed", [0, 1])
def test_few_terms_of_ten_inputs(resting, chaos_of, method, seed):
    study = resting(polynomial, *[chaospy.Uniform(-1, 1)] * 10)
    node = study.propagate(Collocation(order=3, method=method, samples=90, seed=seed))
    chaos = chaos_of(node)
    assert "of 286 terms" in node.attrs["fit"]
    assert node.attrs["realisations"] == 106
    found = {
        tuple(row): value for row, value in zip(chaos.multi_index.tolist(), chaos.coefficients[:, 0, 0], strict=True)
    }
    large = {term: value for term, value in found.items() if abs(value) > 1e-9}
    assert set(large) == set(TERMS)
    assert all(large[term] == pytest.approx(value, abs=1e-9) for term, value in TERMS.items())
    assert node["statistics"]["verification_error"].max() < 1e-9
    assert node["statistics"]["leave_one_out"].max() < 1e-15


def test_least_squares_cannot(resting):
    study = resting(polynomial, *[chaospy.Uniform(-1, 1)] * 10)
    with pytest.raises(uqmbd.StudyError, match="286 terms, more than the 90 samples"):
        study.propagate(Collocation(order=3, method="regression", samples=90))


@pytest.mark.parametrize("method", ["omp", "lars"])
def test_noise_does_not_fill_the_basis(method):
    """Noise of 1 % in samples of three terms: the leave-one-out error stops in time, and states it."""
    rng = np.random.default_rng(5)
    x = rng.uniform(-1, 1, 80)
    psi = np.stack([np.sqrt(2 * k + 1) * eval_legendre(k, x) for k in range(40)], axis=1)
    noise = 0.01 * rng.normal(size=80)
    coefficients, error = sparse_regression((1 + psi[:, 1] + psi[:, 6] + noise)[:, None, None], psi, method)
    assert np.flatnonzero(coefficients[:, 0, 0]).size < 15
    np.testing.assert_allclose(coefficients[[0, 1, 6], 0, 0], 1, atol=0.01)
    assert 0.5 < np.sqrt(error[0, 0] * 2) / 0.01 < 3


def test_outputs_over_time_are_fitted_together():
    """Two outputs at 300 times, each made of two shapes in time; one that does not vary; one of another scale."""
    rng = np.random.default_rng(1)
    x, t = rng.uniform(-1, 1, (60, 1)), np.linspace(0, 1, 300)
    psi = np.concatenate([np.sqrt(2 * k + 1) * eval_legendre(k, x) for k in range(8)], axis=1)
    response = np.stack([psi[:, 1:2] * t + psi[:, 3:4] * np.sin(t), 1e9 * (2 + psi[:, 2:3] * t), 0 * x + t], axis=1)
    for method in ("omp", "lars"):
        coefficients, error = sparse_regression(response, psi, method)
        expected = np.zeros((8, 3, 300))
        expected[1, 0], expected[3, 0] = t, np.sin(t)
        expected[0, 1], expected[2, 1] = 2e9, 1e9 * t
        expected[0, 2] = t
        scale = np.array([1, 1e9, 1])[:, None]
        np.testing.assert_allclose(coefficients / scale, expected / scale, atol=1e-9)
        assert error.max() < 1e-15


def swinging(*x):
    """An oscillation whose frequency is uncertain: its phase, and so the order that it takes, grows with time."""
    frequency = 6.3 * (1 + 0.02 * sum(weight * one for weight, one in zip(range(1, 9), x, strict=True)))
    return (1 + 0.1 * x[7]) * sympy.cos(frequency * uqmbd.t)


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["omp", "lars"])
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # late
def test_what_is_lost_late_spoils_nothing_that_is_known_early(resting, method):
    """Eight inputs, order 2, 128 samples: the order does not suffice at 10 s, and does at 0.1 s."""
    early = [0.0, 0.05, 0.1]

    def error(option, times):
        study = resting(swinging, *[chaospy.Uniform(-1, 1)] * 8, times=times)
        node = study.propagate(Collocation(order=2, method=option, samples=128, verify=256))
        found = node["statistics"].dataset.sel(output="y")
        return found["verification_error"].values, found["std"].values

    _, alone = error(method, early)
    long, std = error(method, [*early, 1.0, *np.linspace(1.5, 10, 18)])  # no step of 0.1 s to 1 s is small
    assert long.max() > 0.5
    np.testing.assert_allclose(std[:3], alone, rtol=1e-6, atol=1e-12)
    assert long[2] < 1.5 * error("regression", early)[0][2] < 0.015


@pytest.mark.thorough
@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    method=st.sampled_from(["omp", "lars"]),
    first=st.integers(1, 12),
    rate=st.floats(0.1, 30),
    noise=st.sampled_from([0.0, 1e-9, 0.1]),
)
def test_a_fit_does_not_depend_on_later_times(seed, method, first, rate, noise):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, 30)
    psi = np.stack([np.sqrt(2 * k + 1) * eval_legendre(k, x) for k in range(12)], axis=1)
    t = np.sort(rng.uniform(0, 2, 20))
    response = np.exp(rate * t * (1 + 0.3 * x[:, None]))[:, None] + noise * rng.normal(size=(30, 1, 20))
    whole, error = sparse_regression(response, psi, method)
    part, known = sparse_regression(response[..., :first], psi, method)
    np.testing.assert_allclose(whole[..., :first], part, rtol=1e-9, atol=1e-12 * np.abs(part).max())
    np.testing.assert_allclose(error[:, :first], known, rtol=1e-6, atol=1e-20)
