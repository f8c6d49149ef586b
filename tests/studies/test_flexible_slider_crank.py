"""The flexible slider crank of the Test Set for IVP Solvers: its published solution, its frequencies, its study."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import uqmbd

STUDY = Path(__file__).parents[2] / "studies" / "flexible_slider_crank.py"

PUBLISHED = {
    "rod angle": -3.311734987910881e-01,
    "slider": 1.697373326718410e-01,
    "q1": 1.893192460247178e-04,
    "q2": 2.375751865617931e-05,
    "q3": -5.323907988763734e-06,
    "q4": -8.363283141616840e-06,
}
"""Solution at 0.1 s, linear stiffness, no damping."""


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDY))


@pytest.mark.parametrize("integrator", ["auto", "radau", "ida"])
def test_the_published_solution_is_met(made, integrator):
    """The initial data have nine digits, so the solution has about ten decimals."""
    mechanism = made["build"](made["rod_model"]())
    found = uqmbd.simulate(mechanism, [0, 0.1], rtol=1e-9, integrator=integrator, check=False)
    for name, value in PUBLISHED.items():
        assert np.isclose(found[name][-1], value, rtol=0, atol=5e-11), name


@pytest.mark.parametrize("damped", [False, True])
def test_both_starts_of_the_test_set_and_all_integrators_agree(made, damped):
    """The start as a rigid mechanism excites all modes."""
    found = [
        uqmbd.simulate(made["build"](made["rod_model"](damped=damped), made["RIGID"]), [0, 0.02], rtol=1e-9,
                       integrator=integrator, check=False)
        for integrator in ("auto", "radau", "ida")
    ]  # fmt: skip
    for name in PUBLISHED:
        values = [float(one[name][-1]) for one in found]
        assert np.ptp(values) < 1e-9, name


def test_the_rod_has_the_frequencies_of_the_matrices(made):
    frequencies = made["rod_model"]().frequencies
    assert np.allclose(frequencies, [203.190957, 812.763828, 1088.749819, 3917.226248], rtol=0, atol=1e-6)


def test_the_stated_error_of_the_integration_holds(made):
    mechanism = made["build"](made["rod_model"]())
    found = uqmbd.simulate(mechanism, [0, 0.1], rtol=1e-6)
    for name, value in PUBLISHED.items():
        stated = float(found["integration_error"].sel(output=name)[-1])
        assert abs(float(found[name][-1]) - value) < 5 * stated + 5e-11, name


@pytest.mark.thorough
def test_samples_and_the_expansion_agree_on_the_spread_of_the_bending(made):
    tree = made["study"].run()
    spread = {
        name: tree[f"{name}/scalars/statistics"]["std"].sel(output="largest bending").item()
        for name in ("monte-carlo", "collocation")
    }
    assert spread["collocation"] > 0
    assert np.isclose(spread["monte-carlo"], spread["collocation"], rtol=0.15)
