"""Costs of a method: numbers of stated, predicted and computed realisations."""

from __future__ import annotations

import json

from uqmbd.propagation.methods import run_method
from uqmbd.testing.propagators.executors import RecordingExecutor
from uqmbd.testing.propagators.subject import PropagatorUnderTest, quiet
from uqmbd.testing.solutions import CASES

__all__ = ["check_costs"]

PREDICTED = 0.1
"""Allowed difference between predicted and computed realisations, relative to the computed number."""


def check_costs(subject: PropagatorUnderTest) -> None:
    """Raise AssertionError if stated or predicted realisations differ from the count of an executor."""
    study, recorder, title = CASES["stone"]().study, RecordingExecutor(), f"{subject.title}: costs"
    # without repeated integrations for the integration error
    with subject.unbroken(study, "costs"), quiet():
        node = run_method(subject.given, study.problem(subject.given, recorder), check=False)
    stated, computed = node.attrs["realisations"], recorder.realisations
    assert stated >= computed, (
        f"{title}: the method computed {computed} realisations, but the attribute 'realisations' is {stated}. Pass "
        "the total number, including verification, as realisations= to problem.node."
    )
    counted = json.loads(node.attrs["solver_counters"]).get("integrations")
    assert counted != computed or stated == computed, (
        f"{title}: the method integrated {computed} realisations, but the attribute 'realisations' is {stated}; "
        "expected equal numbers."
    )
    with subject.unbroken(study, "costs"), quiet():
        estimate = subject.given.estimate(study)
    if estimate is None:
        return
    predicted = estimate.realisations
    if estimate.at_most:
        assert predicted >= stated, (
            f"{title}: the method 'estimate' predicts at most {predicted} realisations, but {stated} were computed."
        )
        return
    assert abs(predicted - stated) <= PREDICTED * stated, (
        f"{title}: the method 'estimate' predicts {predicted} realisations, but {stated} were computed. `uqmbd "
        "check` and budgets use this prediction. An adaptive method returns an upper bound, with at_most=True."
    )
