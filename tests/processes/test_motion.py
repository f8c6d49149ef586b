"""Motions of mechanisms with sampled paths, against the stationary response, closed forms and exact discretisation."""

from __future__ import annotations

import tracemalloc

import chaospy
import numpy as np
import pytest
import scipy.linalg
import sympy

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import (
    CommonPaths,
    PowerSpectralDensity,
    RandomProcess,
    common_paths,
    crossing_rate,
    exponential_covariance,
    iso8608,
    stationary_std,
    white_noise,
)
from uqmbd_processes.common_paths import statistics_of_paths
from uqmbd_springs import PointForce, RadialTyre, SpringDamper

MASS, STIFFNESS, DAMPING = 1.0, 36.0, 2.4
CORRELATION = 0.5
"""Correlation time of the force, s."""

FIRST_PASSAGES = 16_000
"""Number of motions of the first passage."""


def force(**options):
    return RandomProcess("gust", covariance=exponential_covariance(3.0, CORRELATION), units="N", **options)


def oscillator(process, damping=DAMPING):
    """Mass on a spring with a random force; its position at rest is 1 m."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=MASS, position=1.0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, STIFFNESS, damping=damping, free_length=1))
    mechanism.add(PointForce("push", body, 0, process()))
    return mechanism, body


def run(mechanism, samples, times, **options):
    return uqmbd.Study("s", mechanism, times, [MonteCarlo(samples=samples, seed=7, **options)]).run()["monte-carlo"]


@pytest.mark.thorough
def test_sampled_motions_have_the_stationary_deviation():
    mechanism, body = oscillator(force(cutoff=20.0))
    for name, expression in (("position", body.position[0]), ("velocity", body.velocity[0])):
        mechanism.output(name, expression)
        mechanism.output(f"deviation_of_{name}", stationary_std(expression))
    times = np.concatenate([[0.0], np.arange(6.0, 14.0)])
    node = run(mechanism, 800, times)
    found = node["samples"]["response"].values[:, :, 1:].std(axis=2, mean=np.array([1.0, 0.0])[None, :, None])
    found = np.sqrt(np.square(found).mean(axis=0))
    expected = node["scalars/statistics"]["mean"].values
    # eight times a second apart are almost independent; four standard errors
    assert np.abs(found / expected - 1).max() < 4 / np.sqrt(2 * 800 * 6)


def discretised(levels, times, step, count, seed, *, stationary=False):
    """Return exceedances (level, time) and upward crossings per s (level,) of exactly discretised motions.

    A motion begins at rest, or in the stationary state, and counts as exceeded from the first passage of a level on.
    """
    rate = 1 / CORRELATION
    a = np.array([[0, 1, 0], [-STIFFNESS / MASS, -DAMPING / MASS, 1 / MASS], [0, 0, -rate]])
    noise = np.zeros((3, 3))
    noise[2, 2] = 2 * rate * 3.0**2
    # Van Loan 1978: transition and covariance of a step
    block = scipy.linalg.expm(step * np.block([[-a, noise], [np.zeros((3, 3)), a.T]]))
    transition = block[3:, 3:].T
    root = np.linalg.cholesky(transition @ block[:3, 3:])
    exceeded, crossings, each = np.zeros((len(levels), len(times))), np.zeros(len(levels)), 50_000
    for begin in range(0, count, each):
        generator = np.random.default_rng((seed, begin))
        state = np.zeros((each, 3))
        state[:, 2] = 3.0 * generator.standard_normal(each)
        if stationary:
            start = np.linalg.cholesky(scipy.linalg.solve_continuous_lyapunov(a, -noise))
            state = generator.standard_normal((each, 3)) @ start.T
        ever = np.zeros((len(levels), each), dtype=bool)
        for number in range(1, round(times[-1] / step) + 1):
            before = state[:, 0]
            state = state @ transition.T + generator.standard_normal((each, 3)) @ root.T
            for k, level in enumerate(levels):
                above = state[:, 0] > level
                ever[k] |= above
                crossings[k] += np.count_nonzero(above & (before <= level))
            for i in np.flatnonzero(np.abs(times - number * step) < step / 2).tolist():
                exceeded[:, i] += ever.sum(axis=1)
    return exceeded / count, crossings / count / times[-1]


@pytest.mark.slow
def test_first_passage_probability():
    """Probability that a level is exceeded at any time before, against 1,000,000 exactly discretised motions."""
    levels, times = [0.2, 0.25, 0.3], np.linspace(0, 10.0, 21)
    mechanism, body = oscillator(force(cutoff=30.0))
    for level in levels:
        mechanism.require(f"below {level}", body.position[0] <= 1.0 + level)
    node = run(mechanism, FIRST_PASSAGES, times)
    names = [f"below {level}" for level in levels]
    found = node["requirements"]["violated_by"].sel(requirement=names).transpose("requirement", "time").values
    expected, _ = discretised(levels, times, 0.005, 1_000_000, 3)
    assert 0.05 < expected[-1, -1] < 0.3 and expected[0, -1] > 0.5
    error = np.sqrt(expected * (1 - expected) * (1 / FIRST_PASSAGES + 1e-6))
    # crossings between the steps of the reference add up to 0.002
    assert (np.abs(found - expected) <= 4 * error + 0.002).all(), (found, expected)


@pytest.mark.slow
def test_the_crossing_rate_is_that_of_a_million_motions():
    levels = [0.0, 0.1, 0.2, 0.3]
    mechanism, body = oscillator(force())
    for number, level in enumerate(levels):
        mechanism.output(f"rate {number}", crossing_rate(body.position[0], 1.0 + level), units="1/s")
    found = uqmbd.simulate(mechanism, [0, 1])
    _, expected = discretised(levels, np.array([1.0]), 0.005, 1_000_000, 5, stationary=True)
    # at most 1.2 crossings per s: the variance of the number is below its mean
    error = np.sqrt(expected / 1_000_000)
    rates = np.array([float(found[f"rate {number}"]) for number in range(len(levels))])
    assert (np.abs(rates / expected - 1) <= 4 * error / expected + 2e-3).all(), (rates, expected)


@pytest.mark.slow
def test_the_split_of_the_variance_is_that_of_the_closed_form():
    """The square of the position x: given the damping, x is normal with the variance s(damping)."""
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 6.0), units="N s/m")
    mechanism, body = oscillator(force(cutoff=20.0), damping)
    mechanism.output("square", (body.position[0] - 1) ** 2, units="m^2")
    node = run(mechanism, 8000, [0.0, 14.0], sobol_indices=True)
    shares = node["statistics"]["variance_share"].sel(output="square").values[:, 1]
    ends = node["statistics"]["variance_share_interval"].sel(output="square").values[:, :, 1]
    nodes, weights = np.polynomial.legendre.leggauss(20)
    values = 3.25 + 2.75 * nodes
    rate = 1 / CORRELATION
    noise = np.diag([0, 0, 2 * rate * 3.0**2])
    a = [np.array([[0, 1, 0], [-STIFFNESS, -c, 1], [0, 0, -rate]]) for c in values]
    variance = np.array([scipy.linalg.solve_continuous_lyapunov(x, -noise)[0, 0] for x in a])
    mean, square = weights @ variance / 2, weights @ variance**2 / 2
    expected = (square - mean**2) / (3 * square - mean**2)
    half = (ends[1, 0] - ends[0, 0]) / 2
    assert half < 0.12
    assert abs(shares[0] - expected) < 2 * half, (shares, expected, half)
    np.testing.assert_allclose(shares.sum(), 1.0, atol=1e-9)


def test_the_variance_is_split_with_one_and_with_several_processes():
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 6.0), units="N s/m")
    times = [0.0, 1.0, 2.0]
    for second in (False, True):
        mechanism, body = oscillator(force(cutoff=5.0), damping)
        if second:
            other = RandomProcess("wave", covariance=exponential_covariance(1.0, 1.0), units="N", cutoff=5.0)
            mechanism.add(PointForce("second", body, 0, other()))
        mechanism.output("position", body.position[0], units="m")
        node = run(mechanism, 64, times, sobol_indices=True)
        data = node["statistics"]
        assert data["origin"].values.tolist() == ["parameters", "paths", "both"]
        np.testing.assert_allclose(data["variance_share"].sum("origin").values[0, 1:], 1.0, atol=1e-9)
        assert node.attrs["realisations"] == 64 + 32 * (4 if second else 2)
        if not second:
            paths = data["variance_share"].sel(origin="paths")
            np.testing.assert_array_equal(paths, data["sobol_first"].sel(input="gust"))


def test_a_delayed_wheel_has_the_same_path():
    """Two wheels on one road: the second moves as the first did 0.1 s before."""
    road = RandomProcess("road", psd=iso8608("C", band=(0.05, 2.0)), over="distance", units="m")
    mechanism = uqmbd.Mechanism("wheels", uqmbd.Line(gravity=-9.81))
    for name, offset in (("front", 0.0), ("rear", -2.0)):
        wheel = mechanism.body(name, mass=40, position=0.3)
        path = road(20 * uqmbd.t + offset)
        mechanism.add(
            RadialTyre(f"tyre_{name}", mechanism.ground, wheel, 0, road=path, radius=0.32, stiffness=2e4, damping=2e3)
        )
        mechanism.output(name, wheel.position[0], units="m")
    node = run(mechanism, 4, np.linspace(0, 3, 61))
    front, rear = np.moveaxis(node["samples"]["response"].values, 1, 0)
    np.testing.assert_allclose(rear[:, 42:], front[:, 40:-2], atol=2e-5)
    assert np.ptp(front) > 1e-3


def test_the_loss_of_each_output_is_that_of_the_limited_spectrum():
    limit = 2.0
    process = force(cutoff=limit)
    mechanism, body = oscillator(process)
    mechanism.output("position", body.position[0], units="m")
    mechanism.output("acceleration", body.acceleration[0], units="m/s^2")
    study = uqmbd.Study("s", mechanism, [0.0, 1.0], [MonteCarlo(samples=2)])
    (finding,) = [x for x in uqmbd.findings(study) if "sampled paths" in x.message]
    found = []
    for band in ((0.0, limit), (0.0, np.inf)):
        density = PowerSpectralDensity(lambda f: process.two_sided(2 * np.pi * f) * 2 * np.pi, "two", "Hz", band)
        other, body = oscillator(RandomProcess("gust", psd=density, units="N"))
        other.output("position", stationary_std(body.position[0]))
        other.output("acceleration", stationary_std(body.acceleration[0]))
        values = uqmbd.simulate(other, [0.0, 1.0])
        found.append([float(values[name]) ** 2 for name in ("position", "acceleration")])
    lost = 1 - np.divide(*found)
    stated = [
        float(part.split(" %")[0].split()[-1]) / 100 for part in finding.message.split("at the means by")[1].split(",")
    ]
    np.testing.assert_allclose(stated, lost, rtol=0.06)
    assert finding.severity is uqmbd.extend.Severity.WARNING


def test_the_loss_of_requirements_and_summaries_is_stated():
    def finding(declare):
        mechanism, body = oscillator(force(cutoff=2.0))
        declare(mechanism, body)
        study = uqmbd.Study("s", mechanism, [0.0, 1.0], [MonteCarlo(samples=2)])
        (found,) = [x for x in uqmbd.findings(study) if "sampled paths" in x.message]
        return found.message

    expected = finding(lambda m, body: m.output("x", body.acceleration[0])).split("at the means by ")[1]
    for declare in (
        lambda m, body: m.require("x", body.acceleration[0] <= 20),
        lambda m, body: m.require("x", uqmbd.maximum(body.acceleration[0]) <= 20),
        lambda m, body: m.output("x", uqmbd.maximum(body.acceleration[0]) * uqmbd.minimum(body.position[0])),
        lambda m, body: m.output("x", uqmbd.first_time(body.acceleration[0] > 20)),
    ):
        assert finding(declare).split("at the means by ")[1] == expected


def test_a_lower_cutoff_with_its_loss_is_suggested():
    """The suggested cutoff is accepted, and its loss is that of the suggestion."""

    def finding(cutoff):
        mechanism, body = oscillator(force(cutoff=cutoff))
        mechanism.output("position", body.position[0], units="m")
        study = uqmbd.Study("s", mechanism, [0.0, 1.0], [MonteCarlo(samples=2)])
        (found,) = [x for x in uqmbd.findings(study) if "sampled paths" in x.message]
        return found

    remedy = finding(200.0).remedy
    cutoff = float(remedy.split("with ")[1].split(" Hz")[0])
    suggested = float(remedy.split("more than ")[1].split(" %")[0])
    assert 2.0 < cutoff < 15.0 and 0.001 <= suggested <= 0.1
    stated = finding(cutoff).message.split("at the means by ")[1].split(" of ")[0]
    share = 0.001 if stated.startswith("below") else float(stated.removesuffix(" %"))
    # the cutoff is rounded up
    assert 0.7 * suggested <= share <= 1.01 * suggested
    assert finding(0.8).remedy.startswith("Give the process a higher cutoff")


def test_white_noise_has_no_path():
    noise = RandomProcess("noise", psd=white_noise(1.0, "two", "Hz"), units="N")
    mechanism, body = oscillator(noise)
    mechanism.output("position", body.position[0], units="m")
    with pytest.raises(uqmbd.StudyError, match=r"'noise'.*no finite variance, like white noise.*band="):
        run(mechanism, 4, [0.0, 1.0])


def test_a_path_does_not_repeat_within_a_motion():
    mechanism, body = oscillator(force(cutoff=20.0, length=5.0))
    mechanism.output("position", body.position[0], units="m")
    with pytest.raises(uqmbd.StudyError, match=r"repeat after 5 s; write length=\d"):
        run(mechanism, 4, [0.0, 6.0])


def test_two_processes_of_one_name_are_refused():
    mechanism, body = oscillator(force(cutoff=20.0))
    other = RandomProcess("gust", covariance=exponential_covariance(1.0, 1.0), units="N", cutoff=5.0)
    mechanism.add(PointForce("second", body, 0, other()))
    mechanism.output("position", body.position[0], units="m")
    with pytest.raises(uqmbd.StudyError, match=r"two different random processes have the name 'gust'"):
        run(mechanism, 4, [0.0, 1.0])


def squared(damping):
    mechanism, body = oscillator(force(cutoff=10.0), damping)
    mechanism.output("square", (body.position[0] - 1) ** 2, units="m^2")
    mechanism.output("position", body.position[0], units="m")
    return mechanism


def stationary_variances(values):
    rate = 1 / CORRELATION
    noise = np.diag([0, 0, 2 * rate * 3.0**2])
    a = [np.array([[0, 1, 0], [-STIFFNESS, -c, 1], [0, 0, -rate]]) for c in values]
    return np.array([scipy.linalg.solve_continuous_lyapunov(x, -noise)[0, 0] for x in a])


@pytest.mark.thorough
def test_common_paths_have_the_moments_and_shares_of_the_closed_form():
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 6.0), units="N s/m")
    study = uqmbd.Study("s", squared(damping), [0.0, 14.0], [CommonPaths(order=5, paths=150)])
    data = study.run()["common-paths/statistics"].to_dataset().isel(time=1)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    variance = stationary_variances(3.25 + 2.75 * nodes)
    mean, square = weights @ variance / 2, weights @ variance**2 / 2
    expected = {"square": np.sqrt(3 * square - mean**2), "position": np.sqrt(mean)}
    for name, std in expected.items():
        one = data.sel(output=name)
        assert abs(float(one["std"]) - std) < 4 * float(one["std_error_std"]) < 0.6 * std
        assert float(one["stated_error"]) < 0.1 * std
    low, high = data["variance_share_interval"].sel(output="square", origin="parameters").values
    assert high - low < 0.1
    share = (square - mean**2) / (3 * square - mean**2)
    assert low - (high - low) / 2 < share < high + (high - low) / 2


def test_jackknife_intervals_of_common_paths_cover_the_shares():
    """Coefficients are drawn directly: shares and standard deviations are known."""
    generator = np.random.default_rng(5)
    axes = uqmbd.extend.labels([("y", "m")], [], [0.0, 1.0])
    means, stds = np.array([1.0, 0.6, 0.3]), np.array([0.8, 0.4, 0.2])
    parts = np.array([(means[1:] ** 2).sum(), stds[0] ** 2, (stds[1:] ** 2).sum()])
    held = np.zeros(4)
    for _ in range(400):
        c = (means + stds * generator.standard_normal((40, 3)))[:, :, None, None] * np.ones((1, 2))
        data = statistics_of_paths(axes, c, np.zeros((40, 1, 2))).isel(output=0, time=0)
        low, high = data["variance_share_interval"].values
        held[:3] += (low <= parts / parts.sum()) & (parts / parts.sum() <= high)
        std, error = float(data["std"]), float(data["std_error_std"])
        held[3] += abs(std - np.sqrt(parts.sum())) <= 2.02 * error
    assert (held / 400 > 0.9).all(), held / 400


def test_common_paths_need_paths_and_parameters():
    mechanism, body = oscillator(force(cutoff=20.0))
    mechanism.output("position", body.position[0], units="m")
    with pytest.raises(uqmbd.StudyError, match="random processes, but no other random inputs; use MonteCarlo"):
        uqmbd.Study("s", mechanism, [0.0, 1.0], [CommonPaths()]).run()
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 6.0), units="N s/m")
    mechanism, body = oscillator(force(cutoff=20.0), damping)
    mechanism.output("deviation", stationary_std(body.position[0]), units="m")
    with pytest.raises(uqmbd.StudyError, match="do not depend on sampled paths"):
        uqmbd.Study("s", mechanism, [0.0, 1.0], [CommonPaths()]).run()


def random_damping():
    return uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 6.0), units="N s/m")


def test_an_output_that_does_not_vary_has_no_shares():
    mechanism, body = oscillator(force(cutoff=5.0), random_damping())
    mechanism.output("position", body.position[0], units="m")
    mechanism.output("shifted", body.position[0] + 0.1, units="m")
    methods = [MonteCarlo(samples=64, seed=1, sobol_indices=True), CommonPaths(order=2, paths=8)]
    tree = uqmbd.Study("s", mechanism, [0.0, 1.0], methods).run()
    for label in ("monte-carlo", "common-paths"):
        data = tree[label]["statistics"]
        for name in ("variance_share", "variance_share_interval"):
            np.testing.assert_array_equal(data[name].isel(time=0), 0.0)
        np.testing.assert_allclose(data["variance_share"].sum("origin").isel(time=1), 1.0, atol=1e-9)


def failing(low):
    """The root of a number that is negative on some paths."""
    mechanism, body = oscillator(force(cutoff=5.0), random_damping())
    mechanism.output("root", sympy.sqrt(body.position[0] - low), units="m^0.5")
    return mechanism


def test_common_paths_report_omitted_paths():
    with pytest.warns(UserWarning, match=r"\d+ of 40 paths have a failed realisation.*conditional.*'root'"):
        study = uqmbd.Study("s", failing(0.8), [0.0, 1.0, 2.0], [CommonPaths(order=2, paths=40)])
        node = study.run()["common-paths"]
    assert 0 < node.attrs["omitted_paths"] < 20 and node.attrs["failures"] >= node.attrs["omitted_paths"]
    method = CommonPaths(order=2, paths=40, max_failures=0.01)
    with pytest.raises(uqmbd.IntegrationError, match=r"of 40 paths have a failed.*max_failures = 0.01.*'root'"):
        uqmbd.Study("s", failing(0.8), [0.0, 1.0, 2.0], [method]).run()
    with pytest.raises(uqmbd.StudyError, match="paths is 7"):
        CommonPaths(paths=7)


def test_an_output_that_does_not_always_occur_has_no_polynomials():
    mechanism, body = oscillator(force(cutoff=5.0), random_damping())
    mechanism.output("first", uqmbd.first_time(body.position[0] > 1.08))
    mechanism.output("largest", uqmbd.maximum(body.position[0]))
    with pytest.warns(uqmbd.StudyWarning, match=r"output 'first' has no statistics.*Use a sampling method"):
        tree = uqmbd.Study("s", mechanism, [0.0, 3.0], [CommonPaths(order=2, paths=8)]).run()
    data = tree["common-paths/scalars/statistics"]
    assert np.isnan(data["std_error_std"].sel(output="first")).all() and np.isfinite(data["std"].sel(output="largest"))


def test_common_paths_refuse_requirements():
    mechanism, body = oscillator(force(cutoff=5.0), random_damping())
    mechanism.output("position", body.position[0], units="m")
    mechanism.require("low", body.position[0] <= 1.1)
    with pytest.raises(uqmbd.StudyError, match="probabilities of violated requirements.*use MonteCarlo"):
        uqmbd.Study("s", mechanism, [0.0, 1.0], [CommonPaths()]).run()


def test_verification_points_differ_between_paths():
    mechanism, body = oscillator(force(cutoff=5.0), random_damping())
    mechanism.output("position", body.position[0], units="m")
    method = CommonPaths(order=2, paths=16)
    seen = []

    class Recorder(CommonPaths):
        def propagate(self, problem):
            realise = problem.realise

            def recorded(values, *more):
                seen.append(values.copy())
                return realise(values, *more)

            object.__setattr__(problem, "realise", recorded)
            return super().propagate(problem)

    study = uqmbd.Study("s", mechanism, [0.0, 1.0], [Recorder(order=2, paths=16)])
    node = study.run()["common-paths"]
    assert node.attrs["realisations"] == method.estimate(study).realisations == 16 * (3 + 8)
    damping = np.concatenate(seen)[:, mechanism.inputs.names.index("damping")].reshape(16, 11)
    assert len(np.unique(damping[:, :3])) == 3
    # one hypercube: a point in each of 128 strata
    strata = np.floor((damping[:, 3:] - 0.5) / 5.5 * 128).astype(int)
    assert sorted(strata.ravel().tolist()) == list(range(128))


@pytest.mark.thorough
@pytest.mark.parametrize("paths", [8, 16])
def test_standard_errors_of_few_paths_cover(paths):
    generator = np.random.default_rng(1)
    axes = uqmbd.extend.labels([("y", "m")], [], [0.0])
    held, truth = np.zeros(2), np.sqrt(0.3**2 + 1 + 0.2**2)
    for _ in range(600):
        c = (np.array([0, 0.3]) + np.array([1.0, 0.2]) * generator.standard_normal((paths, 2)))[:, :, None, None]
        data = statistics_of_paths(axes, c, np.zeros((paths, 1, 1))).isel(output=0, time=0)
        held[0] += abs(float(data["mean"])) <= 1.96 * float(data["std_error_mean"])
        held[1] += abs(float(data["std"]) - truth) <= 1.96 * float(data["std_error_std"])
    assert abs(held[0] / 600 - 0.95) < 0.025 and 0.91 < held[1] / 600 < 0.985, held / 600


@pytest.mark.thorough
def test_smaller_pieces_need_less_memory_and_have_equal_bits(monkeypatch):
    mechanism, body = oscillator(force(cutoff=5.0), random_damping())
    mechanism.output("position", body.position[0], units="m")
    mechanism.output("speed", body.velocity[0], units="m/s")
    study = uqmbd.Study("s", mechanism, np.linspace(0, 1, 1501), [CommonPaths(order=2, paths=64)])
    study.run()  # compiles, so that only data are measured
    found, peaks, estimates = [], [], []
    for piece in (2**23, 2**17):
        monkeypatch.setattr(common_paths, "PIECE", piece)
        estimates.append(study.propagators[0].estimate(study).memory)
        tracemalloc.start()
        found.append(study.run()["common-paths/statistics"].to_dataset())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    for name in ("mean", "std", "std_error_mean", "std_error_std", "variance_share", "variance_share_interval"):
        np.testing.assert_array_equal(found[0][name], found[1][name])
    assert peaks[1] < 0.5 * peaks[0]
    assert all(peak < 1.5 * estimate + 10e6 for peak, estimate in zip(peaks, estimates, strict=True)), (
        peaks,
        estimates,
    )


def test_the_advice_names_the_larger_error():
    generator = np.random.default_rng(1)
    axes = uqmbd.extend.labels([("y", "m")], [], [0.0])
    c = generator.standard_normal((16, 2, 1, 1))
    for error, remedy in ((1e-4, "use more paths"), (4.0, "increase order")):
        data = statistics_of_paths(axes, c, np.full((16, 1, 1), error))
        assert remedy in str(data["stated_error"].attrs)
