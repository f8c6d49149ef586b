"""Joint distributions of every kind: samples, means and storage against closed forms, scipy and the law of total
expectation; what chaospy computes differently, and what is refused."""

from __future__ import annotations

import itertools

import chaospy
import numpy as np
import pytest
import scipy.stats
import xarray as xr
from scipy.special import ndtr

import uqmbd
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.randomness.rosenblatt import Transform
from uqmbd.randomness.rosenblatt.copulas import Archimedean, Elliptical, triangular

NAMES = ("p", "q", "r", "s")


def made(distribution, names=NAMES):
    return uqmbd.random_vector(names[: len(distribution)], distribution)


def points(count, dimension, seed=1):
    return np.clip(scipy.stats.qmc.Sobol(dimension, seed=seed).random(count), 1e-12, 1 - 1e-12)


def drawn(distribution, count=2**13, seed=1):
    """Sample by a Sobol' sequence, so that means converge faster than random ones."""
    inputs = JointInput.of(made(distribution))
    return inputs.from_uniform(points(count, len(distribution), seed))


A = chaospy.Uniform(1, 2)
K = chaospy.Uniform(1, 5)
N = chaospy.Binomial(5, 0.4)
VECTOR = chaospy.MvNormal([0, 0], [[1, 0.5], [0.5, 1]])


def chained():
    b = chaospy.Normal(2 * A, 0.1)
    return chaospy.J(A, b, chaospy.Uniform(b - 1, b + A))


def walk(steps):
    members = [chaospy.Normal(1, 0.1)]
    for _ in range(steps):
        members.append(chaospy.Normal(members[-1], 0.1))
    return chaospy.J(*members)


# by the laws of total expectation and variance: means and standard deviations
CONDITIONAL = {
    "normal around": (lambda: chaospy.J(K, chaospy.Normal(0.2 * K, 0.05)), [3, 0.6], [4 / 3, 0.05**2 + 0.04 * 4 / 3]),
    "uniform below": (lambda: chaospy.J(A, chaospy.Uniform(0, A)), [1.5, 0.75], [1 / 12, 7 / 9 - 0.75**2]),
    "other order": (lambda: chaospy.J(chaospy.Normal(3 * A, A), A), [4.5, 1.5], [9 / 12 + 7 / 3, 1 / 12]),
    "chain": (chained, [1.5, 3, 3.25], [1 / 12, 4 / 12 + 0.01, None]),
    "rate": (lambda: chaospy.J(A, chaospy.Exponential(A)), [1.5, 1.5], [1 / 12, 2 * 7 / 3 - 2.25]),
    "shape": (lambda: chaospy.J(A, chaospy.Gamma(A, 2)), [1.5, 3], [1 / 12, 4 * 1.5 + 4 / 12]),
    "lognormal": (
        lambda: chaospy.J(A, chaospy.LogNormal(A, 0.2)),
        [1.5, (np.e**2 - np.e) * np.exp(0.02)],
        [1 / 12, (np.e**4 - np.e**2) / 2 * np.exp(0.08) - ((np.e**2 - np.e) * np.exp(0.02)) ** 2],
    ),
    "sum": (lambda: chaospy.J(A, A + chaospy.Uniform()), [1.5, 2], [1 / 12, 1 / 6]),
    "product of a member": (
        lambda: chaospy.J(A, A * chaospy.Normal(0, 1) + A),
        [1.5, 1.5],
        [1 / 12, 7 / 3 + 1 / 12],
    ),
    "arithmetic twice": (lambda: chaospy.J(A, 2 * chaospy.Normal(A, 1) + 1), [1.5, 4], [1 / 12, 4 + 4 / 12]),
    "negative": (lambda: chaospy.J(A, -chaospy.Normal(A, 1)), [1.5, -1.5], [1 / 12, 1 + 1 / 12]),
    "square of a member": (lambda: chaospy.J(A, chaospy.Normal(A**2, 1)), [1.5, 7 / 3], [1 / 12, 1 + 31 / 5 - 49 / 9]),
    "square": (lambda: chaospy.J(A, chaospy.Uniform(0, A) ** 2), [1.5, 7 / 9], [1 / 12, 31 / 25 - 49 / 81]),
    "mode": (lambda: chaospy.J(A, chaospy.Triangle(0, A, 3)), [1.5, 1.5], [1 / 12, None]),
    "of a vector": (
        lambda: chaospy.J(VECTOR, chaospy.Normal(VECTOR[0] + VECTOR[1], 0.2)),
        [0, 0, 0],
        [1, 1, 3 + 0.04],
    ),
    "vector last": (lambda: chaospy.J(A, chaospy.MvNormal([1, 2], [[1, 0.5], [0.5, 1]])), [1.5, 1, 2], [1 / 12, 1, 1]),
    "nested": (
        lambda: chaospy.J(chaospy.J(A, chaospy.Normal(A, 1)), chaospy.Uniform(0, A)),
        [1.5, 1.5, 0.75],
        [1 / 12, 13 / 12, 7 / 9 - 0.75**2],
    ),
    "whole number": (lambda: chaospy.J(N, chaospy.Normal(N, 0.1)), [2, 2], [1.2, 1.21]),
    "whole numbers": (lambda: chaospy.J(N, chaospy.Binomial(N + 2, 0.3)), [2, 1.2], [1.2, 0.84 + 0.09 * 1.2]),
    "probability": (lambda: chaospy.J(A, chaospy.Binomial(4, A / 4)), [1.5, 1.5], [1 / 12, 1.5 - 7 / 12 + 1 / 12]),
    "moved vector": (lambda: 2 * VECTOR + [1, 2], [1, 2], [4, 4]),
    "turned vector": (lambda: -VECTOR, [0, 0], [1, 1]),
    "random walk": (lambda: walk(3), [1, 1, 1, 1], [0.01, 0.02, 0.03, 0.04]),
    "one that is apart": (
        lambda: chaospy.J(A, chaospy.Normal(A, 1), chaospy.Gamma(2, 3)),
        [1.5, 1.5, 6],
        [1 / 12, 13 / 12, 18],
    ),
}


