"""Paths of exactly discretised filters: their covariances against closed forms, and the same path in every call."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import interpolate, signal

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, exponential_covariance, iso8608, kanai_tajimi, stationary_std, white_noise
from uqmbd_processes.checks import LostVariance
from uqmbd_processes.paths.filters import FilterPaths
from uqmbd_springs import PointForce, SpringDamper

OSCILLATOR = ([[0.0, 1.0], [-9.0, -0.6]], [0.0, 2.0], [1.0, 0.0])
GUST = RandomProcess("gust", covariance=exponential_covariance(3.0, 0.5), units="N", cutoff=4.0, paths="filter")
FILTER = RandomProcess("filter", filter=OSCILLATOR, paths="filter")
GROUND = RandomProcess("ground", psd=kanai_tajimi(0.01, 15.6, 0.6), cutoff=50, paths="filter")
ALL = [GUST, FILTER, GROUND]


def values(process, keys, begin, end):
    """Arguments of knots, and paths (K, knots) there."""
    first, step, c = process.sample_paths([process], keys, begin, end)
    found = (c[:, 0, :-2] + 4 * c[:, 0, 1:-1] + c[:, 0, 2:]) / 6
    return first + step * np.arange(found.shape[1]), found


def exact_covariance(process, lags):
    a, b, c = process.shape.matrices
    stationary = scipy.linalg.solve_continuous_lyapunov(a, -np.outer(b, b))
    return np.array([c @ scipy.linalg.expm(a * abs(lag)) @ stationary @ c for lag in lags])


@pytest.mark.parametrize("process", ALL, ids=lambda x: x.name)
def test_the_covariance_between_knots_is_exact(process):
    """Four standard errors of 4,000 paths: between arguments before zero, at zero and after it."""
    step = math.pi / process.sampled_band[1]
    x, paths = values(process, np.random.default_rng(1).random(4000), -40 * step, 40 * step)
    zero = int(np.argmin(np.abs(x)))
    chosen = zero + np.array([-40, -20, -3, -1, 0, 1, 3, 20, 40])
    some = paths[:, chosen]
    products = some[:, :, None] * some[:, None, :]
    error = products.std(axis=0, ddof=1) / math.sqrt(len(paths))
    expected = exact_covariance(process, (x[chosen][:, None] - x[chosen]).ravel()).reshape(error.shape)
    assert (np.abs(products.mean(axis=0) - expected) < 4 * error).all()
    assert error.max() < 0.03 * process.variance


@pytest.mark.parametrize("process", ALL, ids=lambda x: x.name)
def test_the_discretisation_is_that_of_the_matrix_exponential(process):
    """Without sampling: the transitions, and the covariance that they preserve, forwards and backwards."""
    discretised = FilterPaths(process, process.shape)
    after, before, root = discretised.chains
    stationary = root @ root.T
    a, b, c = process.shape.matrices
    solved = scipy.linalg.solve_continuous_lyapunov(a, -np.outer(b, b))
    np.testing.assert_allclose(stationary, solved, rtol=1e-10, atol=1e-13 * solved.max())
    for chain in (after, before):
        basis = chain.first.conj().T
        transition = (basis @ chain.triangle @ chain.first).real
        noise = (basis @ chain.noise).real
        kept = transition @ stationary @ transition.T + noise @ noise.T
        scale = np.sqrt(np.diagonal(stationary))
        np.testing.assert_allclose(kept / scale / scale[:, None], stationary / scale / scale[:, None], atol=1e-12)
    ahead = (after.first.conj().T @ after.triangle @ after.first).real
    np.testing.assert_allclose(ahead, scipy.linalg.expm(a * discretised.step), rtol=1e-10, atol=1e-13 * np.abs(a).max())


@settings(max_examples=30, deadline=None)
@given(st.floats(-20, 20), st.floats(0, 5), st.integers(0, 10**6))
def test_a_path_is_the_same_in_every_interval(begin, length, seed):
    keys = np.random.default_rng(seed).random(3)
    first, step, whole = GUST.sample_paths([GUST], keys, -21, 26)
    start, _, part = GUST.sample_paths([GUST], keys[1:2], begin, begin + length)
    offset = round((start - first) / step)
    np.testing.assert_array_equal(part[0], whole[1, :, offset : offset + part.shape[2]])


def test_different_keys_and_names_are_independent():
    other = RandomProcess("other", covariance=exponential_covariance(3.0, 0.5), cutoff=4.0, paths="filter")
    keys = np.random.default_rng(2).random(2000)
    one, two = (values(p, keys, 0, 0)[1][:, 9] for p in (GUST, other))
    assert abs(np.corrcoef(one, two)[0, 1]) < 4 / math.sqrt(2000)
    assert abs(np.corrcoef(one[1:], one[:-1])[0, 1]) < 4 / math.sqrt(2000)


@pytest.mark.parametrize(
    "options, text",
    [
        ({"psd": iso8608("C", band=(0.01, 10.0)), "over": "distance"}, "has no shaping filter"),
        ({"psd": white_noise(1.0, sided="two", per="Hz")}, "white noise, which has no paths"),
        ({"psd": white_noise(1.0, sided="two", per="Hz", band=(0.0, 1.0))}, "paths='filter' is not possible"),
        ({"filter": OSCILLATOR, "length": 10.0}, "do not repeat; omit length="),
        ({"filter": OSCILLATOR, "coherence": lambda f, d: 1.0 + 0 * f}, "has a coherence"),
    ],
)
def test_processes_without_a_filter_are_refused(options, text):
    with pytest.raises(uqmbd.StudyError, match=text):
        RandomProcess("noise", paths="filter", **options)
    with pytest.raises(uqmbd.StudyError, match="expected 'harmonics', 'filter' or 'karhunen_loeve'"):
        RandomProcess("noise", filter=OSCILLATOR, paths="karhunen")
    with pytest.raises(uqmbd.StudyError, match="give the process a lower cutoff|Give the process a lower cutoff"):
        GUST.sample_paths([GUST], np.array([0.5]), 1e6, 1e6)


@pytest.mark.thorough
def test_motions_on_these_paths_have_the_stationary_deviation():
    """Four standard errors; the oscillator has forgotten its start after 4 s, to 1 %."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 36, damping=2.4, free_length=1))
    mechanism.add(PointForce("push", body, 0, GUST()))
    mechanism.output("position", body.position[0], units="m")
    mechanism.output("expected", stationary_std(body.position[0]), units="m")
    method = MonteCarlo(samples=400, seed=1)
    tree = uqmbd.Study("s", mechanism, np.linspace(0, 24, 41), [method]).run()
    node = tree["monte-carlo"]
    expected = node["scalars/statistics"]["mean"].item()
    late = node["statistics"].to_dataset().sel(output="position")["std"].values[10:]
    assert np.sqrt(np.mean(late**2)) == pytest.approx(expected, rel=0.03)


