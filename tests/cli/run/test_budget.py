"""`uqmbd run --budget --accuracy`: what is said, the exit status, and what is refused."""

from __future__ import annotations

import json
import re

import pytest

from uqmbd.results import load

STUDY = """
import chaospy, numpy as np, uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2))
mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
stone = mechanism.body("stone", mass=1, velocity=(0, speed))
mechanism.output("height", stone.position[1])
study = uqmbd.Study("fall", mechanism, np.linspace(0, 1, 5), [MonteCarlo(seed=1), Collocation()])
"""


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "fall.py"
    path.write_text(STUDY)
    return path.name


@pytest.mark.thorough
def test_sizes_are_reported_stored_and_shown(command_line, script, tmp_path):
    status, out, said = command_line("run", script, "--out", "r", "--accuracy", "20%")
    assert status == 0, said
    assert re.search(r"monte-carlo: the stated error with samples=64 is \d\d % \(standard deviation of height at", said)
    assert "20 % needs about samples=" in said
    tree = load(tmp_path / "r" / "results.nc")
    size = json.loads(tree["monte-carlo"].attrs["options"])["samples"]
    # a mean is known to 20 % of the standard deviation with 97 samples; that of a normal variable with fewer
    assert 97 <= size <= 160
    assert "; 20 % was requested" in tree["monte-carlo"].attrs["budget_summary"]
    assert json.loads(tree.attrs["budget"])["methods"]["collocation"]["size"] == 1
    assert "Size of monte-carlo, chosen by its stated error" in (tmp_path / "r" / "report.html").read_text()
    status, _, _ = command_line("run", script, "--out", "again", "--set", f"monte-carlo.samples={size}")
    assert status == 0
    again = load(tmp_path / "again" / "results.nc")
    assert tree["monte-carlo/samples"].to_dataset().identical(again["monte-carlo/samples"].to_dataset())


@pytest.mark.thorough
def test_an_accuracy_that_is_not_reached_is_the_exit_status(command_line, script):
    status, _, said = command_line("run", script, "--accuracy", "1%", "--budget", "300")
    assert status == 3
    assert "1 % was requested, but not reached: about samples=42258 needs 42258 realisations" in said
    assert "collocation: the stated error with order=1 is" in said


@pytest.mark.thorough
def test_replicates_are_a_start_from_which_an_accuracy_chooses(command_line, script):
    """Options that a size changes as well may be given, and the summary lists their last values."""
    words = ["--accuracy", "20%", "--only", "monte-carlo", "--set", "monte-carlo.sampling=sobol"]
    status, _, said = command_line("run", script, *words, "--set", "monte-carlo.replicates=4")
    assert status == 0, said
    assert re.search(r"monte-carlo: the stated error with samples=\d+(, replicates=\d+)? is", said)


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (
            ["--accuracy", "1%", "--set", "monte-carlo.samples=9"],
            "samples=9 contradicts --accuracy, which chooses samples of monte-carlo",
        ),
        (
            ["--budget", "1min", "--set", "collocation.order=2"],
            "contradicts --budget, which chooses order of collocation",
        ),
        (["--budget", "fast"], "--budget is 'fast'; expected a number of realisations such as 5000, or a time"),
        (["--accuracy", "150%"], "--accuracy is '150%'; expected a share of the standard deviation"),
        (
            ["--budget", "20", "--only", "monte-carlo"],
            "budget of 20 realisations is too small: the smallest size of this method, samples=64, needs 64. Use a budget of 64 realisations or "
            "more, or a time such as 30s.",
        ),
        (["--budget", "2"], "The method 'collocation' failed as well: the budget of 2 realisations is too small"),
    ],
)
def test_what_cannot_be_is_refused(command_line, script, tmp_path, words, part):
    """Nothing is computed, and nothing is there to go on with."""
    status, _, said = command_line("run", script, *words)
    assert status == 2
    assert part in said
    assert "--resume" not in said and not list(tmp_path.glob("results/unfinished/*/*"))


@pytest.mark.thorough
def test_a_method_that_a_budget_does_not_hold_costs_no_other(command_line, script):
    status, _, said = command_line("run", script, "--budget", "30", "--no-report")
    assert status == 1
    found = re.search(
        r"needs 64, and the less expensive methods need (\d+). Use a budget of (\d+) realisations or more", said
    )
    assert found is not None and int(found[2]) == 64 + int(found[1])
    assert "collocation: the stated error with order=1 is" in said and "--resume" not in said
    status, _, said = command_line("run", script, "--budget", found[2], "--no-report")
    assert status == 0, said


@pytest.mark.thorough
def test_an_option_that_is_not_chosen_may_be_set(command_line, script):
    status, _, said = command_line(
        "run", script, "--only", "monte-carlo", "--accuracy", "20%", "--set", "monte-carlo.seed=7"
    )
    assert status == 0, said
