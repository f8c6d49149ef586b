"""The benchmark of calibration: its direct models, and a truth of each."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import uqmbd

BENCHMARK = Path(__file__).parents[2] / "studies" / "benchmarks" / "calibration.py"


@pytest.fixture(scope="module")
def made():
    return runpy.run_path(str(BENCHMARK))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slider-crank", "two masses"])
def test_records_are_those_of_the_same_mechanism(made, name):
    """Two ways to one motion: what records are made by, and the study."""
    case = made["CASES"][name]
    inputs = case.values(np.array([[0.7, -0.4, 1.1]]))
    study = case.study()
    found = uqmbd.simulate(study.mechanism, made["TIMES"], dict(zip(case.names, inputs[0], strict=True)), rtol=1e-9)
    names = [*study.mechanism.outputs, *study.mechanism.scalars]
    seen = np.concatenate([np.ravel(found[x].values) for x in names])
    np.testing.assert_allclose(case.direct(inputs)[0], seen, rtol=1e-6, atol=1e-7)


@pytest.mark.slow
def test_a_truth_of_the_two_masses(made):
    """Intervals as wide as the bound's, within a tenth."""
    rows = []
    made["run"]("two masses", 0, 1, rows.append)
    (row,) = rows[-1]["rows"]
    np.testing.assert_allclose(np.array(row["width"]) / (2 * 1.96 * np.array(row["bound"])), 1, atol=0.1)
    assert np.abs(np.array(row["error"]) / row["bound"]).max() < 4 and row["realisations"] < 200
