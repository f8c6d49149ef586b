"""A surrogate of unknown error has little influence on a posterior, also with a single recorded value."""

import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_calibration import Record, Series, calibrate
from uqmbd_calibration.arranging import arrange
from uqmbd_calibration.inference import read_prior_surrogates
from uqmbd_collocation import Collocation

SPEED, NOISE = 2.0, 0.01
WAY = Record("run", [Series("x", [1.0], [SPEED**3], "m", NOISE)])


def study():
    """Return a stone of the speed a^3, with a standard normal a: by two Gauss nodes, the chaos of order 1 is a."""
    a = uqmbd.RandomVariable("a", chaospy.Normal(0, 1))
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    mechanism.output("x", mechanism.body("stone", mass=1, velocity=a**3).position[0], units="m")
    return uqmbd.Study("stone", mechanism, [0.0, 1.0])


def test_the_error_of_an_unverified_surrogate_is_the_distance_of_its_predictions():
    """The mean square of a - 8 is 65; the true mean square error, of a^3 - a, is 10."""
    arranged = arrange(
        study(), [WAY], robust=False, bias={}, individual=[], realisations=50, executor=None, progress=None
    )
    case = arranged.cases[0]
    nodes = case.point.surrogates([Collocation(order=1, verify=0)], ["x"])
    (variance,) = read_prior_surrogates(nodes, case.point, case.blocks).variances
    assert variance == pytest.approx([65.0], rel=0.02)


def test_an_unverified_surrogate_without_further_realisations_does_not_determine_the_posterior():
    """The surrogate alone has its maximum at 8, with the standard deviation 0.01."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.StudyWarning)
        found = calibrate(
            study(), WAY, surrogate=Collocation(order=1, verify=0), realisations=3, draws=400, chains=2, progress=False
        )
    draws = found.tree["posterior"]["a"].values
    assert abs(draws.mean() - SPEED) < 3 * draws.std()
    assert found.checks["widened"]


def test_a_realisation_at_each_draw_makes_up_for_an_unverified_surrogate():
    """The derivative of a^3 is 12 at the recorded speed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.StudyWarning)
        found = calibrate(
            study(),
            WAY,
            surrogate=Collocation(order=1, verify=0),
            realisations=200,
            draws=400,
            chains=2,
            progress=False,
        )
    draws = found.tree["posterior"]["a"].values
    assert found.checks["even"] and not found.checks["widened"]
    assert draws.mean() == pytest.approx(SPEED, abs=3 * NOISE / 12)
    assert np.std(draws) == pytest.approx(NOISE / 12, rel=0.2)


@pytest.mark.parametrize("count", [2, 200])
def test_many_values_do_not_average_the_error_of_a_surrogate(count):
    """Errors of a surrogate at all times have one sign: more values do not make the posterior narrower."""
    times = np.linspace(1, 1.5, count)
    record = Record("run", [Series("x", times.tolist(), (SPEED**3 * times).tolist(), "m", NOISE)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.StudyWarning)
        found = calibrate(
            study(), record, surrogate=Collocation(order=1, verify=0), realisations=3, draws=400, chains=2,
            progress=False,
        )  # fmt: skip
    draws = found.tree["posterior"]["a"].values
    assert abs(draws.mean() - SPEED) < 3 * draws.std()
    assert draws.std() > 0.5