@pytest.mark.parametrize(("make", "means", "variances"), CONDITIONAL.values(), ids=CONDITIONAL)
def test_conditional_members(make, means, variances):
    variables = made(make())
    assert [v.mean for v in variables] == pytest.approx(means, rel=1e-8, abs=1e-9)
    x = drawn(make())
    columns = sorted(range(len(means)), key=lambda k: NAMES[k])
    for k in columns:
        deviation = x[:, k].std()
        assert abs(x[:, k].mean() - means[k]) < 5e-3 * deviation + 1e-9
        if variances[k] is not None:
            assert deviation**2 == pytest.approx(variances[k], rel=0.02)


def test_a_long_walk_has_exact_means():
    names = tuple(f"x{k:02d}" for k in range(30))
    assert [v.mean for v in uqmbd.random_vector(names, walk(29))] == pytest.approx([1.0] * 30, rel=1e-12)


def generator(family, theta):
    """Of Archimedean copulas, and its inverse: Nelsen, An Introduction to Copulas, table 4.1."""
    return {
        "clayton": (lambda v: v**-theta - 1, lambda t: (1 + t) ** (-1 / theta)),
        "gumbel": (lambda v: (-np.log(v)) ** theta, lambda t: np.exp(-(t ** (1 / theta)))),
        "joe": (lambda v: -np.log(1 - (1 - v) ** theta), lambda t: 1 - (1 - np.exp(-t)) ** (1 / theta)),
    }[family]


def kendall(family, theta):
    if family == "joe":  # 1 - 4 sum 1 / (k (theta k + 2) (theta (k - 1) + 2))
        k = np.arange(1, 200_000)
        return 1 - 4 * np.sum(1 / (k * (theta * k + 2) * (theta * (k - 1) + 2)))
    return theta / (theta + 2) if family == "clayton" else 1 - 1 / theta


