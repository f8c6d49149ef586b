"""Points in the tails, and their weights: together they give the means of the inputs' own distribution."""

from __future__ import annotations

import itertools
import math

import chaospy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.randomness import GermBox, GermSpace, JointInput, TailMixture, cumulated, index_set

FAMILIES = {
    "normal": chaospy.Normal(1, 2),
    "uniform": chaospy.Uniform(-1, 3),
    "beta": chaospy.Beta(2, 5),
    "gamma": chaospy.Gamma(2),
    "lognormal": chaospy.LogNormal(0, 0.3),
    "truncated": chaospy.TruncNormal(-1, 2, 0, 1),
    "dice": chaospy.DiscreteUniform(1, 6),
    "two values": chaospy.DiscreteUniform(0, 1),
    "counts": chaospy.Binomial(6, 0.3),
}


def space_of(*names: str) -> GermSpace:
    inputs = [uqmbd.RandomVariable(f"x{k}", FAMILIES[name]) for k, name in enumerate(names)]
    return GermSpace.of(JointInput.of(inputs))


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("half", [False, True])
def test_weighted_points_have_the_distribution_of_the_germ(name, half):
    """Distribution function by function of the library that draws nothing: of the whole germ, and of half of it."""
    space = space_of(name)
    if half:
        space = GermBox.whole(space).split(0)[1].local
    mixture = TailMixture(space)
    points = mixture.points(4096, seed=3)
    weights = mixture.weights(points)
    germ = space.germs[0]
    assert (points >= germ.bounds[0]).all() and (points <= germ.bounds[1]).all()
    assert 0 < weights.min() and weights.max() <= 2.0
    for level in np.quantile(points, [0.05, 0.2, 0.5, 0.8, 0.95]):
        assert (weights * (points[:, 0] <= level)).mean() == pytest.approx(cumulated(germ, level), abs=5e-3)


def moved(germ, values):
    """Densities (K, 6) of a germ at values: squares of its polynomials, up to four of the probit scale."""
    known = min(5, germ.highest_degree or 5)
    found = np.ones((len(values), 6))
    found[:, : known + 1] = germ.polynomials(values, known) ** 2
    if germ.values is not None:
        return found
    inside = math.erf(4 / math.sqrt(2))
    u = 0.5 + inside * (np.arange(200_000) + 0.5 - 100_000) / 200_000
    whole = inside * (germ.polynomials(germ.from_uniform(u), known) ** 2).mean(axis=0) + 1 - inside
    found[:, : known + 1] /= whole
    probit = np.abs(np.array([cumulated(germ, x) for x in values]) - 0.5) * 2
    found[probit > inside] = 1.0
    return found


@pytest.mark.thorough
@settings(deadline=None, max_examples=8)
@given(st.lists(st.sampled_from(sorted(FAMILIES)), min_size=2, max_size=4), st.integers(0, 99))
def test_weights_of_several_inputs_are_those_of_all_products(names, seed):
    """The density written out over all index sets; within what the constant cells allow."""
    space = space_of(*names)
    points = TailMixture(space).points(64, seed)
    squares = [moved(germ, points[:, k]) for k, germ in enumerate(space.germs)]
    degrees = index_set(len(names), 5)
    density = np.full(len(points), 0.5)
    for total in (2, 3, 4, 5):
        rows = degrees[degrees.sum(axis=1) == total]
        terms = [np.prod([squares[k][:, n] for k, n in enumerate(row)], axis=0) for row in rows]
        alone = [squares[k][:, total] for k in range(len(names))]
        density += 0.125 * (0.5 * np.mean(terms, axis=0) + 0.5 * np.mean(alone, axis=0))
    np.testing.assert_allclose(TailMixture(space).weights(points), 1 / density, rtol=0.1)


def test_means_of_products_are_exact_for_many_inputs():
    """Ten inputs: means of products of polynomials, which are known, from 16 replicates with their own scatter."""
    space = space_of(*["normal", "uniform"] * 5)
    mixture, terms = TailMixture(space), index_set(10, 1)
    found = []
    for seed in range(16):
        points = mixture.points(256, seed)
        basis = space.evaluate(points, terms)
        found.append((basis * mixture.weights(points)[:, None]).T @ basis / len(points))
    error = np.mean(found, axis=0) - np.eye(len(terms))
    assert np.abs(error / (np.std(found, axis=0, ddof=1) / 4 + 1e-12)).max() < 5.5
    assert np.abs(error).max() < 0.06


def test_every_polynomial_is_seen_alike_in_every_direction():
    """For normal germs the products of a degree depend on the distance only: turned points have the same weights."""
    mixture = TailMixture(space_of("normal", "normal"))
    radius = np.repeat([0.5, 1.5, 2.5], 90)
    angle = np.tile(np.linspace(0, 2 * np.pi, 90, endpoint=False), 3)
    weights = mixture.weights(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])).reshape(3, 90)
    turned = itertools.pairwise(weights.min(axis=1))
    assert all(outer < inner for inner, outer in turned)
    assert (weights.max(axis=1) / weights.min(axis=1)).max() < 4
