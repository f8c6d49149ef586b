"""Paths by Karhunen-Loeve expansions: the integral equation, covariances of paths, and what each output loses."""

from __future__ import annotations

import math
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, signal

import uqmbd
from uqmbd.testing import check_excitation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, davenport_coherence, exponential_covariance, kaimal, white_noise
from uqmbd_processes.checks import LostVariance
from uqmbd_processes.paths.karhunen_loeve import KarhunenLoevePaths, eigenfunctions
from uqmbd_springs import RadialTyre, SpringDamper

ROAD = exponential_covariance(0.01, 5.0)


def expanded(length, terms, name="road", covariance=ROAD, **options):
    options = {"over": "distance", "units": "m"} | options
    cutoff = terms / (2 * length)
    return RandomProcess(name, covariance=covariance, length=length, cutoff=cutoff, paths="karhunen_loeve", **options)


def expansion(process):
    """Eigenvalues and eigenfunctions (terms, points) of a process."""
    closed = process.covariance if process.covariance is ROAD else None
    return KarhunenLoevePaths(process, closed).expansion


def values(process, keys, begin, end):
    """Arguments of knots, and paths (K, knots) there."""
    first, step, c = process.sample_paths([process], np.asarray(keys), begin, end)
    found = (c[:, 0, :-2] + 4 * c[:, 0, 1:-1] + c[:, 0, 2:]) / 6
    return first + step * np.arange(found.shape[1]), found


def quarter_car(road):
    car = uqmbd.Mechanism("quarter_car", uqmbd.Line(gravity=-9.81))
    wheel, body = car.body("wheel", mass=40, position=0.3), car.body("body", mass=300, position=0.8)
    car.add(SpringDamper("suspension", wheel, body, 0, 0, stiffness=20e3, damping=1200, free_length=0.65))
    tyre = car.add(RadialTyre("tyre", car.ground, wheel, 0, road=road(20 * uqmbd.t), radius=0.32, stiffness=180e3))
    car.output("height", body.position[0], units="m")
    car.output("acceleration", body.acceleration[0], units="m/s^2")
    car.output("force", tyre.reaction_force[0], units="N")
    car.output("travel", body.position[0] - wheel.position[0], units="m")
    return car


EXACT = np.array([0.013065, 1.164689, 693.730, 0.009730])
"""Standard deviations of the outputs on the road, by Lyapunov's equation."""


def response(covariance, length, terms, times):
    """Return the variances (time, output) of the quarter car from rest, by hand-written equations for each term."""
    a = np.array([[0, 1, 0, 0], [-5000, -30, 500, 30], [0, 0, 0, 1], [200 / 3, 4, -200 / 3, -4]])
    c = np.array([[0, 0, 1, 0], [200 / 3, 4, -200 / 3, -4], [180e3, 0, 0, 0], [-1, 0, 1, 0]])
    system = (a, np.array([[0], [4500.0], [0], [0]]), c, np.array([[0.0], [0.0], [-180e3], [0.0]]))
    sizes, functions = eigenfunctions(covariance, length, terms, len(times) - 1)
    found = np.zeros((len(times), 4))
    for size, function in zip(sizes, functions, strict=True):
        found += size * signal.lsim(system, function, times)[1] ** 2
    return found


def stated(process):
    """Shares of the variance that the outputs of the quarter car lose."""
    (finding,) = LostVariance().find(uqmbd.Study("s", quarter_car(process), [0.0, 1.0], [MonteCarlo(samples=2)]))
    assert "are missing" in finding.message and "shares are means over the length" in finding.message
    return np.array([float(x) / 100 for x in re.findall(r"([\d.]+) % of '", finding.message)]), finding.message


def test_the_lost_share_is_part_of_the_assessment():
    """Without a share s of its variance, a standard deviation is too small by 1 - sqrt(1 - s)."""
    study = uqmbd.Study("s", quarter_car(expanded(40.0, 12)), [0.0, 1.0, 2.0], [MonteCarlo(samples=64, seed=1)])
    (finding,) = LostVariance().find(study)
    errors = dict(finding.hidden_errors)
    shares = stated(expanded(40.0, 12))[0]
    assert list(errors.values()) == pytest.approx(1 - np.sqrt(1 - shares), rel=0.05)
    with pytest.warns(uqmbd.StudyWarning, match="sampled paths"):
        assessed = uqmbd.results.assess(study.run())
    (acceleration,), (travel,) = assessed.of("acceleration"), assessed.of("travel")
    assert (acceleration.word, travel.word) == ("no", "no")
    assert "the stated error excludes 43 % of the standard deviation" in acceleration.reason
    assert "random process 'road'" in acceleration.reason