@pytest.mark.thorough
def test_the_change_of_a_variance_by_knots_is_stated():
    """An oscillator of 2 Hz under coarse knots: a long path of the spline through the knots, and Lyapunov's equation."""
    force = RandomProcess("force", covariance=exponential_covariance(3.0, 0.5), units="N", cutoff=1.2, paths="filter")
    stiffness, damping = (4 * math.pi) ** 2, 0.16 * math.pi
    mechanism = uqmbd.Mechanism("mass", uqmbd.Line())
    body = mechanism.body("body", mass=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness=stiffness, damping=damping))
    mechanism.add(PointForce("push", body, 0, force(uqmbd.t)))
    mechanism.output("x", body.position[0], units="m")
    system = np.array([[0.0, 1.0, 0.0], [-stiffness, -damping, 1.0], [0.0, 0.0, -2.0]])
    exact = scipy.linalg.solve_continuous_lyapunov(system, -np.diag([0.0, 0.0, 36.0]))[0, 0]
    (finding,) = LostVariance().find(uqmbd.Study("s", mechanism, [0.0, 1.0], [MonteCarlo(samples=2)]))
    stated = float(re.search(r"([\d.]+) % of 'x'", finding.text)[1]) / 100
    assert 0.1 < stated < 0.14 and "folded to lower frequencies" in finding.text
    first, step, c = force.sample_paths([force], np.array([0.3]), 0.0, 40_000.0)
    times = np.arange(10.0, 39_990.0, 0.02)
    path = interpolate.BSpline(first + step * np.arange(-2, c.shape[-1] + 2), c[0, 0], 3)(times)
    _, response, _ = signal.lsim(([1.0], [1.0, damping, stiffness]), path, times - times[0])
    assert response[2000:].var() / exact - 1 == pytest.approx(stated, abs=0.04)
