"""Germs of the classical families: polynomials, Gauss rules and products against closed forms and scipy."""

from __future__ import annotations

from math import factorial

import chaospy
import numpy as np
import pytest
import scipy.special
import scipy.stats
from sympy.physics.wigner import wigner_3j

import uqmbd
from uqmbd.randomness import Germ, GermSpace, JointInput, gauss_tensor, index_set


def roots_jacobi(n, alpha, beta):
    """As scipy's, whose starting values divide zero by zero where alpha + beta = -1."""
    with np.errstate(invalid="ignore"):
        return scipy.special.roots_jacobi(n, alpha, beta)


CLASSICAL = {
    "hermite": ("hermite", (), scipy.stats.norm(), lambda n: scipy.special.roots_hermitenorm(n)),
    "legendre": ("legendre", (), scipy.stats.uniform(-1, 2), lambda n: scipy.special.roots_legendre(n)),
    "jacobi": ("jacobi", (2.5, 4), scipy.stats.beta(2.5, 4, -1, 2), lambda n: scipy.special.roots_jacobi(n, 3, 1.5)),
    "arcsine": ("jacobi", (0.5, 0.5), scipy.stats.arcsine(-1, 2), lambda n: scipy.special.roots_jacobi(n, -0.5, -0.5)),
    "jacobi, a + b = 1": ("jacobi", (0.3, 0.7), scipy.stats.beta(0.3, 0.7, -1, 2), lambda n: roots_jacobi(n, -0.3, -0.7)),
    "laguerre": ("laguerre", (2.5,), scipy.stats.gamma(2.5), lambda n: scipy.special.roots_genlaguerre(n, 1.5)),
    "exponential": ("laguerre", (1,), scipy.stats.expon(), lambda n: scipy.special.roots_laguerre(n)),
}  # fmt: skip


@pytest.fixture(params=CLASSICAL.values(), ids=CLASSICAL)
def case(request):
    family, parameters, law, rule = request.param
    return Germ.classical("x", family, *parameters), law, rule


def test_orthonormal_through_order_10_by_a_rule_of_scipy(case):
    germ, _, rule = case
    nodes, weights = rule(40)
    psi = germ.polynomials(nodes, 10)
    gram = (psi * (weights / weights.sum())[:, None]).T @ psi
    assert np.abs(gram - np.eye(11)).max() < 1e-10


@pytest.mark.parametrize("count", [1, 2, 3, 8, 25])
def test_gauss_rules_of_scipy(case, count):
    germ, _, rule = case
    nodes, weights = germ.gauss(count)
    expected, measure = rule(count)
    assert np.allclose(nodes, expected, rtol=1e-11, atol=1e-12)
    assert np.allclose(weights, measure / measure.sum(), rtol=1e-8, atol=1e-15)
    assert weights.sum() == pytest.approx(1, abs=1e-14) and np.all(np.diff(nodes) > 0)


def test_quantiles_of_scipy(case):
    germ, law, _ = case
    u = np.array([1e-9, 0.01, 0.3, 0.5, 0.8, 0.9999])
    assert np.allclose(germ.from_uniform(u), law.ppf(u), rtol=1e-9, atol=1e-12)
    assert np.isfinite(germ.from_uniform(np.array([0.0, 1.0]))).all()


def test_polynomials_are_the_published_ones():
    """Abramowitz and Stegun, table 22.2, with norms such that E[p**2] = 1 and leading coefficients positive."""
    x = np.linspace(-0.9, 1.7, 7)
    for n in range(9):
        hermite = scipy.special.eval_hermitenorm(n, x) / np.sqrt(float(factorial(n)))
        legendre = scipy.special.eval_legendre(n, x) * np.sqrt(2 * n + 1)
        a = 1.5  # the exponent: a gamma distribution of shape 2.5
        laguerre = (-1) ** n * scipy.special.eval_genlaguerre(n, a, x) / np.sqrt(scipy.special.binom(n + a, n))
        assert np.allclose(Germ.classical("x", "hermite").polynomials(x, 8)[:, n], hermite, rtol=1e-12, atol=1e-12)
        assert np.allclose(Germ.classical("x", "legendre").polynomials(x, 8)[:, n], legendre, rtol=1e-12, atol=1e-11)
        assert np.allclose(
            Germ.classical("x", "laguerre", 2.5).polynomials(x, 8)[:, n], laguerre, rtol=1e-11, atol=1e-11
        )