def test_a_share_without_a_linear_response_is_unknown():
    """The square of a displacement from its mean has no slope there, and the height of another body no paths."""
    car = quarter_car(expanded(40.0, 12))
    other = car.body("other", mass=1, position=1)
    car.add(SpringDamper("own", car.ground, other, 0, 0, stiffness=100, damping=1, free_length=1))
    height = car.bodies["body"].position[0]
    car.output("square", (height - 0.8) ** 2, units="m^2")
    car.output("apart", other.position[0], units="m")
    (finding,) = LostVariance().find(uqmbd.Study("s", car, [0.0, 1.0], [MonteCarlo(samples=2)], start="equilibrium"))
    errors = dict(finding.hidden_errors)
    assert "apart" not in errors
    assert math.isnan(errors["square"]) or errors["square"] > 0


@pytest.mark.parametrize("cutoff", [None, 5.0, 10.0])
def test_small_shares_of_a_road_are_known(cutoff):
    """Beyond 5 cycle/m, only the force of the undamped tyre, which follows the road, loses more than 1 %."""
    road = RandomProcess("road", covariance=ROAD, over="distance", units="m", cutoff=cutoff, length=40.0)
    (finding,) = LostVariance().find(uqmbd.Study("s", quarter_car(road), [0.0, 1.0], [MonteCarlo(samples=2)]))
    assert "unknown" not in finding.message
    errors = dict(finding.hidden_errors)
    assert errors.pop("force") < 0.02
    assert all(error < 1e-3 for error in errors.values())


def test_the_eigenfunctions_solve_the_integral_equation():
    """``int C(x - y) f(y) dy = l f(x)`` by adaptive quadrature, orthonormality, and the sum of the eigenvalues."""
    length, points = 20.0, 4000
    sizes, functions = eigenfunctions(ROAD, length, 3000, points)
    x = np.linspace(0.0, length, points + 1)
    for number in (0, 1, 2, 7, 12):
        for k in (0, 1300, 4000):
            integrand = ROAD(x - x[k]) * functions[number]
            found = sum(
                integrate.simpson(part, x=at) for part, at in ((integrand[: k + 1], x[: k + 1]), (integrand[k:], x[k:]))
            )
            assert found == pytest.approx(sizes[number] * functions[number, k], rel=1e-8, abs=1e-14)
    product = integrate.simpson(functions[:12, None] * functions[None, :12], x=x)
    np.testing.assert_allclose(product, np.eye(12), atol=1e-9)
    # the omitted ones: 2 c s^2 / w^2 with w = m pi / length
    rest = 2 / 5 * 1e-4 * (length / math.pi) ** 2 / 3000
    assert sizes.sum() + rest == pytest.approx(1e-4 * length, rel=1e-6)
    assert (np.diff(sizes) < 0).all() and (functions[:, 0] > 0).all()


@pytest.mark.parametrize("terms, error", [(12, 2e-4), (60, 1e-5)])
def test_nystroem_agrees_with_the_closed_form(terms, error):
    """The covariance has a corner: the error decreases with the number of points."""
    closed, other = expanded(100.0, terms), expanded(100.0, terms, covariance=lambda lag: 1e-4 * np.exp(-lag / 5))
    expected, functions = expansion(closed)
    found, approximate = expansion(other)
    assert np.abs(found - expected).sum() < error * expected.sum()
    assert np.abs(approximate[:terms] - functions[:terms]).max() < 0.01 * np.abs(functions).max()
    assert other.lost_variance == pytest.approx(closed.lost_variance, rel=1e-3)
    paths = [values(process, [0.3], 0, 100)[1][0, 9:-9] for process in (closed, other)]
    assert np.abs(paths[0] - paths[1]).max() < 1e-2 * 0.01


def test_nystroem_of_a_smooth_covariance_is_that_of_a_gauss_rule():
    process = expanded(20.0, 24, covariance=lambda lag: np.exp(-((lag / 2) ** 2)))
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x, root = 10 * (nodes + 1), np.sqrt(10 * weights)
    expected = np.linalg.eigvalsh(np.exp(-(((x[:, None] - x) / 2) ** 2)) * root * root[:, None])[::-1]
    np.testing.assert_allclose(expansion(process)[0][:24], expected[:24], atol=2e-4 * expected[0])
    assert process.lost_variance == pytest.approx(expected[24:].sum() / 20, abs=2e-6)


@pytest.mark.parametrize(
    "process, terms",
    [
        (expanded(40.0, 12), 12),
        (RandomProcess("wind", psd=kaimal(1.5, 340, 12), length=100.0, cutoff=0.5, paths="karhunen_loeve"), 100),
        (RandomProcess("noise", psd=white_noise(1, "one", "Hz", (1, 2)), length=20.0, paths="karhunen_loeve"), 80),
    ],
    ids=lambda x: x.name if isinstance(x, RandomProcess) else "",
)
def test_paths_have_the_covariance_of_the_terms(process, terms):
    """Four standard errors of 3,000 paths, and the variance that is not lost."""
    assert process.sampled_band[1] == pytest.approx(math.pi * terms / process.length)
    x, paths = values(process, np.random.default_rng(1).random(3000), 0, process.length)
    inside = slice(9, len(x) - 9)
    assert x[9] == 0 and x[-10] == pytest.approx(process.length)
    paths = paths[:, inside]
    sizes, functions = expansion(process)
    at = functions[:terms, ::2]
    expected = (at.T * sizes[:terms]) @ at
    chosen = np.linspace(0, len(expected) - 1, 7).astype(int)
    some = paths[:, chosen]
    products = some[:, :, None] * some[:, None, :]
    error = products.std(axis=0, ddof=1) / math.sqrt(len(paths))
    assert (np.abs(products.mean(axis=0) - expected[np.ix_(chosen, chosen)]) < 4 * error).all()
    mean = integrate.trapezoid(np.diagonal(expected)) / (len(expected) - 1)
    assert mean == pytest.approx(process.variance * (1 - process.lost_variance), rel=5e-3)


