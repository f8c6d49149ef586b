"""Elements of the germ space: conditional distributions, their polynomials and rules, probabilities, splitting."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.integrate
import scipy.special
import scipy.stats

import uqmbd
from uqmbd.randomness import GermBox, GermSpace, JointInput, gauss_tensor, gram_error, index_set, located
from uqmbd.randomness.germs.truncated import cumulated, truncate_germ

# distribution, density of its germ, and where numerical integrals of it are cut
CASES = {
    "uniform": (chaospy.Uniform(0, 2), scipy.stats.uniform(-1, 2)),
    "normal": (chaospy.Normal(1, 3), scipy.stats.norm()),
    "beta": (chaospy.Beta(0.5, 2.5), scipy.stats.beta(0.5, 2.5, loc=-1, scale=2)),
    "gamma": (chaospy.Gamma(2.5, 1), scipy.stats.gamma(2.5)),
}
TABLES = {"weibull": chaospy.Weibull(2.0, 1.0), "triangle": chaospy.Triangle(0, 0.3, 1)}


def space_of(*distributions):
    """The germ space of independent inputs."""
    return GermSpace.of(JointInput.of([uqmbd.RandomVariable(f"x{k}", d) for k, d in enumerate(distributions)]))


def sixteen(space):
    """The germ space of one input in sixteen equally probable parts."""
    boxes = [GermBox.whole(space)]
    for _ in range(4):
        boxes = [half for box in boxes for half in box.split(0)]
    return boxes


@pytest.mark.parametrize("name", [*CASES, *TABLES])
def test_local_bases_are_orthonormal(name):
    """Under a Gauss rule of two more nodes the Gram matrix is the identity; probabilities are equal and sum to one."""
    space = space_of(CASES[name][0] if name in CASES else TABLES[name])
    boxes = sixteen(space)
    terms = index_set(1, 10)
    assert max(gram_error(b.local, gauss_tensor(b.local, 13), terms) for b in boxes) < 1e-11
    np.testing.assert_allclose([b.probability for b in boxes], 1 / 16, atol=1e-12)
    assert sum(b.probability for b in boxes) == pytest.approx(1, abs=1e-13)


@pytest.mark.parametrize("name", CASES)
def test_rules_are_those_of_the_conditional_density(name):
    """Moments by the local Gauss rule are those of scipy's adaptive quadrature of the density on the interval."""
    distribution, law = CASES[name]
    for box in sixteen(space_of(distribution))[::5]:
        (low,), (high,) = box.lower, box.upper
        nodes, weights = box.local.germs[0].gauss(8)
        # the density of the beta germ is singular at its lower end, which quad takes as a weight
        alg = {"weight": "alg", "wvar": (-0.5, 0.0)} if name == "beta" and low == -1 else {}
        density = (lambda x: (1 - x) ** 1.5) if alg else law.pdf
        for f in (np.ones_like, np.positive, lambda x: x**7, lambda x: np.exp(-x / 4)):
            whole, mass = (
                scipy.integrate.quad(
                    lambda x, g=g, pdf=density: g(x) * pdf(x), low, high, epsabs=0, epsrel=1e-11, **alg
                )[0]
                for g in (f, np.ones_like)
            )
            assert weights @ f(nodes) == pytest.approx(whole / mass, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("name", TABLES)
def test_tabulated_germs(name):
    """Of a germ that is known by its quantile function, rules integrate what its samples are distributed like."""
    points, rule = np.polynomial.legendre.leggauss(16)
    edges = np.unique(np.r_[0, 2.0 ** -np.arange(1, 45), 1 - 2.0 ** -np.arange(2, 45), 1])
    u = ((edges[1:] + edges[:-1])[:, None] / 2 + np.diff(edges)[:, None] / 2 * points).ravel()
    w = (np.diff(edges)[:, None] / 2 * rule).ravel()
    for box in sixteen(space_of(TABLES[name]))[::5]:
        germ = box.local.germs[0]
        nodes, weights = germ.gauss(8)
        values = germ.from_uniform(u)
        assert values.min() >= germ.bounds[0] and values.max() <= germ.bounds[1]
        for power in (1, 2, 5):
            assert weights @ nodes**power == pytest.approx(w @ values**power, rel=1e-7)
        np.testing.assert_allclose(cumulated(germ, germ.from_uniform([0.1, 0.5, 0.9])), [0.1, 0.5, 0.9], atol=1e-9)


def test_a_part_of_a_uniform_germ_keeps_legendre_polynomials():
    """On [a, b] they are sqrt(2 n + 1) P_n((2 x - a - b) / (b - a)), to rounding."""
    germ = truncate_germ(space_of(chaospy.Uniform(3, 5)).germs[0], 0.25, 0.5)
    x = np.linspace(0.25, 0.5, 7)
    expected = [np.sqrt(2 * n + 1) * scipy.special.eval_legendre(n, 8 * x - 3) for n in range(9)]
    np.testing.assert_allclose(germ.polynomials(x, 8), np.array(expected).T, rtol=0, atol=1e-11)


def test_splitting_and_locating():
    """Splits nest, every point lies in exactly one box, and local samples lie in theirs; maps to inputs hold."""
    space = space_of(chaospy.Uniform(0, 2), chaospy.Normal(1, 3))
    left, right = GermBox.whole(space).split(0)
    boxes = [
        left,
        *right.split(1),
    ]
    boxes = [*boxes[:2], *boxes[2].split(1)]
    assert [b.probability for b in boxes] == pytest.approx([0.5, 0.25, 0.125, 0.125])
    assert boxes[3].lower == (0.0, pytest.approx(scipy.stats.norm.ppf(0.75))) and boxes[3].upper == (1.0, np.inf)
    points = space.from_uniform(np.random.default_rng(0).random((2000, 2)))
    inside = np.array([b.contains(points) for b in boxes])
    np.testing.assert_array_equal(inside.sum(axis=0), 1)
    np.testing.assert_array_equal(located(boxes, points), inside.argmax(axis=0))
    np.testing.assert_allclose(inside.mean(axis=1), [b.probability for b in boxes], atol=0.03)
    own = boxes[3].local.from_uniform(np.random.default_rng(1).random((50, 2)))
    assert boxes[3].contains(own).all()
    np.testing.assert_array_equal(boxes[3].local.to_inputs(own), space.to_inputs(own))
    assert left.split(0, "midpoint")[0].upper == (-0.5, np.inf)
    with pytest.raises(uqmbd.StudyError, match="no midpoint"):
        left.split(1, "midpoint")
    with pytest.raises(uqmbd.StudyError, match="empty"):
        GermBox(space, (0.5, 0.0), (0.5, 1.0))
    with pytest.raises(uqmbd.StudyError, match="one for every germ"):
        GermBox(space, (0.5,), (1.0,))


def test_whole_numbers():
    """A discrete germ is split between its values, down to single ones, whose probabilities are kept."""
    space = space_of(chaospy.DiscreteUniform(1, 4))
    boxes = [half for box in GermBox.whole(space).split(0) for half in box.split(0)]
    assert [b.local.germs[0].values for b in boxes] == [1] * 4
    assert [b.probability for b in boxes] == pytest.approx([0.25] * 4)
    values = [b.local.to_inputs(gauss_tensor(b.local, 1).nodes)[0, 0] for b in boxes]
    assert values == pytest.approx([1, 2, 3, 4])
    assert not boxes[0].divisible(0)
    with pytest.raises(uqmbd.StudyError, match="cannot be split"):
        boxes[0].split(0)


def test_dependent_inputs():
    """Boxes lie in the space of the germs, whatever map leads to the inputs."""
    joint = chaospy.MvNormal([0, 1], [[1, 0.5], [0.5, 2]])
    a, b = uqmbd.random_vector(["a", "b"], joint)
    space = GermSpace.of(JointInput.of([a, b]))
    low, high = GermBox.whole(space).split(1)
    germs = high.local.from_uniform(np.random.default_rng(2).random((20, 2)))
    np.testing.assert_allclose(space.to_germs(high.local.to_inputs(germs)), germs, atol=1e-12)
    assert low.probability == high.probability == pytest.approx(0.5)
