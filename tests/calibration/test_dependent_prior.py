"""A calibration of inputs whose prior is a joint distribution with a conditional member, against the closed form."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_calibration import Record, Series, calibrate


@pytest.mark.slow
def test_a_conditional_prior():
    """p ~ U(1, 3), q ~ N(0.5 p, 0.2), and p is measured as 2.2 with a noise of 0.1: p ~ N(2.2, 0.1), q follows."""
    p = chaospy.Uniform(1, 3)
    place, speed = uqmbd.random_vector(["p", "q"], chaospy.J(p, chaospy.Normal(0.5 * p, 0.2)), ["m", "m/s"])
    mechanism = uqmbd.Mechanism("carrier", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=place, velocity=speed)
    mechanism.output("place", body.position[0], units="m")
    study = uqmbd.Study("carrier", mechanism, np.linspace(0, 1, 3))
    found = calibrate(study, Record("start", [Series("place", [0.0], [2.2], "m", noise=0.1)]))
    draws = found.summary()
    means = [float(draws["mean"].sel(input=name)) for name in ("p", "q")]
    deviations = [float(draws["sd"].sel(input=name)) for name in ("p", "q")]
    assert means == pytest.approx([2.2, 1.1], abs=0.02)
    assert deviations == pytest.approx([0.1, np.sqrt(0.04 + 0.25 * 0.01)], rel=0.08)
