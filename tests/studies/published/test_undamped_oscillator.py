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


def test_the_quadrature_of_the_closed_form_is_converged_and_that_of_samples():
    assert case.probability() == pytest.approx(2.834e-2, rel=0.022)  # published, with its own coefficient of variation
    rare = case.probability(0.6, 0.1)
    assert case.probability(0.6, 0.1, points=48) == pytest.approx(rare, rel=1e-6)
    mechanism = case.oscillator(0.6, 0.1)
    space = StandardSpace(uqmbd.extend.GermSpace.of(mechanism.inputs))
    # samples about the most likely violation, weighted: it has more force and time, less stiffness and strength
    direction = dict(zip(("F1", "t1", "c1", "c2", "m", "r"), (2.8, 2.1, -1.3, -0.1, -0.1, -1.9), strict=True))
    point = np.array([direction[name] for name in mechanism.inputs.names])
    u = point + np.random.default_rng(0).normal(size=(200_000, 6))
    ratio = np.exp(0.5 * (point**2).sum() - u @ point)
    weights = np.where(case.margin(space.to_inputs(u)) < 0, ratio, 0)
    error = weights.std() / np.sqrt(len(weights))
    assert error < 0.01 * rare
    assert weights.mean() == pytest.approx(rare, abs=4 * error)


@pytest.mark.thorough
@pytest.mark.parametrize(("mean", "deviation", "within"), [(0.6, 0.1, 0.15), (0.45, 0.075, 0.25)])
def test_smaller_forces_against_the_closed_form(mean, deviation, within):
    """Probabilities of 9e-6 and 1.5e-8, by real motions."""
    study = uqmbd.Study("smaller", case.oscillator(mean, deviation), case.TIMES, [Reliability(seed=2)])
    node = study.run()["reliability"]
    data, exact = node["requirements"].to_dataset(), case.probability(mean, deviation)
    low, high = data["interval"].values[0]
    assert low < exact < high
    assert data["violation_probability"].item() == pytest.approx(exact, rel=within)
    assert node.attrs["realisations"] <= 3000
