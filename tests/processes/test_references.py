"""Stationary responses of random chains of masses, against transfer functions and Lyapunov's equation of SciPy."""

from __future__ import annotations

import itertools

import chaospy
import numpy as np
import pytest
import sympy
from scipy.integrate import quad
from scipy.linalg import solve_continuous_lyapunov

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import (
    RandomProcess,
    crossing_rate,
    expected_maximum,
    kanai_tajimi,
    stationary_psd,
    stationary_std,
    von_karman,
    white_noise,
)
from uqmbd_reliability import Reliability
from uqmbd_springs import PointForce, SpringDamper


def draw(seed):
    """Return masses, stiffnesses and dampings of a chain: frequencies of 0.3 to 5 Hz, damping ratios of 2 to 20 %."""
    rng = np.random.default_rng(seed)
    m = 10 ** rng.uniform(-0.5, 1, 2)
    k = m * (2 * np.pi * 10 ** rng.uniform(-0.5, 0.7, 2)) ** 2
    return m, k, 2 * rng.uniform(0.02, 0.2, 2) * np.sqrt(k * m)


def accelerations(kind, rng):
    """Return a spectrum of the base's acceleration, its two-sided density per rad/s by its formula, and its band."""
    level = 10 ** rng.uniform(-2, 0)
    if kind == "white":
        return white_noise(level, sided="two", per="rad/s"), lambda w: level, (0, np.inf)
    if kind == "band":
        low, high = 0.2, 12.0  # Hz; one-sided per Hz
        return (
            white_noise(level, sided="one", per="Hz", band=(low, high)),
            lambda w: level / 2 / (2 * np.pi),
            (2 * np.pi * low, 2 * np.pi * high),
        )
    if kind == "ground":
        # two-sided density level per rad/s of the rock, Kanai 1957 and Tajimi 1960
        w0, z = rng.uniform(8, 20), rng.uniform(0.3, 0.7)

        def density(w):
            r = (2 * z * w0 * w) ** 2
            return level * (w0**4 + r) / ((w0**2 - w**2) ** 2 + r)

        return kanai_tajimi(level, w0, z), density, (0, np.inf)
    deviation, length, speed = rng.uniform(0.5, 2), rng.uniform(2, 30), 15.0

    def longitudinal(w):
        # one-sided per Hz: 4 s^2 L/U / (1 + 70.8 (n L/U)^2)^(5/6)
        n = w / (2 * np.pi)
        return 4 * deviation**2 * length / speed / (1 + 70.8 * (n * length / speed) ** 2) ** (5 / 6) / (4 * np.pi)

    return von_karman(deviation, length, speed), longitudinal, (0, np.inf)


def chain(process, m, k, c):
    """Two masses on springs; in axes that move with the base, each has the force -m a."""
    mechanism = uqmbd.Mechanism("chain", uqmbd.Line())
    first, second = mechanism.body("first", mass=m[0], position=1), mechanism.body("second", mass=m[1], position=2)
    mechanism.add(SpringDamper("low", mechanism.ground, first, 0, 0, k[0], damping=c[0], free_length=1))
    mechanism.add(SpringDamper("high", first, second, 0, 0, k[1], damping=c[1], free_length=1))
    for name, body, mass in (("a", first, m[0]), ("b", second, m[1])):
        mechanism.add(PointForce(name, body, 0, -mass * process()))
    return mechanism, first, second


def responses(m, k, c):
    """Return the functions of the frequency of the drift, and of the absolute acceleration of the second mass."""
    mass = np.diag(m)
    stiffness = np.array([[k[0] + k[1], -k[1]], [-k[1], k[1]]])
    damping = np.array([[c[0] + c[1], -c[1]], [-c[1], c[1]]])

    def motion(w):
        return np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, -np.asarray(m))

    return lambda w: (lambda x: x[1] - x[0])(motion(w)), lambda w: 1 - w**2 * motion(w)[1]


def integral(function, density, band, rates, order=0):
    """Integrate ``2 w^order |H|^2 S`` over positive frequencies, between and beyond the natural frequencies."""
    points = sorted({band[0], *(x for x in rates if band[0] < x < min(band[1], 1e9)), min(band[1], 50 * max(rates))})

    def value(w):
        return 2 * w**order * abs(function(w)) ** 2 * density(w)

    total = sum(quad(value, a, b, epsabs=0, epsrel=1e-11, limit=500)[0] for a, b in itertools.pairwise(points))
    return total + (quad(value, points[-1], np.inf, epsabs=0, epsrel=1e-9, limit=500)[0] if np.isinf(band[1]) else 0.0)


def natural_rates(m, k):
    stiffness = np.array([[k[0] + k[1], -k[1]], [-k[1], k[1]]])
    return np.sqrt(np.linalg.eigvals(np.diag(1 / np.asarray(m)) @ stiffness).real).tolist()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["white", "band", "ground", "wind"])
