"""The time of the most likely violation is that of the requirement: first, last or none, in closed form."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_reliability import Reliability


@pytest.mark.thorough
@pytest.mark.parametrize("start", [0.0, 2.0])
def test_times_of_design_points_follow_the_kind_of_the_requirement(start: float) -> None:
    """A mass moves at constant speed: its position is smallest at the first time and largest at the last time."""
    mechanism = uqmbd.Mechanism("carriage", uqmbd.Line())
    begin = uqmbd.RandomVariable("begin", chaospy.Normal(0, 0.2), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
    body = mechanism.body("mass", mass=1, position=begin, velocity=speed)
    mechanism.output("x", body.position[0], units="m")
    mechanism.require("behind", body.position[0] >= -0.5)
    mechanism.require("ahead", body.position[0] <= 1.6)
    mechanism.require("lowest", uqmbd.minimum(body.position[0]) >= -0.5)
    mechanism.require("power", uqmbd.root_mean_square(body.velocity[0]) <= 1.25)
    mechanism.require("input", speed <= 1.25)
    times = start + np.linspace(0.0, 1.0, 11)
    method = Reliability(seed=1, max_realisations=1500, target_cov=0.3)
    tree = uqmbd.Study("carriage", mechanism, times, [method]).run()
    data = tree["reliability/requirements"].to_dataset()
    found = {str(name): float(data.sel(requirement=name)["design_times"][0]) for name in data["requirement"].values}
    found.pop("any")
    expected = {"behind": start, "ahead": start + 1, "lowest": start, "power": np.nan, "input": np.nan}
    np.testing.assert_allclose([found[name] for name in expected], list(expected.values()), atol=1e-12)
    assert set(found) == set(expected)
