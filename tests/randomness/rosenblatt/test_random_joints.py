"""Random joint distributions, built of each other, against samples that NumPy and SciPy draw of the same structure."""

from __future__ import annotations

import itertools

import chaospy
import numpy as np
import pytest
import scipy.stats

import uqmbd
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.randomness.rosenblatt import Transform

CORRELATION = np.array([[1.0, 0.6], [0.6, 1.0]])
COUNT = 2**13

SINGLE = {
    "uniform": (lambda: chaospy.Uniform(1, 2), scipy.stats.uniform(1, 1)),
    "normal": (lambda: chaospy.Normal(1, 0.5), scipy.stats.norm(1, 0.5)),
    "gamma": (lambda: chaospy.Gamma(2, 0.5), scipy.stats.gamma(2, scale=0.5)),
    "binomial": (lambda: chaospy.Binomial(5, 0.4), scipy.stats.binom(5, 0.4)),
    "integer": (lambda: chaospy.DiscreteUniform(1, 4), scipy.stats.randint(1, 5)),
}

CHILD = {
    "about": (lambda x: chaospy.Normal(x, 0.5), lambda x, rng: rng.normal(x, 0.5)),
    "between": (lambda x: chaospy.Uniform(x - 1, 2 * x), lambda x, rng: rng.uniform(x - 1, 2 * x)),
    "times": (lambda x: x * chaospy.Gamma(2, 0.5), lambda x, rng: x * rng.gamma(2, 0.5, x.shape)),
    "turned": (lambda x: 1 - x * chaospy.Normal(1, 0.2), lambda x, rng: 1 - x * rng.normal(1, 0.2, x.shape)),
    "number": (lambda x: chaospy.Binomial(4, x / 2 - 0.25), lambda x, rng: rng.binomial(4, x / 2 - 0.25)),
}
"""Conditional on a uniform variable from 1 to 2."""

COPULA = {
    "clayton": lambda margins: chaospy.Clayton(margins, 2.0),
    "gumbel": lambda margins: chaospy.Gumbel(margins, 2.0),
    "joe": lambda margins: chaospy.Joe(margins, 2.0),
    "student": lambda margins: chaospy.TCopula(margins, 4, CORRELATION),
    "normal": lambda margins: chaospy.Nataf(margins, CORRELATION),
}


def copula_values(name, rng, count):
    """Dependent uniform variables by frailties (Marshall and Olkin, 1988), or as functions of normal vectors."""
    if name in ("student", "normal"):
        z = np.linalg.cholesky(CORRELATION) @ rng.normal(size=(2, count))
        return (
            scipy.stats.norm.cdf(z)
            if name == "normal"
            else scipy.stats.t.cdf(z / np.sqrt(rng.chisquare(4, count) / 4), 4)
        )
    e = rng.exponential(size=(2, count))
    if name == "clayton":
        return (1 + e / rng.gamma(0.5, size=count)) ** -0.5
    if name == "gumbel":  # a positive stable variable of index 1/2
        return np.exp(-np.sqrt(e / (0.5 / rng.normal(size=count) ** 2)))
    # of Sibuya's distribution of index 1/2: trials until a success of probability 1 / (2 k)
    frailty, left = np.zeros(count), np.ones(count, dtype=bool)
    u, rest, k = rng.uniform(size=count), 1.0, 1
    while left.any() and k < 10_000:
        rest *= 1 - 0.5 / k
        done = left & (u > rest)
        frailty[done], left = k, left & ~done
        k += 1
    frailty[left] = 1 / (np.pi * u[left] ** 2)  # far out rest is (pi k) ** -1/2
    return 1 - np.sqrt(-np.expm1(-e / frailty))


def single(rng):
    name = str(rng.choice(list(SINGLE)))
    make, law = SINGLE[name]
    return make(), lambda rng, count: law.rvs(count, random_state=rng)[None, :], name


