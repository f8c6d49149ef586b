"""A requested accuracy decides which stated errors are too large; limits of 5 % do not apply to it."""

from __future__ import annotations

import numpy as np
import pytest

from uqmbd.extend import labels, statistics_dataset
from uqmbd.results import compare, propagator_node
from uqmbd.results.assessment import recommended


def node(label, std, cost, error, accuracy):
    """A method of two times with equal standard errors of mean and standard deviation."""
    known = {"std_error_mean": [[error, error]], "std_error_std": [[error, error]]}
    statistics = statistics_dataset(labels(["x"], [], [0.0, 1.0]), mean=[[0.0, 0.0]], std=[[std, std]], **known)
    attrs = {"requested_accuracy": accuracy} if accuracy else {}
    return propagator_node(label, statistics, propagator="p", realisations=cost, wall_time=0.01, attrs=attrs)


@pytest.mark.parametrize(
    ("error", "accuracy", "expected"),
    [
        (0.04, 0.0, "many"),  # 8 % is above 5 %
        (0.04, 0.1, "few"),  # 8 % reaches 10 %
        (0.06, 0.1, "many"),  # 12 % does not
        (0.004, 0.0, "few"),
        (0.004, 0.001, "many"),  # neither reaches it: the smallest error
    ],
)
def test_the_least_expensive_method_that_reaches_the_accuracy_is_recommended(error, accuracy, expected):
    found = compare([node("many", 1.0, 10_000, 0.002, accuracy), node("few", 1.0, 100, error, accuracy)])
    assert recommended(found)[:1] == (expected,)


def test_a_method_that_reaches_the_accuracy_but_differs_is_not_recommended():
    found = compare([node("many", 1.0, 10_000, 0.002, 0.1), node("few", 2.0, 100, 0.04, 0.1)])
    assert recommended(found) in ((), ("many",))
    assert str(found["verdict_kind"].sel({"method": "few"}).item()) != "agrees"


def test_an_accuracy_that_nobody_requested_changes_no_verdict():
    kinds = [
        np.asarray(
            compare([node("many", 1.0, 10_000, 0.002, a), node("few", 1.0, 100, 0.01, a)])["verdict_kind"]
        ).tolist()
        for a in (0.0, 0.05)
    ]
    assert kinds[0] == kinds[1]
