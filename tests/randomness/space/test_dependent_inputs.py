"""Dependent inputs: closed forms of moments through both transforms, and what cannot be mapped."""

from __future__ import annotations

import pickle

import chaospy
import numpy as np
import pytest
import scipy.stats

import uqmbd
from uqmbd.randomness import GermSpace, JointInput, gauss_tensor, index_set
from uqmbd.randomness.space.dependence import nataf_correlation
from uqmbd.randomness.space.families import normal_marginal

MEAN, COVARIANCE = np.array([3.0, -2.0]), np.array([[0.5, 0.3], [0.3, 0.8]])


def space_of(names, distribution, transform="rosenblatt"):
    return GermSpace.of(JointInput.of(uqmbd.random_vector(names, distribution)), transform)


@pytest.mark.parametrize("transform", ["rosenblatt", "nataf"])
@pytest.mark.parametrize("names", [("a", "b"), ("b", "a")])
def test_product_of_two_normal_variables(names, transform):
    """E[ab] = m1 m2 + c and Var[ab] = m1^2 v2 + m2^2 v1 + 2 m1 m2 c + v1 v2 + c^2 (Isserlis), from a chaos of order 2."""
    space = space_of(names, chaospy.MvNormal(MEAN, COVARIANCE), transform)
    assert space.inputs == ("a", "b") and not space.independent
    assert set(space.names) == {names[0], f"{names[1]} | {names[0]}"}
    rule = gauss_tensor(space, 3)
    inputs = space.to_inputs(rule.nodes)
    coefficients = (space.evaluate(rule.nodes, index_set(2, 2)) * rule.weights[:, None]).T @ inputs.prod(axis=1)
    (m1, m2), ((v1, c), (_, v2)) = MEAN, COVARIANCE
    assert coefficients[0] == pytest.approx(m1 * m2 + c, rel=1e-13)
    variance = m1**2 * v2 + m2**2 * v1 + 2 * m1 * m2 * c + v1 * v2 + c**2
    assert (coefficients[1:] ** 2).sum() == pytest.approx(variance, rel=1e-13)
    assert np.allclose(space.to_germs(inputs), rule.nodes, atol=1e-13)


def test_order_of_conditioning_is_that_of_the_joint():
    covariance = [[1, 0.2, 0.3], [0.2, 2, 0.4], [0.3, 0.4, 1]]
    plain = space_of(["a", "b", "c"], chaospy.MvNormal([1, 2, 3], covariance))
    turned = space_of(["a", "b", "c"], chaospy.MvNormal([1, 2, 3], covariance, rotation=[1, 2, 0]))
    assert plain.names == ("a", "b | a", "c | a, b")
    assert turned.names == ("a | b, c", "b", "c | b")
    for space in (plain, turned):
        rule = gauss_tensor(space, 2)
        x = space.to_inputs(rule.nodes) - [1, 2, 3]
        assert np.allclose((x * rule.weights[:, None]).T @ x, covariance, atol=1e-12)


def test_what_is_uncorrelated_is_named_so():
    space = space_of(["a", "b", "c"], chaospy.MvNormal([0, 0, 0], [[1, 0, 0.5], [0, 1, 0], [0.5, 0, 1]]))
    assert space.names == ("a", "b", "c | a")
    assert space_of(["a", "b"], chaospy.MvNormal([0, 0], [[1, 0], [0, 4]])).independent
    independent = space_of(["a", "b"], chaospy.J(chaospy.Uniform(1, 2), chaospy.Gamma(3)))
    assert independent.independent and [g.family for g in independent.germs] == ["legendre", "laguerre"]


