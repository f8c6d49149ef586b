"""Outputs beside requirements: statistics of what is spread like the inputs, and what does not always happen."""

from __future__ import annotations

import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report import write_report
from uqmbd.results import validate
from uqmbd_reliability import Reliability


@pytest.fixture(scope="module")
def tree():
    """A throw by 1 m/s to 2 m/s for a second: it reaches 1.6 m where it is faster than that, in 40 %."""
    mechanism = uqmbd.Mechanism("throw", uqmbd.Translational())
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 2))
    x = mechanism.body("body", mass=1, velocity=(speed, 0)).position[0]
    mechanism.output("x", x, units="m")
    mechanism.output("reached", uqmbd.first_time(x >= 1.6), units="s")
    mechanism.require("near", x <= 1.95)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = uqmbd.Study("throw", mechanism, [0, 1], [Reliability(seed=1)]).run()
    return found, [str(one.message) for one in told]


def test_what_does_not_happen_has_not_failed(tree):
    node, told = tree[0]["reliability"], tree[1]
    validate(node)
    assert node["scalars"].attrs["failures"] == 0 and not any("failed" in words for words in told)
    reached = node["scalars/statistics"].to_dataset().sel(output="reached")
    assert abs(float(reached["censored"]) - 0.6) < 4 * np.sqrt(0.24 / 120)
    exact = 1.6 / np.linspace(1.6, 2, 10_001)
    assert abs(float(reached["mean"]) - exact.mean()) < 5 * exact.std() / np.sqrt(0.4 * 120)


def test_the_report_says_of_how_many_realisations_statistics_are(tree, tmp_path):
    text = " ".join(write_report(tree[0], tmp_path / "report.html").read_text().split())
    assert (
        "The statistics of reliability use the 120 realisations that were sampled from the distributions of the inputs"
        in text
    )
    assert "are those of all" not in text