def test_products_of_hermite_and_legendre_polynomials():
    """Hermite: Janson, Gaussian Hilbert Spaces, 1997, example 3.18; Legendre: squares of Wigner's 3j symbols."""
    hermite = Germ.classical("x", "hermite").linearisation(4)
    legendre = Germ.classical("x", "legendre").linearisation(4)
    assert hermite.shape == legendre.shape == (5, 5, 9)
    for i, j, k in np.ndindex(5, 5, 9):
        s, odd = divmod(i + j + k, 2)
        exact = 0.0
        if not odd and max(i, j, k) <= s:
            f = factorial
            exact = np.sqrt(f(i) * f(j) * f(k)) / (f(s - i) * f(s - j) * f(s - k))
        assert hermite[i, j, k] == pytest.approx(exact, rel=1e-11, abs=1e-12)
        exact = float(wigner_3j(i, j, k, 0, 0, 0)) ** 2 * np.sqrt((2 * i + 1) * (2 * j + 1) * (2 * k + 1))
        assert legendre[i, j, k] == pytest.approx(exact, rel=1e-11, abs=1e-12)


def test_any_degree_of_a_classical_family():
    germ = Germ.classical("x", "legendre")
    assert germ.polynomials(np.array([1.0]), 100)[0, 100] == pytest.approx(np.sqrt(201), rel=1e-12)
    assert len(germ.gauss(90)[0]) == 90 and germ.highest_degree is None


FAMILIES = {
    "normal": (chaospy.Normal(5, 2), "hermite", scipy.stats.norm(5, 2)),
    "uniform": (chaospy.Uniform(2, 5), "legendre", scipy.stats.uniform(2, 3)),
    "beta": (chaospy.Beta(2, 5, 1, 3), "jacobi", scipy.stats.beta(2, 5, 1, 2)),
    "pert": (chaospy.PERT(0, 1, 4), "jacobi", scipy.stats.beta(7 / 3, 11 / 3, 0, 4)),
    "gamma": (chaospy.Gamma(2, 3, shift=1), "laguerre", scipy.stats.gamma(2, 1, 3)),
    "exponential": (chaospy.Exponential(2), "laguerre", scipy.stats.expon(0, 2)),
    "lognormal": (chaospy.LogNormal(0.2, 0.3), "hermite", scipy.stats.lognorm(0.3, 0, np.exp(0.2))),
    "lognormal, moved": (chaospy.LogNormal(0.2, 0.3) + 2, "hermite", scipy.stats.lognorm(0.3, 2, np.exp(0.2))),
    "arithmetic": (3 + chaospy.Normal(0, 1) * 2, "hermite", scipy.stats.norm(3, 2)),
    "turned round": (5 - 2 * chaospy.Uniform(0, 1), "legendre", scipy.stats.uniform(3, 2)),
    "beta, turned round": (-chaospy.Beta(2, 5), "jacobi", scipy.stats.beta(5, 2, -1, 1)),
    "truncated on one side": (chaospy.Trunc(chaospy.Normal(0, 1), lower=0), "stieltjes", scipy.stats.halfnorm()),
}  # fmt: skip


@pytest.mark.parametrize(("distribution", "family", "law"), FAMILIES.values(), ids=FAMILIES)
def test_family_and_map_of_a_distribution(distribution, family, law):
    joint = JointInput.of([uqmbd.RandomVariable("x", distribution)])
    space = GermSpace.of(joint)
    assert space.germs[0].family == family and space.independent and space.names == ("x",)
    u = np.array([[1e-6], [0.01], [0.3], [0.5], [0.77], [0.999]])
    x = space.to_inputs(space.from_uniform(u))
    assert np.allclose(x[:, 0], law.ppf(u[:, 0]), rtol=1e-9, atol=1e-9)
    assert np.allclose(x, joint.from_uniform(u), rtol=1e-9, atol=1e-9)
    assert np.allclose(space.to_inputs(space.to_germs(x)), x, rtol=1e-13, atol=1e-13)
    rule = gauss_tensor(space, 20)
    mean = rule.weights @ space.to_inputs(rule.nodes)
    assert mean == pytest.approx(law.mean(), rel=1e-10) and space.to_inputs(rule.nodes).shape == (20, 1)
    assert joint.means == pytest.approx(law.mean(), rel=1e-9)


def test_a_decreasing_map_of_a_gamma_distribution():
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", -chaospy.Gamma(2, 3))]))
    assert space.germs[0].family == "laguerre"
    rule = gauss_tensor(space, 4)
    x = space.to_inputs(rule.nodes)[:, 0]
    assert (rule.weights @ x, rule.weights @ x**2) == pytest.approx((-6, 54), rel=1e-12)


