"""Orthonormal polynomials of distributions outside Askey's scheme, against integrals over densities of scipy.stats."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.integrate
import scipy.stats

import uqmbd
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.randomness.distributions.decomposed import AffineDistribution
from uqmbd.randomness.germs.stieltjes import discretise, discretise_quantiles


class Density:
    """A density with breaks where it is not smooth, for those that scipy.stats lacks."""

    def __init__(self, pdf, cdf):
        self.pdf, self.cdf = pdf, cdf


normal = scipy.stats.norm
MIXTURE = Density(
    lambda x: (normal.pdf(x, 0, 1) + normal.pdf(x, 3, np.sqrt(0.5))) / 2,
    lambda x: (normal.cdf(x, 0, 1) + normal.cdf(x, 3, np.sqrt(0.5))) / 2,
)
CUT_WEIBULL = Density(
    lambda x: scipy.stats.weibull_min.pdf(x, 2, scale=2) / scipy.stats.weibull_min.cdf(2, 2, scale=2) * (x <= 2),
    lambda x: scipy.stats.weibull_min.cdf(x, 2, scale=2) / scipy.stats.weibull_min.cdf(2, 2, scale=2),
)

CASES = {
    "truncated normal": (chaospy.TruncNormal(-1, 2, 0, 1), scipy.stats.truncnorm(-1, 2), [-1, 2]),
    "truncated on both sides": (chaospy.Trunc(chaospy.Normal(1, 2), -1, 2), scipy.stats.truncnorm(-1, 0.5, 1, 2), [-1, 2]),
    "truncated below": (chaospy.Trunc(chaospy.Normal(0, 1), lower=0), scipy.stats.halfnorm(), [0, 40]),
    "truncated, moved": (1 - 2 * chaospy.Trunc(chaospy.Weibull(2, 2), upper=2), None, [-3, 1]),
    "truncated Cauchy": (chaospy.Trunc(chaospy.Cauchy(), -10, 10), None, [-10, 0, 10]),
    "triangle": (chaospy.Triangle(0, 1, 4), scipy.stats.triang(0.25, 0, 4), [0, 1, 4]),
    "Weibull 2": (chaospy.Weibull(2, 3), scipy.stats.weibull_min(2, scale=3), [0, 60]),
    "Weibull 1.5": (chaospy.Weibull(1.5), scipy.stats.weibull_min(1.5), [0, 1, 60]),
    "Weibull 0.7": (chaospy.Weibull(0.7), scipy.stats.weibull_min(0.7), [0, 1e-8, 1e-4, 0.1, 10, 100, 1000]),
    "Laplace": (chaospy.Laplace(0, 1), scipy.stats.laplace(), [-150, -20, 0, 20, 150]),
    "logistic": (chaospy.Logistic(), scipy.stats.logistic(), [-150, -20, 0, 20, 150]),
    "Gumbel": (chaospy.LogWeibull(), scipy.stats.gumbel_r(), [-8, 0, 20, 150]),
    "log-uniform": (chaospy.LogUniform(1, 2), scipy.stats.loguniform(np.exp(1), np.exp(2)), [np.exp(1), np.exp(2)]),
    "reciprocal inverse Gaussian": (chaospy.Wald(1), scipy.stats.recipinvgauss(1), [0, 0.1, 1, 20, 300]),
    "chi": (chaospy.Chi(3), scipy.stats.chi(3), [0, 40]),
    "Student 150": (chaospy.StudentT(150), scipy.stats.t(150), [-200, -20, 0, 20, 200]),
    "mixture": (chaospy.GaussianMixture([0, 3], [1, 0.5]), MIXTURE, [-15, 0, 3, 15]),
}  # fmt: skip


def density_of(case, x):
    """The density, by hand where scipy.stats has none."""
    distribution, law, _ = case
    if law is not None:
        return law.pdf(x)
    if "Cauchy" in str(distribution):
        return scipy.stats.cauchy.pdf(x) / (2 * scipy.stats.cauchy.cdf(10) - 1)
    return CUT_WEIBULL.pdf((1 - x) / 2) / 2


@pytest.mark.thorough
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_orthonormal_through_order_10(case):
    distribution, _, breaks = case
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", distribution)]))
    germ, marginal = space.germs[0], space.groups[0].marginals[0]
    assert germ.family == "stieltjes" and marginal.kind == "affine"

    def products(x):
        psi = germ.polynomials((x - marginal.shift) / marginal.scale, 10)
        return np.outer(psi, psi) * density_of(case, x)

    gram = np.zeros((11, 11))
    for low, high in zip(breaks, breaks[1:], strict=False):
        gram += scipy.integrate.quad_vec(products, low, high, epsabs=1e-13, epsrel=1e-12, norm="max", limit=2000)[0]
    assert np.abs(gram - np.eye(11)).max() < 1e-10
    # the Gauss rule of the germ's own coefficients says the same
    nodes, weights = germ.gauss(11)
    psi = germ.polynomials(nodes, 10)
    assert np.abs((psi * weights[:, None]).T @ psi - np.eye(11)).max() < 1e-11


# the quantiles of scipy's reciprocal inverse Gaussian take seconds
WITH_QUANTILES = {n: c for n, c in CASES.items() if hasattr(c[1], "ppf") and not n.startswith("reciprocal")}


@pytest.mark.parametrize("case", WITH_QUANTILES.values(), ids=WITH_QUANTILES)
def test_quantiles_from_the_table_are_those_of_scipy(case):
    """To 1e-7 of the spread from 1e-4 to 1 - 1e-4 (kinks and numerical inverses are the worst), 1e-5 at 1e-7."""
    distribution, law, _ = case
    joint = JointInput.of([uqmbd.RandomVariable("x", distribution)])
    space = GermSpace.of(joint)
    bulk = np.linspace(1e-4, 1 - 1e-4, 2001)
    spread = np.ptp(law.ppf(bulk))
    for u, accuracy in ((bulk, 1e-7), (np.array([1e-7, 1 - 1e-7]), 1e-5)):
        found = space.to_inputs(space.from_uniform(u[:, None]))[:, 0]
        assert np.abs(found - law.ppf(u)).max() < accuracy * spread
    assert np.abs(joint.from_uniform(bulk[:, None])[:, 0] - law.ppf(bulk)).max() < 1e-7 * spread
    assert joint.means[0] == pytest.approx(law.mean(), abs=1e-9 * spread)


@pytest.mark.thorough
def test_a_kernel_density():
    """Silverman's or any other bandwidth: the density that chaospy tells, integrated."""
    samples = np.random.default_rng(4).normal(size=30) ** 3
    distribution = chaospy.GaussianKDE(samples)
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", distribution)]))
    germ, marginal = space.germs[0], space.groups[0].marginals[0]
    assert marginal.bounds == (-np.inf, np.inf)  # as those of the normal distributions that it is a mixture of
    low, high = samples.min() - 10 * samples.std(), samples.max() + 10 * samples.std()
    x, w = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(low, high, 2001)
    points = ((edges[1:] + edges[:-1])[:, None] + np.diff(edges)[:, None] * x).ravel() / 2
    weights = (np.diff(edges)[:, None] * w / 2).ravel() * distribution.pdf(points)
    psi = germ.polynomials((points - marginal.shift) / marginal.scale, 10)
    assert np.abs((psi * weights[:, None]).T @ psi - np.eye(11)).max() < 1e-10