ARCHIMEDEAN = [
    (family, theta, dimension)
    for family, thetas in (("clayton", (0.3, 2.0, 9.0)), ("gumbel", (1.0, 1.5, 6.0)), ("joe", (1.0, 1.7, 8.0)))
    for theta in thetas
    for dimension in (2, 3)
]


@pytest.mark.thorough
@pytest.mark.parametrize(("family", "theta", "dimension"), ARCHIMEDEAN)
def test_archimedean_copulas(family, theta, dimension):
    """Their distribution function, uniform marginals, Kendall's tau, and both ways."""
    copula = Archimedean(family, theta, dimension)
    u = points(2**12, dimension).T
    v = copula.inverse(u)
    assert np.abs(copula.forward(v) - u).max() < 1e-11
    there, back = generator(family, theta)
    corners = np.random.default_rng(2).random((40, dimension)) ** 0.5
    empirical = [(v <= corner[:, None]).all(axis=0).mean() for corner in corners]
    assert np.abs(empirical - back(there(corners).sum(axis=1))).max() < 0.012
    assert all(scipy.stats.kstest(row, "uniform").statistic < 0.012 for row in v)
    assert scipy.stats.kendalltau(v[0], v[1]).statistic == pytest.approx(kendall(family, theta), abs=0.015)


@pytest.mark.parametrize(("family", "theta"), [("clayton", 1.4), ("gumbel", 2.5), ("joe", 3.2)])
def test_conditional_distributions_are_ratios_of_derivatives_of_the_generator(family, theta):
    """Against mpmath, up to the fifth derivative: of the inverse generator, after a component and before it."""
    mpmath = pytest.importorskip("mpmath")
    alpha = mpmath.mpf(1) / theta
    inverse = {
        "clayton": lambda t: (1 + t) ** -alpha,
        "gumbel": lambda t: mpmath.exp(-(t**alpha)),
        "joe": lambda t: 1 - (1 - mpmath.exp(-t)) ** alpha,
    }[family]

    v = np.random.default_rng(4).uniform(0.05, 0.95, (6, 3))
    found = Archimedean(family, theta, 6).forward(v)
    with mpmath.workdps(40):
        generator = {
            "clayton": lambda x: x**-theta - 1,
            "gumbel": lambda x: (-mpmath.log(x)) ** theta,
            "joe": lambda x: -mpmath.log(1 - (1 - x) ** theta),
        }[family]
        for column in range(v.shape[1]):
            sums = list(itertools.accumulate(generator(mpmath.mpf(x)) for x in v[:, column]))
            for k in range(1, 6):
                after, before = (mpmath.diff(inverse, sums[place], k) for place in (k, k - 1))
                assert found[k, column] == pytest.approx(float(after / before), rel=1e-10)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
@pytest.mark.parametrize("freedom", [1.0, 4.0, np.inf])
def test_elliptical_copulas(freedom, order):
    """Uniform marginals, Kendall's tau ``2 / pi asin(rho)`` whatever the degrees of freedom, and the joint density."""
    correlation = np.array([[1, 0.6, 0.2], [0.6, 1, -0.3], [0.2, -0.3, 1]])
    copula = Elliptical(triangular(correlation, order), order, freedom)
    u = points(2**12, 3).T
    v = copula.inverse(u)
    assert np.abs(copula.forward(v) - u).max() < 1e-10
    assert all(scipy.stats.kstest(row, "uniform").statistic < 0.012 for row in v)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        exact = 2 / np.pi * np.arcsin(correlation[i, j])
        assert scipy.stats.kendalltau(v[i], v[j]).statistic == pytest.approx(exact, abs=0.01)


