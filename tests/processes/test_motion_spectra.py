"""Spectral densities, orders and rainflow cycles of motions, against closed forms and other programs."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.signal

import uqmbd
from uqmbd.compiled import PLACES, SERIES
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import (
    PowerSpectralDensity,
    RandomProcess,
    estimated_psd,
    estimated_std,
    exponential_covariance,
    fatigue_damage,
    order_amplitude,
    rainflow_counts,
    rainflow_damage,
    stationary_psd,
)
from uqmbd_springs import PointForce, SpringDamper


def polynomials(functions, edges):
    """Interpolate functions of time on parts between edges."""
    begin, end = np.asarray(edges[:-1], dtype=float), np.asarray(edges[1:], dtype=float)
    times = begin[:, None] + (end - begin)[:, None] * PLACES
    return uqmbd.extend.MotionPolynomials(begin, end, np.stack([f(times) @ SERIES for f in functions]))


def value(summary, motion):
    """Apply the function of a summary to a motion."""
    return summary.declared.function(motion, *summary.numbers)


MASS = uqmbd.Mechanism("m", uqmbd.Line()).body("mass", mass=1).position[0]


def signal(t):
    return 2.0 + 0.3 * np.sin(2 * np.pi * 1.3 * t) + 0.1 * np.cos(2 * np.pi * 4.1 * t + 1) + 0.02 * t


@pytest.mark.parametrize("end", [16.0, 18.3])
def test_the_estimate_is_that_of_scipy_with_many_samples(end):
    segment, rate = 4.0, 2000
    motion = polynomials([signal], np.linspace(0, end, 400))
    samples = signal(np.arange(int(end * rate)) / rate)
    frequencies, density = scipy.signal.welch(samples, fs=rate, nperseg=int(segment * rate))
    for k in range(2, 40):
        found = value(estimated_psd(MASS, frequencies[k], segment=segment), motion)
        assert abs(found - density[k]) < 2e-3 * density[k] + 1e-7 * density.max(), k


def test_the_integral_of_the_estimate_is_the_variance_and_sides_and_units_agree():
    """Parseval's equation, for one segment: the energy of the windowed motion."""
    segment = 8.0
    motion = polynomials([lambda t: signal(t) - 0.02 * t], np.linspace(0, segment, 200))
    step = 1 / (4 * segment)
    frequencies = np.arange(2 / segment, 12, step)
    density = np.array([value(estimated_psd(MASS, f, segment=segment), motion) for f in frequencies])
    times = np.linspace(0, segment, 20001)
    window = np.sin(np.pi * times / segment) ** 2
    x = signal(times) - 0.02 * times
    energy = np.trapezoid((window * (x - x.mean())) ** 2, times) / (3 * segment / 8)
    assert abs(density.sum() * step / energy - 1) < 5e-3
    one = value(estimated_psd(MASS, 1.3, segment=segment), motion)
    angular = value(estimated_psd(MASS, 2 * np.pi * 1.3, segment=segment, sided="two", per="rad/s"), motion)
    np.testing.assert_allclose(one, 4 * np.pi * angular)