def test_two_masses_on_a_base_have_the_variances_of_their_transfer_functions(kind, seed):
    m, k, c = draw(seed)
    spectrum, density, band = accelerations(kind, np.random.default_rng((seed, 1)))
    process = RandomProcess("base", psd=spectrum, over="time")
    mechanism, first, second = chain(process, m, k, c)
    drift = second.position[0] - first.position[0]
    absolute = second.acceleration[0] + sympy.Float(1.0) * process()
    mechanism.output("drift", stationary_std(drift))
    mechanism.output("density", stationary_psd(drift, 1.3))
    mechanism.output("crossings", crossing_rate(drift, 1.0))
    mechanism.output("largest", expected_maximum(drift, 600))
    if kind != "white":
        mechanism.output("absolute", stationary_std(absolute))
    found = uqmbd.simulate(mechanism, [0, 1])
    of_drift, of_acceleration = responses(m, k, c)
    rates = natural_rates(m, k) + ([10.0] if kind == "ground" else [])
    variance = integral(of_drift, density, band, rates)
    rate = np.sqrt(integral(of_drift, density, band, rates, 2) / variance) / (2 * np.pi)
    g = np.sqrt(2 * np.log(600 * rate))
    assert float(found["drift"]) == pytest.approx(np.sqrt(variance), rel=1e-6)
    assert float(found["crossings"]) == pytest.approx(rate, rel=1e-6)
    assert float(found["largest"]) == pytest.approx(1.0 + np.sqrt(variance) * (g + 0.5772 / g), rel=1e-4)
    at = 2 * np.pi * 1.3
    assert float(found["density"]) == pytest.approx(4 * np.pi * abs(of_drift(at)) ** 2 * density(at), rel=1e-9)
    if kind != "white":
        expected = np.sqrt(integral(of_acceleration, density, band, rates))
        assert float(found["absolute"]) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_white_base_acceleration_has_the_closed_forms_of_an_oscillator(seed):
    """Relative displacement ``pi S / (2 z w^3)`` and force per mass ``pi S w (1 + 4 z^2) / (2 z)`` (Crandall 1963)."""
    rng = np.random.default_rng(seed)
    w, z, level, mass = (
        10 ** rng.uniform(-1, 2),
        10 ** rng.uniform(-3, 0),
        10 ** rng.uniform(-3, 1),
        rng.uniform(0.2, 5),
    )
    process = RandomProcess("base", psd=white_noise(level, sided="two", per="rad/s"), over="time")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = mechanism.body("body", mass=mass, position=1)
    stiffness, damping = mass * w**2, 2 * z * w * mass
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness, damping=damping, free_length=1))
    mechanism.add(PointForce("inertia", body, 0, -mass * process()))
    mechanism.output("relative", stationary_std(body.position[0]))
    mechanism.output("force", stationary_std(w**2 * body.position[0] + 2 * z * w * body.velocity[0]))
    found = uqmbd.simulate(mechanism, [0, 1])
    assert float(found["relative"]) ** 2 == pytest.approx(np.pi * level / (2 * z * w**3), rel=1e-9)
    assert float(found["force"]) ** 2 == pytest.approx(np.pi * level * w * (1 + 4 * z**2) / (2 * z), rel=1e-9)


@pytest.mark.thorough
def test_every_method_propagates_the_variance_of_a_chain():
    """Uncertain stiffness and damping: mean, standard deviation and probability by a Gauss rule and by SciPy."""
    m, k, c = draw(1)
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(0.8 * k[1], 1.2 * k[1]), units="N/m")
    damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.6 * c[0], 1.4 * c[0]), units="N s/m")
    level, w0, z = 0.05, 12.0, 0.5
    process = RandomProcess("base", psd=kanai_tajimi(level, w0, z), over="time")
    mechanism, first, second = chain(process, m, (k[0], stiffness), (damping, c[1]))
    drift = stationary_std(second.position[0] - first.position[0])

    def reference(k2, c1):
        """Return the deviation by Lyapunov's equation of masses and ground together."""
        a, noise = np.zeros((6, 6)), np.zeros((6, 6))
        a[:2, 2:4], a[4, 5] = np.eye(2), 1.0
        a[2:4, :2] = -np.array([[(k[0] + k2) / m[0], -k2 / m[0]], [-k2 / m[1], k2 / m[1]]])
        a[2:4, 2:4] = -np.array([[(c1 + c[1]) / m[0], -c[1] / m[0]], [-c[1] / m[1], c[1] / m[1]]])
        a[5, 4:] = -(w0**2), -2 * z * w0
        a[2:4, 4:] = w0**2, 2 * z * w0  # minus the acceleration of the ground
        noise[5, 5] = 2 * np.pi * level
        covariance = solve_continuous_lyapunov(a, -noise)
        row = np.array([-1.0, 1, 0, 0, 0, 0])
        return np.sqrt(row @ covariance @ row)

    nodes, weights = np.polynomial.legendre.leggauss(12)
    values = np.array([[reference(k[1] * (1 + 0.2 * x), c[0] * (1 + 0.4 * y)) for y in nodes] for x in nodes])
    mean = weights @ values @ weights / 4
    std = np.sqrt(weights @ values**2 @ weights / 4 - mean**2)
    limit = float(mean + 1.2 * std)
    rng = np.random.default_rng(0)
    many = 1 + rng.uniform(-1, 1, (4000, 2)) * [0.2, 0.4]
    share = np.mean([reference(k[1] * x, c[0] * y) > limit for x, y in many])
    mechanism.output("drift", drift)
    mechanism.require("small", drift <= limit)
    methods = [Collocation(order=8), MonteCarlo(samples=4000, seed=1), Galerkin(order=5), Reliability(seed=1)]
    tree = uqmbd.Study("chain", mechanism, propagators=methods).run()
    for name, accuracy in (("collocation", 1e-5), ("galerkin", 1e-4)):
        data = tree[f"{name}/scalars/statistics"].to_dataset().sel(output="drift")
        assert data["mean"].item() == pytest.approx(mean, rel=accuracy)
        assert data["std"].item() == pytest.approx(std, rel=30 * accuracy)
    data = tree["monte-carlo/scalars/statistics"].to_dataset().sel(output="drift")
    assert data["mean"].item() == pytest.approx(mean, abs=4 * std / np.sqrt(4000))
    assert data["std"].item() == pytest.approx(std, rel=0.05)
    for name in ("collocation", "monte-carlo", "reliability"):
        found = tree[f"{name}/requirements"]["violation_probability"].values.ravel()[0]
        assert found == pytest.approx(share, abs=0.03)
