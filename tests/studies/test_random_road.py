"""The Karhunen-Loeve expansion of a random road, against its covariance and linear random vibration."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

SCRIPT = Path(__file__).parents[2] / "studies" / "benchmarks" / "random_road.py"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(SCRIPT))


def study_of(made, terms, times):
    return uqmbd.Study("road", made["quarter_car"](made["random_road"](terms)), times, start="equilibrium")


def test_eigenvalues_of_the_road(made):
    """Against those of the covariance matrix on a fine grid (Nystrom's method)."""
    count = 1000
    x = (np.arange(count) + 0.5) / count * 2 * made["HALF"]
    covariance = made["DEVIATION"] ** 2 * np.exp(-abs(x[:, None] - x) / made["CORRELATION"])
    expected = np.sort(np.linalg.eigvalsh(covariance * (x[1] - x[0])))[::-1][:12]
    np.testing.assert_allclose([value for _, value in made["karhunen_loeve"](12)], expected, rtol=5e-4)


def response(made, times):
    """Standard deviations of body height, suspension travel and tyre force, by the linear equations of motion."""
    ms, mu, ks, cs, kt, ct = 300, 40, 20_000, 1_200, 180_000, 100
    road = made["random_road"](12)
    found = []
    for variable in sorted(road.free_symbols - {uqmbd.t}, key=str):
        wave = road.coeff(variable)
        height = sympy.lambdify(uqmbd.t, wave)
        slope = sympy.lambdify(uqmbd.t, wave.diff(uqmbd.t))

        def rate(t, y, height=height, slope=slope):
            zs, zu, vs, vu = y
            pull = ks * (zu - zs) + cs * (vu - vs)
            push = kt * (height(t) - zu) + ct * (slope(t) - vu)
            return [vs, vu, pull / ms, (push - pull) / mu]

        # at rest on a road that moves: its rate bears on the tyre's damper
        start = float(height(0.0) + ct / kt * slope(0.0))
        solved = scipy.integrate.solve_ivp(rate, (0, 2), [start, start, 0, 0], t_eval=times, rtol=1e-9, atol=1e-12).y
        push = kt * (height(times) - solved[1]) + ct * (slope(times) - solved[3])
        found.append([solved[0], solved[0] - solved[1], push])
    return np.sqrt((np.array(found) ** 2).sum(axis=0))


@pytest.mark.thorough
def test_three_methods_find_the_spread(made):
    """Twelve inputs: both expansions to 1e-4, samples within their errors (the tyre never lifts off)."""
    times = np.linspace(0, 2, 201)
    study = study_of(made, 12, times)
    expected = response(made, times)
    most = expected.max(axis=1, keepdims=True)
    chosen = ["body_height", "suspension_travel", "tyre_force"]
    for method in (Collocation(order=2, method="regression"), Galerkin(order=1, rule="sobol", samples=64)):
        std = study.propagate(method)["statistics"]["std"].sel(output=chosen).values
        np.testing.assert_allclose(std / most, expected / most, atol=1e-4)
    sampled = study.propagate(MonteCarlo(samples=300, seed=2))["statistics"].sel(output=chosen)
    away = abs(sampled["std"].values - expected) / (sampled["std_error_std"].values + 1e-6 * most)
    assert away.max() < 5


def test_the_road_is_a_mean_over_the_contact_patch(made):
    """Each wave, integrated over the patch by a Gauss rule, at three times."""
    patch, speed = made["PATCH"], made["SPEED"]
    nodes, weights = np.polynomial.legendre.leggauss(8)
    fine, mean = made["random_road"](5, 0.0), made["random_road"](5, patch)
    for k in range(1, 6):
        (variable,) = (one for one in fine.free_symbols if str(one) == f"road_{k}")
        (other,) = (one for one in mean.free_symbols if str(one) == f"road_{k}")
        wave = sympy.lambdify(uqmbd.t, fine.coeff(variable))
        averaged = sympy.lambdify(uqmbd.t, mean.coeff(other))
        for time in (0.3, 1.0, 1.7):
            expected = weights @ [wave(time + patch / 2 * x / speed) for x in nodes] / 2
            assert averaged(time) == pytest.approx(expected, rel=1e-9, abs=1e-15)


@pytest.mark.slow
def test_outputs_converge_with_the_number_of_terms(made):
    """To integrals of the transfer function and the spectral density of the road, from 1 s on: the start is over."""
    exact = dict(zip(made["OUTPUTS"], made["exact"](made["PATCH"], 4e4), strict=True))
    for terms, check in ((12, lambda found, limit: found < 0.9 * limit), (96, lambda f, e: abs(f - e) < 0.01 * e)):
        found = dict(zip(made["OUTPUTS"], made["computed"](terms, made["PATCH"]), strict=True))
        for name in ("body_acceleration", "suspension_travel"):
            assert check(found[name], exact[name])
