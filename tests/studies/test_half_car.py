"""The half car: accelerations against quadrature of a system written by hand, and the filter of the wheelbase."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate

import uqmbd

STUDY = Path(__file__).parents[2] / "studies" / "half_car.py"
SPEED, MASS, INERTIA, WHEEL = 20.0, 1200.0, 2000.0, 80.0
AXLES = np.array([1.2, -1.5])
STIFFNESS, DAMPING = np.array([36e3, 32e3]), 0.85 * np.array([3000.0, 2700.0])


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDY))


def tangents():
    """Return the tyre stiffnesses in equilibrium, where the force is smooth within 0.1 mm."""
    load = (MASS * np.array([1.5, 1.2]) / 2.7 + WHEEL) * 9.81
    return 360e3 / (1 + (36.0 / load) ** 2 / 4)


def response(omega):
    """Return the accelerations of heave and pitch for unit heights of the road at both axles, (2, 2)."""
    lift = np.array([[1.0, AXLES[0], -1, 0], [1.0, AXLES[1], 0, -1]])  # heave, pitch, wheels to strokes
    strut = lift.T @ np.diag(STIFFNESS + 1j * omega * DAMPING) @ lift
    tyres = np.zeros((4, 2))
    tyres[2:] = np.diag(tangents())
    dynamic = strut + np.diag([0, 0, *tangents()]) - omega**2 * np.diag([MASS, INERTIA, WHEEL, WHEEL])
    return -(omega**2) * np.linalg.solve(dynamic, tyres)[:2]


def deviation(row, *, one_track):
    """Return a standard deviation by adaptive quadrature."""

    def density(omega):
        n = omega / (2 * np.pi * SPEED)
        front, rear = response(omega)[row]
        rear = rear * np.exp(-1j * omega * 2.7 / SPEED)
        power = abs(front + rear) ** 2 if one_track else abs(front) ** 2 + abs(rear) ** 2
        return power * 64e-6 * (n / 0.1) ** -2 / (2 * np.pi * SPEED)

    edges = 2 * np.pi * SPEED * np.geomspace(0.01, 10, 30)
    parts = [scipy.integrate.quad(density, x, y, epsrel=1e-9)[0] for x, y in zip(edges[:-1], edges[1:], strict=True)]
    return np.sqrt(sum(parts))


@pytest.mark.thorough
@pytest.mark.parametrize("one_track", [True, False])
def test_accelerations_agree_with_quadrature(made, one_track):
    car = made["half_car"](SPEED, made["track" if one_track else "other_track"])
    found = uqmbd.simulate(car, [0, 1])
    expected = [deviation(row, one_track=one_track) for row in (0, 1)]
    # tyre deflections pitch the car by 1 mrad, which the system written by hand ignores
    assert [float(found[name]) for name in ("heave", "pitch")] == pytest.approx(expected, rel=3e-6)


@pytest.mark.thorough
def test_the_wheelbase_filters_heave_and_pitch_in_turn(made):
    """The density on one track over that on two: at half a wavelength no heave, at a whole one no pitch."""
    frequencies = [SPEED / 2.7 / 2, SPEED / 2.7]
    one, two = (made["densities"](made["half_car"](SPEED, made[x]), frequencies) for x in ("track", "other_track"))
    ratio = one / two
    assert ratio[0, 0] < 0.01 and ratio[1, 1] < 0.02
    assert ratio[0, 1] == pytest.approx(2, abs=0.02) and ratio[1, 0] == pytest.approx(2, abs=0.02)
    for k, frequency in enumerate(frequencies):
        h = response(2 * np.pi * frequency)
        delayed = h * np.exp(-2j * np.pi * frequency * 2.7 / SPEED * np.array([0, 1]))
        exact = abs(delayed.sum(axis=1)) ** 2 / (abs(h) ** 2).sum(axis=1)
        np.testing.assert_allclose(ratio[k], exact, rtol=1e-6)