def test_singular_at_both_ends_and_known_in_closed_form():
    """Kumaraswamy's distribution: the moment of order n is ``b B(1 + n / a, b)``, here 8/15 and 128/315."""
    found = discretise(AffineDistribution.of(chaospy.Kumaraswamy(0.5, 0.5)))
    mean = found.shift + found.scale * found.alpha[0]
    variance = found.scale**2 * found.beta[1]
    assert mean == pytest.approx(8 / 15, abs=1e-12)
    assert variance == pytest.approx(128 / 315 - (8 / 15) ** 2, abs=1e-12)


def test_recurrences_of_a_discretised_uniform_and_gamma_distribution_are_the_classical_ones():
    legendre, laguerre = (
        discretise(AffineDistribution.of(d), 20) for d in (chaospy.Uniform(3, 4), chaospy.Gamma(2, 5))
    )
    k = np.arange(1, 20)
    assert np.allclose(legendre.beta[1:], k**2 / (4 * k**2 - 1), rtol=1e-12)
    assert np.allclose(laguerre.beta[1:] * laguerre.scale**2, 25 * k * (k + 1), rtol=1e-10)
    assert np.allclose(laguerre.alpha * laguerre.scale + laguerre.shift, 5 * (2 * np.arange(20) + 2), rtol=1e-10)
    rough = discretise_quantiles(AffineDistribution.of(chaospy.Uniform(3, 4)), 8)
    assert np.allclose(rough.beta[1:], legendre.beta[1:8], rtol=1e-5)


