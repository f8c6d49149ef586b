"""The quarter car on a rough road: the stationary response against quadrature, the sampled one against both."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
import scipy.interpolate
import scipy.stats

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, iso8608

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(STUDIES / "quarter_car.py"))


@pytest.fixture(scope="module")
def sampled():
    return runpy.run_path(str(STUDIES / "quarter_car_paths.py"))


def by_quadrature(mass, stiffness, damping, tyre, speed=20.0):
    """Return the outputs of the study (K, 4) for inputs (K,), by the transfer function on a logarithmic grid."""
    edges = np.log(2 * np.pi * speed * np.geomspace(0.01, 10.0, 201))
    x, w = np.polynomial.legendre.leggauss(4)
    omega = np.exp(((edges[1:, None] + edges[:-1, None]) / 2 + np.diff(edges)[:, None] / 2 * x).ravel())
    weight = (np.diff(edges)[:, None] / 2 * w).ravel() * omega / (2 * np.pi)
    density = 256e-6 * (omega / (2 * np.pi * speed) / 0.1) ** -2 / speed * weight  # one-sided per Hz
    mass, stiffness, damping, tyre = (np.asarray(one, dtype=float)[:, None] for one in (mass, stiffness, damping, tyre))
    load = (mass + 40) * 9.81
    tyre = tyre / (1 + (tyre * 1e-4 / load) ** 2 / 4)  # the tangent of its force, which is smooth within 0.1 mm
    s = 1j * omega
    strut = stiffness + damping * s
    ratio = strut / (mass * s**2 + strut)
    wheel = tyre / (40 * s**2 + strut * (1 - ratio) + tyre)
    acceleration, travel, force = s**2 * ratio * wheel, (ratio - 1) * wheel, tyre * (1 - wheel)

    def moment(transfer, power=0):
        return (abs(transfer) ** 2 * omega**power) @ density

    load = load[:, 0]
    lift_offs = 60 / (2 * np.pi) * np.sqrt(moment(force, 2) / moment(force)) * np.exp(-(load**2) / 2 / moment(force))
    g = np.sqrt(2 * np.log(600 / (2 * np.pi) * np.sqrt(moment(travel, 2) / moment(travel))))
    largest = 1000 * np.sqrt(moment(travel)) * (g + 0.5772156649 / g)
    return np.stack([np.sqrt(moment(acceleration)), np.sqrt(moment(force)) / load, lift_offs, largest], axis=1)


@pytest.mark.thorough
def test_outputs_agree_with_quadrature_of_the_transfer_function(made):
    samples = made["study"].propagate(MonteCarlo(samples=20, seed=3))["scalars/samples"].to_dataset()
    inputs = {name: samples["inputs"].sel(input=name).values for name in samples["input"].values}
    names = ("body_mass", "stiffness", "damping", "tyre_stiffness")
    expected = by_quadrature(*(inputs[name] for name in names))
    np.testing.assert_allclose(samples["response"].values, expected, rtol=1e-6)


@pytest.mark.thorough
def test_collocation_and_counts_agree_with_many_samples(made):
    """4,000 realisations by quadrature: means, and probabilities of violation, of both methods."""
    rng = np.random.default_rng(5)
    count = 4_000
    values = by_quadrature(
        rng.uniform(260, 380, count), rng.normal(20e3, 1e3, count), rng.uniform(900, 1500, count),
        rng.normal(180e3, 12e3, count),
    )  # fmt: skip
    tree = made["study"].propagate(Collocation(order=4))
    std = tree["scalars/statistics"]["std"].values
    np.testing.assert_allclose(std, values.std(axis=0), rtol=0.05)
    np.testing.assert_allclose(tree["scalars/statistics"]["mean"].values, values.mean(axis=0), atol=5 * std.max() / 100)
    for name, violated in (("comfortable", values[:, 0] > 1.5), ("contact", values[:, 2] > 1)):
        found = float(tree["requirements"]["violation_probability"].sel(requirement=name))
        interval = scipy.stats.binomtest(int(violated.sum()), count).proportion_ci(0.999)
        assert interval.low < found < interval.high


@pytest.mark.thorough
def test_a_sampled_motion_is_that_of_the_equations_written_by_hand(sampled):
    """One road of class D, as a B-spline, and the nonlinear car in scipy."""
    road = RandomProcess("road", psd=iso8608("D", band=(0.01, 10.0)), over="distance", units="m", cutoff=2.0)
    key, duration, mass, damping = 0.3, 2.0, 370.0, 1000.0
    first, step, coefficients = road.sample_paths([road], np.array([key]), 0.0, 20.0 * duration)
    values = np.ravel(coefficients)
    spline = scipy.interpolate.BSpline(first + step * np.arange(-3, len(values) + 1), values, 3)

    def forces(t, zu, zs, vu, vs):
        short = sampled["DESIGN_LENGTH"] - zs + zu
        pressed = short - sampled["CLEARANCE"]
        pressed = (pressed + np.hypot(pressed, sampled["TRANSITION"])) / 2
        strut = 20e3 * (short + 320 * 9.81 / 20e3) - damping * (vs - vu) + sampled["PROGRESSION"] * pressed**2
        load = 180e3 * (spline(20 * t) + 0.32 - zu)
        return strut, (load + np.hypot(load, 18.0)) / 2

    def rate(t, y):
        strut, tyre = forces(t, *y)
        return [y[2], y[3], (tyre - strut) / 40 - 9.81, strut / mass - 9.81]

    found = uqmbd.simulate(
        sampled["quarter_car"]("D"), np.linspace(0, duration, 201), {"body_mass": mass, "damping": damping, "road": key},
        start="equilibrium",
    )  # fmt: skip
    rest = scipy.optimize.fsolve(lambda z: rate(0.0, [*z, 0.0, 0.0])[2:], [0.3, 0.75], xtol=1e-13)
    solved = scipy.integrate.solve_ivp(
        rate, (0, duration), [*rest, 0, 0], t_eval=found["time"].values, rtol=1e-9, atol=1e-12, max_step=2e-3
    ).y
    acceleration = np.array([rate(t, y)[3] for t, y in zip(found["time"].values, solved.T, strict=True)])
    np.testing.assert_allclose(found["acceleration"].values, acceleration, atol=2e-4)
    assert acceleration.max() > 3


@pytest.mark.filterwarnings("ignore:.*sampled paths of random processes resolve")
@pytest.mark.thorough
@pytest.mark.parametrize("road_class, low, high", [("B", 0.96, 1.02), ("D", 1.03, 1.12)])
def test_the_linear_response_agrees_while_the_car_does_not_touch_its_stop(sampled, road_class, low, high):
    study = sampled["study_of"](road_class)
    means = study.propagate(MonteCarlo(samples=64, seed=2))["scalars/statistics"]["mean"]
    assert low < float(means.sel(output="comfort") / means.sel(output="linear_comfort")) < high