def test_the_estimate_does_not_depend_on_output_times_and_skips_a_beginning():
    """A cosine of the amplitude A in a window has the density A^2 L / 3 at its frequency."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.3)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=(2 * np.pi) ** 2))
    mechanism.output("density", estimated_psd(mass.position[0], 1.0, segment=5, skip=1.7), units="m^2/Hz")
    found = [
        float(uqmbd.simulate(mechanism, times, rtol=1e-8)["density"])
        for times in (np.linspace(0, 20, 3), np.linspace(0, 20, 777), np.array([0, 0.1, 20]))
    ]
    np.testing.assert_allclose(found, 0.3**2 * 5 / 3, rtol=1e-5)


def test_high_frequencies_have_no_aliases():
    """A sine of 3 Hz has no power at other frequencies, however few parts the motion has."""
    motion = polynomials([lambda t: np.sin(2 * np.pi * 3 * t)], np.linspace(0, 20, 401))
    peak = value(estimated_psd(MASS, 3.0, segment=10), motion)
    for frequency in (17.0, 23.0, 40.0, 77.0, 103.0):
        assert value(estimated_psd(MASS, frequency, segment=10), motion) < 1e-9 * peak


def angle(t):
    return 8 * t + 0.9 * t**2 + 0.3 * np.sin(2 * t)


def ordered(t):
    a = angle(t)
    return 5.0 + 0.7 * np.cos(a + 0.3) + 0.2 * np.sin(2.5 * a) + 0.05 * np.cos(12 * a - 1)


def test_orders_of_a_sum_of_sines_of_an_accelerated_angle():
    motion = polynomials([ordered, angle], np.linspace(0, 6, 600))
    found = [value(x, motion) for x in order_amplitude(MASS, uqmbd.t, [1, 2, 2.5, 12, 20])]
    np.testing.assert_allclose(found[:4], [0.7, 0, 0.2, 0.05], atol=0.02)
    # 12 turns are whole for halves as well
    exact = polynomials([ordered, angle], np.linspace(0, 6, 600))
    assert abs((angle(6.0) - angle(0.0)) / (2 * np.pi) - 12) < 1
    halves = [value(order_amplitude(MASS, uqmbd.t, k), exact) for k in (2.5, 0.5)]
    np.testing.assert_allclose(halves, [0.2, 0], atol=1e-7)
    later = value(order_amplitude(MASS, uqmbd.t, 2.5, skip=0.7), exact)
    np.testing.assert_allclose(later, 0.2, atol=1e-7)


def test_the_standard_deviation_begins_after_the_transient():
    """A sine over whole periods, in closed form; the beginning is much larger, and ends within a part."""
    motion = polynomials(
        [lambda t: 5 + 0.3 * np.sin(2 * np.pi * t) + 40 * np.maximum(2 - t, 0) ** 9], np.arange(0, 12.1, 0.1)
    )
    late = value(estimated_std(MASS, skip=2.03), motion)
    assert value(estimated_std(MASS, skip=2.0), motion) == pytest.approx(0.3 / np.sqrt(2), rel=1e-7)
    assert value(estimated_std(MASS), motion) > 1000
    times = np.linspace(2.03, 12, 200_001)
    assert late == pytest.approx((0.3 * np.sin(2 * np.pi * times)).std(), rel=1e-4)


def test_whole_orders_over_whole_turns_are_exact():
    def whole(t):
        return 5.0 + 0.7 * np.cos(angle(t) + 0.3) + 0.05 * np.cos(12 * angle(t) - 1)

    motion = polynomials([whole, angle], np.linspace(0, 4, 600))
    found = [value(x, motion) for x in order_amplitude(MASS, uqmbd.t, [1, 2, 12, 40])]
    np.testing.assert_allclose(found, [0.7, 0, 0.05, 0], atol=1e-7)


def test_motions_without_a_turn_are_refused():
    one = polynomials([np.sin, lambda t: 2 * t], np.linspace(0, 3, 50))
    assert value(order_amplitude(MASS, uqmbd.t, 1), one) == (
        "the angle completes 0.9549 turns; the order 1 needs at least 1 turn"
    )
    two = polynomials([np.sin, lambda t: 2 * t], np.linspace(0, 6, 50))
    assert "the order 1.5 needs at least 2" in value(order_amplitude(MASS, uqmbd.t, 1.5), two)
    back = polynomials([np.sin, lambda t: np.sin(t / 4)], np.linspace(0, 9, 99))
    assert value(order_amplitude(MASS, uqmbd.t, 1), back).startswith("the angle decreases at t = 6.")


ASTM = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
"""History of ASTM E1049-85, figure 6."""


def history(points):
    """Half cosines between turning points, one second each."""
    levels = np.asarray(points)

    def at(t):
        k = np.clip(np.floor(t.mean(axis=1)).astype(int), 0, len(levels) - 2)[:, None]
        return levels[k] + (levels[k + 1] - levels[k]) * (1 - np.cos(np.pi * (t - k))) / 2

    edges = np.linspace(0, len(levels) - 1, 8 * (len(levels) - 1) + 1)
    return polynomials([at], edges)


def test_rainflow_counts_are_those_of_the_standard():
    pytest.importorskip("rainflow")
    motion = history(ASTM)
    np.testing.assert_allclose(motion.turning_points(), ASTM, atol=1e-6)
    ranges = {3: 0.5, 4: 1.5, 6: 0.5, 8: 1.0, 9: 0.5}
    edges = np.arange(0.5, 11)
    counts = [value(x, motion) for x in rainflow_counts(MASS, edges)]
    assert counts == [ranges.get(k, 0.0) for k in range(1, 11)]
    found = value(rainflow_damage(MASS, exponent=3, coefficient=1e4), motion)
    np.testing.assert_allclose(found, sum(n * r**3 for r, n in ranges.items()) / 1e4, rtol=1e-5)


def test_a_monotone_motion_is_a_half_cycle_and_edges_are_closed():
    pytest.importorskip("rainflow")
    motion = uqmbd.extend.MotionPolynomials(np.zeros(1), np.array([2.0]), np.eye(8)[None, [1]])  # from -1 to 1
    assert [value(x, motion) for x in rainflow_counts(MASS, [0, 2, 5])] == [0.0, 0.5]
    assert [value(x, motion) for x in rainflow_counts(MASS, [0, 1, 2])] == [0.0, 0.5]
    assert [value(x, motion) for x in rainflow_counts(MASS, [0, 0.9, 1.1], skip=1)] == [0.0, 0.5]
    still = polynomials([lambda t: np.ones_like(t)], [0.0, 1.0])
    assert value(rainflow_damage(MASS, exponent=3, coefficient=1.0), still) < 1e-40


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda x: estimated_psd(x, 1.0, segment=0), "segment is 0"),
        (lambda x: estimated_psd(x, [1.0, -1], segment=5), "frequency is -1"),
        (
            lambda x: estimated_psd(x, 0.3, segment=5),
            "0.3 Hz has fewer than two periods in a segment of 5 s.*at least 0.4 Hz",
        ),
        (lambda x: estimated_psd(x, 1.0, segment=5, sided="both"), "sided is 'both'"),
        (lambda x: estimated_psd(x, 1.0, segment=5, per="s"), "per='s'"),
        (lambda x: estimated_psd(x, 1.0, segment=5, skip=-1), "skip is -1"),
        (lambda x: estimated_std(x, skip=-1), "skip is -1"),
        (lambda x: order_amplitude(x, uqmbd.t, 0), "order is 0"),
        (lambda x: order_amplitude(x, uqmbd.t, np.pi), "not a fraction with a denominator up to 12"),
        (lambda x: order_amplitude(x, uqmbd.t, 1, skip=np.inf), "skip is inf"),
        (lambda x: rainflow_damage(x, exponent=0, coefficient=1), "exponent is 0"),
        (lambda x: rainflow_counts(x, [1]), r"edges is \[1\]; expected two or more increasing"),
        (lambda x: rainflow_counts(x, [1, 3, 2]), "increasing"),
        (lambda x: rainflow_counts(x, [-1, 3]), "increasing"),
        (lambda x: rainflow_counts(x, 3.0), "increasing"),
    ],
)
def test_other_arguments_are_refused(make, text):
    with pytest.raises(uqmbd.StudyError, match=text):
        make(MASS)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda x: estimated_psd(x, 1.0, segment=5), "the run lasts 2 s after skip=0, less than one segment of 5 s"),
        (lambda x: estimated_psd(x, 2.0, segment=2, skip=3), "skip is 3 s, but the run lasts 2 s"),
        (lambda x: estimated_std(x, skip=2), "skip is 2 s, but the run lasts 2 s"),
        (lambda x: order_amplitude(x, uqmbd.t, 1), "'x' has no value: .* the angle completes 0.3183 turns"),
    ],
)
def test_runs_that_are_too_short_are_refused(make, text):
    mechanism = uqmbd.Mechanism("throw", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, velocity=1.0)
    mechanism.output("x", make(mass.position[0]))
    with pytest.raises(uqmbd.UqmbdError, match=text):
        uqmbd.simulate(mechanism, [0, 2])


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rainflow", None)
    for make in (
        lambda: rainflow_damage(MASS, exponent=3, coefficient=1.0),
        lambda: rainflow_counts(MASS, [0, 1]),
    ):
        with pytest.raises(uqmbd.StudyError, match=r'needs rainflow.*pip install "uqmbd\[fatigue\]"'):
            make()


@pytest.mark.thorough
def test_every_method_propagates_them_and_requirements_contain_them():
    amplitude = uqmbd.RandomVariable("a", chaospy.Uniform(0.1, 0.3), units="m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=amplitude)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=(2 * np.pi) ** 2))
    x = mass.position[0]
    mechanism.output("density", estimated_psd(x, 1.0, segment=4), units="m^2/Hz")
    mechanism.output("order", order_amplitude(x, 2 * np.pi * uqmbd.t, 1), units="m")
    mechanism.require("smooth", estimated_psd(x, 1.0, segment=4) <= 0.2**2 * 4 / 3)
    methods = [MonteCarlo(samples=64, sampling="sobol", seed=1), Collocation(order=3)]
    tree = uqmbd.Study("oscillator", mechanism, [0, 8], methods).run()
    for label in ("monte-carlo", "collocation"):
        mean = tree[label]["scalars/statistics"].dataset["mean"].values
        np.testing.assert_allclose(mean, [(0.04 + 0.04 / 12) * 4 / 3, 0.2], rtol=1e-3)
        lower, upper = tree[label]["requirements"].dataset["interval"].values[0]
        assert lower <= 0.5 <= upper


@pytest.mark.slow
def test_the_estimate_of_sampled_motions_is_the_stationary_density():
    """A broad resonance: the bias of the window is below 1 %; four standard errors of the mean."""
    process = RandomProcess("gust", covariance=exponential_covariance(3.0, 0.5), units="N", cutoff=15.0)
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=1.0, position=1.0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 36.0, damping=4.8, free_length=1))
    mechanism.add(PointForce("push", body, 0, process()))
    frequencies = [0.4, 0.8, 1.0, 2.0]
    for k, density in enumerate(estimated_psd(body.position[0], frequencies, segment=10, skip=3)):
        mechanism.output(f"estimate_{k}", density, units="m^2/Hz")
    for k, density in enumerate(stationary_psd(body.position[0], frequencies)):
        mechanism.output(f"stationary_{k}", density, units="m^2/Hz")
    samples = 60
    study = uqmbd.Study("s", mechanism, [0.0, 63.0], [MonteCarlo(samples=samples, seed=4)])
    statistics = study.run()["monte-carlo/scalars/statistics"]
    mean, deviation = (statistics[name].values.reshape(2, -1) for name in ("mean", "std"))
    ratio = mean[0] / mean[1]
    segments = 2 * 60 // 10 - 1
    error = np.sqrt((1 + (1 - 1 / segments) / 18) / segments)
    assert np.abs(ratio - 1).max() < 4 * error / np.sqrt(samples) + 0.01, ratio
    # the stated standard error of one run, within four standard errors of a deviation from 60 samples
    assert np.abs(deviation[0] / mean[1] / error - 1).max() < 4 / np.sqrt(2 * samples) + 0.05, deviation[0] / mean[1]


@pytest.mark.slow
def test_the_damage_of_narrow_band_paths_is_that_of_the_closed_form():
    pytest.importorskip("rainflow")
    density = PowerSpectralDensity(lambda f: 1.0 + 0 * f, "one", "Hz", (0.96, 1.04))
    process = RandomProcess("stress", psd=density, units="N", length=2000.0)
    mechanism = uqmbd.Mechanism("bar", uqmbd.Line())
    body = mechanism.body("body", mass=1.0, position=1.0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, 9.0, damping=4.8, free_length=1))
    mechanism.add(PointForce("push", body, 0, process()))
    options = {"exponent": 4, "coefficient": 1e3}
    mechanism.output("counted", rainflow_damage(process(), **options), units="1")
    mechanism.output("expected", fatigue_damage(process(), 200, rule="narrow_band", **options), units="1")
    samples = 120
    study = uqmbd.Study("s", mechanism, [0.0, 200.0], [MonteCarlo(samples=samples, seed=4)])
    statistics = study.run()["monte-carlo/scalars/statistics"]
    (counted, expected), deviation = statistics["mean"].values, statistics["std"].values[0]
    assert abs(counted - expected) < 4 * deviation / np.sqrt(samples) + 0.02 * expected, (counted, expected, deviation)


def hann(frequency):
    """Return the squared transform of Hann's window of unit length, with unit integral."""
    return (0.5 * np.sinc(frequency) + 0.25 * np.sinc(frequency - 1) + 0.25 * np.sinc(frequency + 1)) ** 2 / 0.375


