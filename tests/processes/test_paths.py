"""Sampled paths: their distribution against closed forms, and the same path in every call.

Means over paths are compared within four standard errors, estimated from the paths; the keys are fixed.
"""

import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import BSpline
from scipy.signal import csd, welch
from scipy.stats import kstest, kurtosis

import uqmbd
from uqmbd_processes import (
    PowerSpectralDensity,
    RandomProcess,
    davenport_coherence,
    exponential_covariance,
    iso8608,
    kaimal,
    kanai_tajimi,
    von_karman,
    white_noise,
)
from uqmbd_processes.paths import draw_splines, line_powers, line_spectrum

ROAD = RandomProcess("road", psd=iso8608("C", band=(0.01, 10.0)), over="distance", units="m")
SHORT = RandomProcess("short", psd=iso8608("C", band=(0.05, 1.0)), over="distance", units="m", length=320)
GAUSS = RandomProcess("gauss", covariance=lambda d: 4 * np.exp(-((d / 2) ** 2)), over="distance", length=200)
NOISE = RandomProcess("noise", covariance=exponential_covariance(2.0, 5.0), over="distance", length=320)
GROUND = RandomProcess("ground", psd=kanai_tajimi(0.01, 15.6, 0.6), length=20, cutoff=100)
WIND = RandomProcess("wind", psd=kaimal(1.5, 340.2, 12.0), units="m/s", length=1800, cutoff=2.0)
FILTER = RandomProcess("filter", filter=([[0.0, 1.0], [-9.0, -0.6]], [0.0, 2.0], [1.0, 0.0]), length=200)
ALL = [ROAD, SHORT, GAUSS, NOISE, GROUND, WIND, FILTER]

COHERENCE = davenport_coherence(10, 12.0)
FIELD = RandomProcess("field", psd=kaimal(1.5, 340.2, 12.0), coherence=COHERENCE, length=600, cutoff=2.0)


def keys(count, seed=0):
    return np.random.default_rng(seed).random(count)


def at_knots(c):
    return (c[..., :-2] + 4 * c[..., 1:-1] + c[..., 2:]) / 6


def values(process, count, seed=0, part=0.9):
    """Paths (count, knots) at their knots, and the distance of the knots."""
    _, step, c = process.sample_paths([process], keys(count, seed), 0, part * process.sampled_period)
    return at_knots(c[:, 0]), step


def spline(found):
    """Paths as functions of the argument, by SciPy; the argument is the first axis of their values."""
    first, step, c = found
    return BSpline(first + step * np.arange(-3, c.shape[-1] + 1), np.moveaxis(c, -1, 0), 3, extrapolate=False)


def mean_and_error(samples):
    """Mean over independent paths, and its standard error."""
    return samples.mean(axis=0), samples.std(axis=0, ddof=1) / math.sqrt(len(samples))


@pytest.mark.parametrize("process", ALL, ids=lambda p: p.name)
def test_the_variance_is_that_of_the_process(process):
    paths, _ = values(process, 50)
    mean, error = mean_and_error((paths**2).mean(axis=1))
    expected = process.variance * (1 - process.lost_variance)
    assert abs(mean - expected) < 4 * error
    assert error < 0.06 * expected


@pytest.mark.parametrize("process", ALL, ids=lambda p: p.name)
def test_the_powers_of_the_lines_sum_up_to_the_variance_in_the_band(process):
    powers = line_powers(process, line_spectrum(process))
    assert 2 * powers.sum() == pytest.approx(process.variance * (1 - process.lost_variance), rel=1e-6)


def test_the_variance_of_a_road_is_exact_in_each_bin():
    """The first and the last bin are cut by the band; G(n) = a / n^2 has the integral a / n1 - a / n2."""
    road = RandomProcess("road", psd=iso8608("C", band=(0.013, 0.171)), over="distance", length=200)
    spectrum = line_spectrum(road)
    bounds = np.clip(np.append(spectrum.lines - 0.5, spectrum.lines[-1] + 0.5) / 200, 0.013, 0.171)
    assert line_powers(road, spectrum) == pytest.approx(256e-8 * -np.diff(1 / bounds) / 2, rel=1e-8)
    assert spectrum.lines[[0, -1]].tolist() == [3, 34]


