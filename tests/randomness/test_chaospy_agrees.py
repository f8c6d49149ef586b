"""Bases, rules, index sets and statistics of ours are those of chaospy, where chaospy's are right.

Where they are not is on the page docs/explanation/chaospy.md, whose examples run.
"""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import labels
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.results import PolynomialChaos
from uqmbd_collocation import Collocation

from ..mechanisms import pendulum

FAMILIES = {
    "normal": (chaospy.Normal(1.5, 0.2), 7),
    "uniform": (chaospy.Uniform(-1, 3), 8),
    "beta": (chaospy.Beta(2, 3.5, 0, 2), 7),
    "gamma": (chaospy.Gamma(2.5, 0.5), 6),
    "exponential": (chaospy.Exponential(2), 6),
    "Weibull": (chaospy.Weibull(2, 3), 5),
    "triangle": (chaospy.Triangle(0, 1, 4), 5),
    "logistic": (chaospy.Logistic(1, 0.2), 4),
    "truncated below": (chaospy.Trunc(chaospy.Normal(1, 0.5), lower=0.5), 5),
    "whole numbers": (chaospy.Binomial(6, 0.4), 4),
}
ROUGH = ("Weibull", "triangle", "logistic", "truncated below")
"""chaospy integrates their densities numerically, to some 1e-5."""


def one(distribution):
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", distribution)]))
    return space, space.germs[0]


@pytest.mark.parametrize("name", FAMILIES)
def test_bases(name):
    """Orthonormal polynomials of the input are unique up to their signs."""
    distribution, order = FAMILIES[name]
    space, germ = one(distribution)
    nodes = germ.gauss(order + 1)[0]
    x = space.to_inputs(nodes[:, None])[:, 0]
    theirs = np.array([p(x) for p in chaospy.generate_expansion(order, distribution, normed=True)])
    ours = space.evaluate(nodes[:, None], space.basis(order)).T
    signs = np.sign(np.sum(theirs * ours, axis=1))
    # of the nodes of order + 1, where polynomials up to the order are determined
    scale = np.abs(ours).max(axis=1)
    assert (np.abs(signs[:, None] * theirs - ours).max(axis=1) / scale).max() < (2e-3 if name in ROUGH else 1e-6)


@pytest.mark.parametrize("name", sorted(FAMILIES.keys() - {"whole numbers"}))  # chaospy rounds their nodes
def test_gauss_rules(name):
    distribution, order = FAMILIES[name]
    space, germ = one(distribution)
    nodes, weights = germ.gauss(order + 1)
    theirs, by = chaospy.generate_quadrature(order, distribution, rule="gaussian")
    places = np.argsort(theirs[0])
    spread = float(chaospy.Std(distribution))
    tolerance = 5e-4 if name in ROUGH else 1e-6
    assert np.allclose(space.to_inputs(nodes[:, None])[:, 0], theirs[0][places], rtol=0, atol=tolerance * spread)
    assert np.allclose(weights, by[places], rtol=0, atol=tolerance)


def test_tensor_rules_and_clenshaw_curtis():
    joint = chaospy.J(chaospy.Normal(1, 2), chaospy.Uniform(0, 1))
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable(n, d) for n, d in zip("ab", joint, strict=True)]))
    ours, (theirs, weights) = (
        uqmbd.extend.gauss_tensor(space, [4, 4]),
        chaospy.generate_quadrature(3, joint, rule="gaussian"),
    )
    places, others = (np.lexsort(np.round(x.T, 9)) for x in (space.to_inputs(ours.nodes), theirs.T))
    assert np.allclose(space.to_inputs(ours.nodes)[places], theirs.T[others], rtol=0, atol=1e-9)
    assert np.allclose(ours.weights[places], weights[others], rtol=0, atol=1e-12)
    space, _ = one(chaospy.Uniform(0, 1))
    ours = uqmbd.extend.clenshaw_curtis(space, 3)
    theirs, weights = chaospy.generate_quadrature(8, chaospy.Uniform(0, 1), rule="clenshaw_curtis")
    places = np.argsort(ours.nodes[:, 0])
    assert np.allclose(space.to_inputs(ours.nodes)[places, 0], theirs[0], rtol=0, atol=1e-12)
    assert np.allclose(ours.weights[places], weights, rtol=0, atol=1e-12)