def vector(rng):
    kind = str(rng.choice(["MvNormal", "MvStudentT", "GaussianMixture"]))
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    if kind == "GaussianMixture":
        centres = np.array([[-1.0, 0.0], [0.0, 4.0], [1.0, 0.0]])
        covariances = np.stack([0.1 * np.eye(2)] * 3)

        def draw(rng, count):
            return (centres[rng.integers(0, 3, count)] + np.sqrt(0.1) * rng.normal(size=(count, 2))).T

        return chaospy.GaussianMixture(centres, covariances), draw, kind
    if kind == "MvNormal":
        law = scipy.stats.multivariate_normal([1, 2], covariance)
        return chaospy.MvNormal([1, 2], covariance), lambda rng, count: law.rvs(count, random_state=rng).T, kind
    law = scipy.stats.multivariate_t([1, 2], covariance, df=5)
    return chaospy.MvStudentT(5, [1, 2], covariance), lambda rng, count: law.rvs(count, random_state=rng).T, kind


def conditional(rng):
    name = str(rng.choice(list(CHILD)))
    make, child = CHILD[name]
    root = chaospy.Uniform(1, 2)
    members = [root, make(root)]
    order = list(rng.permutation(2))

    def draw(rng, count):
        x = rng.uniform(1, 2, count)
        return np.stack([x, child(x, rng)])[order]

    return chaospy.J(*(members[k] for k in order)), draw, f"conditional {name}"


def coupled(rng):
    name = str(rng.choice(list(COPULA)))
    margins = [str(rng.choice(list(SINGLE))) for _ in range(2)]

    def draw(rng, count):
        v = copula_values(name, rng, count)
        return np.stack([SINGLE[margin][1].ppf(u) for margin, u in zip(margins, v, strict=True)])

    return COPULA[name](chaospy.J(*(SINGLE[margin][0]() for margin in margins))), draw, f"{name}({', '.join(margins)})"


def referring(rng):
    """A copula, one margin of which depends on a variable outside of it."""
    name = str(rng.choice(list(COPULA)))
    root = chaospy.Uniform(1, 2)
    members = [root, COPULA[name](chaospy.J(chaospy.Normal(root, 0.5), chaospy.Uniform()))]
    swapped = bool(rng.integers(2))

    def draw(rng, count):
        x, v = rng.uniform(1, 2, count), copula_values(name, rng, count)
        found = [x[None, :], np.stack([x + 0.5 * scipy.stats.norm.ppf(v[0]), v[1]])]
        return np.concatenate(found[::-1] if swapped else found)

    return chaospy.J(*(members[::-1] if swapped else members)), draw, f"{name} of a member"


def joined(rng, depth):
    parts = [made(rng, depth - 1) for _ in range(int(rng.integers(2, 4)))]

    def draw(rng, count):
        return np.concatenate([one[1](rng, count) for one in parts])

    return chaospy.J(*(one[0] for one in parts)), draw, f"J({', '.join(one[2] for one in parts)})"


def made(rng, depth):
    """Return a distribution of chaospy, a function that draws from the same one, and its description."""
    kinds = [single, vector, conditional, coupled, referring] if depth < 2 else [lambda rng: joined(rng, depth)]
    inner, draw, words = kinds[int(rng.integers(len(kinds)))](rng)
    if len(inner) == 1 or rng.uniform() < 0.5:
        return inner, draw, words
    shape = len(inner) if rng.integers(2) else 1
    scale, shift = rng.choice([-3, -1, 2], shape), rng.integers(-2, 3, shape)
    moved = (
        chaospy.Negative(inner) if shape == 1 and scale[0] == -1 else (scale if shape > 1 else int(scale[0])) * inner
    )
    return (
        moved + (shift if shape > 1 else int(shift[0])),
        lambda rng, count: shift[:, None] + scale[:, None] * draw(rng, count),
        f"{scale.tolist()} * {words} + {shift.tolist()}",
    )