@pytest.mark.parametrize("segment, bias", [(1, -0.40), (2, -0.19), (4, -0.07), (8, -0.02), (16, -0.005)])
def test_the_stated_bias_at_a_resonance_is_that_of_the_window(segment, bias):
    """The expected estimate is the convolution of the density with the window; near a resonance: Lorentz' curve."""
    frequency = np.linspace(-400, 400, 400_001)  # in units of 1 / segment
    density = 1 / (1 + (2 * frequency / segment) ** 2)
    assert np.trapezoid(hann(frequency) * density, frequency) - 1 == pytest.approx(bias, abs=0.007, rel=0.05)


@pytest.mark.slow
def test_the_bias_of_sampled_motions_is_the_stated_one():
    """An oscillator at 1 Hz with 5 % damping, whose half-power bandwidth is 0.1 Hz, and segments of 10 and 40 s."""
    flat = PowerSpectralDensity(np.ones_like, sided="one", per="Hz", band=(0.05, 3.0))
    force, stiffness = RandomProcess("force", psd=flat, units="N"), (2 * np.pi) ** 2
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=1)
    spring = SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness, 0.1 * 2 * np.pi, free_length=1)
    mechanism.add(spring)
    mechanism.add(PointForce("load", mass, 0, force()))
    for segment in (10.0, 40.0):
        mechanism.output(f"{segment:g}", estimated_psd(mass.position[0], 1.0, segment=segment, skip=40))
    mechanism.output("exact", stationary_psd(mass.position[0], 1.0))
    study = uqmbd.Study("long", mechanism, [0, 200], [MonteCarlo(samples=64, seed=3)], start="equilibrium")
    means = study.run()["monte-carlo/scalars/statistics"]["mean"]
    ratio = [float(means.sel(output=name) / means.sel(output="exact")) for name in ("10", "40")]
    # 31 and 7 segments in each of 64 motions: standard errors of 3 and 5 %
    assert ratio[0] == pytest.approx(0.60, abs=0.08)
    assert ratio[1] == pytest.approx(0.93, abs=0.15)
