"""Covariances of joint inputs, against closed forms, SciPy and many draws."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.stats
from scipy.stats import qmc

import uqmbd
from uqmbd.extend import JointInput

SINGLE = {
    "normal": chaospy.Normal(1, 0.2),
    "uniform": chaospy.Uniform(0, 2),
    "lognormal": scipy.stats.lognorm(0.8, scale=2),
    "weibull": scipy.stats.weibull_min(1.4),
    "stretched": scipy.stats.weibull_min(0.4),
    "arcsine": scipy.stats.arcsine(),
    "triangular": scipy.stats.triang(0.3),
    "truncated": scipy.stats.truncnorm(-1, 2),
    "poisson": scipy.stats.poisson(3.3),
    "binomial": scipy.stats.binom(10, 0.3),
    "t 2.1": scipy.stats.t(2.1),
    "t 5": scipy.stats.t(5, loc=1e3, scale=0.01),
    "pareto 2.2": scipy.stats.pareto(2.2),
    "fisk": scipy.stats.fisk(2.4),
    "inverse gamma": scipy.stats.invgamma(2.7),
}

MATRIX = np.array([[1.0, 0.3], [0.3, 2.0]])


def joint_of(distribution, count):
    return JointInput.of(uqmbd.random_vector([f"x{k}" for k in range(count)], distribution))


@pytest.mark.parametrize("name", SINGLE)
def test_standard_deviations_are_those_of_scipy(name):
    distribution = SINGLE[name]
    known = {"normal": 0.2, "uniform": 2 / np.sqrt(12)}.get(name) or distribution.std()
    found = JointInput.of([uqmbd.RandomVariable("x", distribution)]).std
    np.testing.assert_allclose(found, [known], rtol=1e-8)


@pytest.mark.parametrize(
    ("degrees", "expected"), [(2.0, np.inf), (1.5, np.inf), (0.9, np.nan)], ids=["2", "1.5", "no mean"]
)
def test_variances_that_do_not_exist_are_no_numbers(degrees, expected):
    inputs = JointInput.of(
        [uqmbd.RandomVariable("a", scipy.stats.t(degrees)), uqmbd.RandomVariable("b", SINGLE["t 5"])]
    )
    np.testing.assert_array_equal(inputs.covariance[0], [expected, 0.0])
    np.testing.assert_allclose(inputs.std[1], 0.01 * np.sqrt(5 / 3), rtol=1e-8)


def test_independent_variables_and_vectors_are_blocks():
    """In the order of the names, whatever that of the vector is."""
    q, b = uqmbd.random_vector(["q", "b"], chaospy.MvNormal([0, 0], MATRIX))
    p = uqmbd.RandomVariable("p", chaospy.Uniform(0, 1))
    expected = [[2.0, 0.0, 0.3], [0.0, 1 / 12, 0.0], [0.3, 0.0, 1.0]]
    np.testing.assert_allclose(JointInput.of([q, p]).covariance, expected, atol=1e-12)
    assert b.name in JointInput.of([q]).names


def test_vectors_have_closed_forms():
    np.testing.assert_allclose(joint_of(chaospy.MvStudentT(5, [1, 2], MATRIX), 2).covariance, MATRIX * 5 / 3)
    infinite = joint_of(chaospy.MvStudentT(1.5, [1, 2], MATRIX), 2).covariance
    np.testing.assert_array_equal(infinite, [[np.inf, np.nan], [np.nan, np.inf]])
    lognormal = joint_of(chaospy.MvLogNormal([0, 0.1], MATRIX / 4), 2).covariance
    means = np.exp([0.125, 0.35])
    np.testing.assert_allclose(lognormal, np.outer(means, means) * (np.exp(MATRIX / 4) - 1), rtol=1e-12)


def test_conditional_distributions_follow_the_law_of_total_covariance():
    """For y given x normal about x, the covariance of both is the variance of x."""
    x = chaospy.Gamma(2.0)
    found = joint_of(chaospy.J(x, chaospy.Normal(x, 0.5)), 2).covariance
    np.testing.assert_allclose(found, [[2.0, 2.0], [2.0, 2.25]], rtol=1e-7)
    count = chaospy.DiscreteUniform(1, 5)
    found = joint_of(chaospy.J(count, chaospy.Normal(count, 0.5)), 2).covariance
    np.testing.assert_allclose(found, [[2.0, 2.0], [2.0, 2.25]], rtol=1e-7)


def copulas():
    uniform, normal = chaospy.Uniform(0, 1), chaospy.Normal(0, 1)
    five = np.full((5, 5), 0.3) + 0.7 * np.eye(5)
    scale = chaospy.Uniform(1, 2)
    return {
        "nataf": (chaospy.Nataf(chaospy.J(uniform, chaospy.Gamma(2)), [[1, 0.5], [0.5, 1]]), 2),
        "clayton": (chaospy.Clayton(chaospy.J(uniform, normal), 2.0), 2),
        "mixture": (chaospy.GaussianMixture([[0, 0], [2, 1]], [MATRIX, MATRIX / 2]), 2),
        "chain": (chaospy.J(scale, chaospy.Normal(0, scale), chaospy.Uniform(0, scale)), 3),
        "five": (chaospy.Nataf(chaospy.J(*[chaospy.Uniform(k, k + 1) for k in range(5)]), five), 5),
    }


@pytest.mark.thorough
@pytest.mark.parametrize("name", copulas())
def test_covariances_are_those_of_many_draws(name):
    distribution, count = copulas()[name]
    inputs = joint_of(distribution, count)
    rows = qmc.Sobol(count, seed=5).random(2**15)
    drawn = np.cov(inputs.from_uniform(np.clip(rows, 1e-12, 1 - 1e-12)).T)
    np.testing.assert_allclose(inputs.covariance, drawn, atol=2e-3 * np.diag(drawn).max())


def test_uniform_numbers_of_plugins_are_judged():
    inputs = joint_of(chaospy.MvNormal([0, 0], MATRIX), 2)
    for wrong in ([[0.5, 1.5]], [[0.5, np.nan]], [[0.5]], [[-0.1, 0.5]]):
        with pytest.raises(uqmbd.StudyError, match="uniform"):
            inputs.from_uniform(wrong)