def test_a_truncation_from_both_sides_has_no_lump_at_its_upper_bound():
    """chaospy's inverse puts 0.4 % of the probability there; Monte Carlo and chaos both see the right distribution."""
    a, b = uqmbd.random_vector(["a", "b"], chaospy.J(chaospy.Trunc(chaospy.Normal(), -1, 2), chaospy.Uniform()))
    joint = JointInput.of([a, uqmbd.RandomVariable("c", 2 * chaospy.Trunc(chaospy.Normal(), -1, 2) + 1)])
    law = scipy.stats.truncnorm(-1, 2)
    u = np.linspace(0.001, 0.9999, 999)
    values = joint.from_uniform(np.column_stack([u, u, u]))
    assert np.allclose(values[:, 0], law.ppf(u), atol=1e-9) and np.allclose(values[:, 1], u)
    assert np.allclose(values[:, 2], 1 + 2 * law.ppf(u), atol=1e-9)
    assert joint.means == pytest.approx([law.mean(), 0.5, 1 + 2 * law.mean()], rel=1e-9)


DISCRETE = {
    "uniform": (chaospy.DiscreteUniform(20, 25), scipy.stats.randint(20, 26), 6),
    "binomial": (chaospy.Binomial(7, 0.3), scipy.stats.binom(7, 0.3), 8),
}


@pytest.mark.parametrize(("distribution", "law", "count"), DISCRETE.values(), ids=DISCRETE)
def test_whole_numbers(distribution, law, count):
    joint = JointInput.of([uqmbd.RandomVariable("teeth", distribution)])
    space = GermSpace.of(joint)
    germ = space.germs[0]
    assert germ.family == "discrete" and germ.highest_degree == count - 1
    numbers = np.arange(law.support()[0], law.support()[1] + 1.0)
    psi = germ.polynomials(space.to_germs(numbers[:, None])[:, 0], count - 1)
    assert np.abs((psi * law.pmf(numbers)[:, None]).T @ psi - np.eye(count)).max() < 1e-10
    # the Gauss rule with as many nodes as numbers is the distribution itself
    nodes, weights = germ.gauss(count)
    assert np.allclose(space.to_inputs(nodes[:, None])[:, 0], numbers, atol=1e-9)
    assert np.allclose(weights, law.pmf(numbers), rtol=1e-8)
    u = np.random.default_rng(3).random((1000, 1))
    assert np.array_equal(space.to_inputs(space.from_uniform(u)).round(9), joint.from_uniform(u))
    # of products of too high a degree, what exists is right, and the rest zero: the expansion still is exact
    products = germ.linearisation(count - 1)
    i, j = 2, count - 2
    expansion = psi @ products[i, j, :count]
    assert np.allclose(expansion, psi[:, i] * psi[:, j], atol=1e-9) and not products[..., count:].any()
    with pytest.raises(
        uqmbd.StudyError, match=f"'teeth' has only {count} values, so it has polynomials up to degree {count - 1}"
    ):
        germ.polynomials(0.0, count)
    with pytest.raises(uqmbd.StudyError, match="Use a lower order for this input"):
        germ.gauss(count + 1)


def test_arithmetic_with_whole_numbers_and_distributions_that_contradict_themselves():
    wrong = {
        "with a distribution of whole numbers as continuous": 2 * chaospy.DiscreteUniform(1, 6),
        "is inconsistent": chaospy.Normal() ** 2,
        "cannot evaluate": chaospy.Normal() + chaospy.Uniform(),
    }
    for words, distribution in wrong.items():
        from uqmbd.randomness.space.families import independent_part

        with pytest.raises(uqmbd.StudyError, match=f"Input 'x'.*{words}.*mechanism"):
            independent_part("x", distribution)


def test_a_mean_that_is_large_costs_no_digits():
    near, far = (
        GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", chaospy.Weibull(0.7, scale, shift=shift))]))
        for scale, shift in ((1, 0), (1e-3, 1e6))
    )
    assert np.array_equal(near.germs[0].beta, far.germs[0].beta)
    assert far.to_inputs([[0.5]])[0, 0] - 1e6 == pytest.approx(1e-3 * near.to_inputs([[0.5]])[0, 0], abs=1e-9)


def test_no_inputs_at_all():
    space = GermSpace.of(JointInput.of([]))
    assert space.names == () and space.evaluate(np.zeros((3, 0)), np.zeros((1, 0), int)).tolist() == [[1.0]] * 3
    assert GermSpace.from_dataset(space.to_dataset()).names == ()