@settings(max_examples=30, deadline=None)
@given(st.floats(0, 40), st.floats(0, 40), st.integers(0, 10**6))
def test_a_path_is_the_same_in_every_interval(one, other, seed):
    process = expanded(40.0, 12)
    keys, (begin, end) = np.random.default_rng(seed).random(3), sorted((one, other))
    first, step, whole = process.sample_paths([process], keys, 0, 40)
    copy = pickle.loads(pickle.dumps(process))
    start, _, part = copy.sample_paths([copy], keys[1:2], begin, end)
    offset = round((start - first) / step)
    np.testing.assert_array_equal(part[0], whole[1, :, offset : offset + part.shape[2]])


def test_more_terms_refine_the_same_path():
    """The difference has the variance of the further terms: four standard errors of 400 paths."""
    coarse, fine = expanded(40.0, 11), expanded(40.0, 47)
    keys = np.random.default_rng(3).random(400)
    difference = values(fine, keys, 0, 40)[1][:, 9:-9][:, ::4] - values(coarse, keys, 0, 40)[1][:, 9:-9]
    square = np.square(difference).mean(axis=1)
    expected = (coarse.lost_variance - fine.lost_variance) * coarse.variance
    assert abs(square.mean() - expected) < 4 * square.std(ddof=1) / 20 + 0.01 * expected


def test_the_conformance_kit_accepts_an_expansion():
    check_excitation(expanded(300.0, 500, covariance=exponential_covariance(0.01, 20.0)), interval=(75, 225))


def test_twelve_terms_have_57_percent_of_the_acceleration():
    """The example of a road of 40 m; the tyre force has no limit, and has more omitted variance."""
    share, text = stated(expanded(40.0, 12))
    assert math.sqrt(1 - share[1]) == pytest.approx(0.57, abs=0.01)
    assert share[0] < 0.005 and share[2] > 0.85
    assert "0.15 cycle/m (12 terms) for 'road'" in text


@pytest.mark.thorough
@pytest.mark.parametrize("length", [20.0, 40.0])
def test_the_loss_of_each_output_is_that_of_all_terms(length):
    """Responses to 12 terms and to 240, by SciPy; the stated loss is a mean with the weight of Hann's window."""
    times = np.linspace(0.0, length / 20, 6001)
    window = np.square(np.sin(np.pi * times / times[-1]))
    kept, whole = (response(ROAD, length, terms, times) for terms in (12, 240))
    lost = (window[:, None] * (whole - kept)).sum(axis=0) / window.sum() / EXACT**2
    share, _ = stated(expanded(length, 12))
    # the force has 1.5 % of its variance in further terms; two digits are stated
    np.testing.assert_allclose(share, lost, rtol=0.06)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*sampled paths of random processes:uqmbd.StudyWarning")
def test_sampled_outputs_lose_the_stated_variance():
    """600 motions on 12 terms, from 0.8 s after the start: the mean variance, within 10 %."""
    process = expanded(40.0, 12)
    times, method = np.linspace(0, 2, 81), MonteCarlo(samples=600, seed=1)
    tree = uqmbd.Study("s", quarter_car(process), times, [method], start="equilibrium").run()
    found = tree["monte-carlo/statistics"]["std"].sel(output=["height", "acceleration", "force", "travel"])
    variance = np.square(found.transpose("time", "output").values[32:-4]).mean(axis=0)
    share, _ = stated(process)
    np.testing.assert_allclose(variance / EXACT**2, 1 - share, rtol=0.1)


@pytest.mark.parametrize(
    "make, text",
    [
        (lambda: RandomProcess("p", covariance=ROAD, paths="karhunen_loeve"), "give length=, the largest argument"),
        (
            lambda: RandomProcess(
                "p", psd=kaimal(1, 30, 9), coherence=davenport_coherence(10, 9), length=9.0, paths="karhunen_loeve"
            ),
            "has a coherence, which only paths of harmonics have",
        ),
        (lambda: values(expanded(40.0, 12), [0.5], -1, 3), "a path from -1 to 3 m was requested.* greater length="),
        (lambda: values(expanded(40.0, 12), [0.5], 1, 41), "between 0 and length=40 m"),
        (
            lambda: expanded(100.0, 600).lost_variance,
            "would have 600 terms .* cutoff=2.56 cycle/m, which has 512 terms",
        ),
    ],
)
def test_impossible_expansions_are_refused(make, text):
    with pytest.raises(uqmbd.StudyError, match=text):
        make()
