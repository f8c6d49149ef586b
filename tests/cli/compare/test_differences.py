"""What differs between results besides their numbers."""

import chaospy
import pytest

import uqmbd
from uqmbd.cli.compare.differences import find_differences
from uqmbd.extend import InputInfo, labels, sample_dataset, statistics_dataset
from uqmbd.results import propagator_node, save, study_tree
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo


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
    assert find_differences({"A": stored(one), "B": stored(other)}) == found


@pytest.mark.thorough
def test_what_does_not_always_happen_is_not_compared(command_line, tmp_path):
    """Statistics of other realisations in each method; the other outputs are compared."""
    for name, seed in (("one", 1), ("other", 2)):
        study = uqmbd.Study(
            "throw", throw(), [0, 1], [MonteCarlo(samples=50, seed=seed), Collocation(order=2, seed=seed)]
        )
        with pytest.warns(uqmbd.StudyWarning, match="has no statistics"):
            tree = study.run()
        (tmp_path / name).mkdir()
        save(tree, tmp_path / name / "results.nc")
    status, out, err = command_line("compare", "one", "other")
    assert status == 0, err
    assert "Not compared, because they do not occur in all realisations: reached." in out
    assert "last" in out


def throw():
    mechanism = uqmbd.Mechanism("throw", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 2))
    x = mechanism.body("body", mass=1, velocity=speed).position[0]
    mechanism.output("reached", uqmbd.first_time(x >= 1.5), units="s")
    mechanism.output("last", uqmbd.final(x), units="m")
    return mechanism