@pytest.mark.thorough
@pytest.mark.parametrize(
    "process, covariance, lags",
    [
        (NOISE, lambda d: 4 * np.exp(-d / 5), [0.5, 2.0, 5.0, 12.0, 25.0]),
        (GAUSS, lambda d: 4 * np.exp(-((d / 2) ** 2)), [0.5, 1.0, 2.0, 3.0]),
        (
            SHORT,
            lambda d: [quad(lambda n: 256e-8 / n**2 * np.cos(2 * np.pi * n * d[0]), 0.05, 1, limit=200)[0]],
            [1.0, 3.0, 8.0],
        ),
        (
            FILTER,  # oscillator in white noise: damping ratio 0.1, variance 4 / (4 * 0.1 * 27)
            lambda d: 4 / 10.8 * np.exp(-0.3 * d) * (np.cos(8.91**0.5 * d) + 0.3 / 8.91**0.5 * np.sin(8.91**0.5 * d)),
            [0.3, 1.0, 2.1, 5.0],
        ),
    ],
    ids=lambda x: getattr(x, "name", None),
)
def test_the_covariance_is_the_closed_form(process, covariance, lags):
    """300 paths; the lines change it by less than 0.3 % of the variance."""
    paths, step = values(process, 300)
    variance = process.variance
    for lag in lags:
        shift = round(lag / step)
        mean, error = mean_and_error((paths[:, shift:] * paths[:, : paths.shape[1] - shift]).mean(axis=1))
        expected = covariance(np.array([shift * step]))[0]
        assert abs(mean - expected) < 4 * error + 3e-3 * variance
        assert error < 0.03 * variance


def test_the_lines_have_the_covariance_of_the_process():
    """Without sampling: sums over lines against the closed forms."""
    for process, covariance in (
        (GAUSS, lambda d: 4 * np.exp(-((d / 2) ** 2))),
        (NOISE, lambda d: 4 * np.exp(-d / 5)),
    ):
        spectrum = line_spectrum(process)
        frequency = 2 * np.pi * spectrum.lines / spectrum.period
        powers = line_powers(process, spectrum)
        for lag in (0.0, 1.0, 2.0, 5.0, 10.0):
            assert 2 * powers @ np.cos(frequency * lag) == pytest.approx(covariance(lag), abs=2e-3 * process.variance)