def test_lognormal_functions_converge():
    """A chaos in the logarithm finds E[1 / x] exactly; no polynomial in x comes near."""
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", chaospy.LogNormal(0.2, 1.0))]))
    rule = gauss_tensor(space, 30)
    assert rule.weights @ (1 / space.to_inputs(rule.nodes)[:, 0]) == pytest.approx(np.exp(-0.2 + 0.5), rel=1e-12)


def test_a_chaos_of_several_inputs_is_orthonormal_and_evaluated_as_products():
    make = {"a": chaospy.Normal(1, 2), "b": chaospy.Gamma(3), "c": chaospy.Triangle(0, 1, 3)}
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable(n, d) for n, d in make.items()]))
    index = index_set(3, 4)
    rule = gauss_tensor(space, 5)
    psi = space.evaluate(rule.nodes, index)
    assert psi.shape == (125, 35)
    assert np.abs((psi * rule.weights[:, None]).T @ psi - np.eye(35)).max() < 1e-12
    single = [germ.polynomials(rule.nodes[:, k], 4) for k, germ in enumerate(space.germs)]
    for p, degrees in enumerate(index):
        product = np.prod([single[k][:, degree] for k, degree in enumerate(degrees)], axis=0)
        assert np.allclose(psi[:, p], product, rtol=1e-14, atol=0)


def test_no_row_depends_on_another_one_to_the_bit():
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvNormal([1, 2], [[4, 3], [3, 9]]))
    others = {
        "c": chaospy.Weibull(2), "d": chaospy.LogNormal(0, 1), "e": chaospy.Beta(2, 3), "f": chaospy.Gamma(2),
        "g": chaospy.StudentT(7), "h": chaospy.DiscreteUniform(1, 6), "i": chaospy.Uniform(0, 1),
    }  # fmt: skip
    space = GermSpace.of(JointInput.of([a, b, *(uqmbd.RandomVariable(n, d) for n, d in others.items())]))
    uniform = np.random.default_rng(1).random((1001, 9))
    germs = space.from_uniform(uniform)
    inputs = space.to_inputs(germs)
    index = index_set(9, 2)
    psi, back = space.evaluate(germs, index), space.to_germs(inputs)
    for rows in (slice(0, 1), slice(7, 20), slice(500, 1001), slice(3, 1000, 7), [5, 900, 2]):
        assert np.array_equal(space.from_uniform(uniform[rows]), germs[rows])
        assert np.array_equal(space.to_inputs(germs[rows]), inputs[rows])
        assert np.array_equal(space.to_germs(inputs[rows]), back[rows])
        assert np.array_equal(space.evaluate(germs[rows], index), psi[rows])


WRONG = {
    "degree": (lambda g: g.polynomials(0.0, -1), "degree of the polynomials of 'x' is -1"),
    "nodes": (lambda g: g.gauss(0), "number of Gauss nodes of 'x' is 0"),
    "fraction": (lambda g: g.gauss(2.5), "is 2.5; expected a whole number of at least 1"),
}  # fmt: skip


@pytest.mark.parametrize(("do", "words"), WRONG.values(), ids=WRONG)
def test_numbers_that_a_germ_cannot_use(do, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        do(Germ.classical("x", "hermite"))


def test_inputs_outside_their_support_and_arrays_of_another_shape():
    space = GermSpace.of(
        JointInput.of(
            [uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)), uqmbd.RandomVariable("b", chaospy.LogNormal(0, 1))]
        )
    )
    with pytest.raises(uqmbd.StudyError, match=r"Input 'a' is 2.5 in row 1, outside the support .* \[0, 2\]"):
        space.to_germs([[1.0, 1.0], [2.5, 1.0]])
    with pytest.raises(uqmbd.StudyError, match="Input 'b' is -1 in row 0"):
        space.to_germs([[1.0, -1.0]])
    with pytest.raises(uqmbd.StudyError, match=r"germs have the shape \(3,\); expected \(points, 2\)"):
        space.to_inputs([1, 2, 3])
    with pytest.raises(
        uqmbd.StudyError, match=r"multi-index has the shape \(1, 3\); expected \(terms, 2\) with degrees of 0 or more"
    ):
        space.evaluate([[0, 0]], [[0, 0, 0]])
    with pytest.raises(uqmbd.StudyError, match="transform is 'cholesky'; expected one of rosenblatt, nataf"):
        GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(0, 2))]), "cholesky")
