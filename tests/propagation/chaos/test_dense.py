"""Realisations as functions of time: smooth ones are resolved, kinks are told, and every integration is counted."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

import uqmbd


class _Given(uqmbd.extend.Problem):
    """A problem whose output is a function of time, and counts how often it is computed."""

    labels = SimpleNamespace(shape=(1, 1))

    def __init__(self, function):
        vars(self).update(function=function, calls=[], times=np.array([0.0]), model=SimpleNamespace(events=()))

    def watching(self, times):
        def realise(values):
            self.calls.append(len(times))
            response = self.function(times)[None, None].repeat(len(values), axis=0)
            counters = Counter(integrations=len(values))
            good = np.zeros(len(values), dtype=np.int64)
            return uqmbd.extend.Realisations(values, response, good, ("",) * len(values), counters, 0.0)

        return SimpleNamespace(realise=realise)


FUNCTIONS = {
    "slow": lambda t: np.sin(t),
    "fast": lambda t: np.sin(400 * t) + t,
    "many": lambda t: np.sin(4000 * t),
    "kink": lambda t: np.abs(np.sin(3 * t)),
    "kink of a rate": lambda t: np.sin(3 * t) * np.abs(np.sin(3 * t)),
    "jump": lambda t: np.where(np.sin(3 * t) > 0, 1.0, 0.0),
}


@pytest.mark.parametrize(
    ("name", "most", "accuracy"),
    [
        ("slow", 1, 1e-12),
        ("fast", 3, 1e-6),
        ("many", 6, 1e-6),
        ("kink of a rate", 3, 1e-4),
        ("kink", 5, 1e-2),
        ("jump", 5, 2),
    ],
)
def test_it_is_as_accurate_as_reported_by_few_integrations(name, most, accuracy):
    problem = _Given(FUNCTIONS[name])
    found, told = uqmbd.extend.dense(problem, np.zeros((2, 1)), 10.0)
    at = np.random.default_rng(1).uniform(0.1, 9.9, 20_000)
    true = np.abs(found.spline(0)(at)[:, 0] - problem.function(at)).max() / np.ptp(found.values)
    assert true <= accuracy
    # a kink lies anywhere between two times; rounding of the spline's own coefficients is not told
    assert true <= 8 * found.error + 1e-12
    assert len(problem.calls) == found.integrations <= most
    assert told.counters["integrations"] == 2 * found.integrations
