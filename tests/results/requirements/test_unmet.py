"""Which requirements are met, by methods of which some know no probability."""

from __future__ import annotations

import math

import xarray as xr
from hypothesis import example, given, settings
from hypothesis import strategies as st

from uqmbd.extend import requirements_dataset
from uqmbd.results import unmet

shares = st.lists(st.floats(0, 1), min_size=3, max_size=3).map(sorted)
answers = st.lists(st.tuples(st.booleans(), shares), min_size=1, max_size=4)


@example(given_answers=[(False, [0.0, 0.5, 1.0])], allowed=1.0)
@settings(max_examples=60, deadline=None)
@given(given_answers=answers, allowed=st.one_of(st.floats(0, 1), st.sampled_from([0.0, 1.0])))
def test_the_verdict_follows_the_intervals_of_methods_that_know(
    given_answers: list[tuple[bool, list[float]]], allowed: float
) -> None:
    """Met: all upper ends are allowed, and there is one; a probability of 1 is always allowed."""
    nodes = {}
    for k, (known, (lower, probability, upper)) in enumerate(given_answers):
        data = requirements_dataset(
            ["load"],
            violation_probability=[probability if known else math.nan],
            std_error=[0.0 if known else math.nan],
            lower=[lower if known else 0.0],
            upper=[upper if known else 1.0],
        )
        nodes[f"m{k}"] = xr.DataTree.from_dict({"requirements": data})
    ends = [(low, high) for known, (low, _, high) in given_answers if known]
    known_methods = [f"m{k}" for k, (known, _) in enumerate(given_answers) if known]
    said = unmet(nodes, allowed)
    if allowed >= 1 or (ends and all(high <= allowed for _, high in ends)):
        assert said == []
        return
    (sentence,) = said
    if not ends:
        assert "no method states the probability of its violation" in sentence
    violated = any(low > allowed for low, _ in ends) and not any(high <= allowed for _, high in ends)
    assert ("is not met" in sentence) == violated
    assert ("is not known to be met" in sentence) == (not violated)
    # a requirement that one method confirms is reported with this method
    confirmed = [name for name, (_, high) in zip(known_methods, ends, strict=True) if high <= allowed]
    assert ("is met according to" in sentence) == bool(confirmed)
    assert all(f"{name}, " in sentence.partition("is met according to")[2] for name in confirmed)