@pytest.mark.parametrize("process, low, high", [(SHORT, 0.1, 0.9), (GROUND, 0.5, 30.0), (WIND, 0.02, 1.8)])
def test_the_spectrum_is_that_of_the_process(process, low, high):
    """Welch's estimate over 60 paths, in eight bands of frequency."""
    paths, step = values(process, 60)
    frequency, density = welch(paths, fs=1 / step, nperseg=paths.shape[1] // 4, axis=1)
    inside = np.flatnonzero((frequency >= low) & (frequency <= high))
    expected = process.two_sided(2 * np.pi * frequency) * 4 * np.pi
    for band in np.array_split(inside, 8):
        mean, error = mean_and_error((density[:, band] / expected[band]).mean(axis=1))
        assert abs(mean - 1) < 4 * error + 0.01
        assert error < 0.05


@pytest.mark.parametrize("level", [0.0, 1.0, 2.0])
def test_the_rate_of_crossings_is_that_of_rice(level):
    """A road between n1 and n2 crosses its mean sqrt(n1 n2) times per metre upwards."""
    found = SHORT.sample_paths([SHORT], keys(400), 0, 280)
    x = np.arange(0, 280, found[1] / 2)
    above = spline(found)(x)[..., 0] > level * math.sqrt(SHORT.variance)
    mean, error = mean_and_error((above[1:] & ~above[:-1]).sum(axis=0) / x[-1])
    expected = math.sqrt(0.05 * 1.0) * math.exp(-(level**2) / 2)
    assert abs(mean - expected) < 4 * error + 0.003 * expected  # two crossings between two places are not seen
    assert error < 0.04 * expected


def test_values_are_normal():
    """8,000 paths at one place: the standard error of the kurtosis is sqrt(24 / 8000) = 0.055."""
    process = dataclasses.replace(SHORT, length=60.0, cutoff=0.3)
    found = process.sample_paths([process], keys(8000), 10, 10)
    one = spline(found)(10.0)[:, 0] / math.sqrt(process.variance * (1 - process.lost_variance))
    assert abs(kurtosis(one)) < 4 * math.sqrt(24 / 8000)
    assert kstest(one, "norm").pvalue > 0.01
    rate = spline(found).derivative(1)(10.0)[:, 0]
    assert abs(kurtosis(rate)) < 4 * math.sqrt(24 / 8000)
    assert abs(np.corrcoef(one, rate)[0, 1]) < 4 / math.sqrt(8000)


def test_paths_of_different_processes_and_keys_are_independent():
    others = [dataclasses.replace(SHORT, name=f"p{i}", length=80.0) for i in range(4)]
    places = [spline(p.sample_paths([p], keys(2000), 0, 9))([0.0, 7.0])[..., 0] for p in others]
    corner = np.corrcoef(np.concatenate([x[:1] for x in places]))
    assert np.abs(corner - np.eye(4)).max() < 4 / math.sqrt(2000)
    a, b = SHORT.sample_paths([SHORT], np.array([0.5, np.nextafter(0.5, 1)]), 0, 280)[2][:, 0]
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.5


def test_processes_of_one_name_have_common_random_numbers():
    """Roads of classes C and D differ by the factor 2; a higher cutoff adds harmonics to the same path."""
    worse = dataclasses.replace(SHORT, psd=iso8608("D", band=(0.05, 1.0)))
    assert worse.sample_paths([worse], keys(2), 0, 50)[2] == pytest.approx(
        2 * SHORT.sample_paths([SHORT], keys(2), 0, 50)[2], rel=1e-9, abs=1e-12
    )
    coarse = dataclasses.replace(SHORT, cutoff=0.5)
    x = np.linspace(0, 100, 50)
    smooth, rough = (spline(p.sample_paths([p], keys(40), 0, 100))(x) for p in (coarse, SHORT))
    assert (rough - smooth).var() / SHORT.variance == pytest.approx(coarse.lost_variance, rel=0.1)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(0, 1, exclude_min=True, exclude_max=True), min_size=1, max_size=5),
    st.floats(-1e4, 1e4),
    st.floats(0, 100),
    st.floats(-40, 40),
    st.randoms(use_true_random=False),
)
def test_a_path_depends_on_its_key_alone(numbers, begin, extent, shift, random):
    """Bit for bit: other intervals, other keys in the call, another order."""
    process = SHORT
    first, step, whole = process.sample_paths([process], np.array(numbers), begin, begin + extent)
    order = random.sample(range(len(numbers)), len(numbers))
    chosen = order[: random.randint(1, len(order))]
    other, again, part = process.sample_paths(
        [process], np.array(numbers)[chosen], begin + shift, begin + shift + extent
    )
    assert step == again
    a, b = round(first / step), round(other / step)
    assert (first, other) == (a * step, b * step)
    start, stop = max(a, b), max(min(a + whole.shape[-1], b + part.shape[-1]), a, b)
    assert (whole[chosen][..., start - a : stop - a] == part[..., start - b : stop - b]).all()
    assert first <= begin - 8 * step + 1e-9 and first + (whole.shape[-1] - 3) * step >= begin + extent + 8 * step - 1e-9


def test_paths_repeat_after_their_period_and_far_from_the_origin():
    period = SHORT.sampled_period
    near, far = (spline(SHORT.sample_paths([SHORT], keys(3), x, x + 20))(x + np.arange(20)) for x in (0, 50 * period))
    assert near == pytest.approx(far, abs=1e-9)


def test_a_delay_is_a_shift_of_the_path():
    """Front and rear wheel, 2.5 m apart: calls for their intervals give one path, with the covariance at 2.5 m."""
    front, rear = (spline(ROAD.sample_paths([ROAD], keys(5), x, x + 60)) for x in (0, -2.5))
    x = np.linspace(0, 57, 40)
    assert front(x) == pytest.approx(rear(x), abs=1e-12)


def test_values_do_not_depend_on_the_process_that_is_sent_to_a_worker():
    road = RandomProcess("road", psd=iso8608("C", band=(0.05, 1.0)), over="distance")
    plain = pickle.dumps(road)
    here = road.sample_paths([road], keys(2), 0, 50)[2]
    assert pickle.dumps(road) == plain
    there = pickle.loads(plain)
    assert (there.sample_paths([there], keys(2), 0, 50)[2] == here).all()


EARLIER = [[-0.0012118924081281333, 0.0025053958143132333], [-0.005505172465772749, -0.0004625275913820721]]


