"""Sizes of a method: what a run with a budget or an accuracy relies on."""

from __future__ import annotations

import json
import math

from uqmbd.testing.propagators.moments import difference
from uqmbd.testing.propagators.subject import Subject, quiet
from uqmbd.testing.solutions import CASES

__all__ = ["check_sizes"]

ACCURACY = 0.3
"""That is asked for: coarse, so that it costs little."""


def check_sizes(subject: Subject) -> None:
    """Check that larger sizes take more, that options say them, and that a chosen one gives the same bits again."""
    study, given, title = CASES["stone"]().study, subject.given, f"{subject.title}: sizes"
    with subject.unbroken(study, "sizes"), quiet():
        sizing = given.sizing(study, ACCURACY)
    if sizing is None:
        return
    assert hasattr(given, sizing.option), (
        f"{title}: its sizing names the option {sizing.option!r}, which it does not have."
    )
    sizes = sorted({sizing.largest(number) for number in (0, sizing.least, 2 * sizing.least, 5 * sizing.least)})
    assert sizes[0] == sizing.least, (
        f"{title}: the least size is {sizing.least}, and there is a smaller one, {sizes[0]}."
    )
    costs = []
    for size in sizes:
        with subject.unbroken(study, "sizes"), quiet():
            made = sizing.at(size)
            estimate = made.estimate(study)
        assert getattr(made, sizing.option) == size, (
            f"{title}: at({size}) has {sizing.option}={getattr(made, sizing.option)!r}; expected {size}."
        )
        assert made.node_name == given.node_name, f"{title}: at({size}) is called {made.node_name!r}."
        costs.append(math.nan if estimate is None else estimate.realisations)
    assert not any(math.isnan(cost) for cost in costs), f"{title}: estimate is None; a budget needs what a size takes."
    assert costs == sorted(costs), f"{title}: sizes {sizes} take {costs} realisations; a larger one took less."
    with subject.unbroken(study, "sizes"), quiet():
        tree = study.with_propagators([given]).run(accuracy=ACCURACY, budget=max(20 * int(costs[-1]), 5000))
    about = json.loads(tree.attrs["budget"])["methods"][given.node_name]
    if sizing.of == "moments":
        assert about["stated"] is not None, f"{title}: no error is stated, so that no accuracy is ever reached."
    with subject.unbroken(study, "sizes"), quiet():
        again = study.propagate(sizing.at(about["size"]))
    found = difference(tree.children[given.node_name], again)
    assert not found, f"{title}: the chosen size {about['size']} gives other results when it is run again: {found}."
