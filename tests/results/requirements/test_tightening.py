"""The probability of a violation with half the spread of one input is that of a study with half its spread."""

import chaospy
import numpy as np
import pytest
from scipy.stats import norm

import uqmbd
from uqmbd.results.requirements import tightened_probabilities
from uqmbd_collocation import Collocation

SIZES = ("one", "two", "three")


def part_of(*variables, weights, limit, order=1, two=False):
    """Return the requirements of a weighted sum of inputs that must not exceed a limit."""
    mechanism = uqmbd.Mechanism("stack", uqmbd.Planar())
    mechanism.body("part", mass=1, inertia=1)
    total = sum(w * v for w, v in zip(weights, variables, strict=True))
    mechanism.require("fits", total <= limit)
    if two:
        mechanism.require("reaches", total >= limit - 100.0)
    tree = uqmbd.Study("stack", mechanism, [0.0, 1.0], [Collocation(order=order, verify=16)]).run()
    return tree["collocation/requirements"]


def normal_sum(generator, **more):
    """Return a requirement on a sum of normal inputs, and its probabilities in closed form by the halved input."""
    means, stds = generator.uniform(1, 3, 3), generator.uniform(0.05, 0.3, 3)
    weights = generator.choice([-1.0, 1.0], 3) * generator.uniform(0.5, 2, 3)
    spread, middle = np.hypot.reduce(weights * stds), weights @ means
    limit = middle + generator.uniform(0.8, 2.2) * spread
    inputs = [
        uqmbd.RandomVariable(n, chaospy.Normal(m, s), units="m") for n, m, s in zip(SIZES, means, stds, strict=True)
    ]
    half = [np.hypot.reduce(weights * stds * np.where(np.arange(3) == k, 0.5, 1.0)) for k in range(3)]
    return part_of(*inputs, weights=weights, limit=limit, **more), norm.sf((limit - middle) / np.array(half))


@pytest.mark.thorough
def test_of_normal_sums_it_is_the_closed_form():
    generator = np.random.default_rng(3)
    inside, all_of = 0, 0
    for case in range(8):
        part, exact = normal_sum(generator, two=bool(case % 2))
        found = tightened_probabilities(part, "fits", SIZES)
        assert list(found) == list(SIZES)
        for name, value in zip(SIZES, exact, strict=True):
            one = found[name]
            assert one.lower <= one.probability <= one.upper
            assert one.probability == pytest.approx(value, abs=2e-4 + 0.02 * value)
            inside, all_of = inside + (one.lower <= value <= one.upper), all_of + 1
    assert inside == all_of


@pytest.mark.thorough
@pytest.mark.parametrize(
    "distribution",
    [chaospy.Uniform(1, 2), chaospy.LogNormal(0.1, 0.3), chaospy.TruncNormal(0.8, 1.4, 1.0, 0.2)],
)
def test_of_other_distributions_it_is_that_of_samples_about_the_same_mean(distribution):
    """The input is halved about its mean, in its units, whatever its distribution is."""
    one, two = uqmbd.RandomVariable("one", distribution), uqmbd.RandomVariable("two", chaospy.Normal(1, 0.1))
    x = np.asarray(distribution.sample(400_000, seed=5))
    y = np.random.default_rng(6).normal(1, 0.1, len(x))
    limit = float(np.quantile(x + y, 0.9))
    found = tightened_probabilities(part_of(one, two, weights=(1, 1), limit=limit, order=7), "fits", ["one"])["one"]
    exact = float(np.mean(x.mean() + 0.5 * (x - x.mean()) + y > limit))
    assert found.probability == pytest.approx(exact, abs=4e-3)


def test_a_factor_of_one_changes_nothing_and_unknown_names_are_left_out():
    part, _ = normal_sum(np.random.default_rng(1))
    (same,) = tightened_probabilities(part, "fits", ["one", "none"], 1.0).values()
    assert same.probability == pytest.approx(float(part["violation_probability"][0]), abs=3e-3)
    assert tightened_probabilities(part, "absent", ["one"]) == {}


def test_dependent_inputs_and_inputs_of_few_values_are_left_out():
    joint = uqmbd.random_vector(["one", "two"], chaospy.MvNormal([1, 1], [[0.04, 0.03], [0.03, 0.04]]))
    few = uqmbd.RandomVariable("three", chaospy.DiscreteUniform(1, 3))
    part = part_of(*joint, few, weights=(1, 1, 0.1), limit=2.6, order=2)
    assert tightened_probabilities(part, "fits", SIZES) == {}