@pytest.mark.parametrize("transform", ["rosenblatt", "nataf"])
def test_moments_of_a_lognormal_vector(transform):
    """E[a^i b^j] = exp(n' mu + n' C n / 2)."""
    mu, covariance = np.array([0.1, 0.5]), np.array([[0.1, 0.05], [0.05, 0.2]])
    space = space_of(["a", "b"], chaospy.MvLogNormal(mu, covariance), transform)
    rule = gauss_tensor(space, 20)
    x = space.to_inputs(rule.nodes)
    for n in np.array([[1, 0], [0, 1], [1, 1], [2, 1], [-1, 2]]):
        assert rule.weights @ np.prod(x**n, axis=1) == pytest.approx(np.exp(n @ mu + n @ covariance @ n / 2), rel=1e-12)


@pytest.mark.parametrize("transform", ["rosenblatt", "nataf"])
def test_a_gaussian_copula_with_uniform_marginals(transform):
    """The correlation of the uniform marginals is 6 / pi asin(rho / 2)."""
    space = space_of(["a", "b"], chaospy.Nataf(chaospy.Iid(chaospy.Uniform(0, 1), 2), [[1, 0.6], [0.6, 1]]), transform)
    rule = gauss_tensor(space, 60)
    x = space.to_inputs(rule.nodes)
    covariance = (x * rule.weights[:, None]).T @ x - 0.25
    assert covariance[0, 0] * 12 == pytest.approx(1, abs=1e-3)
    assert covariance[0, 1] * 12 == pytest.approx(6 / np.pi * np.arcsin(0.3), abs=1e-3)
    assert np.allclose(
        space.to_germs(x[np.abs(rule.nodes).max(axis=1) < 4]), rule.nodes[np.abs(rule.nodes).max(axis=1) < 4], atol=1e-8
    )


def test_rosenblatt_of_conditional_distributions():
    """b is normal around a, and a uniform: a chaos of order 1 in the germ of a, and of b given a, is not exact but close."""
    a = chaospy.Uniform(1, 2)
    space = space_of(["b", "a"], chaospy.J(chaospy.Normal(a, 0.3), a))
    assert space.names == ("a", "b | a") and [g.family for g in space.germs] == ["legendre", "hermite"]
    rule = gauss_tensor(space, 8)
    x = space.to_inputs(rule.nodes)
    mean = rule.weights @ x
    covariance = ((x - mean) * rule.weights[:, None]).T @ (x - mean)
    assert mean == pytest.approx([1.5, 1.5], rel=1e-12)
    assert np.allclose(covariance, [[1 / 12, 1 / 12], [1 / 12, 0.09 + 1 / 12]], rtol=1e-9)
    assert np.allclose(space.to_germs(x), rule.nodes, atol=1e-7)
    with pytest.raises(uqmbd.StudyError, match="Input 'a' is 2.5 in row 0, outside the support"):
        space.to_germs([[2.5, 1.0]])
    copied = pickle.loads(pickle.dumps(space))
    assert np.array_equal(copied.to_inputs(rule.nodes), x)


@pytest.mark.thorough
def test_both_transforms_sample_the_same_joint_as_monte_carlo():
    joint = JointInput.of(
        uqmbd.random_vector(["a", "b"], chaospy.Clayton(chaospy.J(chaospy.Uniform(), chaospy.Normal(1, 2)), 2))
    )
    uniform = np.random.default_rng(2).random((4000, 2))
    samples = joint.from_uniform(uniform)
    exact = GermSpace.of(joint)
    assert [g.family for g in exact.germs] == ["legendre", "hermite"]
    assert np.allclose(exact.to_inputs(exact.from_uniform(uniform)), samples, atol=1e-6)
    approximate = GermSpace.of(joint, "nataf")
    others = approximate.to_inputs(approximate.from_uniform(uniform))
    # marginals and correlation agree; the tail of Clayton's copula (its dependence below) does not
    assert np.corrcoef(others.T)[0, 1] == pytest.approx(np.corrcoef(samples.T)[0, 1], abs=0.03)
    for k in range(2):
        assert scipy.stats.ks_2samp(others[:, k], samples[:, k]).pvalue > 0.01


