"""Subset simulation on sampled paths, against exactly discretised motions and a Gaussian closed form."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.linalg
from scipy.stats import norm

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, exponential_covariance
from uqmbd_reliability import Reliability
from uqmbd_reliability.path_splitting import split_paths
from uqmbd_springs import PointForce, SpringDamper

MASS, STIFFNESS, DAMPING, DEVIATION, CORRELATION = 1.0, 36.0, 2.4, 3.0, 0.5


def oscillator(stiffness=STIFFNESS, **options):
    """Mass on a spring with a random force; its position at rest is 1 m."""
    gust = RandomProcess(
        "gust", covariance=exponential_covariance(DEVIATION, CORRELATION), units="N", **({"cutoff": 8.0} | options)
    )
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=MASS, position=1.0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness, damping=DAMPING, free_length=1))
    mechanism.add(PointForce("push", body, 0, gust()))
    return mechanism, body


def first_passages(level, duration, count, step=0.005):
    """Return the share of exactly discretised motions from rest that pass a level."""
    rate = 1 / CORRELATION
    a = np.array([[0, 1, 0], [-STIFFNESS / MASS, -DAMPING / MASS, 1 / MASS], [0, 0, -rate]])
    noise = np.diag([0, 0, 2 * rate * DEVIATION**2])
    block = scipy.linalg.expm(step * np.block([[-a, noise], [np.zeros((3, 3)), a.T]]))
    transition = block[3:, 3:].T
    root, passed, each = np.linalg.cholesky(transition @ block[:3, 3:]), 0, 50_000
    for begin in range(0, count, each):
        generator = np.random.default_rng((9, begin))
        state = np.zeros((each, 3))
        state[:, 2] = DEVIATION * generator.standard_normal(each)
        ever = np.zeros(each, dtype=bool)
        for _ in range(round(duration / step)):
            state = state @ transition.T + generator.standard_normal((each, 3)) @ root.T
            ever |= state[:, 0] > level
        passed += int(ever.sum())
    return passed / count


def test_a_combined_path_is_the_weighted_sum_of_paths():
    mechanism, body = oscillator(length=20.0)
    mechanism.output("displacement", body.position[0] - 1, units="m")
    study = uqmbd.Study("s", mechanism, [0.0, 1.0, 2.0], [MonteCarlo(samples=2)], rtol=1e-9)
    problem = study.problem(study.propagators[0])
    plain = problem.realise(np.array([[0.2], [0.7]])).response[:, 0]
    keys, weights = np.array([[[0.2, 0.7, 0.4]]] * 2), np.array([[[0.8, 0.6, 0.0]], [[1.0, 0.0, 0.0]]])
    found = problem.realise(uqmbd.extend.combined_paths(np.array([[0.5], [0.5]]), keys, weights)).response[:, 0]
    np.testing.assert_allclose(found[0], 0.8 * plain[0] + 0.6 * plain[1], rtol=0, atol=1e-8)
    np.testing.assert_array_equal(found[1], plain[0])


@pytest.mark.thorough
def test_the_probability_of_a_gaussian_value_is_the_closed_form():
    """The integral of the displacement is normal; the deviation follows from the covariance of the states."""
    duration, ratio = 2.0, 2.5
    rate = 1 / CORRELATION
    a = np.array([[0, 1, 0, 0], [-STIFFNESS, -DAMPING, 1, 0], [0, 0, -rate, 0], [1, 0, 0, 0]])
    noise, begin = np.diag([0, 0, 2 * rate * DEVIATION**2, 0]), np.diag([0, 0, DEVIATION**2, 0])
    # Van Loan 1978
    block = scipy.linalg.expm(duration * np.block([[-a, noise], [np.zeros((4, 4)), a.T]]))
    transition = block[4:, 4:].T
    deviation = np.sqrt((transition @ (begin @ transition.T + block[:4, 4:]))[3, 3])
    mechanism, body = oscillator(length=20.0)
    mechanism.require("below", uqmbd.integral(body.position[0] - 1) <= float(ratio * deviation))
    method = Reliability(max_realisations=6000, seed=2, target_cov=0.3)
    data = uqmbd.Study("s", mechanism, [0.0, duration], [method]).run()["reliability/requirements"]
    low, high = data["interval"].values.ravel()
    assert low / 1.2 < norm.sf(ratio) < 1.2 * high and high < 4 * low


@pytest.mark.slow
def test_a_rare_first_passage_is_that_of_a_million_motions():
    level, duration = 0.45, 5.0
    expected = first_passages(level, duration, 1_000_000)
    mechanism, body = oscillator(length=20.0)
    mechanism.require("below", body.position[0] <= 1 + level)
    found = []
    for seed in range(8):
        method = Reliability(max_realisations=6000, seed=seed, target_cov=0.6)
        tree = uqmbd.Study("s", mechanism, np.linspace(0, duration, 11), [method]).run()
        data = tree["reliability/requirements"]
        low, high = data["interval"].values.ravel()
        found.append((float(data["violation_probability"].item()), low, high))
    probabilities = [x for x, _, _ in found]
    # Both means have an error: eight estimates, and a binomial share of a million motions.
    error = np.hypot(np.std(probabilities, ddof=1) / np.sqrt(len(found)), np.sqrt(expected / 1e6))
    assert np.mean(probabilities) == pytest.approx(expected, abs=3 * error) and error < 0.25 * expected
    # At least six of eight intervals of 95 % contain the probability, with a probability of 0.994.
    assert sum(low < expected < high for _, low, high in found) >= 6, (expected, found)


@pytest.mark.thorough
def test_paths_and_parameters_have_derivatives_by_parameters_only():
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(20, 40), units="N/m")
    mechanism, body = oscillator(stiffness, cutoff=4.0, length=10.0)
    mechanism.require("below", body.position[0] <= 1.25)
    times = np.linspace(0, 1, 5)
    tree, again = (
        uqmbd.Study("s", mechanism, times, [Reliability(max_realisations=600, seed=1, target_cov=1)]).run()
        for _ in range(2)
    )
    data = tree["reliability/requirements"].to_dataset()
    assert 0 < data["violation_probability"].item() < 0.5
    assert np.isfinite(data["probability_gradient"].sel(input="stiffness")).all()
    assert np.isnan(data["probability_gradient"].sel(input="gust")).all() and np.isnan(data["importance"]).all()
    assert data["violated_by"].values.ravel()[-1] == pytest.approx(data["violation_probability"].item())
    assert data.equals(again["reliability/requirements"].to_dataset())


@pytest.mark.parametrize(
    "options, text",
    [
        ({"method": "form"}, "which have no design points"),
        ({"surrogate": Collocation(order=2)}, "a surrogate is not possible"),
        ({}, "Set requirement= to one of below, above"),
    ],
)
def test_other_analyses_of_paths_are_refused(options, text):
    mechanism, body = oscillator(length=20.0)
    mechanism.require("below", body.position[0] <= 1.25)
    mechanism.require("above", body.position[0] >= 0.75)
    study = uqmbd.Study("s", mechanism, [0.0, 1.0], [Reliability(**options)])
    with pytest.raises(uqmbd.UqmbdError, match=text):
        study.run()


class FakeRuns:
    """Margins of a function of a standard normal point; some realisations fail, independently of it."""

    reason = "a limit of the test"

    def __init__(self, margin, share=0.0, seed=0):
        self.margin, self.share, self.count = margin, share, 0
        self.generator = np.random.default_rng((seed, 1))

    def __call__(self, points, terms):
        self.count += len(points)
        return self.margin(points[:, 0])[:, None], self.generator.uniform(size=len(points)) < self.share


class FakeSpace:
    """One standard normal input, and no process."""

    dimension, paths = 1, ()


def split(margin, *, share=0.0, seed=0, most=20_000):
    runs = FakeRuns(margin, share, seed)
    generator = np.random.default_rng(seed)
    return split_paths(runs, FakeSpace(), target=0.05, most=most, generator=generator)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
def test_failed_realisations_are_a_share_of_the_independent_states(share):
    """The probability is that of the others, and the upper limit includes all that failed."""
    found = [split(lambda x: 3 - x, share=share, seed=seed) for seed in range(10)]
    probabilities = [one.estimates[0].probability for one in found]
    deviation = np.std(probabilities, ddof=1) / np.sqrt(len(found))
    assert np.mean(probabilities) == pytest.approx(norm.sf(3.0), abs=4 * deviation)
    for one in found:
        assert np.mean(one.sampled.ratio) == pytest.approx(one.estimates[0].probability)
    assert sum(one.estimates[0].upper >= share for one in found) >= 8  # an upper limit of 97.5 %


def test_infinite_and_equal_margins_are_levels():
    """An event that seldom occurs has an infinite margin; rounded margins are equal."""
    seldom = split(lambda x: np.where(x > 1.5, 3 - x, np.inf))
    steps = split(lambda x: np.maximum(np.ceil(2 * (3 - x)), 0) / 2 - 1e-9)
    for one in (seldom, steps):
        estimate = one.estimates[0]
        assert estimate.lower < norm.sf(3.0) < estimate.upper < 2 * estimate.lower
    with pytest.raises(uqmbd.IntegrationError, match="all 1000 margins of a level are infinite; use MonteCarlo"):
        split(lambda x: np.full(len(x), np.inf))


def test_most_realisations_that_fail_are_an_error_with_the_reason():
    with pytest.raises(uqmbd.IntegrationError, match=r"\d+ of the first 1000 .*reason: a limit of the test"):
        split(lambda x: 3 - x, share=0.98)
    with pytest.raises(uqmbd.IntegrationError, match="needs more than the allowed 500 realisations"):
        split(lambda x: 6 - x, most=500)