def test_vectors_of_student_are_those_of_scipy():
    """Probabilities of boxes against scipy, marginals against Student's distribution; chaospy's are other ones."""
    scale, centre = np.array([[1.0, 0.6], [0.6, 2.0]]), np.array([1.0, 2.0])
    for given in (chaospy.MvStudentT(4, centre, scale), scipy.stats.multivariate_t(centre, scale, df=4)):
        x = JointInput.of(uqmbd.random_vector(["p", "q"], given)).from_uniform(points(2**13, 2))
        for k in range(2):
            law = scipy.stats.t(4, centre[k], np.sqrt(scale[k, k]))
            assert scipy.stats.kstest(x[:, k], law.cdf).statistic < 0.006
        exact = scipy.stats.multivariate_t(centre, scale, df=4)
        for corner in ([0.0, 1.0], [2.0, 3.0], [1.0, 5.0]):
            assert (x <= corner).all(axis=1).mean() == pytest.approx(exact.cdf(corner, random_state=1), abs=0.005)
    theirs = chaospy.MvStudentT(4, centre, scale).inv(points(2**13, 2).T)
    assert scipy.stats.kstest(theirs[1], scipy.stats.t(4, 2, np.sqrt(2)).cdf).statistic > 0.01


COPULAS = {
    "clayton": lambda d: chaospy.Clayton(d, 2.0),
    "gumbel": lambda d: chaospy.Gumbel(d, 2.0),
    "joe": lambda d: chaospy.Joe(d, 2.0),
    "student": lambda d: chaospy.TCopula(d, 5, [[1, 0.6], [0.6, 1]]),
    "normal": lambda d: chaospy.Nataf(d, [[1, 0.6], [0.6, 1]]),
}
MARGINS = {
    "smooth": (lambda: chaospy.J(chaospy.Gamma(2), chaospy.Normal(3, 0.5)), scipy.stats.gamma(2), 2.0),
    "cut": (
        lambda: chaospy.J(chaospy.Trunc(chaospy.Normal(0, 1), -1, 2), chaospy.Normal(3, 0.5)),
        scipy.stats.truncnorm(-1, 2),
        scipy.stats.truncnorm(-1, 2).mean(),
    ),
    "moved": (
        lambda: chaospy.J(2 * chaospy.Exponential() + 1, chaospy.Normal(3, 0.5)),
        scipy.stats.expon(1, 2),
        3.0,
    ),
    "whole": (lambda: chaospy.J(chaospy.Binomial(6, 0.3), chaospy.Normal(3, 0.5)), scipy.stats.binom(6, 0.3), 1.8),
    "cut whole": (
        lambda: chaospy.J(chaospy.Trunc(chaospy.DiscreteUniform(0, 9), 2, 5), chaospy.Normal(3, 0.5)),
        scipy.stats.randint(2, 6),
        3.5,
    ),
}


@pytest.mark.thorough
@pytest.mark.parametrize("margin", MARGINS)
@pytest.mark.parametrize("copula", COPULAS)
def test_a_copula_leaves_its_marginals(copula, margin):
    make, law, mean = MARGINS[margin]
    distribution = COPULAS[copula](make())
    variables = made(distribution)
    assert [v.mean for v in variables] == pytest.approx([mean, 3.0], rel=1e-6)
    x = drawn(distribution, 2**12)
    at = np.array([0.05, 0.2, 0.5, 0.8, 0.95])
    where = law.ppf(at)
    assert [(x[:, 0] <= y + 1e-9).mean() for y in where] == pytest.approx(law.cdf(where), abs=0.01)
    assert scipy.stats.kstest(x[:, 1], scipy.stats.norm(3, 0.5).cdf).statistic < 0.012
    if "whole" in margin:
        assert np.array_equal(x[:, 0], np.rint(x[:, 0]))


