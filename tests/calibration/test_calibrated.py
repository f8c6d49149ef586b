"""Methods with the posterior in the place of the prior, against closed forms of linear models."""

from __future__ import annotations

import functools

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.results import load, save, validate
from uqmbd.testing import check_propagator
from uqmbd.testing.solutions import CASES
from uqmbd_calibration import Calibrated, Calibration, Record, Series, calibrate
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability

pytestmark = pytest.mark.thorough

TIMES, NOISE = np.linspace(0, 1, 11), 0.05
MEAN, PRIOR = np.array([2.0, 0.5]), np.diag([0.3**2, 0.2**2])


def stone(extra=False, units="m"):
    """A stone that goes on: x = place + speed t."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    place = uqmbd.RandomVariable("place", chaospy.Normal(MEAN[1], 0.2), units=units)
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(MEAN[0], 0.3), units="m/s")
    body = mechanism.body("stone", mass=1, position=place / 1000 if units == "mm" else place, velocity=speed)
    mechanism.output("x", body.position[0] + (uqmbd.RandomVariable("shift", chaospy.Normal(0, 1)) if extra else 0))
    mechanism.require("near", body.position[0] <= 8.5)
    return mechanism


@pytest.fixture(scope="module")
def found():
    """Return the calibration by one record, and the posterior in closed form: mean and covariance of (speed, place)."""
    rows = np.stack([TIMES, np.ones_like(TIMES)], axis=1)
    values = rows @ [2.2, 0.4] + NOISE * np.random.default_rng(3).standard_normal(len(TIMES))
    covariance = np.linalg.inv(np.linalg.inv(PRIOR) + rows.T @ rows / NOISE**2)
    mean = covariance @ (np.linalg.solve(PRIOR, MEAN) + rows.T @ values / NOISE**2)
    record = Record("run 1", [Series("x", TIMES, values, "", NOISE)])
    return calibrate(uqmbd.Study("stone", stone(), TIMES), record, draws=20000), mean, covariance


@pytest.mark.parametrize(
    ("method", "close"),
    [(Collocation(order=1), 0.02), (Galerkin(order=1), 0.02), (MonteCarlo(samples=2000, seed=1), 0.06)],
)
def test_predictions_are_those_of_the_closed_form(found, method, close):
    """At later times: mean [t 1] m, variance [t 1] S [t 1]; the two inputs hang together, so that less is known late."""
    calibration, mean, covariance = found
    later = np.linspace(0, 4, 5)
    study = uqmbd.Study("later", stone(), later, [Calibrated(method, calibration, label="after")])
    tree = study.run()
    validate(tree)
    rows = np.stack([later, np.ones_like(later)], axis=1)
    expected = np.sqrt(np.einsum("ti,ij,tj->t", rows, covariance, rows))
    data = tree["after/statistics"]
    np.testing.assert_allclose(data["std"].values[0], expected, rtol=close)
    assert np.abs((data["mean"].values[0] - rows @ mean) / expected).max() < 3 * close


def test_rare_violations_by_the_posterior(found):
    """P(place + 4 speed > 8.5 + ...) is a normal probability."""
    from scipy.stats import norm

    calibration, mean, covariance = found
    study = uqmbd.Study("later", stone(), [0, 3.4], [Calibrated(Reliability(seed=1, target_cov=0.1), calibration)])
    tree = study.run()
    row = np.array([3.4, 1.0])
    exact = norm.sf((8.5 - row @ mean) / np.sqrt(row @ covariance @ row))
    data = tree["calibrated/requirements"]
    assert float(data["violation_probability"].values.ravel()[-1]) == pytest.approx(exact, rel=0.5)


def test_an_input_that_was_not_calibrated_keeps_its_distribution(found):
    calibration, _, covariance = found
    method = Calibrated(Collocation(order=1), calibration)
    study = uqmbd.Study("more", stone(extra=True), [0, 1], [Collocation(order=1), method])
    assert method.remarks(study) == ("the calibration does not change the distributions of 'shift'",)
    tree = study.run()
    np.testing.assert_allclose(
        tree["calibrated/statistics"]["std"].values[0, 0], np.sqrt(1 + covariance[1, 1]), rtol=0.02
    )
    assert tree["comparison"]["method"].values.tolist() == ["collocation"]


def test_what_does_not_fit_is_reported(found):
    calibration, *_ = found
    mechanism = uqmbd.Mechanism("other", uqmbd.Line())
    mass = uqmbd.RandomVariable("mass", chaospy.Normal(1, 0.1), units="kg")
    mechanism.output("x", mechanism.body("stone", mass=1, velocity=mass / mass.mean).position[0])
    method = Calibrated(Collocation(order=1), calibration)
    with pytest.raises(
        uqmbd.StudyError, match="the calibration has the inputs 'place', 'speed', but the study has 'mass'"
    ):
        uqmbd.Study("other", mechanism, [0, 1], [method]).run()
    with pytest.raises(uqmbd.StudyError, match="input 'place' has the units 'mm', but its replacement has 'm'"):
        uqmbd.Study("other", stone(units="mm"), [0, 1], [method]).run()
    with pytest.raises(
        uqmbd.StudyError, match="Calibrated: the type of calibration is int; expected the result of calibrate"
    ):
        Calibrated(Collocation(order=1), 3)


def test_results_hold_the_calibration(found, tmp_path):
    calibration, *_ = found
    tree = uqmbd.Study("later", stone(), [0, 1], [Calibrated(Collocation(order=1), calibration)]).run()
    again = load(save(tree, tmp_path / "results.nc"))
    kept = again["calibrated/calibration"]
    assert kept["posterior"]["speed"].equals(calibration.tree["posterior"]["speed"])
    assert kept["summary"]["reduction"].equals(calibration.tree["summary"]["reduction"])


def alike():
    """Make a calibration that has learned nothing of the inputs of the cases of the conformance kit."""
    from scipy.special import ndtr

    normal = np.linspace(-8, 8, 1601)
    studies = [make().study for make in CASES.values()]
    known = {v.name: v for study in studies for v in study.mechanism.inputs.variables}
    names = np.array(list(known))
    uniform = np.clip(ndtr(normal), 1e-14, 1 - 1e-14)
    tables = np.stack([np.ravel(v.distribution.inv(uniform)) for v in known.values()], axis=1)
    data = {
        "marginals": xr.Dataset(
            {"quantile": (("normal", "input"), tables), "correlation": (("input", "other"), np.eye(len(names)))},
            coords={"normal": normal, "input": names, "other": names},
        ),
        "summary": xr.Dataset({"units": ("input", [v.units for v in known.values()])}, coords={"input": names}),
    }
    tree = xr.DataTree.from_dict(data)
    tree.attrs |= {"kind": "calibration", "study": "cases", "records": ["nothing"], "realisations": 0}
    return Calibration(tree)


@pytest.mark.slow
def test_it_conforms():
    """All but failures: the case of these has an input of another distribution than that of its name here."""
    make = functools.partial(_calibrated, method=Collocation(order=4), calibration=alike())
    check_propagator(make, failures=False)


def _calibrated(method, calibration, label=None, seed=None):
    return Calibrated(method, calibration, label=label)
