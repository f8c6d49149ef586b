"""What differs between results besides their numbers."""

import pytest

from uqmbd.cli.differences import what_differs
from uqmbd.results import InputInfo, labels, propagator_node, sample_dataset, statistics_dataset, study_tree


def stored(inputs=None):
    """Results of one method: statistics alone, or with samples of these inputs."""
    axes = labels([("x", "m")], inputs or [], [0.0, 1.0])
    statistics = statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.0, 0.1]])
    samples = None if inputs is None else sample_dataset([[[0.0, 1.0]]], [[1.0] * len(inputs)], axes)
    node = propagator_node("mine", statistics, samples, propagator="p", realisations=1, wall_time=1.5)
    return study_tree([node], study="crank", mechanism="crank")


K = InputInfo("k", "N/m", "Normal(20, 1)")


@pytest.mark.parametrize(
    ("one", "other", "found"),
    [
        (None, None, [("inputs", {"A": "not recorded", "B": "not recorded"})]),
        (None, [K], [("inputs", {"A": "not recorded", "B": "k"})]),
        ([K], [K], []),
        (
            [K],
            [InputInfo("k", "N/m", "Normal(20, 2)")],
            [("input k", {"A": "Normal(20, 1) N/m", "B": "Normal(20, 2) N/m"})],
        ),
    ],
)
def test_inputs_that_nobody_recorded_are_not_said_to_be_equal(one, other, found):
    assert what_differs({"A": stored(one), "B": stored(other)}) == found
