"""The Kraichnan-Orszag problem as a free body: the scaling, the exact solution, and statistics over long times."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd.results import surrogate
from uqmbd_collocation import Collocation

STUDY = Path(__file__).parents[3] / "studies" / "published" / "kraichnan_orszag.py"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDY))


def kraichnan_orszag(_, y):
    return [y[0] * y[2], -y[1] * y[2], y[1] ** 2 - y[0] ** 2]


@pytest.mark.parametrize("xi", [-0.7, 0.02, 1.0])
def test_exact_solution_is_that_of_scipy(made, xi):
    times = np.linspace(0, 60, 61)
    found = solve_ivp(kraichnan_orszag, (0, 60), [1, 0.1 * xi, 0], "DOP853", times, rtol=1e-12, atol=1e-14).y
    np.testing.assert_allclose(made["exact"](times, [xi])[0], found, rtol=0, atol=1e-8)


@pytest.mark.parametrize("start", [(1.0, 0.05, 0.0), (0.3, -0.8, 0.5)])
def test_rates_of_any_body_are_the_problem_in_other_units(made, start):
    """Equations of Euler, from the start that `body_rates` says, by SciPy."""
    a, b, c = made["A"], made["B"], made["C"]

    def euler(_, w):
        return [(b - c) / a * w[1] * w[2], (c - a) / b * w[2] * w[0], (a - b) / c * w[0] * w[1]]

    times, limits = np.linspace(0, 20, 21), {"rtol": 1e-11, "atol": 1e-12}
    first = [float(rate) for rate in made["body_rates"](*start)]
    long, middle, normal = solve_ivp(euler, (0, 20), first, "DOP853", times, **limits).y
    z1, z2, z3 = made["SCALE_A"] * long, made["SCALE_C"] * normal, -made["SCALE_B"] * middle
    expected = solve_ivp(kraichnan_orszag, (0, 20), start, "DOP853", times, **limits).y
    np.testing.assert_allclose([(z1 + z2) / np.sqrt(2), (z1 - z2) / np.sqrt(2), z3], expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("xi", [-0.4, 0.9])
def test_the_body_moves_as_the_exact_solution_says(made, xi):
    times = np.linspace(0, 30, 61)
    found = uqmbd.simulate(made["mechanism"], times, {"xi": xi}, rtol=1e-10)
    exact = made["exact"](times, [xi])[0]
    np.testing.assert_allclose([np.asarray(found[f"y{k}"]) for k in (1, 2, 3)], exact, rtol=0, atol=1e-6)


def test_reference_has_converged(made):
    times = np.linspace(0, 100, 101)
    for fine, coarse in zip(made["reference"](times), made["reference"](times, 24, 40), strict=True):
        np.testing.assert_allclose(fine, coarse, rtol=0, atol=1e-6)


def variance_error(made, node, times):
    """Largest over time, over the largest variance of each output (O,)."""
    _, std = made["reference"](times)
    return np.abs(node["statistics"]["std"].values ** 2 - std**2).max(axis=1) / (std**2).max(axis=1)


@pytest.mark.thorough
@pytest.mark.filterwarnings(
    "ignore:.*different sequences of phases",
    "ignore:.*stops or reverses",
    "ignore::uqmbd.errors.SurrogateWarning",
)
def test_few_elements_hold_where_plain_ones_fail(made):
    """Ten elements each, to t = 40; aligned ones are at equal phase, or near the separatrix at equal times."""
    times = np.linspace(0, 40, 101)
    study = uqmbd.Study("short", made["mechanism"], times, rtol=1e-9)
    plain = study.propagate(Collocation(order=5, elements=10))
    aligned = study.propagate(Collocation(order=5, elements=10, alignment="phase", clock="y3"))
    assert variance_error(made, aligned, times).max() < 0.01 < variance_error(made, plain, times).max()
    assert "phase" in {element.landmarks for element in surrogate(aligned).elements}


@pytest.mark.slow
@pytest.mark.filterwarnings(
    "ignore:.*different sequences of phases",
    "ignore:.*stops or reverses",
    "ignore::uqmbd.errors.SurrogateWarning",
)
def test_variance_to_100(made):
    """Within 1 % of the quadrature of the exact solution, by the elements that the study says."""
    study = made["study"]
    (aligned,) = (p for p in study.propagators if p.node_name == "aligned")
    assert variance_error(made, study.propagate(aligned), study.times).max() < 0.01
