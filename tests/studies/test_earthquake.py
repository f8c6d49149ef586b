"""The frame in an earthquake: drift and pendulum against Lyapunov's equation, first passage against its bound."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import stationary_std

STUDY = Path(__file__).parents[2] / "studies" / "earthquake.py"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDY))


def covariance(made, ratio, stiffness, intensity, absorber_ratio):
    """Return the covariance of drifts, angle and their rates, with the filter of Kanai and Tajimi as two states."""
    mass, bob, length, first = (made[name] for name in ("MASS", "BOB", "LENGTH", "FIRST"))
    chain = np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1.0]])
    m, k, c = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    m[:3, :3] = mass * np.eye(3)
    m[2, 2] += bob
    m[2, 3] = m[3, 2] = bob * length
    m[3, 3] = bob * length**2 + 1.0  # the inertia of the bob
    k[:3, :3] = stiffness * chain
    k[3, 3] = bob * 9.81 * length
    c[:3, :3] = 2 * ratio * stiffness / first * chain
    c[3, 3] = 2 * absorber_ratio * first * bob * length**2
    push = -intensity * np.array([mass, mass, mass + bob, bob * length])
    system = np.zeros((10, 10))
    system[:4, 4:8] = np.eye(4)
    system[4:8, :4], system[4:8, 4:8] = -np.linalg.solve(m, k), -np.linalg.solve(m, c)
    w, z = 15.6, 0.6
    system[4:8, 8:] = np.outer(np.linalg.solve(m, push), [w**2, 2 * z * w])
    system[8, 9], system[9, 8:] = 1, [-(w**2), -2 * z * w]
    noise = np.zeros((10, 10))
    noise[9, 9] = 2 * np.pi * 0.4**2 * 2 * z / (np.pi * w * (1 + 4 * z**2))
    return solve_continuous_lyapunov(system, -noise)


@pytest.mark.thorough
def test_drift_and_angle_agree_with_lyapunov(made):
    samples = made["study"].propagate(MonteCarlo(samples=10, seed=4))["scalars/samples"].to_dataset()
    names = ("damping_ratio", "stiffness", "intensity", "absorber_ratio")
    for one in range(10):
        inputs = [float(samples["inputs"].sel(input=name)[one]) for name in names]
        found = covariance(made, *inputs)
        drift, rate, angle = np.sqrt(found[[0, 4, 3], [0, 4, 3]])
        responses = samples["response"][one]
        assert float(responses.sel(output="drift")) == pytest.approx(1000 * drift, rel=1e-6)
        assert float(responses.sel(output="pendulum")) == pytest.approx(angle, rel=1e-6)
        crossings = 40 * rate / drift / (2 * np.pi)
        u = np.linspace(0, 9, 20_001)
        largest = 1000 * drift * np.trapezoid(1 - np.exp(-crossings * np.exp(-(u**2) / 2)), u)
        assert float(responses.sel(output="largest_drift")) == pytest.approx(largest, rel=1e-6)


@pytest.mark.thorough
def test_sampled_motions_reach_the_stationary_response(made):
    """The mean square from 30 s to 45 s of 100 motions, in which the pendulum is nearly linear."""
    frame, drift = made["frame"]()
    frame.output("drift", drift)
    frame.output("stationary", stationary_std(drift))
    study = uqmbd.Study("long", frame, np.linspace(0, 45, 91), start="equilibrium")
    tree = study.propagate(MonteCarlo(samples=100, seed=2))
    later = tree["statistics"]["std"].sel(output="drift").values[60:]
    expected = np.sqrt((tree["scalars/samples"]["response"].values[:, 0] ** 2).mean())
    assert np.sqrt((later**2).mean()) == pytest.approx(expected, rel=0.06)