def test_sparse_rules_integrate_alike():
    """Their points differ, as levels grow in another way; both are exact for polynomials of degree 7."""
    joint = chaospy.J(*(chaospy.Uniform(-1, 1) for _ in range(3)))
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable(n, chaospy.Uniform(-1, 1)) for n in "abc"]))
    nodes, weights = chaospy.generate_quadrature(4, joint, rule="gaussian", sparse=True)
    ours = uqmbd.extend.smolyak(space, 3)
    powers = np.array(chaospy.glexindex(0, 8, 3))
    exact = np.where(powers % 2, 0.0, 1 / (powers + 1)).prod(axis=1)
    for x, w in ((nodes.T, weights), (ours.nodes, ours.weights)):
        assert np.allclose([w @ (x**p).prod(axis=1) for p in powers], exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("kind", "truncation"), [("total", 1.0), ("tensor", np.inf)])
@pytest.mark.parametrize(("dimension", "order"), [(1, 4), (2, 3), (3, 2), (4, 3)])
def test_index_sets(kind, truncation, dimension, order):
    theirs = chaospy.glexindex(0, order + 1, dimension, cross_truncation=truncation)
    assert {tuple(row) for row in uqmbd.extend.index_set(dimension, order, kind).tolist()} == {
        tuple(row) for row in theirs.tolist()
    }


@pytest.fixture(scope="module")
def chaos():
    node = uqmbd.Study("pendulum", pendulum(loaded=True), np.linspace(0, 0.6, 4)).propagate(Collocation(order=3))
    return uqmbd.results.surrogate(node)


GERMS = chaospy.J(chaospy.Normal(0, 1), chaospy.Uniform(-1, 1))


def test_the_polynomial_of_chaospy_has_the_values_of_the_chaos(chaos):
    """At random inputs; q0 is the germ of the length, q1 that of the mass."""
    polynomial = chaos.to_chaospy()
    assert polynomial.shape == (2, 4) and polynomial.names == ("q0", "q1")
    inputs, expected = chaos.sample(200, 4)
    found = np.moveaxis(polynomial(*chaos.space.to_germs(inputs).T), -1, 0)
    assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize(
    "families", [("hermite", "laguerre", "jacobi"), ("legendre", "stieltjes", "discrete")], ids=str
)
def test_of_germs_of_every_family(families):
    made = {
        "hermite": chaospy.Normal(3, 2), "laguerre": chaospy.Gamma(2), "jacobi": chaospy.Beta(2, 3),
        "legendre": chaospy.Uniform(0, 1), "stieltjes": chaospy.Weibull(2, 3), "discrete": chaospy.Binomial(6, 0.4),
    }  # fmt: skip
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable(f"x_{k}", made[f]) for k, f in enumerate(families)]))
    assert tuple(germ.family for germ in space.germs) == families
    terms = space.basis(5)
    coefficients = np.random.default_rng(1).normal(size=(len(terms), 2, 3))
    known = PolynomialChaos(coefficients, terms, space, labels(["x", "y"], space.inputs, [0.0, 1.0, 2.0]))
    germs = space.from_uniform(np.random.default_rng(2).uniform(0.01, 0.99, (100, 3)))
    polynomial = known.to_chaospy()
    found, expected = np.moveaxis(polynomial(*germs.T), -1, 0), known.evaluate_germs(germs)
    # sums of powers cancel: rounding is that of the largest of them
    size = max(np.abs(c).max() for c in polynomial.coefficients) * np.abs(germs).max() ** 5
    assert np.abs(found - expected).max() < 1e-14 * size
    single = PolynomialChaos(coefficients[:, :, 0], terms, space, labels(["x", "y"], space.inputs, None)).to_chaospy()
    assert single.shape == (2,)


def test_statistics_of_the_polynomial_are_ours(chaos):
    polynomial = chaos.to_chaospy()
    assert np.allclose(chaospy.E(polynomial, GERMS), chaos.mean, rtol=0, atol=1e-12)
    assert np.allclose(chaospy.Std(polynomial, GERMS), chaos.std, rtol=0, atol=1e-9)
    last = polynomial[:, -1]
    assert np.allclose(chaospy.Skew(last, GERMS), chaos.skewness[:, -1], rtol=0, atol=1e-6)
    assert np.allclose(chaospy.Kurt(last, GERMS, fisher=False), chaos.kurtosis[:, -1], rtol=1e-6)
    assert np.allclose(chaospy.Sens_m(last, GERMS), chaos.sobol_first[:, :, -1], rtol=0, atol=1e-8)
    assert np.allclose(chaospy.Sens_t(last, GERMS), chaos.sobol_total[:, :, -1], rtol=0, atol=1e-8)