def compared(distribution, draw, words, seed):
    names = tuple(f"x{k:02d}" for k in range(len(distribution)))
    variables = uqmbd.random_vector(names, distribution)
    rng = np.random.default_rng(seed)
    u = np.clip(scipy.stats.qmc.Sobol(len(names), seed=rng).random(COUNT), 1e-9, 1 - 1e-9)
    x, expected = JointInput.of(variables).from_uniform(u), draw(rng, COUNT).T
    for k, variable in enumerate(variables):
        assert scipy.stats.ks_2samp(np.round(x[:, k], 9), np.round(expected[:, k], 9), method="asymp").pvalue > 1e-7, (
            words,
            k,
        )
        own = expected[:, k]
        assert abs(variable.mean - own.mean()) < 6 * own.std() / np.sqrt(COUNT), (words, k, variable.mean, own.mean())
    joint = variables[0].joint
    low, high = joint.bounds.T
    slack = 1e-9 * (1 + np.abs(expected).max())
    assert ((expected >= low - slack) & (expected <= high + slack)).all(), words
    ranks = [scipy.stats.spearmanr(one).statistic for one in (x, expected)]
    assert np.abs(ranks[0] - ranks[1]).max() < 6 * np.sqrt(2 / COUNT), words
    if joint.distribution.stochastic_dependent:
        transform = joint.transform
        if not transform.gaussian:
            assert transform.text and np.array_equal(Transform.read(transform.text).inverse(u[:64]), x[:64]), words
        if transform.invertible:
            middle = 0.05 + 0.9 * u[:64]
            back = transform.inverse(transform.forward(transform.inverse(middle)))
            assert np.abs(back - transform.inverse(middle)).max() < 1e-6 * (1 + np.abs(back).max()), words


def swept(seed, count, depth):
    rng = np.random.default_rng(seed)
    for k in range(count):
        found = made(rng, depth)
        if len(found[0]) > 1:
            compared(*found, seed + k)


def test_random_joints():
    swept(0, 4, 1)


@pytest.mark.thorough
def test_more_random_joints():
    swept(100, 12, 2)


@pytest.mark.slow
def test_many_random_joints():
    swept(1000, 250, 2)
    swept(2000, 60, 3)


MEMBERS = {
    "normal": (lambda: chaospy.Normal(), "1"),
    "whole": (lambda: chaospy.Binomial(5, 0.4), "1"),
    "vector": (lambda: chaospy.MvNormal([0, 0], CORRELATION), "2"),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.thorough] if name in ("gumbel", "joe") else []) for name in COPULA],
)
def test_the_order_of_members_does_not_matter(name):
    """Each member has the values of its own uniform variables, wherever it stands, and is stored."""
    made_alone = {"copula": lambda: COPULA[name](chaospy.J(chaospy.Uniform(), chaospy.Gamma(2)))}
    made_alone |= {key: make for key, (make, _) in MEMBERS.items()}
    sizes = {"copula": 2, "normal": 1, "whole": 1, "vector": 2}
    first: dict[str, np.ndarray] = {}
    u = {key: np.random.default_rng(len(key)).uniform(size=(128, size)) for key, size in sizes.items()}
    for order in itertools.permutations(sizes):
        names = tuple(f"{key}{k}" for key in order for k in range(sizes[key]))
        variables = uqmbd.random_vector(names, chaospy.J(*(made_alone[key]() for key in order)))
        assert variables[0].joint.transform.text, order
        inputs = JointInput.of(variables)
        x = inputs.from_uniform(np.concatenate([u[key] for key in sorted(order)], axis=1))
        for key in order:
            own = x[:, [k for k, one in enumerate(inputs.names) if one.startswith(key)]]
            assert np.array_equal(first.setdefault(key, own), own), (order, key)


def test_means_of_joints_that_are_shifted_and_scaled():
    """The mean of a uniform variable from 0 to 2 is 1, as is that of a normal one about it."""
    for make, means in (
        (lambda joint: joint + 1, [2, 2]),
        (lambda joint: 2 * joint, [2, 2]),
        (lambda joint: -joint, [-1, -1]),
        (lambda joint: joint * [2, 3] - 1, [1, 2]),
    ):
        a = chaospy.Uniform(0, 2)
        variables = uqmbd.random_vector(("a", "b"), make(chaospy.J(a, chaospy.Normal(a, 1))))
        assert [v.mean for v in variables] == pytest.approx(means, rel=1e-12)


