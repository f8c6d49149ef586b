"""Estimates of Sobol' indices outside 0 to 100 % are shown with their interval and the reason, wherever they are text."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.report.figures import indices_of
from uqmbd.report.overview.influences import of_history, of_scalar
from uqmbd.report.sections.about_results.scalars import strongest_input
from uqmbd.report.view import StudyResult
from uqmbd_montecarlo import MonteCarlo


def sampled(seed: int):
    """A sum of two waves, one of them small: total indices are 98 % and 2 % exactly, and uncertain for 128 pairs."""
    a, b = (uqmbd.RandomVariable(name, chaospy.Uniform(0, 2 * np.pi)) for name in "ab")
    mechanism = uqmbd.Mechanism("sum", uqmbd.Line())
    point = mechanism.body("point", mass=1, position=sympy.sin(a) ** 3 + 0.1 * sympy.cos(b))
    mechanism.output("x", point.position[0], units="m")
    mechanism.output("last", uqmbd.final(point.position[0]), units="m")
    return uqmbd.Study("s", mechanism, [0, 1], [MonteCarlo(samples=256, seed=seed, sobol_indices=True)]).run()


@pytest.fixture(scope="module")
def beyond():
    """A tree whose total index of `a` is above 100 %: among ten seeds, some are."""
    trees = [sampled(seed) for seed in range(10)]
    values = [float(tree["monte-carlo/scalars/statistics"]["sobol_total"].values[0, 0]) for tree in trees]
    assert 0 < sum(value > 1.01 for value in values) < 10
    exact, ends = 5 / 16 / (5 / 16 + 0.005), [tree["monte-carlo/scalars/statistics"] for tree in trees]
    inside = [low < exact < high for low, high in (one["sobol_total_interval"].values[:, 0, 0] for one in ends)]
    assert sum(inside) >= 6, "the intervals explain the estimates above 100 %"
    return trees[int(np.argmax(values))]


def test_every_text_of_an_index_above_its_range_states_interval_and_reason(beyond) -> None:
    data = beyond["monte-carlo/scalars/statistics"]
    value, (low, high) = float(data["sobol_total"][0, 0]), data["sobol_total_interval"].values[:, 0, 0]
    expected = f"100 % (estimate {100 * value:.0f} %, 95 % interval {100 * low:.0f} % to {100 * high:.0f} %, limited by"
    result = StudyResult.of(beyond)
    texts = [
        of_scalar(result, "last").written(0),
        of_history(result, "x").written(0),
        strongest_input(data.to_dataset().isel(output=0)).removeprefix("a ("),
        indices_of(beyond["monte-carlo"], "x").written[0][1],
    ]
    assert all(text.startswith(expected) for text in texts), texts
    found = of_scalar(result, "last")
    assert not found.together or "within their sampling errors" in found.together