def test_paths_are_those_of_earlier_versions():
    """Studies are reproduced from their seed; NumPy keeps the streams of its generators."""
    found = spline(SHORT.sample_paths([SHORT], np.array([0.3, 0.7]), 0, 5))([0.0, 2.0])[..., 0]
    assert found == pytest.approx(np.array(EARLIER), rel=1e-9)


@pytest.mark.parametrize(
    "process, value, second", [(ROAD, 8.7e-6, 0.0162), (SHORT, 6.3e-5, 0.016), (GAUSS, 2.6e-6, 0.0029)]
)
def test_the_error_between_knots_is_the_documented_one(process, value, second):
    """The same harmonics with eight times as many knots; rms relative to the rms of the path and its second rate."""
    coarse = line_spectrum(process)
    fine = dataclasses.replace(coarse, knots=8 * coarse.knots)
    powers = line_powers(process, coarse)
    extent = 0.5 * process.sampled_period
    a, b = (spline(draw_splines(x, powers, [process], keys(4), 0, extent)) for x in (coarse, fine))
    x = np.arange(0, extent, fine.step / 2)[: 2**18]
    assert math.sqrt((a(x) - b(x)).var() / process.variance) == pytest.approx(value, rel=0.1)
    a, b = a.derivative(2)(x), b.derivative(2)(x)
    assert math.sqrt((a - b).var() / b.var()) == pytest.approx(second, rel=0.1)


def field_paths(distances, count, seed=0):
    points = [FIELD.at(0, 20 + x) for x in distances]
    _, step, c = points[0].sample_paths(points, keys(count, seed), 0, 530)
    return at_knots(c), step


@pytest.mark.parametrize("distance", [3.0, 10.0])
def test_two_points_have_the_coherence_of_davenport(distance):
    paths, step = field_paths([0.0, distance], 100)
    frequency, cross = csd(paths[:, 0], paths[:, 1], fs=1 / step, nperseg=2048, axis=1)
    expected = FIELD.two_sided(2 * np.pi * frequency) * 4 * np.pi
    for low, high in ((0.05, 0.1), (0.1, 0.2), (0.3, 0.5), (0.8, 1.2)):
        band = (frequency > low) & (frequency < high)
        ratio = (cross[:, band] / expected[band]).mean(axis=1)
        mean, error = mean_and_error(ratio.real)
        assert abs(mean - COHERENCE(frequency[band], distance).mean()) < 4 * error + 0.01
        assert error < 0.05
        mean, error = mean_and_error(ratio.imag)
        assert abs(mean) < 4 * error


def test_each_point_has_the_variance_and_the_path_of_its_order():
    """The first point in the order of the coordinates has the path that it has without the others."""
    paths, _ = field_paths([0.0, 4.0, 9.0, 30.0], 60)
    mean, error = mean_and_error((paths**2).mean(axis=-1))
    assert (np.abs(mean - FIELD.variance * (1 - FIELD.lost_variance)) < 4 * error).all()
    alone, _ = field_paths([0.0], 60)
    assert (paths[:, :1] == alone).all()


def test_points_are_in_any_order_and_may_be_equal():
    a, b, c = (FIELD.at(0, x) for x in (20, 30, 40))
    first = a.sample_paths([a, b, c], keys(3), 0, 100)[2]
    other = c.sample_paths([c, FIELD.at(0, 20), b, c], keys(3)[[2]], 0, 100)[2]
    assert (first[2, [2, 0, 1, 2]] == other[0]).all()


@pytest.mark.parametrize("distance", [0.0, 1e-13])
def test_coherence_matrices_may_be_singular(distance):
    whole = RandomProcess("whole", psd=white_noise(0.1, "one", "Hz", (0, 5)), coherence=lambda f, d: np.ones_like(f))
    found = whole.sample_paths([whole.at(x) for x in (0.0, 1.0, 2.0)], keys(2), 0, 10)[2]
    assert (found == found[:, :1]).all()
    near = [FIELD.at(0, 0), FIELD.at(0, distance), FIELD.at(0, 5)]
    found = FIELD.sample_paths(near, keys(2), 0, 100)[2]
    assert found[:, 0] == pytest.approx(found[:, 1], abs=1e-4)
    assert np.isfinite(found).all()


