"""Costs of a method: how many realisations it states, predicts and computes."""

from __future__ import annotations

import json

from uqmbd.testing.propagators.executors import RecordingExecutor
from uqmbd.testing.propagators.subject import PropagatorUnderTest, quiet
from uqmbd.testing.solutions import CASES

__all__ = ["check_costs"]

PREDICTED = 0.1
"""Difference of predicted and computed realisations that is allowed, over the latter."""


def check_costs(subject: PropagatorUnderTest) -> None:
    """Compare stated and predicted realisations with those that an executor counts; raise AssertionError."""
    study, recorder, title = CASES["stone"]().study, RecordingExecutor(), f"{subject.title}: costs"
    node = subject.node(study, "costs", recorder)
    stated, computed = node.attrs["realisations"], recorder.realisations
    assert stated >= computed, (
        f"{title}: {computed} realisations were computed; the attribute 'realisations' is {stated}. Pass their number, "
        "those for verification included, as realisations= of problem.node."
    )
    counted = json.loads(node.attrs["solver_counters"]).get("integrations")
    assert counted != computed or stated == computed, (
        f"{title}: {computed} realisations were computed and integrated; the attribute 'realisations' is {stated}."
    )
    with subject.unbroken(study, "costs"), quiet():
        estimate = subject.given.estimate(study)
    if estimate is None:
        return
    predicted = estimate.realisations
    if estimate.at_most:
        assert predicted >= stated, (
            f"{title}: estimate predicts at most {predicted} realisations; {stated} were computed."
        )
        return
    assert abs(predicted - stated) <= PREDICTED * stated, (
        f"{title}: estimate predicts {predicted} realisations; {stated} were computed. `uqmbd check` and budgets rely "
        "on it. A method that finds its size as it goes returns an upper bound, with at_most=True."
    )
