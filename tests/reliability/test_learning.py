"""Probabilities from wrong surrogates and few real realisations."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from uqmbd_reliability.learning import learn

SCRIPT = Path(__file__).parents[2] / "studies" / "benchmarks" / "limit_states.py"
SPEC = importlib.util.spec_from_file_location("limit_states_of_learning", SCRIPT)
limit_states = importlib.util.module_from_spec(SPEC)
sys.modules[SPEC.name] = limit_states
SPEC.loader.exec_module(limit_states)
CASES = limit_states.CASES

ERRORS = {
    "none": lambda u: 0.0,
    "shifted": lambda u: 0.15 + 0.1 * np.sin(u[:, :1]),
    "wavy": lambda u: np.sin(2 * u[:, :1]),
}


def learned(name, error, seed):
    case = CASES[name]

    def limit(u):
        return case(u)[0] + ERRORS[error](u)

    found = learn(case, limit, case.dimension, generator=np.random.default_rng(seed))
    return case.probability, found


@pytest.mark.thorough
@pytest.mark.parametrize("error", ERRORS)
def test_the_interval_is_that_of_the_real_limit_state(error):
    probability, found = learned("kink", error, 1)
    one = found.estimates[0]
    assert one.lower < probability < one.upper
    assert one.probability == pytest.approx(probability, rel=0.1)
    assert found.ledger.count < 700


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kink", "two design points"])
def test_intervals_hold_the_probability_as_often_as_they_say(name):
    held = []
    for seed in range(40):
        probability, found = learned(name, "wavy", seed)
        held.append(found.estimates[0].lower <= probability <= found.estimates[0].upper)
    assert np.mean(held) >= 0.9


@pytest.mark.thorough
def test_a_surrogate_that_knows_nothing_is_corrected():
    case = CASES["plane"]
    found = learn(case, lambda u: np.ones((len(u), 1)), 2, generator=np.random.default_rng(1))
    one = found.estimates[0]
    assert one.lower < case.probability < one.upper < 1.5 * one.lower


def test_where_nothing_is_violated_a_surrogate_is_of_no_use():
    def safe(u):
        return np.ones((len(u), 1)), np.zeros(len(u), dtype=bool)

    assert learn(safe, lambda u: safe(u)[0], 2, most=500, generator=np.random.default_rng(1)) is None
