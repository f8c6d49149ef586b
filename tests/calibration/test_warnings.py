"""What a posterior does not show by itself is told: other maxima, and inputs that are far from their priors."""

import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_calibration import Record, Series, calibrate
from uqmbd_springs import SpringDamper


def told(input_, stiffness, truth, noise, **options):
    """Calibrate with the frequency of a mass on a spring; return the result, and what it warned of."""
    made = uqmbd.Mechanism("oscillator", uqmbd.Line())
    body = made.body("mass", mass=1.0, position=1)
    made.add(SpringDamper("spring", made.ground, body, 0, 0, stiffness(input_), free_length=1))
    made.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    values = np.sqrt(stiffness(truth)) / (2 * np.pi) + noise * np.array([-1.0, 0.2, 0.8])
    record = Record("tap test", [Series("frequency", [], values, "Hz", noise=noise)])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = calibrate(uqmbd.Study("oscillator", made), record, **options)
    return found, " ".join(str(one.message) for one in said)


def symmetric(x):
    return 20 + x**2


@pytest.mark.thorough
def test_all_maxima_have_draws():
    """The frequency does not depend on the sign of the input."""
    found, said = told(uqmbd.RandomVariable("x", chaospy.Normal(0, 2)), symmetric, 3.0, 0.01)
    assert "maxima" not in said and not found.checks["unsampled"]
    assert found.checks["modes"] == pytest.approx([0.5, 0.5], abs=0.02)
    assert "the posterior has 2 maxima, with about 50 % and 50 % of the probability" in str(found)
    draws = found.tree["posterior"]["x"].values.ravel()
    assert (draws > 0).mean() == pytest.approx(0.5, abs=0.03)
    # the square of the input over the noise of three values, from the derivative of the frequency
    sd = 0.01 / np.sqrt(3) * 4 * np.pi * np.sqrt(symmetric(3.0)) / 6
    assert np.abs(draws).std() == pytest.approx(sd, rel=0.15)


@pytest.mark.thorough
def test_a_maximum_that_no_draws_are_about_is_reported():
    """A limit of the realisations leaves none for a second surrogate."""
    found, said = told(uqmbd.RandomVariable("x", chaospy.Normal(0, 2)), symmetric, 3.0, 0.01, realisations=100)
    assert "1 further maxima of the posterior contain about 50 % of the probability. The sampled draws" in said
    assert found.checks["unsampled"] == pytest.approx([0.5], abs=0.02)
    assert "of the probability, but the sampled draws contain less than a fifth" in str(found)


@pytest.mark.slow
def test_maxima_that_draws_hold_are_not_reported():
    found, said = told(uqmbd.RandomVariable("x", chaospy.Normal(0, 2)), symmetric, 1.0, 0.02)
    assert len(found.checks["modes"]) == 2
    assert "maxima" not in said and not found.checks["unsampled"]
    share = float((found.tree["posterior"]["x"] > 0).mean())
    assert share == pytest.approx(0.5, abs=0.1)


@pytest.mark.thorough
def test_maxima_that_few_realisations_do_not_follow_are_reported():
    found, said = told(uqmbd.RandomVariable("x", chaospy.Normal(0, 2)), symmetric, 3.0, 0.01, realisations=40)
    assert len(found.checks["modes"]) == 1
    assert found.checks["unseen"] == 1
    assert "1 further maxima of the surrogate have a similar probability" in said


@pytest.mark.thorough
@pytest.mark.parametrize("truth, side", [(130.0, "above"), (70.0, "below")])
def test_an_input_far_from_its_prior_is_reported(truth, side):
    prior = uqmbd.RandomVariable("k", chaospy.Normal(100, 2), units="N/m")
    found, said = told(prior, lambda k: k, truth, 0.002)
    (far,) = found.checks["far"]
    assert far["input"] == "k"
    assert abs(far["deviations"]) == pytest.approx(15.0, abs=0.3)
    assert f"prior standard deviations {side} the prior median" in said
    values = found.tree["observed_data"]["frequency"].values
    # the prior says next to nothing beside the record: normal, by the derivative of the frequency
    information = 3 / (0.002 * 4 * np.pi * np.sqrt(truth)) ** 2 + 1 / 4
    assert float(found.summary()["sd"].item()) == pytest.approx(information**-0.5, rel=0.05)
    assert float(found.summary()["mean"].item()) == pytest.approx(
        truth + (100 - truth) / 4 / information + 4 * np.pi * truth**0.5 * (values.mean() - truth**0.5 / 2 / np.pi),
        abs=0.2 * information**-0.5,
    )
    assert "prior median" not in told(prior, lambda k: k, 103.0, 0.002)[1]