def test_contradictory_coherences_are_refused():
    """Correlated neighbours of a point, but no correlation between them: 1 - 2 * 0.9^2 < 0."""
    wrong = RandomProcess(
        "wrong",
        psd=white_noise(0.1, "one", "Hz", (0, 5)),
        coherence=lambda f, d: np.full_like(f, 0.9 if d < 1.5 else 0.0),
    )
    with pytest.raises(uqmbd.StudyError, match="random process 'wrong': the matrix of coherences of 3 points"):
        wrong.sample_paths([wrong.at(x) for x in (0.0, 1.0, 2.0)], keys(1), 0, 10)


def test_a_coherence_is_not_evaluated_at_the_frequency_zero_and_must_be_finite():
    def coherence(limit):
        return lambda f, d: np.where(f < limit, np.exp(-d * f) * np.sin(f) / f, np.nan)

    psd = white_noise(0.1, "one", "Hz", (0, 5))
    good, bad = (RandomProcess("p", psd=psd, length=100, coherence=coherence(x)) for x in (9.0, 4.0))
    assert np.isfinite(good.sample_paths([good.at(0.0), good.at(1.0)], keys(1), 0, 10)[2]).all()
    with pytest.raises(uqmbd.StudyError, match="random process 'p': coherence at the frequency 4 Hz is not finite"):
        bad.sample_paths([bad.at(0.0), bad.at(1.0)], keys(1), 0, 10)


def test_a_record_has_paths():
    rng = np.random.default_rng(5)
    record = np.convolve(rng.normal(size=4000), np.exp(-np.arange(50) / 10), mode="valid")
    process = RandomProcess("record", record=(0.05, record), units="m")
    paths, _ = values(process, 20)
    mean, error = mean_and_error((paths**2).mean(axis=1))
    assert abs(mean - process.variance) < 4 * error


def test_the_default_period_and_band_follow_the_documented_rules():
    """Tails: exponential covariance 2 / (pi w c), Kaimal (1 + 6 n)^(-2/3); periods from one-sided densities at zero."""
    road = RandomProcess("road", psd=iso8608("C", band=(0.01, 10.0)), over="distance")
    assert road.sampled_band == pytest.approx((0.02 * np.pi, 20 * np.pi))
    assert road.lost_variance == 0
    assert road.sampled_period == 1640  # 16,384 wavelengths of 0.1 m
    slow = RandomProcess("slow", psd=iso8608("C", band=(0.001, 10.0)), over="distance")
    assert slow.sampled_period == 16_100  # 16 wavelengths of 1 km, and 1 / (1 - 1e-4)
    noise = RandomProcess("noise", covariance=exponential_covariance(1.0, 5.0), cutoff=2000 / (2 * np.pi * 5))
    assert noise.lost_variance == pytest.approx(1 - 2 / np.pi * np.arctan(2000), rel=1e-5)
    free = dataclasses.replace(noise, cutoff=None)
    assert free.sampled_band[1] * 5 == pytest.approx(2 / np.pi / 1e-3, rel=5e-3)
    wind = RandomProcess("wind", psd=kaimal(1.5, 340.2, 12.0), units="m/s")
    assert wind.sampled_band[1] / (2 * np.pi) == pytest.approx(186)  # 1 + 6 n = 1000^1.5
    assert wind.lost_variance == pytest.approx((1 + 6 * 186 * 340.2 / 12) ** (-2 / 3), rel=1e-5)
    assert wind.sampled_period == pytest.approx(64 * 340.2 / 12, rel=5e-3)
    gust = RandomProcess("gust", psd=von_karman(1.5, 100, 12.0))
    assert gust.sampled_period == pytest.approx(64 * 100 / 12, rel=5e-3)
    ground = RandomProcess("ground", psd=kanai_tajimi(0.01, 15.6, 0.6), cutoff=50)
    assert ground.sampled_band == pytest.approx((0, 100 * np.pi))
    tail = 2 * quad(lambda w: ground.two_sided(np.array([w]))[0], 100 * np.pi, np.inf)[0]
    assert ground.lost_variance == pytest.approx(tail / ground.variance, rel=1e-5)


def test_narrow_peaks_are_integrated():
    """An oscillator with the damping ratio 1e-5, whose peak is inside a bin of a short period."""
    process = RandomProcess("narrow", filter=([[0, 1], [-100.0, -2e-4]], [0, 1.0], [1.0, 0]), length=100, cutoff=5)
    assert 2 * line_powers(process, line_spectrum(process)).sum() == pytest.approx(process.variance, rel=1e-6)
    assert process.lost_variance < 1e-5