@pytest.mark.thorough
def test_a_mixture_of_normal_vectors():
    weights, centres = [0.3, 0.7], np.array([[0.0, 0.0], [3.0, 1.0]])
    covariances = np.array([[[1.0, 0.5], [0.5, 1.0]], [[0.5, -0.2], [-0.2, 0.3]]])
    distribution = chaospy.GaussianMixture(centres, covariances, weights)
    assert [v.mean for v in made(distribution)] == pytest.approx([2.1, 0.7], rel=1e-12)
    x = drawn(distribution)
    spread = sum(w * (c + np.outer(m, m)) for w, m, c in zip(weights, centres, covariances, strict=True))
    assert np.cov(x, rowvar=False) == pytest.approx(spread - np.outer([2.1, 0.7], [2.1, 0.7]), abs=0.02)
    for corner in ([0.0, 0.0], [2.5, 1.0], [3.0, 0.5]):
        exact = sum(
            w * scipy.stats.multivariate_normal(m, c).cdf(corner)
            for w, m, c in zip(weights, centres, covariances, strict=True)
        )
        assert (x <= corner).all(axis=1).mean() == pytest.approx(exact, abs=0.005)


ALL = {
    **{name: make for name, (make, _, _) in CONDITIONAL.items()},
    **{f"{name} copula": lambda name=name: COPULAS[name](MARGINS["smooth"][0]()) for name in COPULAS},
    "cut copula": lambda: chaospy.Joe(MARGINS["cut"][0](), 3.0),
    "copula of a conditional": lambda: chaospy.Clayton(chaospy.J(A, chaospy.Normal(A, 1)), 2.0),
    "student": lambda: chaospy.MvStudentT(9, [1, 2], [[1, 0.6], [0.6, 2]]),
    "mixture": lambda: chaospy.GaussianMixture([[0, 0], [3, 1]], [[[1, 0.5], [0.5, 1]], [[0.5, 0], [0, 0.3]]]),
    "kernels": lambda: chaospy.GaussianKDE(np.random.default_rng(0).normal(size=(2, 20))),
    "one cut at another": lambda: chaospy.J(A, chaospy.Trunc(chaospy.Normal(0, 1), -1, A)),
}


QUICK = ("normal around", "other order", "of a vector", "whole number", "clayton copula", "student")


@pytest.mark.parametrize("name", QUICK)
def test_the_same_bits_again_and_stored(name):
    """In any number of rows, whatever the state of NumPy's generator, copied, and read from text."""
    same_bits(name)


@pytest.mark.thorough
@pytest.mark.parametrize("name", [name for name in ALL if name not in QUICK])
def test_the_same_bits_of_others_again_and_stored(name):
    same_bits(name)


def same_bits(name):
    distribution = ALL[name]()
    transform = Transform.of(distribution)
    u = points(64, len(distribution))
    expected = transform.inverse(u)
    np.random.seed(5)
    assert np.array_equal(transform.inverse(u[:7]), expected[:7])
    assert np.array_equal(transform.inverse(np.concatenate([u] * 40))[:64], expected)
    if not transform.gaussian:
        assert np.array_equal(Transform.read(transform.text).inverse(u), expected)
    if transform.invertible and not any(transform.law.discrete):
        assert np.abs(transform.forward(expected) - u).max() < 1e-9


@pytest.mark.parametrize("names", [("a", "b"), ("b", "a")])
def test_a_stored_germ_space_maps_as_before(names, tmp_path):
    """Names in another order than the members, too: inputs are sorted by name."""
    a = chaospy.Uniform(1, 2)
    inputs = JointInput.of(uqmbd.random_vector(names, chaospy.J(a, chaospy.Normal(a, 0.3))))
    space = GermSpace.of(inputs)
    space.to_dataset().to_netcdf(tmp_path / "space.nc")
    with xr.open_dataset(tmp_path / "space.nc") as stored:
        read = GermSpace.from_dataset(stored)
    germs = space.from_uniform(points(32, 2))
    assert read.names == space.names == tuple(sorted([names[0], f"{names[1]} | {names[0]}"]))
    assert np.array_equal(read.to_inputs(germs), space.to_inputs(germs))
    x = space.to_inputs(germs)
    assert np.array_equal(read.to_germs(x), space.to_germs(x))
    assert space.to_germs(x) == pytest.approx(germs, abs=1e-9)


