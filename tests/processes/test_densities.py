"""Spectral densities: their variances in closed form, their sides and units, and wrong arguments."""

import numpy as np
import pytest
from scipy.integrate import quad

import uqmbd
from uqmbd_processes import (
    PowerSpectralDensity,
    RandomProcess,
    exponential_covariance,
    iso8608,
    kaimal,
    kanai_tajimi,
    von_karman,
    white_noise,
)


def dipped(frequency):
    """Return a density that is negative from 2.8 to 3.2 Hz."""
    return 1e-6 * (1 - 3 * np.exp(-(((frequency - 3) / 0.2) ** 2)))


@pytest.mark.parametrize("road_class, value", [("A", 16e-6), ("B", 64e-6), ("C", 256e-6), ("H", 262144e-6)])
def test_roads_have_the_densities_of_iso_8608(road_class, value):
    """ISO 8608:2016, table C.1: geometric means at 0.1 cycle/m; four times as much for each class."""
    density = iso8608(road_class, band=(0.01, 10.0))
    assert density.function(np.array([0.1]))[0] == pytest.approx(value)
    assert density.variance == pytest.approx(value * 0.1**2 * (1 / 0.01 - 1 / 10), rel=1e-9)
    assert iso8608(road_class).variance == np.inf


def test_spectra_of_wind_have_the_stated_deviation():
    assert kaimal(1.5, 340.2, 12.0).variance == pytest.approx(1.5**2, rel=1e-6)
    assert von_karman(1.5, 100.0, 12.0).variance == pytest.approx(1.5**2, rel=2e-4)  # 70.8 is rounded


def test_kanai_tajimi_is_the_spectrum_of_its_filter():
    density = kanai_tajimi(0.02, 15.6, 0.6)
    frequency = np.array([0.1, 5.0, 15.6, 40.0])
    assert density.filter.two_sided(frequency) == pytest.approx(density.function(frequency), rel=1e-12)
    assert density.variance == pytest.approx(np.pi * 0.02 * 15.6 * (1 + 4 * 0.36) / 1.2, rel=1e-12)


@pytest.mark.parametrize("sided", ["one", "two"])
@pytest.mark.parametrize("per, factor", [("Hz", 2 * np.pi), ("rad/s", 1.0)])
def test_the_variance_is_the_integral_of_the_stated_sides_and_unit(sided, per, factor):
    def function(f):
        return np.exp(-f)

    density = PowerSpectralDensity(function, sided=sided, per=per, band=(0.5, 3.0))
    whole = (np.exp(-0.5) - np.exp(-3.0)) * (2 if sided == "two" else 1)
    assert density.variance == pytest.approx(whole, rel=1e-9)
    again = quad(lambda w: 2 * density.two_sided(np.array([w]))[0], 0.5 * factor, 3.0 * factor)[0]
    assert again == pytest.approx(whole, rel=1e-7)


def test_densities_of_covariances_are_their_cosine_transforms():
    """Gauss: ``c exp(-(w c / 2)^2) / (2 sqrt(pi))``; exponential times cosine: two Lorentz curves."""
    frequency = np.array([0.01, 0.2, 1.0, 3.0])
    gauss = RandomProcess("g", covariance=lambda d: np.exp(-((d / 2) ** 2)), over="distance")
    assert gauss.two_sided(frequency) == pytest.approx(np.exp(-(frequency**2)) / np.sqrt(np.pi), rel=1e-6)
    waves = RandomProcess("w", covariance=lambda d: 4 * np.exp(-d / 3) * np.cos(4 * d))
    lorentz = sum((1 / 3) / (1 / 9 + (frequency + shift) ** 2) for shift in (-4, 4)) / (2 * np.pi)
    assert waves.two_sided(frequency) == pytest.approx(4 * lorentz, rel=1e-6)
    assert waves.variance == pytest.approx(4, rel=1e-4)


