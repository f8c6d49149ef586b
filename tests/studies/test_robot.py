"""The robot arm: one realisation against SciPy, by equations of motion derived by hand, and three methods."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo

STUDY = Path(__file__).parents[2] / "studies" / "robot.py"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDY))


def arm(made, upper_arm_mass, forearm_mass, payload, friction):
    """Rates of (shoulder, elbow, their speeds) under torques, by Lagrange's equations of a two-link arm."""
    a, b, g = made["UPPER"], made["FORE"], made["GRAVITY"]
    m1, m2, m3 = upper_arm_mass, forearm_mass, payload
    own, tip = (m1 / 3 + m2 + m3) * a**2, (m2 / 3 + m3) * b**2 + 1e-4
    coupled = (m2 / 2 + m3) * a * b

    def rates(t, x, torque):
        shoulder, elbow, w1, w2 = x
        c, s = coupled * np.cos(elbow), coupled * np.sin(elbow)
        mass = np.array([[own + tip + 2 * c, tip + c], [tip + c, tip]])
        lift = np.array([(m1 / 2 + m2 + m3) * a * np.cos(shoulder), 0]) + (m2 / 2 + m3) * b * np.cos(shoulder + elbow)
        spin = np.array([-s * w2 * (2 * w1 + w2), s * w1**2])
        rub = np.array([friction * w1 / np.hypot(w1, 0.2) + 0.2 * w1, friction / 2 * w2 / np.hypot(w2, 0.2) + 0.1 * w2])
        return [w1, w2, *np.linalg.solve(mass, torque - rub - spin - g * lift)]

    return rates


@pytest.mark.thorough
def test_a_realisation_is_that_of_scipy(made):
    """Samples every 10 ms, torques that act 4 ms later: the angles of the tool's path to 1e-8."""
    values = {"upper_arm_mass": 5.3, "forearm_mass": 2.8, "payload": 1.4, "friction": 0.7}
    times = made["study"].times[:51]
    found = uqmbd.simulate(made["mechanism"], times, values, rtol=1e-10, check=False)
    rates, control = arm(made, **values), made["computed_torque"]
    x = np.array([*made["joint_angles"](*made["path"](0.0)), 0, 0])
    torque = waiting = control(0.0, x[None])[0]
    exact = []
    for sample in range(101):
        now = sample / made["RATE"]
        if sample % 2 == 0:
            shoulder, elbow = x[:2]
            tool = made["UPPER"] * np.exp(1j * shoulder) + made["FORE"] * np.exp(1j * (shoulder + elbow))
            miss = (tool - complex(*made["CENTRE"])) * np.exp(-1j * made["phase"](now)) - made["RADIUS"]
            exact.append([1000 * miss.real, 1000 * miss.imag, *torque])
        waiting = np.clip(control(now, x[None])[0], -made["LIMIT"], made["LIMIT"])
        for end in (now + made["DELAY"], now + 1 / made["RATE"]):
            run = scipy.integrate.solve_ivp(rates, (now, end), x, "DOP853", rtol=1e-12, atol=1e-13, args=(torque,))
            x, now, torque = run.y[:, -1], end, waiting
    for name, value, size in zip(found, np.array(exact).T, (1e-5, 1e-5, 1e-6, 1e-6), strict=True):
        np.testing.assert_allclose(found[name], value, rtol=0, atol=size)  # mm, N m


@pytest.mark.slow
def test_three_methods_agree_on_the_path_error(made):
    study, times = made["study"], slice(0.1, None)
    methods = MonteCarlo(samples=300, seed=1), Collocation(order=2), Galerkin(order=2)
    found = {m.node_name: study.propagate(m)["statistics"].to_dataset().sel(time=times) for m in methods}
    sampled, chaos, galerkin = (found[name] for name in ("monte-carlo", "collocation", "galerkin"))
    most = chaos["std"].max("time")
    for name in ("mean", "std"):
        assert float((abs(galerkin[name] - chaos[name]) / most).max()) < 5e-3
        assert float((abs(sampled[name] - chaos[name]) / (sampled[f"std_error_{name}"] + 1e-3 * most)).max()) < 5
    assert float(most.sel(output="path_error")) > 3  # mm: the controller does not know the payload
