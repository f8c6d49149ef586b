"""The double wishbone: its geometry by intersections of circles, and three methods."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin

STUDY = Path(__file__).parents[2] / "studies" / "suspension.py"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDY))


def geometry(made, lower_length, upper_length, pivot_height, travel):
    """Camber (deg) and half track (mm) of the upright at a travel (m), from the distances of its ball joints."""
    height = made["CENTRE"][1] + travel
    lower, upper = complex(*made["LOWER_PIVOT"]), complex(made["UPPER_PIVOT"][0], pivot_height)

    def gaps(unknown):
        x, angle = unknown
        turn = np.exp(1j * angle)
        below, above = (complex(x, height) + complex(*made[k]) * turn for k in ("LOWER_BALL", "UPPER_BALL"))
        return abs(below - lower) - lower_length, abs(above - upper) - upper_length

    x, angle = scipy.optimize.fsolve(gaps, (made["CENTRE"][0], 0.0), xtol=1e-13)
    patch = complex(x, height) + complex(*made["PATCH"]) * np.exp(1j * angle)
    return -np.degrees(angle), 1000 * patch.real


@pytest.mark.thorough
def test_a_realisation_is_that_of_the_geometry(made):
    values = {"lower_length": made["LOWER_LENGTH"] + 1e-3, "upper_length": made["UPPER_LENGTH"] - 8e-4}
    values["pivot_height"] = 0.4015
    found = uqmbd.simulate(made["mechanism"], made["study"].times, values, rtol=1e-8, check=False)
    travel = made["TRAVEL"] * (2 * made["study"].times - 1)
    exact = np.array([geometry(made, **values, travel=x) for x in travel]).T
    assert found["travel"].values == pytest.approx(1000 * travel, abs=1e-6)
    assert found["camber"].values == pytest.approx(exact[0], abs=1e-6)
    assert found["half_track"].values == pytest.approx(exact[1], abs=1e-5)
    assert exact[0][0] > 0.5 and exact[0][-1] < -1  # camber falls in bump


@pytest.mark.thorough
@pytest.mark.parametrize("method", [Collocation(order=2, verify=0), Galerkin(order=2, verify=0)], ids=lambda m: m.name)
def test_mean_and_spread_are_those_of_the_geometry(made, method):
    """Means and standard deviations by 125 Gauss nodes of the geometry."""
    study = uqmbd.Study("suspension", made["mechanism"], np.linspace(0, 1, 5), [method])
    found = study.run()[f"{method.name}/statistics"]
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    weights = weights / weights.sum()
    every = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    shares = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    middle = np.array([made["LOWER_LENGTH"], made["UPPER_LENGTH"], made["UPPER_PIVOT"][1]])
    inputs = middle + every * (0.5e-3, 0.5e-3, 1e-3)
    for k, travel in enumerate(made["TRAVEL"] * np.array([-1, -0.5, 0, 0.5, 1])):
        values = np.array([geometry(made, *x, travel=travel) for x in inputs])
        mean = shares @ values
        std = np.sqrt(shares @ (values - mean) ** 2)
        at = found.sel(output=["camber", "half_track"]).isel(time=k)
        assert at["mean"].values == pytest.approx(mean, abs=1e-5)
        assert at["std"].values == pytest.approx(std, rel=1e-3)
