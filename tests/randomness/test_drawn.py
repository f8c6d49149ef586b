"""Rows of inputs that are no draws are found; sound draws of any design and distribution pass."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.stats
from scipy.stats import norm, qmc

import uqmbd
from uqmbd.extend import GermSpace, JointInput, gauss_tensor
from uqmbd.randomness import joint, why_not_drawn


def single(distribution):
    return JointInput.of([uqmbd.RandomVariable("a", distribution)])


def vector(distribution):
    return JointInput.of(uqmbd.random_vector(["v", "w"], distribution))


def joints():
    middle = chaospy.Uniform(1, 2)
    return {
        "normal": single(chaospy.Normal(3, 0.2)),
        "narrow": single(chaospy.Normal(1e6, 1e-7)),
        "truncated": single(chaospy.Trunc(chaospy.Normal(0, 1), -1, 1)),
        "arcsine": single(chaospy.Beta(0.3, 0.4)),
        "cauchy": single(scipy.stats.cauchy()),
        "whole numbers": single(chaospy.DiscreteUniform(0, 3)),
        "poisson": single(scipy.stats.poisson(2.5)),
        "correlated": vector(chaospy.MvNormal([0, 0], [[1, 0.6], [0.6, 1]])),
        "clayton": vector(chaospy.Clayton(chaospy.J(chaospy.Uniform(0, 1), chaospy.Normal(0, 1)), 2.0)),
        "chain": vector(chaospy.J(middle, chaospy.Gamma(middle, 2.0))),
    }


DESIGNS = {
    "random": lambda count, size, seed: np.random.default_rng(seed).random((size, count)),
    "sobol": lambda count, size, seed: qmc.Sobol(count, seed=seed).random_base2(int(np.log2(size))),
    "latin hypercube": lambda count, size, seed: qmc.LatinHypercube(count, seed=seed).random(size),
    "antithetic": lambda count, size, seed: np.concatenate(
        [u := np.random.default_rng(seed).random((size, count)), 1 - u]
    ),
}


@pytest.mark.thorough
@pytest.mark.parametrize("design", DESIGNS)
def test_sound_draws_pass(design):
    for name, inputs in joints().items():
        for seed, size in enumerate((1, 2, 4, 32, 128, 1024)):
            uniform = np.clip(DESIGNS[design](len(inputs), size, seed), 1e-12, 1 - 1e-12)
            assert why_not_drawn(inputs, inputs.from_uniform(uniform)) == "", (name, size)


def test_pick_freeze_rows_pass():
    """Each row of a first sample occurs again with one input from a second one."""
    inputs = JointInput.of([uqmbd.RandomVariable(name, chaospy.Normal(0, 1)) for name in "abcdef"])
    one, other = np.random.default_rng(1).random((2, 50, 6))
    rows = [one, other, *(np.where(np.arange(6) == k, other, one) for k in range(6))]
    assert why_not_drawn(inputs, inputs.from_uniform(np.concatenate(rows))) == ""


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["normal", "poisson", "clayton", "arcsine"])
def test_the_chance_of_a_false_alarm_is_at_most_the_stated_one(monkeypatch, name):
    """At a chance of 5 %, of 300 samples; three standard errors are 3.8 %."""
    monkeypatch.setattr(joint, "CHANCE", 0.05)
    inputs, rng = joints()[name], np.random.default_rng(7)
    count = sum(bool(why_not_drawn(inputs, inputs.from_uniform(rng.random((25, len(inputs)))))) for _ in range(300))
    assert count / 300 < 0.088


@pytest.mark.parametrize(
    ("name", "size"),
    [(name, size) for name in ("normal", "cauchy", "truncated") for size in (33, 1000)] + [("poisson", 300)],
)
def test_nodes_that_fill_the_space_are_found(name, size):
    """Whole numbers need more rows: their tails are atoms."""
    inputs = joints()[name]
    if name == "truncated":
        values = np.linspace(-3, 3, size)[:, None]  # partly outside of the support
    else:
        values = inputs.from_uniform(norm.cdf(np.linspace(-4, 4, size))[:, None])
    assert "'a'" in why_not_drawn(inputs, values)


def test_nodes_of_quadratures_and_repeated_rows_are_found():
    inputs = JointInput.of([uqmbd.RandomVariable(name, chaospy.Uniform(0, 1)) for name in "abc"])
    space = GermSpace.of(inputs)
    assert "occurs in 16 of 64 rows" in why_not_drawn(inputs, space.to_inputs(gauss_tensor(space, 4).nodes))
    assert "occurs in 9 of 9 rows" in why_not_drawn(inputs, np.full((9, 3), 0.5))
    assert why_not_drawn(inputs, np.empty((0, 3))) == ""


def test_draws_of_another_distribution_are_found():
    """Weighted draws, as those of an importance sampling, have the distribution of the proposal."""
    shifted = np.random.default_rng(3).normal(1.0, 1.0, (200, 1))
    assert "Kolmogorov" in why_not_drawn(single(chaospy.Normal(0, 1)), shifted)
    inputs = vector(chaospy.MvNormal([0, 0], [[1, 0.6], [0.6, 1]]))
    assert "'w'" in why_not_drawn(inputs, np.random.default_rng(3).normal(size=(2000, 2)))  # independent ones


@pytest.mark.parametrize("count", [30, 100, 800, 1500, 16384])
def test_the_limit_of_the_distance_is_that_of_scipy(count):
    """Samples of one input are rejected if the two-sided p-value is below 5e-10."""
    inputs = single(chaospy.Uniform(0, 1))
    places = (np.arange(count) + 0.5) / count
    for p, word in ((4.5e-10, "Kolmogorov"), (5.5e-10, "")):
        distance = scipy.stats.kstwo.isf(p, count)
        values = np.where(places > 1 - distance, 1 - distance + 1e-7 * places, places)
        # the last value is farthest from its share
        assert scipy.stats.ks_1samp(values, scipy.stats.uniform.cdf).statistic == pytest.approx(distance, abs=2e-7)
        found = why_not_drawn(inputs, values[:, None])
        assert word in found and bool(word) == bool(found)


@pytest.mark.parametrize("count", [100, 2000])
def test_the_limit_of_the_number_in_a_tail_is_that_of_scipy(count):
    """Four shares are tested, so that the limit is a quarter of 5e-10."""
    inputs = single(chaospy.Uniform(0, 1))
    share = 0.05
    limit = next(k for k in range(count) if 4 * scipy.stats.binom.sf(k - 1, count, share) < 5e-10)
    for many, word in ((limit, "tails"), (limit - 1, "")):
        tail = 1 - 0.012 * (np.arange(many) + 1) / many  # above 0.975, and below the next share
        rest = 0.03 + 0.94 * (np.arange(count - many) + 0.5) / (count - many)
        found = why_not_drawn(
            inputs, np.append(rest, np.minimum(tail, 0.994))[:, None] + 1e-6 * np.arange(count)[:, None] / count
        )
        assert word in found and bool(word) == bool(found)