def test_nataf_equation():
    """Lognormal pairs in closed form (Liu and Der Kiureghian 1986, table 6); uniform pairs 2 sin(pi rho / 6)."""
    lognormal = [normal_marginal("x", chaospy.LogNormal(0, s)) for s in (0.3, 0.9)]
    for rho in (-0.5, 0.2, 0.7):
        exact = np.log(1 + rho * np.sqrt(np.expm1(0.09) * np.expm1(0.81))) / 0.27
        assert nataf_correlation(*lognormal, rho) == pytest.approx(exact, abs=1e-10)
    uniform = normal_marginal("x", chaospy.Uniform())
    for rho in (-0.8, 0.5):
        assert nataf_correlation(uniform, uniform, rho) == pytest.approx(2 * np.sin(np.pi * rho / 6), abs=1e-4)
    with pytest.raises(
        uqmbd.StudyError, match="no Gaussian copula gives these marginal distributions the correlation -0.95"
    ):
        nataf_correlation(*lognormal, -0.95)


def test_what_has_no_marginals_or_is_cut_is_refused():
    a = chaospy.Uniform(1, 2)
    with pytest.raises(
        uqmbd.StudyError, match="needs the marginal distributions of the inputs a, b.*use transform='rosenblatt'"
    ):
        space_of(["a", "b"], chaospy.J(a, chaospy.Normal(a, 0.3)), "nataf")
    with pytest.raises(uqmbd.StudyError, match=r"random_vector \('a', 'b'\): chaospy does not truncate dependent"):
        space_of(["a", "b"], chaospy.Trunc(chaospy.MvNormal([0, 0], [[1, 0.5], [0.5, 1]]), [-1, -1], [1, 1]))


def test_a_copula_leaves_the_means_of_its_marginals():
    joint = chaospy.Nataf(chaospy.J(chaospy.Uniform(1, 4), chaospy.Weibull(2)), [[1, 0.5], [0.5, 1]])
    first, second = uqmbd.random_vector(["a", "b"], joint)
    # of a Weibull distribution of shape 2: gamma(3/2)
    assert first.mean == pytest.approx(2.5) and second.mean == pytest.approx(np.sqrt(np.pi) / 2, rel=1e-6)


def test_tables_of_quantiles_are_distributions():
    """Against the lognormal distribution, and the covariance of two that a Gaussian copula couples."""
    z = np.linspace(-8, 8, 801)
    joint = uqmbd.tabulated(z, np.stack([np.exp(0.2 * z), 3 + z], axis=1), [[1, 0.6], [0.6, 1]])
    variables = uqmbd.random_vector(["a", "b"], joint)
    space = space_of(["a", "b"], joint, "rosenblatt")
    drawn = space.to_inputs(np.random.default_rng(0).standard_normal((200_000, 2)))
    assert [v.mean for v in variables] == pytest.approx([np.exp(0.02), 3.0], rel=1e-5)
    assert np.cov(drawn, rowvar=False)[0, 1] == pytest.approx(0.6 * 0.2 * np.exp(0.02), rel=0.02)
    single = uqmbd.tabulated(z, np.exp(0.2 * z))
    exact = chaospy.LogNormal(0, 0.2)
    at = np.array([0.5, 0.9, 1.3])
    np.testing.assert_allclose(single.cdf(at), exact.cdf(at), rtol=1e-5)
    np.testing.assert_allclose(single.pdf(at), exact.pdf(at), rtol=1e-4)


@pytest.mark.parametrize(
    "arguments, said",
    [
        (([0, 1, 2, 3], [0, 1, 2]), "shape"),
        (([0, 1, 2, 3], [0, 2, 1, 3]), "the quantiles of a table do not increase"),
        (([0, 1, 2, 3], [[0, 0], [1, 1], [2, 2], [3, 3]]), "correlation"),
        (([0, 1, 2, 3], [0, 1, 2, np.inf]), "finite"),
    ],
)
def test_tables_that_are_no_quantiles_are_refused(arguments, said):
    with pytest.raises(uqmbd.StudyError, match=said):
        uqmbd.tabulated(*arguments)
