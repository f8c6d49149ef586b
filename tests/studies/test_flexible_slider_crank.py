"""The flexible slider crank of the Test Set for IVP Solvers: its published solution, its frequencies, its study."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

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


class Stretching(uqmbd.Component):
    """Energy of the axial force that bending causes: the nonlinear stiffness of the test set."""

    bodies, spaces = (), (uqmbd.Planar,)
    factor = uqmbd.Parameter("N/m^2", "stiffness per displacement")
    q1 = uqmbd.Parameter("m", "first bending mode")
    q2 = uqmbd.Parameter("m", "second bending mode")
    q3 = uqmbd.Parameter("m", "displacement along the rod in the middle")
    q4 = uqmbd.Parameter("m", "displacement along the rod at the end")

    def terms(self, p):
        """Yield the potential, whose derivatives are the forces of the test set."""
        both = 80 / (9 * np.pi**2) * p.q1 * p.q2
        yield uqmbd.Potential(p.factor * ((p.q1**2 / 2 + 2 * p.q2**2) * p.q4 + both * (4 * p.q3 - 2 * p.q4)))


def nonlinear_by_scipy(made, end):
    """Return rod angle, slider and modes at a time: equations of the test set, index 1, by SciPy.

    The unknowns are the angles of crank and rod, the slider and four modes; three constraints have multipliers.
    """
    crank, rod, speed = made["CRANK"], made["ROD"], made["SPEED"]
    rho, area, modulus, pi = made["DENSITY"], made["WIDTH"] * made["HEIGHT"], made["MODULUS"], made["PI"]
    volume = area * rod
    mass = rho * volume * np.array([[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 8, 1], [0, 0, 1, 2]])
    bending = pi**4 * (made["HEIGHT"] / rod) ** 2 * np.array([1 / 24, 2 / 3])
    linear = np.zeros((4, 4))
    linear[0, 0], linear[1, 1] = bending
    linear[2:, 2:] = np.array([[16, -8], [-8, 7]]) / 3
    linear *= modulus * area / rod
    b = np.zeros((4, 4))
    b[0, 2:], b[1, 3] = (-16 / pi**3, 8 / pi**3 - 1 / pi), 0.5 / pi
    b = volume * (b - b.T)
    c1, c2 = volume * np.array([0, 0, 2 / 3, 1 / 6]), volume * np.array([2 / pi, 0, 0, 0])
    c12, c21 = rod * volume * np.array([0, 0, 1 / 3, 1 / 6]), rod * volume * np.array([1 / pi, -0.5 / pi, 0, 0])
    factor, g = 0.5 * modulus * area / rod**2 * pi**2, 80 / (9 * pi**2)

    def nonlinear(q):
        tip = -4 * q[2] + 2 * q[3]
        return factor * np.array([
            q[0] * q[3] - g * q[1] * tip,
            4 * q[1] * q[3] - g * q[0] * tip,
            4 * g * q[0] * q[1],
            q[0] ** 2 / 2 + 2 * q[1] ** 2 - 2 * g * q[0] * q[1],
        ])  # fmt: skip

    def rate(t, y):
        (one, two, _), q, (v1, v2, _), qd = y[:3], y[3:7], y[7:10], y[10:]
        apart, long = one - two, rod + q[3]
        sin, cos = np.sin(apart), np.cos(apart)
        m = np.zeros((10, 10))
        m[0, 0] = made["CRANK_INERTIA"] + made["ROD_MASS"] * crank**2
        m[0, 1] = m[1, 0] = crank * (rod * made["ROD_MASS"] * cos / 2 + rho * (sin * c2 @ q + cos * c1 @ q))
        m[1, 1] = made["ROD_INERTIA"] + q @ mass @ q + 2 * rho * c12 @ q
        m[2, 2] = made["SLIDER_MASS"]
        m[0, 3:7] = m[3:7, 0] = rho * crank * (cos * c2 - sin * c1)
        m[1, 3:7] = m[3:7, 1] = rho * (c21 + q @ b)
        m[3:7, 3:7] = mass
        rows = np.zeros((3, 7))
        rows[0, [0, 1, 6]] = crank * np.cos(one), long * np.cos(two), np.sin(two)
        rows[1, [0, 1, 2, 6]] = crank * np.sin(one), long * np.sin(two), 1, -np.cos(two)
        rows[2, 0] = 1
        m[7:, :7], m[:7, 7:] = rows, rows.T
        half = crank * rod * made["ROD_MASS"] / 2
        f = np.zeros(10)
        f[0] = -half * v2**2 * sin + rho * crank * v2 * (
            v2 * (cos * c2 @ q - sin * c1 @ q) - 2 * (cos * c1 @ qd + sin * c2 @ qd)
        )
        f[1] = half * v1**2 * sin + rho * crank * v1**2 * (sin * c1 @ q - cos * c2 @ q)
        f[1] -= 2 * v2 * (rho * c12 @ qd + qd @ mass @ q) + rho * qd @ b @ qd
        f[3:7] = v2**2 * (mass @ q + rho * c12) + rho * (crank * v1**2 * (cos * c1 + sin * c2) + 2 * v2 * b @ qd)
        f[3:7] -= linear @ q + nonlinear(q)
        f[7] = crank * np.sin(one) * v1**2 + long * np.sin(two) * v2**2 - 2 * v2 * np.cos(two) * qd[3]
        f[8] = -crank * np.cos(one) * v1**2 - long * np.cos(two) * v2**2 - 2 * v2 * np.sin(two) * qd[3]
        return np.concatenate([y[7:], np.linalg.solve(m, f)[:7]])

    place, turning, initial, rates = made["SMOOTH"]
    sliding = rates[3]  # the rod is on the axis: the slider moves with its end
    start = [0, 0, place, *initial, speed, turning, sliding, *rates]
    found = solve_ivp(rate, (0, end), start, "DOP853", rtol=1e-9, atol=1e-12).y[:, -1]
    return dict(zip(PUBLISHED, found[1:7], strict=True))


@pytest.mark.thorough
def test_the_nonlinear_stiffness_of_the_test_set(made):
    """A component adds the potential; the linear rod moves otherwise."""
    mechanism = made["build"](made["rod_model"]())
    modes = mechanism.components["rod modes"]
    factor = 0.5 * made["MODULUS"] * made["WIDTH"] * made["HEIGHT"] / made["ROD"] ** 2 * made["PI"] ** 2
    q = {f"q{k}": modes.coordinate(f"mode {k}") for k in range(1, 5)}
    mechanism.add(Stretching("stretching", factor=factor, **q))
    expected = nonlinear_by_scipy(made, 0.005)
    linear = uqmbd.simulate(made["build"](made["rod_model"]()), [0, 0.005], rtol=1e-9, check=False)
    for integrator in ("auto", "radau"):
        found = uqmbd.simulate(mechanism, [0, 0.005], rtol=1e-9, integrator=integrator, check=False)
        for name, value in expected.items():
            assert np.isclose(found[name][-1], value, rtol=0, atol=1e-9), name
    assert abs(float(linear["q1"][-1]) - expected["q1"]) > 1e-7