def test_length_and_cutoff_are_in_the_text_of_a_process():
    assert "length" not in repr(ROAD)
    assert repr(GROUND).endswith("length=20.0, cutoff=100.0)")
    assert FIELD.at(0, 1).length == 600
    assert FIELD.at(0, 1).family == FIELD.family == "field"


FAR = {"psd": iso8608("C", band=(0.01, 10.0)), "over": "distance"}


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: RandomProcess("p", **FAR, length=0), "random process 'p': length is 0; expected a positive number"),
        (
            lambda: RandomProcess("p", **FAR, cutoff="1"),
            "random process 'p': cutoff is '1'; expected a positive number",
        ),
        (lambda: RandomProcess("p", **FAR, cutoff=0.01).sampled_band, "cutoff is 0.01 cycle/m, and the band begins at"),
        (
            lambda: RandomProcess("p", **FAR, length=1e6).sampled_band,
            "knots in their period of 1e\\+06 m, .* length=50000",
        ),
        (lambda: RandomProcess("p", psd=white_noise(1, "one", "Hz")).sampled_band, "like white noise .* band=.* Hz"),
        (lambda: RandomProcess("p", psd=iso8608("C"), over="distance").lost_variance, "no finite variance.* cycle/m"),
        (
            lambda: ROAD.sample_paths([ROAD], keys(1), 0, 1500),
            "path of 1500 m .* repeat after 1640 m; write length=1700",
        ),
        (lambda: ROAD.sample_paths([ROAD], keys(1), 0, math.inf), "expected finite numbers that do not decrease"),
        (lambda: ROAD.sample_paths([ROAD], keys(1), 1, 0), "expected finite numbers that do not decrease"),
        (lambda: ROAD.sample_paths([ROAD, SHORT], keys(1), 0, 1), "paths of 'road', 'short' .* points of one process"),
    ],
)
def test_wrong_arguments_are_refused_with_advice(make, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        make()


def test_the_suggested_length_and_cutoff_are_accepted():
    with pytest.raises(uqmbd.StudyError) as told:
        _ = RandomProcess("p", **FAR, length=1e6).sampled_band
    length, cutoff = (float(str(told.value).split(f"{x}=")[1].split()[0].rstrip(",.")) for x in ("length", "cutoff"))
    assert RandomProcess("p", **FAR, length=length).sampled_period == length
    assert RandomProcess("p", **FAR, length=1e6, cutoff=cutoff).sampled_band[1] == pytest.approx(2 * np.pi * cutoff)
    with pytest.raises(uqmbd.StudyError) as told:
        ROAD.sample_paths([ROAD], keys(1), -10, 1999)
    longer = RandomProcess("p", **FAR, length=float(str(told.value).split("length=")[1].rstrip(".")))
    assert longer.sample_paths([longer], keys(1), -10, 1999)[2].shape[:2] == (1, 1)


def test_a_density_that_is_unbounded_at_zero_is_integrated():
    """G(f) = f^-0.5 / 2 between 0 and 1 Hz has the variance 1."""
    process = RandomProcess("p", psd=PowerSpectralDensity(lambda f: 0.5 / np.sqrt(f), "one", "Hz", (0, 1)), length=100)
    powers = line_powers(process, line_spectrum(process))
    assert powers[:2] == pytest.approx([math.sqrt(0.005) / 2, (math.sqrt(0.015) - math.sqrt(0.005)) / 2], rel=1e-6)
    assert 2 * powers.sum() == pytest.approx(1, rel=1e-7)


@pytest.mark.parametrize("options", [{}, {"length": 100.0}])
def test_paths_with_different_cutoffs_have_the_same_long_waves(options):
    """With an equal period, which a spectrum with an upper end has by default."""
    spectrum = iso8608("C", band=(0.05, 2.0)) if not options else None
    covariance = exponential_covariance(1.0, 5.0) if options else None
    found = []
    for cutoff in (2.0, 0.5):
        process = RandomProcess("x", psd=spectrum, covariance=covariance, over="distance", cutoff=cutoff, **options)
        found.append(spline(process.sample_paths([process], keys(20), 0.0, 50.0))(np.linspace(0, 50, 200)).ravel())
    assert np.corrcoef(*found)[0, 1] > 0.95
