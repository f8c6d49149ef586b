"""The posterior as random variables has the moments and the dependence of the posterior."""

import chaospy
import numpy as np
import pytest
from scipy.stats import norm

import uqmbd
from uqmbd_calibration import Record, Series, calibrate
from uqmbd_calibration.result.marginals import CURVED, GRID, curvature, through_quantiles
from uqmbd_springs import SpringDamper


def oscillator(stiffness, mass=1.0):
    """Make a study of the frequency of a mass on a spring."""
    made = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = made.body("mass", mass=mass, position=1)
    made.add(SpringDamper("spring", made.ground, body, 0, 0, stiffness, free_length=1))
    made.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    return uqmbd.Study("oscillator", made)


def drawn(variables, count=20000):
    """Draw from random variables, (d, count)."""
    return np.atleast_2d(variables[0].joint.distribution.sample(count, seed=1))


def frequency(stiffness, mass=1.0):
    return np.sqrt(stiffness / mass) / (2 * np.pi)


@pytest.mark.thorough
def test_inputs_that_depend_a_priori_keep_their_spread():
    covariance = [[100.0, 0.8], [0.8, 0.01]]
    study = oscillator(*uqmbd.random_vector(["k", "m"], chaospy.MvNormal([100.0, 1.0], covariance), ["N/m", "kg"]))
    record = Record("tap test", [Series("frequency", [], [1.66, 1.67, 1.68], "Hz", noise=0.01)])
    k, m = np.meshgrid(np.linspace(60, 145, 1701), np.linspace(0.5, 1.5, 2001), indexing="ij")
    away = np.stack([k - 100, m - 1])
    prior = np.einsum("i...,ij,j...->...", away, np.linalg.inv(covariance), away)
    density = np.exp(-0.5 * prior - 0.5 * sum((frequency(k, m) - value) ** 2 for value in (1.66, 1.67, 1.68)) / 1e-4)
    density /= density.sum()
    mean = np.array([(density * x).sum() for x in (k, m)])
    sd = np.sqrt([(density * (x - at) ** 2).sum() for x, at in zip((k, m), mean, strict=True)])
    correlation = (density * (k - mean[0]) * (m - mean[1])).sum() / sd.prod()
    values = drawn(calibrate(study, record).variables())
    assert values.mean(axis=1) == pytest.approx(mean, abs=0.1 * sd.min(), rel=0.01)
    assert values.std(axis=1) == pytest.approx(sd, rel=0.06)
    assert np.corrcoef(values)[0, 1] == pytest.approx(correlation, abs=1e-3)
    assert frequency(*values).std() == pytest.approx(0.01 / np.sqrt(3), rel=0.2)


@pytest.mark.thorough
@pytest.mark.parametrize("truth", [60.0, 99.9])
def test_a_posterior_at_the_edge_of_its_prior_keeps_its_moments_and_the_edge(truth):
    study = oscillator(uqmbd.RandomVariable("k", chaospy.Uniform(60.0, 100.0), units="N/m"))
    record = Record("tap test", [Series("frequency", [], [frequency(truth)], "Hz", noise=0.01)])
    k = np.linspace(60, 100, 8001)
    density = norm.pdf(frequency(k), frequency(truth), 0.01)
    density /= density.sum()
    mean = (density * k).sum()
    sd = np.sqrt((density * (k - mean) ** 2).sum())
    (values,) = drawn(calibrate(study, record).variables())
    assert values.mean() == pytest.approx(mean, abs=0.08 * sd)
    assert values.std() == pytest.approx(sd, rel=0.06)
    assert 60.0 <= values.min() and values.max() <= 100.0


@pytest.mark.parametrize("bounds", [(-np.inf, np.inf), (0.0, np.inf), (-np.inf, 1.0), (0.0, 1.0)])
@pytest.mark.parametrize("count", [100, 4000])
def test_a_curve_through_quantiles_increases_and_stays_within_bounds(bounds, count):
    values = np.random.default_rng(0).beta(0.7, 3.0, count)
    table = through_quantiles(values, *bounds)
    assert np.all(np.diff(table) >= 0)
    assert bounds[0] <= table[0] and table[-1] <= bounds[1]
    # beyond ten draws from either end it goes on straight
    inside = np.linspace(0.12, 0.88, 19)
    away = np.interp(norm.ppf(inside), GRID, table) - np.quantile(values, inside)
    assert np.abs(away).max() < (0.3 if count == 100 else 0.03) * values.std()


@pytest.mark.parametrize("correlation", [-0.99, -0.4, 0.0, 0.45, 0.999])
def test_a_gaussian_copula_is_not_curved(correlation):
    covariance = [[1.0, correlation], [correlation, 1.0]]
    normal = np.random.default_rng(0).multivariate_normal([0.0, 0.0], covariance, 1000)
    assert curvature(normal).max() < 0.7 * CURVED


def test_a_crescent_and_a_ring_are_curved():
    generator = np.random.default_rng(0)
    x = generator.standard_normal(4000)
    angle = 2 * np.pi * generator.random(4000)
    for pair in ((x, -(x**2) + 0.1 * generator.standard_normal(4000)), (np.cos(angle), np.sin(angle))):
        ranks = np.argsort(np.argsort(np.stack(pair, axis=1), axis=0), axis=0)
        assert curvature(norm.ppf((ranks + 0.5) / 4000))[0, 1] > 1.2 * CURVED


@pytest.mark.slow
def test_variables_of_a_crescent_warn():
    x = uqmbd.RandomVariable("x", chaospy.Normal(0.0, 1.0))
    offset = uqmbd.RandomVariable("offset", chaospy.Normal(30.0, 2.0), units="N/m")
    record = Record("tap test", [Series("frequency", [], [frequency(31.0)], "Hz", noise=0.01)])
    found = calibrate(oscillator(offset + 2 * x**2), record)
    with pytest.warns(uqmbd.StudyWarning, match="posterior of (offset and x|x and offset) is curved"):
        found.variables()
    assert len(found.variables(inputs=["x"])) == 1
