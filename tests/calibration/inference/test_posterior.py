"""Densities, their derivatives, and draws, against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd_calibration.inference import LEVEL_SPREAD, Bias, Level, climb, sample

from . import forward


def _linear(generator, inputs, count):
    matrix, offset = generator.standard_normal((count, inputs)), generator.standard_normal(count)
    return matrix, offset, lambda z: z @ matrix.T + offset


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), inputs=st.integers(1, 5), count=st.integers(1, 30), bias=st.booleans())
def test_the_posterior_of_a_linear_model_is_the_closed_form(seed, inputs, count, bias):
    generator = np.random.default_rng(seed)
    matrix, offset, function = _linear(generator, inputs, count)
    noise = float(generator.uniform(0.05, 2.0))
    times = np.sort(generator.uniform(0, 1, count))
    modes = Bias(0.7, 0.3).modes(times) if bias and count > 1 else np.zeros((count, 0))
    values = function(generator.standard_normal((1, inputs)))[0] + noise * generator.standard_normal(count)
    target = forward.model(function, inputs, [forward.block(values, noise, times=times, modes=modes)]).posterior

    covariance = noise**2 * np.eye(count) + modes @ modes.T
    precision = np.eye(inputs) + matrix.T @ np.linalg.solve(covariance, matrix)
    mean = np.linalg.solve(precision, matrix.T @ np.linalg.solve(covariance, values - offset))
    found = climb(target, generator.standard_normal((3, inputs)))
    # all starts end in the one maximum, whose curvature is the precision
    np.testing.assert_allclose(found.vectors, np.tile(np.clip(mean, -5, 5), (3, 1)), atol=2e-3 * np.sqrt(inputs))
    np.testing.assert_allclose(found.hessian[0], precision, rtol=1e-6, atol=1e-6)
    # the density itself, by the multivariate normal
    at = generator.standard_normal((1, inputs))
    rest = values - function(at)[0]
    expected = -0.5 * (rest @ np.linalg.solve(covariance, rest) + np.linalg.slogdet(2 * np.pi * covariance)[1])
    np.testing.assert_allclose(target.log_likelihood(at), expected, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("bias", [False, True])
def test_normal_equations_are_derivatives_of_the_density(robust, bias):
    generator = np.random.default_rng(3)
    times = np.linspace(0, 1, 12)

    def function(z):
        return np.sin(times * (1 + z[:, :1])) + z[:, 1:2] * times**2

    modes = Bias(0.2, 0.5).modes(times) if bias else np.zeros((12, 0))
    values = function(np.array([[0.3, -0.2]]))[0] + 0.1 * generator.standard_normal(12)
    one = forward.block(values, 0.1, times=times, modes=modes, robust=robust, first=2, variance=np.full(12, 0.01))
    coefficients = modes.shape[1] if robust else 0
    target = forward.model(function, 2, [one], coefficients=coefficients).posterior
    at = 0.3 * generator.standard_normal((1, 2 + coefficients))
    found = target.linearised(at)
    np.testing.assert_allclose(found.cost, -target.log_density(at), rtol=1e-12)
    numeric = [
        (target.log_density(at + 1e-5 * e) - target.log_density(at - 1e-5 * e))[0] / -2e-5 for e in np.eye(at.shape[1])
    ]
    np.testing.assert_allclose(found.gradient[0], numeric, rtol=1e-4, atol=1e-4)


@pytest.mark.thorough
def test_draws_of_a_linear_model_have_its_moments():
    generator = np.random.default_rng(5)
    matrix, offset, function = _linear(generator, 3, 20)
    values = function(np.array([[0.5, -1.0, 0.2]]))[0] + 0.5 * generator.standard_normal(20)
    target = forward.model(function, 3, [forward.block(values, 0.5)]).posterior
    precision = np.eye(3) + matrix.T @ matrix / 0.25
    covariance = np.linalg.inv(precision)
    mean = covariance @ matrix.T @ (values - offset) / 0.25
    found = sample(target.log_density, mean, np.linalg.cholesky(covariance), draws=4000, chains=4, seed=1)
    assert found.converged
    assert found.vectors.shape == (4, 1000, 3)
    sd = np.sqrt(np.diag(covariance))
    # 4000 draws, nearly independent
    np.testing.assert_allclose((found.flat.mean(axis=0) - mean) / sd, 0, atol=0.08)
    np.testing.assert_allclose(
        np.cov(found.flat, rowvar=False) / np.outer(sd, sd), covariance / np.outer(sd, sd), atol=0.1
    )


@pytest.mark.thorough
def test_the_sampler_finds_its_way_from_a_poor_start():
    # three times as wide and half a deviation beside, and curved: a banana, whose moments are known
    def density(z):
        return -0.5 * (z[:, 0] ** 2 + (z[:, 1] - 0.5 * (z[:, 0] ** 2 - 1)) ** 2)

    found = sample(density, np.array([0.5, 0.5]), 3.0 * np.eye(2), draws=4000, chains=4, seed=1)
    assert found.converged
    np.testing.assert_allclose(found.flat.mean(axis=0), 0, atol=0.12)
    np.testing.assert_allclose(found.flat.var(axis=0), [1.0, 1.5], rtol=0.15)


def test_the_same_seed_gives_the_same_bits():
    def density(z):
        return -0.5 * (z**2).sum(axis=1)

    one, same, other = (
        sample(density, np.zeros(2), np.eye(2), draws=400, chains=2, seed=seed).vectors for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


@pytest.mark.thorough
def test_an_unknown_noise_level_has_its_posterior():
    """Values about a known mean: by quadrature over the level; with many, by the inverse gamma distribution."""
    generator = np.random.default_rng(2)
    values = 0.3 * generator.standard_normal(25)
    level = Level("y", "m", 0.1)
    target = forward.model(
        lambda z: np.zeros((len(z), 25)), 1, [forward.block(values, None, level=0)], [level]
    ).posterior
    found = climb(target, np.zeros((1, 2)))
    factor = np.linalg.cholesky(np.linalg.inv(found.hessian[0]))
    draws = sample(target.log_density, found.vectors[0], factor, draws=4000, chains=4, seed=1)
    sigma = target.unknowns.noise(draws.flat)[:, 0]
    grid = np.linspace(-2, 2, 4001)
    levels = 0.1 * np.exp(LEVEL_SPREAD * grid)
    weights = np.exp(-25 * np.log(levels) - 0.5 * (values @ values) / levels**2 - 0.5 * grid**2 + 25 * np.log(0.3))
    weights /= weights.sum()
    mean = weights @ levels
    sd = np.sqrt(weights @ (levels - mean) ** 2)
    np.testing.assert_allclose(sigma.mean(), mean, atol=0.08 * sd)
    np.testing.assert_allclose(sigma.std(), sd, rtol=0.06)
    # the prior of the level is so wide that the scale prior of textbooks gives nearly the same
    np.testing.assert_allclose(np.mean(1 / sigma**2), 25 / (values @ values), rtol=0.05)


@pytest.mark.thorough
def test_the_two_storey_oscillator_has_the_published_posterior():
    """U5 of the reference cases: eigenvalue and mode ratio of two masses on two springs, five times measured."""
    from scipy.stats import norm

    eigenvalues = [0.3860, 0.3922, 0.4157, 0.3592, 0.3615]
    ratios = [1.68245252, 1.71103903, 1.57876073, 1.58722342, 1.61878479]

    def function(z):
        k1, k2 = 0.8 + 1.4 * norm.cdf(z[:, 0]), 0.4 + 0.8 * norm.cdf(z[:, 1])
        trace, determinant = k1 + 2 * k2, k1 * k2
        first = 0.5 * (trace - np.sqrt(trace**2 - 4 * determinant))
        return np.stack([first] * 5 + [(k1 + k2 - first) / k2] * 5, axis=1)

    blocks = [forward.block(eigenvalues, 0.0191), forward.block(ratios, 0.0809)]
    blocks[1] = type(blocks[1])(**{**vars(blocks[1]), "columns": np.arange(5, 10)})
    target = forward.model(function, 2, blocks).posterior
    found = climb(target, np.zeros((1, 2)))
    factor = np.linalg.cholesky(np.linalg.inv(found.hessian[0]))
    draws = sample(target.log_density, found.vectors[0], factor, draws=8000, chains=4, seed=1)
    k = np.stack([0.8 + 1.4 * norm.cdf(draws.flat[:, 0]), 0.4 + 0.8 * norm.cdf(draws.flat[:, 1])], axis=1)
    np.testing.assert_allclose(k.mean(axis=0), [1.0086, 0.9907], atol=0.003)
    np.testing.assert_allclose(k.std(axis=0), [0.0264, 0.0416], rtol=0.05)
    np.testing.assert_allclose(np.corrcoef(k, rowvar=False)[0, 1], 0.008, atol=0.05)
