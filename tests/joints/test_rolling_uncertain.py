"""Skates and rolling wheels with random inputs, by every method."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_galerkin import Galerkin
from uqmbd_joints import RollingWheel
from uqmbd_montecarlo import MonteCarlo

from .sleighs import sleigh

G = 9.81
ORIGIN = (0, 0, 0)
UP = (0, 0, 1)


def uncertain_sleigh():
    inertia = uqmbd.RandomVariable("inertia", chaospy.Uniform(0.12, 0.18), units="kg m^2")
    arm = uqmbd.RandomVariable("arm", chaospy.Normal(0.3, 0.01), units="m")
    return sleigh(0, 3.0, inertia=inertia, arm=arm)


def sleigh_moments(times, mass=2.0, turning=3.0):
    """Mean and standard deviation of speed and turning, by a Gauss rule of NumPy on the closed form."""
    (x, w), (y, u) = np.polynomial.legendre.leggauss(20), np.polynomial.hermite_e.hermegauss(20)
    inertia, arm = (0.15 + 0.03 * x)[:, None, None], (0.3 + 0.01 * y)[None, :, None]
    weights = np.outer(w / w.sum(), u / u.sum())
    whole = inertia + mass * arm**2
    final = turning * np.sqrt(whole / mass)
    k = mass * arm * final / whole
    for values in (final * np.tanh(k * times), turning / np.cosh(k * times)):
        mean = np.einsum("ij,ijt->t", weights, values)
        yield mean, np.sqrt(np.einsum("ij,ijt->t", weights, (values - mean) ** 2))


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_an_uncertain_sleigh_by_every_method(integrator, close):
    """Moments of the closed form: by collocation and Galerkin to their order, by Monte Carlo within its errors."""
    times = np.linspace(0, 1.5, 7)
    study = uqmbd.Study(
        "sleigh",
        uncertain_sleigh(),
        times,
        propagators=[
            Galerkin(order=5, verify=0, integrator=integrator),
            Collocation(order=5, verify=0),
            MonteCarlo(samples=400, seed=3),
        ],
        rtol=1e-9,
        integrator=integrator,
    )
    tree = study.run()
    for name, (mean, std) in zip(("speed", "turning"), sleigh_moments(times), strict=True):
        for method in ("galerkin", "collocation"):
            found = tree[f"{method}/statistics"].sel(output=name)
            close(found["mean"], mean, relative=1e-6)
            close(found["std"], std, relative=1e-4)
        found = tree["monte-carlo/statistics"].sel(output=name)
        assert (np.abs(found["mean"] - mean)[1:] < 4 * found["std_error_mean"][1:]).all()
        assert (np.abs(found["std"] - std)[1:] < 4 * found["std_error_std"][1:]).all()


@pytest.mark.thorough
def test_galerkin_keeps_the_velocity_constraint_and_the_energy():
    """The projections of the slip on the polynomials of the basis vanish, and the expected energy stays."""
    times = np.linspace(0, 1.5, 7)
    for order in (2, 4):
        study = uqmbd.Study("sleigh", uncertain_sleigh(), times, propagators=[Galerkin(order=order, verify=0)])
        node = study.run()["galerkin"]
        across = node["statistics"].to_dataset().sel(output="across")
        assert float(np.abs(across["mean"]).max()) < 1e-6 and float(across["std"].max()) < 1e-6
        diagnostics = node["diagnostics"].to_dataset()
        energy = diagnostics["energy"].values
        assert np.abs(energy - energy[0]).max() < 1e-5 * np.abs(energy).max()


@pytest.mark.thorough
def test_an_uncertain_disc_by_galerkin_and_collocation(close):
    """A wobbling disc of random mass and lean in space: two methods, and both integrators, tell the same."""
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1.2, 1.8), units="kg")
    lean = uqmbd.RandomVariable("lean", chaospy.Normal(0.6, 0.02), units="rad")

    def mechanism():
        made = uqmbd.Mechanism("disc", uqmbd.Spatial(gravity=(0, 0, -G)))
        up, axis = (
            sympy.Matrix([sympy.sin(lean), 0, sympy.cos(lean)]),
            sympy.Matrix([-sympy.cos(lean), 0, sympy.sin(lean)]),
        )
        quaternion = (sympy.cos(lean / 2 - sympy.pi / 4), 0, sympy.sin(lean / 2 - sympy.pi / 4), 0)
        turning = 4 * sympy.Matrix([0, 0, 1]) - 3 * axis
        radius = sympy.Rational(1, 4)
        body = made.body(
            "disc", mass=mass, inertia=(0.02, 0.02, 0.03), position=tuple(radius * up), quaternion=quaternion,
            velocity=tuple(turning.cross(radius * up)),
        )  # fmt: skip
        made.add(RollingWheel("road", made.ground, body, ORIGIN, ORIGIN, normal_i=UP, axis_j=UP, radius=radius))
        for k, name in enumerate("xyz"):
            made.output(name, body.position[k], units="m")
        return made

    found = {}
    for integrator in ("dop853", "ida"):
        propagators = [Galerkin(order=4, verify=0, integrator=integrator), Collocation(order=4, verify=0)]
        study = uqmbd.Study(
            "disc", mechanism(), [0, 0.1, 0.2], propagators=propagators, rtol=1e-8, integrator=integrator
        )
        tree = study.run()
        for method in ("galerkin", "collocation"):
            found[method, integrator] = tree[f"{method}/statistics"].to_dataset()
    first = found.pop(("collocation", "dop853"))
    for other in found.values():
        close(other["mean"], first["mean"], relative=1e-5)
        close(other["std"], first["std"], relative=1e-3)


@pytest.mark.slow
def test_a_rolling_wheel_that_hits_a_wall_by_every_method(close):
    """Its place after the impact, ``L - e v (t - L / v)``, of random speed and restitution: the moments by a Gauss rule."""
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1.8, 2.2), units="m/s")
    restitution = uqmbd.RandomVariable("restitution", chaospy.Uniform(0.4, 0.6))
    radius, way, time = 0.3, 1.0, 1.0
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar(gravity=(0, -G)))
    wheel = mechanism.body("wheel", mass=2, inertia=0.05, position=(0, radius), velocity=(speed, 0))
    mechanism.add(RollingWheel("road", mechanism.ground, wheel, (0, 0), (0, 0), (0, 1), radius=radius))
    mechanism.add(
        PlaneImpact(
            "wall", mechanism.ground, wheel, (way + radius, 0), (0, 0), (-1, 0), radius=radius, restitution=restitution
        )
    )
    mechanism.output("x", wheel.position[0], units="m")
    mechanism.output("turning", wheel.angular_velocity[0], units="rad/s")
    propagators = [
        Collocation(order=4, verify=0),
        Collocation(order=4, verify=2, alignment="events", label="aligned"),
        Galerkin(order=4, verify=0, index_set="tensor"),
        MonteCarlo(samples=300, seed=2, label="sampled"),
    ]
    study = uqmbd.Study("wheel", mechanism, [0, 0.2, time], propagators=propagators, rtol=1e-9)
    tree = study.run(workers=2)
    nodes, weights = np.polynomial.legendre.leggauss(10)
    v, e, w = (2 + 0.2 * nodes)[:, None], (0.5 + 0.1 * nodes)[None, :], np.outer(weights, weights) / 4
    for name, values in (("x", way - e * v * (time - way / v)), ("turning", e * v / radius)):
        mean = np.sum(w * values)
        std = np.sqrt(np.sum(w * (values - mean) ** 2))
        for method, allowed in (("collocation", 1e-5), ("aligned", 2e-2), ("galerkin", 1e-5), ("sampled", 0.2)):
            found = tree[f"{method}/statistics"].to_dataset().sel(output=name).isel(time=-1)
            close(found["mean"], mean, relative=allowed, scale=std)
            close(found["std"], std, relative=allowed)
