"""A recorded double pendulum: another engine made the records, whose values are known."""

from __future__ import annotations

import runpy
import warnings
from pathlib import Path

import numpy as np
import pytest

import uqmbd

STUDY = Path(__file__).parents[2] / "studies" / "calibration.py"
TRUTH = {"lower_mass": 0.55, "upper_damping": 0.015, "lower_damping": 0.005}


@pytest.fixture(scope="module")
def made():
    with warnings.catch_warnings():
        # that a plain chaos alone does not follow all of the motion
        warnings.simplefilter("ignore")
        return runpy.run_path(str(STUDY))


@pytest.mark.slow
def test_intervals_hold_what_the_other_engine_was_given(made):
    """Within the 95 % intervals, by fewer than 200 realisations, confirmed by the mechanism and the residuals."""
    found = made["study"].propagators[1].calibration
    data = found.summary()
    for name, value in TRUTH.items():
        one = data.sel(input=name)
        assert float(one["lower"]) < value < float(one["upper"]), name
        assert float(one["reduction"]) > 0.95
    assert found.realisations < 200 and found.checks["even"] and found.checks["converged"]
    assert not any(one["rejected"] for one in found.checks["model"])


@pytest.mark.slow
def test_friction_that_is_left_out_is_noticed_with_the_times(made):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = made["calibrated"]("double_pendulum_with_friction")
    said = [str(one.message) for one in told if issubclass(one.category, uqmbd.StudyWarning)]
    for output in ("upper angle", "joint angle"):
        assert any(f"{output!r}: the model does not explain these values" in x and "above all at" in x for x in said)
    assert all(one["rejected"] and one["where"] for one in found.checks["model"])


@pytest.mark.slow
def test_the_next_motion_is_known_better(made):
    tree = made["study"].run()
    for output, least in (("upper angle", 0.3), ("joint angle", 0.1)):
        before, after = (tree[x]["statistics"]["std"].sel(output=output).values for x in ("before", "after"))
        assert np.sqrt(np.mean(after**2) / np.mean(before**2)) < least, output
