"""The undamped oscillator against its published probability and its closed form."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import uqmbd
from uqmbd_reliability import Reliability
from uqmbd_reliability.space import StandardSpace

SCRIPT = Path(__file__).parents[3] / "studies" / "published" / "undamped_oscillator.py"
SPEC = importlib.util.spec_from_file_location("undamped_oscillator", SCRIPT)
case = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(case)


@pytest.mark.thorough
def test_the_published_probability():
    found = case.study.run()["reliability"]
    data = found["requirements"].to_dataset()
    low, high = data["interval"].values[0]
    assert low < 2.834e-2 < high
    assert data["violation_probability"].item() == pytest.approx(2.834e-2, rel=0.15)
    assert found.attrs["realisations"] <= 3000
    # FORM alone is wrong by more than the published number is uncertain
    assert data["beta"].values[0, 0] == pytest.approx(1.85, abs=0.05)


@pytest.mark.thorough
def test_a_smaller_force_against_the_closed_form():
    mechanism = case.oscillator(0.6, 0.1)
    study = uqmbd.Study("smaller", mechanism, case.TIMES, [Reliability(seed=2)])
    data = study.run()["reliability/requirements"].to_dataset()
    # samples about the design point, weighted
    space = StandardSpace(uqmbd.GermSpace.of(mechanism.inputs))
    point = data["design_points_standard"].values[0, 0]
    u = point + np.random.default_rng(0).normal(size=(200_000, 6))
    ratio = np.exp(0.5 * ((u - point) ** 2).sum(axis=1) - 0.5 * (u**2).sum(axis=1))
    exact = np.where(case.margin(space.to_inputs(u)) < 0, ratio, 0).mean()
    assert exact == pytest.approx(9.07e-6, rel=0.02)
    low, high = data["interval"].values[0]
    assert low < exact < high
    assert data["violation_probability"].item() == pytest.approx(exact, rel=0.15)
