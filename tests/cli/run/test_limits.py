"""Requirements on the command line and in the report: tables, contradictions, and the exit status for scripts."""

from __future__ import annotations

import pytest
import xarray as xr

from uqmbd.extend import requirements_dataset
from uqmbd.results import answers, load, unmet
from uqmbd.results.requirements import differing
from uqmbd.wording import format_interval

SCRIPT = """
import chaospy, numpy as np, uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-10))
speed = uqmbd.RandomVariable("speed", chaospy.Uniform(3, 5), units="m/s")
stone = mechanism.body("stone", mass=1, velocity=speed)
mechanism.require("low enough", stone.position[0] <= 1, description="below the ceiling, 1 m")
mechanism.require("slow enough", speed <= 6)
study = uqmbd.Study("fall", mechanism, np.linspace(0, 1, 21), [MonteCarlo(samples=200, seed=1), Collocation(order=2)])
"""
# the highest point, speed^2 / 20, is above 1 m where the speed is above sqrt(20) m/s: 26 % of the stones
PROBABILITY = (5 - 20**0.5) / 2


@pytest.mark.thorough
def test_a_run_tells_and_leaves_with_the_status_of_its_requirements(command_line, tmp_path, monkeypatch):
    (tmp_path / "fall.py").write_text(SCRIPT)
    status, out, err = command_line("run", "fall.py", "--require", "0.01")
    assert status == 3
    assert "Requirement 'low enough' is not met: it is violated with a probability of at least" in err
    assert "'slow enough' is not known to be met" in err  # nothing failed in 200 samples: at most 1.5 %
    lines = {line.split("  ")[0]: line for line in out.splitlines()}
    assert "probability of violation (95 %)" in out and "0 (at most 1.5 %)" in lines["slow enough"]
    assert "low enough" in lines and "any" in lines
    nodes = {label: load(tmp_path / "results" / "results.nc")[label] for label in ("monte-carlo", "collocation")}
    for one in answers(nodes)["low enough"].values():
        assert one.lower <= PROBABILITY <= one.upper
    page = (tmp_path / "results" / "report.html").read_text()
    assert "below the ceiling, 1 m" in page and "to 2 requirements, by 2 methods" in page
    assert page.index("below the ceiling, 1 m") < page.index('<section id="requirements"'), "on the first screen"
    monkeypatch.setattr("uqmbd.cli.run.run.write", lambda tree, path, **_: path)  # once is enough
    status, out, err = command_line("run", "fall.py", "--out", "again", "--require", "40%")
    assert (
        status == 0
        and "not met" not in err
        and "All requirements are met: every method that states a probability states at most 40 %" in out
    )
    status, out, _ = command_line("check", "fall.py")
    assert status == 0 and "stone.x <= 1" in out and "at all times" in out and "below the ceiling" in out
    status, out, _ = command_line("compare", "results")
    assert status == 0 and "probability of violation (95 %)" in out and "slow enough" in out


def test_a_study_without_requirements_meets_none(command_line, tmp_path):
    (tmp_path / "fall.py").write_text(SCRIPT.replace("mechanism.require(", "(lambda *a, **k: None)("))
    status, _, err = command_line("run", "fall.py", "--require", "0.01")
    assert status == 2 and "has no requirements" in err
    for given, told in (("1.5", "as 0.01 or '1%'"), ("0.99", "write 0.01"), ("99%", "write 0.01"), ("no", "'1%'")):
        status, _, err = command_line("run", "fall.py", "--require", given)
        assert status == 2 and f"--require is '{given}'" in err and told in err


def node(probability, lower, upper):
    data = requirements_dataset(
        ["overload"], violation_probability=[probability], lower=[lower], upper=[upper], attrs={"how": "by hand"}
    )
    return xr.DataTree.from_dict({"requirements": data})


def test_methods_that_contradict_each_other_are_named():
    nodes = {"one": node(0.02, 0.01, 0.03), "other": node(0.05, 0.04, 0.06), "third": node(0.03, 0.0, 0.2)}
    assert differing(nodes) == [
        "one and other contradict each other on 'overload': 2.0 % (1.0 % to 3.0 %) and 5.0 % (4.0 % to 6.0 %)"
    ]
    assert len(unmet(nodes, 0.1)) == 1 and "third" in unmet(nodes, 0.1)[0] and not unmet(nodes, 0.2)


def test_what_is_not_known_is_not_met():
    assert format_interval(float("nan"), 0.0, 1.0) == "not known"
    assert unmet({"blind": node(float("nan"), 0.0, 1.0)}, 0.5)