def test_the_density_of_a_record_has_the_variance_of_the_record():
    noise = np.random.default_rng(5).normal(size=40_000)
    values = np.convolve(noise, np.exp(-np.arange(200) / 20), mode="valid")
    process = RandomProcess("record", record=(0.01, values), over="time", units="m")
    assert process.variance == pytest.approx(values.var(), rel=0.1)


def test_the_error_of_an_estimated_density_is_that_of_repeated_records():
    """White noise of density 0.02 per Hz, one-sided: 200 records of 4,096 values."""
    rng = np.random.default_rng(3)
    frequency = 2 * np.pi * np.array([8.0, 15.0, 22.0, 31.0])
    processes = [RandomProcess("r", record=(0.01, rng.normal(size=4096))) for _ in range(200)]
    found = np.array([p.two_sided(frequency) * 4 * np.pi for p in processes])
    assert found.mean() == pytest.approx(0.02, rel=0.02)
    assert found.std(axis=0).mean() / 0.02 == pytest.approx(processes[0].density_error, rel=0.15)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: iso8608("I"), "expected a letter from 'A' to 'H'"),
        (lambda: iso8608("A", band=(10, 0.01)), "expected the lowest and the highest frequency"),
        (lambda: white_noise(-1, "one", "Hz"), "density is -1; expected a positive number"),
        (lambda: exponential_covariance(0, 1), "deviation is 0; expected a positive number"),
        (lambda: PowerSpectralDensity(np.ones_like, sided="both", per="Hz"), "sided is 'both'; expected 'one'"),
        (lambda: PowerSpectralDensity(np.ones_like, sided="one", per="1/m"), "per='1/m'; expected the unit"),
        (
            lambda: PowerSpectralDensity(np.negative, sided="one", per="Hz"),
            "expected a finite density that is not negative",
        ),
        (lambda: PowerSpectralDensity(dipped, sided="one", per="Hz", band=(0.01, 10)), "returned -"),
        (lambda: RandomProcess("p"), "no description is given"),
        (lambda: RandomProcess("p", psd=iso8608("C"), over="time"), "over distance, but over='time'"),
        (lambda: RandomProcess("p", psd=np.ones_like), "which states its sides and its frequency"),
        (lambda: RandomProcess("p", filter=([[1.0]], [1.0], [1.0])), "filter is not stable"),
        (lambda: RandomProcess("p", filter=([[-1.0]], [1.0, 2.0], [1.0])), "filter has the shapes"),
        (lambda: RandomProcess("p", covariance=lambda d: 1 + 0 * d), "does not decay to zero"),
        (lambda: RandomProcess("p", record=(0.1, [1, 2])), "at least 64 finite numbers"),
        (lambda: RandomProcess("a/b", psd=iso8608("C")), "expected a text without '/'"),
        (lambda: RandomProcess("p", psd=iso8608("C"), over="distance")(), "call it with the distance over time"),
        (lambda: RandomProcess("p", psd=white_noise(1, "one", "Hz"))(uqmbd.t**2), "is not linear in time"),
        (lambda: RandomProcess("p", psd=white_noise(1, "one", "Hz"))(3), "which is constant"),
    ],
)
def test_wrong_arguments_are_refused_with_advice(make, message):
    with pytest.raises(uqmbd.StudyError, match=message.replace("(", r"\(").replace("[", r"\[")):
        make()


def test_a_density_that_is_negative_in_a_narrow_band_is_refused_where_it_is_used():
    density = PowerSpectralDensity(lambda f: np.where(np.abs(f - 3.001) < 1e-9, -1.0, 1.0), "one", "Hz", (0.01, 10))
    assert density.two_sided(np.array([2 * np.pi]))[0] == pytest.approx(1 / (4 * np.pi))
    with pytest.raises(uqmbd.StudyError, match=r"returned -1 for the frequency 3\.001 Hz"):
        density.two_sided(2 * np.pi * np.array([1.0, 3.001]))
