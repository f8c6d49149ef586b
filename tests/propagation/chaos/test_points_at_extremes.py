"""Verification points at extremes are those of a linear fit, for random polynomials of one to four germs."""

from __future__ import annotations

import functools

import chaospy
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.extend import GermSpace, VerificationPoints
from uqmbd.randomness import JointInput

DISTRIBUTIONS = {
    "normal": chaospy.Normal(0.4, 0.05),
    "uniform": chaospy.Uniform(-1, 3),
    "beta": chaospy.Beta(2, 3, 0, 4),
    "gamma": chaospy.Gamma(3, 0.5, shift=1),
    "triangle": chaospy.Triangle(0, 1, 3),
    "dice": chaospy.DiscreteUniform(1, 6),
}
SPACES = st.lists(st.sampled_from(sorted(DISTRIBUTIONS)), min_size=1, max_size=4).map(tuple)


@functools.cache
def space_of(names):
    """Return the germ space of independent inputs."""
    inputs = [uqmbd.RandomVariable(f"v{k}", DISTRIBUTIONS[name]) for k, name in enumerate(names)]
    return GermSpace.of(JointInput.of(inputs))


@st.composite
def polynomials(draw):
    """A germ space, germ points (K, d), and a random polynomial of them (K, O, T)."""
    space = space_of(draw(SPACES))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    degree, known = draw(st.integers(1, 3)), draw(st.integers(1, 60))
    outputs, times = draw(st.integers(1, 2)), draw(st.integers(1, 4))
    terms = space.basis(degree)
    coefficients = random.normal(size=(len(terms), outputs * times)) * 10.0 ** draw(st.integers(-6, 6))
    germs = uqmbd.extend.monte_carlo_rule(space, known, int(random.integers(1000)), "random").nodes
    response = (space.evaluate(germs, terms) @ coefficients).reshape(known, outputs, times)
    # differences that are rounding have no direction
    assume(known == 1 or (np.ptp(response, axis=0) > 1e-3 * np.abs(response).max(axis=0)).all())
    return space, germs, response


COUNTS, SEEDS = st.integers(1, 64), st.integers(0, 1000)


@pytest.mark.thorough
@settings(deadline=None, max_examples=30)
@given(case=polynomials(), count=COUNTS, seed=SEEDS)
def test_points_are_in_the_support_and_reproducible(case, count, seed):
    """Two points; they do not change if outputs are shifted, or scaled by a power of two."""
    space, germs, response = case
    ends = VerificationPoints.at_extremes(space, count, germs, response, seed, 7)
    assert ends.germs.shape == (2, space.dimension) and np.isfinite(ends.germs).all()
    for germ, own in zip(space.germs, ends.germs.T, strict=True):
        assert (own >= germ.bounds[0]).all() and (own <= germ.bounds[1]).all()
    assert np.isfinite(space.to_inputs(ends.germs)).all()
    assert (ends.weights > 0).all()
    again = VerificationPoints.at_extremes(space, count, germs.copy(), response.copy(), seed, 7)
    np.testing.assert_array_equal(again.germs, ends.germs)
    np.testing.assert_array_equal(again.weights, ends.weights)
    scaled = VerificationPoints.at_extremes(space, count, germs, 1024 * response, seed, 7)
    np.testing.assert_array_equal(scaled.germs, ends.germs)


@pytest.mark.thorough
@settings(deadline=None, max_examples=30)
@given(case=polynomials(), count=st.integers(8, 64), seed=SEEDS)
def test_a_linear_fit_is_extreme_at_the_points(case, count, seed):
    """Of 32 points for each verification point, one end has the largest value of the fit and one the smallest."""
    space, germs, response = case
    one = response[:, :1, :1]
    ends = VerificationPoints.at_extremes(space, count, germs, one, seed, 7)
    among = VerificationPoints.drawn(space, 32 * count, seed, 7).germs
    linear = np.eye(space.dimension, dtype=np.int64)
    basis, y = (values - values.mean(axis=0) for values in (space.evaluate(germs, linear), one[:, 0, 0]))
    # as many observations of a slope of zero as there are germs
    rows = np.concatenate([basis, np.sqrt(space.dimension) * linear])
    slopes = np.linalg.lstsq(rows, np.concatenate([y, np.zeros(space.dimension)]), rcond=None)[0]
    at, every = (space.evaluate(points, linear) @ slopes for points in (ends.germs, among))
    rounding = 1e-7 * np.abs(slopes).sum() * max(np.abs(every).max() / max(np.abs(slopes).sum(), 1e-300), 1)
    assert at.max() >= every.max() - rounding and at.min() <= every.min() + rounding


@pytest.mark.thorough
@settings(deadline=None, max_examples=30)
@given(names=SPACES, seed=SEEDS, count=st.integers(8, 64), slopes=st.lists(st.floats(0.2, 5), min_size=4, max_size=4))
def test_a_linear_surrogate_is_extreme_at_the_points(names, seed, count, slopes):
    """The range of a linear output at the two points is nearly that at 32 times as many points."""
    space = space_of(names)
    linear = np.eye(space.dimension, dtype=np.int64)

    def function(germs):
        return space.evaluate(germs, linear) @ slopes[: space.dimension]

    germs = uqmbd.extend.monte_carlo_rule(space, 200, seed, "sobol").nodes
    ends = VerificationPoints.at_extremes(space, count, germs, function(germs)[:, None, None], seed, 7)
    among = function(VerificationPoints.drawn(space, 32 * count, seed, 7).germs)
    assert np.ptp(function(ends.germs)) >= 0.95 * np.ptp(among)


@pytest.mark.thorough
@settings(deadline=None, max_examples=30)
@given(case=polynomials(), seed=SEEDS)
def test_errors_choose_the_output_whose_extremes_count(case, seed):
    """With an error of zero elsewhere the points are those of one output alone."""
    space, germs, response = case
    chosen = np.zeros(response.shape[1:])
    chosen[0, -1] = 0.5
    ends = VerificationPoints.at_extremes(space, 16, germs, response, seed, 7, chosen)
    alone = VerificationPoints.at_extremes(space, 16, germs, response[:, :1, -1:], seed, 7, np.array([[0.5]]))
    np.testing.assert_array_equal(ends.germs, alone.germs)
