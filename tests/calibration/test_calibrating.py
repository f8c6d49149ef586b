"""The whole way, from records of a mechanism to its posterior."""

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd_calibration import Calibration, Record, Series, calibrate
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0.05, 3, 60)


def oscillator(stiffness=None, damping=None):
    """Make a study of a mass on a spring and a damper, let go 0.1 m beside its rest."""
    if stiffness is None:
        stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(100.0, 10.0), units="N/m")
    if damping is None:
        damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 1.5), units="N s/m")
    made = uqmbd.Mechanism("oscillator", uqmbd.Translational(gravity=(0, 0)))
    mass = made.body("mass", mass=1.0, position=(1.1, 0))
    made.add(
        SpringDamper(
            "spring",
            made.ground,
            mass,
            point_i=(0, 0),
            point_j=(0, 0),
            stiffness=stiffness,
            damping=damping,
            free_length=1.0,
        )
    )
    made.output("x", mass.position[0], units="m")
    return uqmbd.Study("oscillator", made, np.linspace(0, 3, 61), rtol=1e-8)


def motion(stiffness, damping, times=TIMES):
    """Return the position, by the formula of a damped oscillator."""
    decay = damping / 2
    omega = np.sqrt(stiffness - decay**2)
    turned = np.multiply.outer(omega, times)
    fading = np.exp(-np.multiply.outer(decay, times))
    return 1.0 + 0.1 * fading * (np.cos(turned) + (decay / omega)[..., None] * np.sin(turned))


def record(stiffness=112.0, damping=0.9, noise=0.005, seed=0, stated=True):
    """Make a record of the formula."""
    values = motion(np.array(stiffness), np.array(damping)) + noise * np.random.default_rng(seed).standard_normal(60)
    return Record("run 1", [Series("x", TIMES, values, "m", noise=noise if stated else None)])


def grid(measured, noise):
    """Return means and deviations (2,) of stiffness and damping by quadrature over a grid."""
    k, c = np.meshgrid(np.linspace(90, 130, 401), np.linspace(0.5, 1.5, 301), indexing="ij")
    misfit = motion(k, c) - measured
    density = np.exp(-0.5 * (misfit**2).sum(axis=-1) / noise**2 - 0.5 * ((k - 100) / 10) ** 2)
    density /= density.sum()
    mean = np.array([(density * k).sum(), (density * c).sum()])
    return mean, np.sqrt([(density * (k - mean[0]) ** 2).sum(), (density * (c - mean[1]) ** 2).sum()])


@pytest.fixture(scope="module")
def found():
    return calibrate(oscillator(), record(), seed=1)


@pytest.mark.thorough
def test_the_posterior_is_that_of_a_grid(found):
    mean, sd = grid(record()["x"].values, 0.005)
    posterior = found.tree["posterior"]
    for k, name in enumerate(("stiffness", "damping")):
        draws = posterior[name].values
        assert draws.mean() == pytest.approx(mean[k], abs=0.08 * sd[k])
        assert draws.std() == pytest.approx(sd[k], rel=0.06)
        assert posterior[name].attrs["units"] == ("N/m", "N s/m")[k]
    assert found.checks["even"] and not found.checks["widened"] and found.checks["converged"]
    assert found.realisations < 200
    assert found.unidentified == ()


@pytest.mark.thorough
def test_a_calibration_is_stored_as_it_is(found, tmp_path):
    path = found.save(tmp_path / "found.nc")
    again = Calibration.load(path)
    assert again.summary().identical(found.summary())
    assert str(again) == str(found) and again.checks == found.checks
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        assert tree["posterior"].to_dataset().equals(found.tree["posterior"].to_dataset())


@pytest.mark.thorough
def test_the_posterior_is_propagated_by_other_methods(found):
    from uqmbd_collocation import Collocation
    from uqmbd_montecarlo import MonteCarlo

    by_name = {variable.name: variable for variable in found.variables()}
    study = oscillator(by_name["stiffness"], by_name["damping"])
    tree = study.with_propagators([MonteCarlo(samples=400, seed=1), Collocation(order=2)]).run()
    posterior = found.tree["posterior"]
    exact = motion(posterior["stiffness"].values.ravel(), posterior["damping"].values.ravel(), study.times)
    largest = exact.std(axis=0).max()
    for method, loose in (("monte-carlo", 0.15), ("collocation", 0.05)):
        statistics = tree[method]["statistics"]
        np.testing.assert_allclose(statistics["mean"].values[0], exact.mean(axis=0), atol=loose * largest)
        np.testing.assert_allclose(statistics["std"].values[0], exact.std(axis=0), atol=loose * largest)
