"""The denominator of a stated error: a sentence without its lower limit holds at all times."""

from __future__ import annotations

import re

import chaospy
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.results import assess
from uqmbd.results.assessment import integration_shares
from uqmbd.results.chaos import error_words, reference_spread
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute

LIMITED = "the standard deviation, taken as at least 1 % of its maximum"
sizes = st.floats(-12, 0).map(lambda power: 10.0**power)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(sizes, sizes), min_size=2, max_size=6), st.sampled_from([1e-3, 0.1, np.inf]))
def test_errors_are_at_most_the_stated_number_or_the_limit_is_named(pairs: list, limit: float) -> None:
    absolute, std = np.array(pairs).T
    error = absolute / reference_spread(std)
    said = error_words(error, np.arange(len(std), dtype=float), limit, std)
    early = np.logical_and.accumulate(error <= limit)
    if LIMITED not in said:
        assert (absolute <= error.max() * std * 1.006).all() and (absolute <= limit * std * 1.006)[early].all()
    else:
        assert (absolute > min(limit, error.max()) * std).any() and std.min() < 0.01 * std.max()


def test_a_common_start_is_named_in_all_sentences() -> None:
    """The pendulum of the README: near the start, the error of integration exceeds the small standard deviation."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body("rod", mass=1.0, inertia=length**2 / 12, position=(length / 2, 0), angle=0.0)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    mechanism.output("tip_height", rod.point((length / 2, 0))[1], units="m")
    methods = [Collocation(order=5), Collocation(order=3, label="coarse")]
    tree = uqmbd.Study("pendulum", mechanism, np.linspace(0, 2, 201), methods).run()
    statistics = tree["collocation/statistics"].to_dataset().isel(output=0)
    std, error = statistics["std"].values, statistics["verification_error"].values
    some = std > 0
    local = (error * reference_spread(std))[some] / std[some]
    assert local.max() > 5 * error.max(), "the case under test"
    found = assess(tree)
    (line,) = found.reliability
    (sentence,) = (one for one in found.judgements if one.method == "collocation")
    for text in (line.reason, found.recommendation[0], sentence.text, sentence.stated):
        assert LIMITED in text, text
        number = re.findall(r"at most ([\d.]+) %", text)[0]
        assert np.isclose(float(number), 100 * error.max(), rtol=0.02)
    (share,) = integration_shares(tree["collocation/statistics"].to_dataset())
    assert share.words().endswith("of the largest standard deviation")