def test_germs_far_out_are_finite():
    """Calibrations search there: a probability is rounded to one at 8.3 standard deviations."""
    a = chaospy.Uniform(1, 2)
    space = GermSpace.of(JointInput.of(made(chaospy.J(a, chaospy.Normal(a, 0.3)))))
    germs = np.array([[0.2, z] for z in (-30.0, -9.0, -5.0, 5.0, 9.0, 30.0)])
    back = space.to_germs(space.to_inputs(germs))
    assert np.isfinite(back).all() and (np.diff(back[:, 1]) >= 0).all()
    assert back[2:4, 1] == pytest.approx([-5, 5], abs=1e-6)
    assert (np.abs(back[[0, 1, 4, 5], 1]) > 7).all()
    with pytest.raises(uqmbd.StudyError, match="Input 'p' is 2.5 in row 0, outside the support"):
        space.to_germs([[2.5, 1.0]])


def _below(x, m):
    return np.clip((x - m) / 2, 0, 1)


def test_functions_of_a_user_are_not_stored_and_say_so():
    a = chaospy.Uniform(1, 2)
    own = chaospy.UserDistribution(
        cdf=_below, pdf=lambda x, m: 0.5 + 0 * x, lower=lambda m: m, upper=lambda m: m + 2, parameters={"m": a}
    )
    variables = made(chaospy.J(a, own))
    assert [v.mean for v in variables] == pytest.approx([1.5, 2.5], rel=1e-8)
    space = GermSpace.of(JointInput.of(variables))
    read = GermSpace.from_dataset(space.to_dataset())
    with pytest.raises(
        uqmbd.StudyError,
        match="This polynomial chaos does not contain the map .* The distribution may contain user functions",
    ):
        read.to_inputs([[0.1, 0.2]])


def test_a_damaged_text_is_refused():
    space = GermSpace.of(JointInput.of(made(chaospy.J(A, chaospy.Uniform(0, A)))))
    stored = space.to_dataset()
    text = str(stored["germ_joint"].values[0])
    for bad in (text[:-3], text.replace("uniform.uniform", "os.system"), text.replace("spanned", "evil")):
        stored["germ_joint"].values[0] = bad
        with pytest.raises(uqmbd.StudyError, match="contains a joint distribution that cannot be read"):
            GermSpace.from_dataset(stored)


REFUSED = {
    "scale that is negative": (
        lambda: chaospy.J(A, chaospy.Normal(0, A - 1.5)),
        "component 2 the quantiles do not inc",
    ),
    "scale that is rarely negative": (
        lambda: chaospy.J(*(lambda s: (s, chaospy.Normal(0, s)))(chaospy.Normal(1, 0.2))),
        "component 2 the quantiles do not increase where component 1 is -0.1",
    ),
    "ends that are exchanged": (lambda: chaospy.J(A, chaospy.Uniform(0, A - 1.5)), "the quantiles do not increase"),
    "square of both signs": (lambda: chaospy.J(A, chaospy.Normal(A, 1) ** 2), "the quantiles do not increase"),
    "parameter of a copula": (
        lambda: chaospy.Gumbel(chaospy.Iid(chaospy.Uniform(), 2), 0.5),
        "theta of a Gumbel copula is 0.5; expected a number that is at least 1",
    ),
    "truncated vector": (lambda: chaospy.Trunc(VECTOR, -1, 1), "chaospy does not truncate dependent variables"),
    "margin of no distribution": (
        lambda: chaospy.Clayton(chaospy.J(chaospy.Normal(0, -1), chaospy.Uniform()), 2.0),
        "is not a valid distribution",
    ),
    "quantiles that are searched for": (lambda: chaospy.J(A, chaospy.Wald(A)), "by a random search"),
    "without whole numbers": (
        lambda: chaospy.J(0.5 * chaospy.Binomial(3, 0.5), chaospy.Uniform()),
        "has values that are not whole numbers",
    ),
}


