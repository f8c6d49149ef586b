"""Random chains of conditional distributions against the same chains of scipy, value by value."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.stats

import uqmbd
from uqmbd.randomness import JointInput

ROOTS = {
    "uniform": (lambda a, b: chaospy.Uniform(a, a + b), lambda a, b: scipy.stats.uniform(a, b)),
    "triangle": (lambda a, b: chaospy.Triangle(a, a + b / 3, a + b), lambda a, b: scipy.stats.triang(1 / 3, a, b)),
    "gamma": (lambda a, b: a + chaospy.Gamma(2, b), lambda a, b: scipy.stats.gamma(2, a, b)),
    "beta": (lambda a, b: chaospy.Beta(2, 3, a, a + b), lambda a, b: scipy.stats.beta(2, 3, a, b)),
    "exponential": (lambda a, b: chaospy.Exponential(b, a), lambda a, b: scipy.stats.expon(a, b)),
    "cut": (
        lambda a, b: chaospy.Trunc(chaospy.Normal(a, b), a, a + 2 * b),
        lambda a, b: scipy.stats.truncnorm(0, 2, a, b),
    ),
    "whole": (lambda a, b: chaospy.DiscreteUniform(1, 4), lambda a, b: scipy.stats.randint(1, 5)),
    "count": (lambda a, b: 1 + chaospy.Binomial(4, 0.3), lambda a, b: scipy.stats.binom(4, 0.3, 1)),
}
"""Positive variables, by two positive numbers."""

CHILDREN = {
    "normal": (lambda x, b: chaospy.Normal(x, b), lambda x, b: scipy.stats.norm(x, b)),
    "spread": (lambda x, b: chaospy.Normal(b, x), lambda x, b: scipy.stats.norm(b, x)),
    "below": (lambda x, b: chaospy.Uniform(0, x), lambda x, b: scipy.stats.uniform(0, x)),
    "about": (lambda x, b: chaospy.Uniform(x - b, x + b), lambda x, b: scipy.stats.uniform(x - b, 2 * b)),
    "rate": (lambda x, b: chaospy.Exponential(x), lambda x, b: scipy.stats.expon(0, x)),
    "shape": (lambda x, b: chaospy.Gamma(1 + x, b), lambda x, b: scipy.stats.gamma(1 + x, 0, b)),
    "weibull": (lambda x, b: chaospy.Weibull(2, x), lambda x, b: scipy.stats.weibull_min(2, 0, x)),
    "lognormal": (
        lambda x, b: chaospy.LogNormal(0.1 * x, 0.3),
        lambda x, b: scipy.stats.lognorm(0.3, 0, np.exp(0.1 * x)),
    ),
    "logistic": (lambda x, b: chaospy.Logistic(1, x, b), lambda x, b: scipy.stats.logistic(x, b)),
    "laplace": (lambda x, b: chaospy.Laplace(x, b), lambda x, b: scipy.stats.laplace(x, b)),
    "arithmetic": (lambda x, b: 2 * chaospy.Normal(x, b) - x, lambda x, b: scipy.stats.norm(x, 2 * b)),
    "turned": (lambda x, b: b - x * chaospy.Normal(1, 0.2), None),
    "product": (lambda x, b: x * chaospy.Gamma(2, b), lambda x, b: scipy.stats.gamma(2, 0, x * b)),
    "square": (lambda x, b: chaospy.Normal(x**2, b), lambda x, b: scipy.stats.norm(x**2, b)),
    "cut": (
        lambda x, b: chaospy.Trunc(chaospy.Normal(0, b), -b, x),
        lambda x, b: scipy.stats.truncnorm(-1, x / b, 0, b),
    ),
    "chance": (lambda x, b: chaospy.Binomial(6, 0.1 + 0.1 * b), lambda x, b: scipy.stats.binom(6, 0.1 + 0.1 * b)),
    "pieces": (lambda x, b: chaospy.DiscreteUniform(0, 3) + x, None),
}
"""Conditional on a positive variable, by it and a positive number."""


def quantile_of(name, x, b, u):
    if name == "turned":  # falls with the normal variable
        return b - x * scipy.stats.norm(1, 0.2).ppf(1 - u)
    if name == "pieces":
        return x + scipy.stats.randint(0, 4).ppf(u)
    return CHILDREN[name][1](x, b).ppf(u)


def one_case(rng):
    """Two to five members, each conditional on a root, in a random order, with what scipy makes of the same numbers."""
    count = int(rng.integers(2, 6))
    roots = int(rng.integers(1, count))
    u = rng.uniform(1e-6, 1 - 1e-6, (64, count))
    members, values, words = [], [], []
    for k in range(count):
        a, b = rng.uniform(0.3, 2.0, 2)
        if k < roots:
            name = str(rng.choice(list(ROOTS)))
            members.append(ROOTS[name][0](a, b))
            values.append(ROOTS[name][1](a, b).ppf(u[:, k]))
        else:
            name, parent = str(rng.choice(list(CHILDREN))), int(rng.integers(0, roots))
            members.append(CHILDREN[name][0](members[parent], b))
            values.append(quantile_of(name, values[parent], b, u[:, k]))
        words.append(name)
    order = rng.permutation(count)
    joint = chaospy.J(*(members[k] for k in order))
    return joint, u[:, order], np.stack([values[k] for k in order], axis=1), [words[k] for k in order]


def compared(seed, count):
    rng, worst = np.random.default_rng(seed), 0.0
    for _ in range(count):
        joint, u, expected, words = one_case(rng)
        names = tuple(f"x{k}" for k in range(len(words)))
        variables = uqmbd.random_vector(names, joint)
        found = JointInput.of(variables).from_uniform(u)
        error = np.abs(found - expected).max(axis=0) / (np.abs(expected).max(axis=0) + np.ptp(expected, axis=0))
        assert error.max() < 1e-7, (words, error)
        worst = max(worst, float(error.max()))
    return worst


def test_chains_have_the_values_of_scipy():
    compared(0, 8)


@pytest.mark.slow
def test_many_chains_have_the_values_of_scipy():
    compared(1, 1500)


def means_compared(seed, count):
    """Means against a Sobol' sequence of scipy's values, within its error."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        joint, _, _, words = one_case(rng)
        names = tuple(f"x{k}" for k in range(len(words)))
        variables = uqmbd.random_vector(names, joint)
        u = np.clip(scipy.stats.qmc.Sobol(len(words), seed=3).random(2**12), 1e-9, 1 - 1e-9)
        x = JointInput.of(variables).from_uniform(u)
        means = np.array([v.mean for v in variables])
        assert (np.abs(x.mean(axis=0) - means) < 0.02 * x.std(axis=0)).all(), (words, means, x.mean(axis=0))


@pytest.mark.thorough
def test_means_of_chains():
    means_compared(2, 40)


@pytest.mark.slow
def test_means_of_many_chains():
    means_compared(3, 600)