def test_copulas_of_whole_numbers_within_others():
    def inner():
        return chaospy.Nataf(chaospy.J(chaospy.Binomial(5, 0.5), chaospy.Normal()), CORRELATION)

    for distribution, count in ((inner() + 1, 2), (chaospy.J(inner(), chaospy.Uniform()), 3)):
        variables = uqmbd.random_vector(tuple("abc"[:count]), distribution)
        assert not variables[0].joint.transform.invertible


def test_a_copula_that_cannot_be_taken_apart_is_refused():
    """Arithmetic of two joint distributions is left to chaospy, whose copula of Student is none."""
    a = chaospy.Normal()
    copula = chaospy.TCopula(chaospy.J(chaospy.Uniform(), chaospy.Uniform()), 4, CORRELATION)
    with pytest.raises(uqmbd.StudyError, match=r"is not supported: conditional quantiles of .*TCopula.* are unknown"):
        uqmbd.random_vector(("a", "b", "c", "d"), chaospy.J(1 + chaospy.J(a, copula), chaospy.Normal(a, 1)))


def test_members_that_chaospy_loses_are_found_again():
    vectors = [chaospy.MvNormal([10 * k, 10 * k + 5], CORRELATION) for k in range(3)]
    whole = chaospy.Binomial(5, 0.4)
    for order in itertools.permutations([*vectors[:2], whole, chaospy.Normal(50)]):
        names = tuple(f"x{k:02d}" for k in range(6))
        means = [float(m) for one in order for m in np.ravel(chaospy.E(one))]
        variables = uqmbd.random_vector(names, chaospy.J(*order))
        assert [v.mean for v in variables] == pytest.approx(means)
    lost = chaospy.J(vectors[0], vectors[1], chaospy.Iid(chaospy.Normal(), 3), chaospy.Binomial(2, 0.5), vectors[2])
    try:
        found = uqmbd.random_vector(tuple(f"x{k:02d}" for k in range(10)), lost)
    except uqmbd.StudyError as error:
        assert "chaospy ignores members" in str(error)
    else:
        assert [v.mean for v in found] == pytest.approx([0, 5, 10, 15, 0, 0, 0, 1, 20, 25])


def test_a_whole_number_that_depends_on_nothing_has_a_germ_of_its_own():
    p = chaospy.Uniform(1, 2)
    members = {"p": p, "q": chaospy.Normal(p, 0.1), "n": chaospy.Binomial(3, 0.5)}
    for names in itertools.permutations(members):
        inputs = JointInput.of(uqmbd.random_vector(names, chaospy.J(*(members[name] for name in names))))
        space = GermSpace.of(inputs)
        u = np.random.default_rng(3).uniform(size=(64, 3))
        expected = scipy.stats.binom(3, 0.5).ppf(u[:, inputs.names.index("n")])
        families = dict(zip(inputs.names, (germ.family for germ in space.germs), strict=True))
        assert families == {"p": "legendre", "q": "hermite", "n": "discrete"}
        for one in (space, GermSpace.from_dataset(space.to_dataset())):
            x = one.to_inputs(one.from_uniform(u))
            assert np.abs(x[:, inputs.names.index("n")] - expected).max() < 1e-9
            assert np.abs(x - inputs.from_uniform(u)).max() < 1e-9


def test_a_whole_number_within_arithmetic_has_no_germ():
    p = chaospy.Uniform(1, 2)
    joint = 2 * chaospy.J(p, chaospy.Normal(p, 0.1), chaospy.Binomial(3, 0.5))
    with pytest.raises(uqmbd.StudyError, match="Input 'c', of .*, and is part of an expression of several variables"):
        GermSpace.of(JointInput.of(uqmbd.random_vector(("a", "b", "c"), joint)))


def test_bounds_hold_a_mixture():
    centres, covariances = [[-1, 0], [0, 10], [1, 0]], np.stack([0.01 * np.eye(2)] * 3)
    _, b = uqmbd.random_vector(("a", "b"), chaospy.GaussianMixture(centres, covariances))
    assert np.array_equal(b.joint.bounds, [[-np.inf, np.inf]] * 2)