@pytest.mark.parametrize(("make", "words"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_joint_distribution_is_refused(make, words):
    with pytest.raises(uqmbd.StudyError, match=rf"random_vector \('p', 'q'\): .*{words}"):
        made(make())


def test_a_mean_that_does_not_exist_is_no_number():
    """Of Pareto's distribution of shape a the mean is ``a / (a - 1)``, whose mean over a from 1 to 2 is infinite."""
    _, second = made(chaospy.J(A, chaospy.Pareto1(A)))
    with pytest.raises(uqmbd.StudyError, match="the error of the computed mean of 'q' is"):
        float(second.mean)


def test_whole_numbers_stay_whole():
    """In arithmetic, cut, and next to others: chaospy spreads them over intervals of length one."""
    u = points(512, 1)
    cases = {
        "doubled": (2 * chaospy.Binomial(5, 0.4), 2 * scipy.stats.binom(5, 0.4).ppf(u)),
        "shifted": (chaospy.DiscreteUniform(2, 5) + 3, 3 + scipy.stats.randint(2, 6).ppf(u)),
        "cut": (chaospy.Trunc(chaospy.DiscreteUniform(0, 9), 2, 5), scipy.stats.randint(2, 6).ppf(u)),
    }
    for name, (distribution, expected) in cases.items():
        inputs = JointInput.of([uqmbd.RandomVariable("n", distribution)])
        assert np.abs(inputs.from_uniform(u) - expected).max() < 1e-9, name
        space = GermSpace.of(inputs)
        assert space.germs[0].family == "discrete"
        assert np.abs(space.to_inputs(space.from_uniform(u)) - expected).max() < 1e-9, name
        assert inputs.means[0] == pytest.approx(expected.mean(), abs=0.02)
    both = JointInput.of(made(chaospy.J(chaospy.Binomial(5, 0.4), chaospy.Normal())))
    x = both.from_uniform(points(512, 2))
    assert np.array_equal(x[:, 0], scipy.stats.binom(5, 0.4).ppf(points(512, 2)[:, 0]))
    assert both.means == pytest.approx([2.0, 0.0])


def test_arithmetic_of_independent_variables():
    variables = made(2 * chaospy.Iid(chaospy.Uniform(), 2) + [1, 3])
    assert [v.mean for v in variables] == pytest.approx([2, 4])
    cut = made(chaospy.Trunc(chaospy.Iid(chaospy.Normal(), 2), [-1, 0], 2))
    exact = [scipy.stats.truncnorm(low, 2) for low in (-1, 0)]
    assert [v.mean for v in cut] == pytest.approx([law.mean() for law in exact], rel=1e-9)
    x = JointInput.of(cut).from_uniform(points(256, 2))
    assert (
        np.abs(x - np.stack([law.ppf(u) for law, u in zip(exact, points(256, 2).T, strict=True)], axis=1)).max() < 1e-8
    )
    assert GermSpace.of(JointInput.of(cut)).independent


def test_mixtures_of_one_variable_are_the_same_in_each_run():
    mixture = chaospy.GaussianMixture([0, 3], [1, 0.25], [0.4, 0.6])
    variable = uqmbd.RandomVariable("x", mixture)
    u = points(128, 1)
    x = JointInput.of([variable]).from_uniform(u)
    np.random.seed(7)
    assert np.array_equal(x, JointInput.of([variable]).from_uniform(u))
    assert np.abs(0.4 * ndtr(x) + 0.6 * ndtr((x - 3) / 0.5) - u).max() < 1e-12
    assert variable.mean == pytest.approx(1.8, rel=1e-12)


def test_single_values_that_depend_on_others_have_no_germ():
    for distribution in (CONDITIONAL["whole number"][0](), COPULAS["clayton"](MARGINS["whole"][0]())):
        with pytest.raises(
            uqmbd.StudyError, match="Input 'p', of .*, is discrete, and is statistically dependent on other"
        ):
            GermSpace.of(JointInput.of(made(distribution)))
