"""Posteriors of nine inputs, of a rig of two masses that is shaken at its base.

The reference is the linear differential equation in closed form: by eigenvalues, and weights of draws of a normal
distribution about its most probable values.  The record says next to nothing of one direction, as stiffnesses, dampings
and masses that grow together leave the motion as it is.
"""

import warnings

import chaospy
import numpy as np
import pytest
import scipy.stats
import sympy
from scipy.optimize import least_squares

import uqmbd
from uqmbd_calibration import Record, Series, calibrate
from uqmbd_drivers import PositionDriver
from uqmbd_springs import SpringDamper

NAMES = ["k1", "k2", "c1", "c2", "m1", "m2", "amplitude", "offset", "omega"]
MASSES = np.array([[0.04, 0.01], [0.01, 0.01]])
NOISE = 2e-4, 1e-4


def rig():
    def normal(name, mean, sd, units):
        return uqmbd.RandomVariable(name, chaospy.Normal(mean, sd), units=units)

    k1, k2 = normal("k1", 4000, 600, "N/m"), normal("k2", 2500, 400, "N/m")
    c1 = uqmbd.RandomVariable("c1", scipy.stats.lognorm(0.4, scale=12), units="N s/m")
    c2 = uqmbd.RandomVariable("c2", scipy.stats.lognorm(0.4, scale=8), units="N s/m")
    m1, m2 = uqmbd.random_vector(["m1", "m2"], scipy.stats.multivariate_normal([10.0, 5.0], MASSES), ["kg", "kg"])
    amplitude, offset = normal("amplitude", 0.01, 0.0002, "m"), normal("offset", 0.0, 0.002, "m")
    omega = normal("omega", 14.0, 0.05, "rad/s")
    made = uqmbd.Mechanism("rig", uqmbd.Line())
    base = made.body("base", mass=1, position=0.0)
    lower, upper = made.body("lower", mass=m1, position=0.3), made.body("upper", mass=m2, position=0.6)
    displacement = amplitude * sympy.sin(omega * uqmbd.t)
    made.add(PositionDriver("shaker", made.ground, base, 0, 0, 1, displacement=displacement))
    made.add(SpringDamper("s1", base, lower, 0, 0, stiffness=k1, damping=c1, free_length=0.3))
    made.add(SpringDamper("s2", lower, upper, 0, 0, stiffness=k2, damping=c2, free_length=0.3))
    made.output("upper", upper.position[0] - 0.6 + offset, units="m")
    made.output("lower", lower.position[0] - 0.3, units="m")
    return uqmbd.Study("rig", made, np.linspace(0, 4, 201), [])


def inputs(normals):
    """Inputs (K, 9) at standard normal variables (K, 9)."""
    masses = np.array([10, 5]) + normals[:, 4:6] @ np.linalg.cholesky(MASSES).T
    springs = np.column_stack([4000 + 600 * normals[:, 0], 2500 + 400 * normals[:, 1]])
    dampers = np.column_stack([12 * np.exp(0.4 * normals[:, 2]), 8 * np.exp(0.4 * normals[:, 3])])
    motion = np.column_stack([0.01 + 2e-4 * normals[:, 6], 0.002 * normals[:, 7], 14 + 0.05 * normals[:, 8]])
    return np.column_stack([springs, dampers, masses, motion])


def outputs(normals, times):
    """Displacements (K, time) of both masses, which begin at rest, by eigenvalues of the linear equations."""
    k1, k2, c1, c2, m1, m2, amplitude, offset, omega = inputs(normals).T
    system = np.zeros((len(k1), 4, 4))
    system[:, 0, 2] = system[:, 1, 3] = 1
    system[:, 2] = np.column_stack([-(k1 + k2), k2, -(c1 + c2), c2]) / m1[:, None]
    system[:, 3] = np.column_stack([k2, -k2, c2, -c2]) / m2[:, None]
    load = np.zeros((len(k1), 4), complex)
    load[:, 2] = (k1 + 1j * omega * c1) * amplitude / m1
    steady = np.linalg.solve(1j * omega[:, None, None] * np.eye(4) - system, load[..., None])[..., 0]
    values, vectors = np.linalg.eig(system)
    free = np.linalg.solve(vectors, -steady.imag[..., None].astype(complex))[..., 0]
    decaying, swinging = np.exp(values[:, :, None] * times), np.exp(1j * omega[:, None] * times)
    lower, upper = (
        np.einsum("nj,njt->nt", vectors[:, row] * free, decaying).real + (steady[:, row, None] * swinging).imag
        for row in (0, 1)
    )
    return upper + offset[:, None], lower


def reference(record, times, truth, generator):
    """Mean and deviations (9,) of the inputs given values of both outputs."""

    def misfits(normals):
        pairs = zip(outputs(np.atleast_2d(normals), times), record, NOISE, strict=True)
        return np.column_stack([*((found - values) / sd for found, values, sd in pairs), np.atleast_2d(normals)])

    found = least_squares(lambda z: misfits(z)[0], truth, xtol=1e-14, ftol=1e-14)
    factor = np.linalg.cholesky(np.linalg.inv(found.jac.T @ found.jac))
    local = generator.standard_normal((20_000, 9))
    drawn = found.x + 1.15 * local @ factor.T
    costs = np.concatenate([0.5 * (misfits(part) ** 2).sum(axis=1) for part in np.split(drawn, 40)])
    weights = np.exp(costs.min() - costs + 0.5 * (local**2).sum(axis=1))
    weights /= weights.sum()
    assert 1 / (weights**2).sum() > 2000
    values = inputs(drawn)
    mean = weights @ values
    return mean, np.sqrt(weights @ (values - mean) ** 2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3, 5, 6])
def test_posterior_is_that_of_the_closed_form(seed):
    generator = np.random.default_rng(seed)
    truth = 0.9 * generator.standard_normal(9)
    times = np.sort(generator.uniform(0.02, 3.98, 160))
    record = [
        values[0] + sd * generator.standard_normal(160)
        for values, sd in zip(outputs(truth[None], times), NOISE, strict=True)
    ]
    mean, sd = reference(record, times, truth, generator)
    series = [
        Series(name, times, values, "m", noise=noise)
        for name, values, noise in zip(("upper", "lower"), record, NOISE, strict=True)
    ]
    with warnings.catch_warnings():
        # the record cannot say how large stiffnesses and masses are together
        warnings.simplefilter("ignore")
        found = calibrate(rig(), Record("rig", series), seed=seed)
    summary = found.summary().sel(input=NAMES)
    assert found.checks["even"], found.checks["surrogate"]
    np.testing.assert_allclose((summary["mean"].values - mean) / sd, 0, atol=0.15)
    np.testing.assert_allclose(summary["sd"].values, sd, rtol=0.15)
