"""`uqmbd run` where a method fails: the others are stored, reported and compared, and the exit status says so."""

from __future__ import annotations

import json
import textwrap

import pytest

import uqmbd.report
from uqmbd import results

SCRIPT = """
    import chaospy, numpy as np, uqmbd
    from uqmbd_collocation import Collocation
    from uqmbd_montecarlo import MonteCarlo

    class Broken(uqmbd.extend.Propagator):
        name = "broken"

        def propagate(self, problem):
            raise RuntimeError("no <licence> found")

    class Unfit(Broken):
        name = "unfit"

        def obstacle(self, study):
            return "too many inputs"

    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    stone = mechanism.body("stone", mass=1, velocity=(0, speed))
    mechanism.output("height", stone.position[1], units="m")
    study = uqmbd.Study("fall", mechanism, np.linspace(0, 1, 3), [{methods}])
"""
REASONS = {"broken": "RuntimeError: no <licence> found", "unfit": "the method cannot run this study: too many inputs"}


@pytest.fixture
def cli(command_line, tmp_path):
    """Run the command line in a folder with a study of these methods."""

    def run(*words, methods="Unfit(), MonteCarlo(samples=8, seed=1), Broken(), Collocation(order=1, verify=0)"):
        (tmp_path / "fall.py").write_text(textwrap.dedent(SCRIPT.replace("{methods}", methods)))
        return command_line(*words)

    return run


@pytest.mark.thorough
def test_methods_that_fail_are_reported_at_the_end_and_the_others_are_there(cli, tmp_path):
    status, out, err = cli("run", "fall.py", "--out", "r")
    assert status == 1 and "Traceback" not in err
    tree = results.load(tmp_path / "r" / "results.nc")
    assert list(results.propagator_nodes(tree)) == ["monte-carlo", "collocation"]
    assert "monte-carlo" in out and "collocation" in out and "results.nc" in out
    for label, reason in REASONS.items():
        assert err.count(reason) == 1 and err.index(f"Error: {label} has no results: {reason}") >= 0
        assert err.index("writing the report") < err.index(reason)
        assert reason in json.loads(tree.attrs["failed"])[label]
    report = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "unfit has no results: the method cannot run this study: too many inputs" in report
    assert "no &lt;licence&gt; found" in report and "no <licence>" not in report
    assert "--resume" in err  # chunks of what succeeded are kept, so that it costs little to go on


@pytest.mark.thorough
def test_results_with_failed_methods_are_reported_and_compared(cli, tmp_path, monkeypatch):
    monkeypatch.setattr("uqmbd.cli.run.run.write", lambda tree, path, **_: path)
    cli("run", "fall.py", "--out", "r")
    assert not (tmp_path / "r" / "report.html").exists()
    status, _, err = cli("report", "r")
    assert (status, err) == (0, "")
    assert "too many inputs" in (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    cli("run", "fall.py", "--out", "q", methods="MonteCarlo(samples=9, seed=2)")
    status, out, err = cli("compare", "r", "q", "--out", "both")
    assert (status, err) == (0, "")
    assert "broken has no results in A: RuntimeError" in out
    rows = [line.split() for line in out.splitlines()]
    assert ["method", "broken", "failed", "–"] in rows and not any(row[:1] == ["failed"] for row in rows)
    whole = results.load(tmp_path / "both" / "comparison.nc")
    assert list(json.loads(whole.attrs["failed"])) == ["A unfit", "A broken"]
    assert "A broken has no results" in (tmp_path / "both" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("methods", ["Unfit(), Broken()", "Broken(), Unfit()", "Unfit()", "Broken()"])
def test_without_any_result_the_status_is_1_and_every_reason_is_reported(cli, tmp_path, methods):
    status, out, err = cli("run", "fall.py", "--out", "r", methods=methods)
    assert status == 1 and out == "" and "Traceback" not in err
    for label, reason in REASONS.items():
        assert err.count(reason) == (label in methods.lower())
    assert not (tmp_path / "r" / "results.nc").exists()


def failing(*arguments, **options):
    raise ZeroDivisionError("no ink")


@pytest.mark.thorough
@pytest.mark.parametrize("part", ["report", "motion"])
def test_results_are_stored_before_report_and_motion_can_fail(cli, tmp_path, monkeypatch, part):
    owner, name = (uqmbd.report, "write_report") if part == "report" else (uqmbd.report, "with_motion")
    monkeypatch.setattr(owner, name, failing)
    status, out, err = cli("run", "fall.py", "--out", "r", methods="MonteCarlo(samples=8, seed=1)")
    assert status == (1 if part == "report" else 0)
    assert list(results.propagator_nodes(results.load(tmp_path / "r" / "results.nc"))) == ["monte-carlo"]
    assert "ZeroDivisionError: no ink" in err and "results.nc" in out
    assert (tmp_path / "r" / "report.html").exists() == (part == "motion")


@pytest.mark.thorough
def test_comparison_that_fails_costs_nothing_but_itself(cli, tmp_path, monkeypatch):
    import uqmbd.results.tree.compared

    monkeypatch.setattr(uqmbd.results.tree.compared, "compare_both", failing)
    methods = "MonteCarlo(samples=8, seed=1), Collocation(order=1, verify=0)"
    status, out, err = cli("run", "fall.py", "--out", "r", methods=methods)
    assert (status, "no ink" in out) == (0, True), err
    report = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "The methods could not be compared: ZeroDivisionError: no ink" in report


@pytest.mark.thorough
def test_results_are_stored_before_curves_of_error_against_cost(cli, tmp_path, monkeypatch):
    """An interruption there is none of a method: it finds them stored."""
    import uqmbd.propagation.convergence.node

    def interrupted(*arguments, **options):
        assert list(results.propagator_nodes(results.load(tmp_path / "r" / "results.nc"))) == ["monte-carlo"]
        raise KeyboardInterrupt

    monkeypatch.setattr(uqmbd.propagation.convergence.node, "converge", interrupted)
    methods = (
        'MonteCarlo(samples=8, seed=1)], convergence={"propagators": [Collocation], "order": [1, 2]}, report_times=['
    )
    status, _, err = cli("run", "fall.py", "--out", "r", methods=methods)
    assert status == 130 and "--resume" in err
    assert list(results.propagator_nodes(results.load(tmp_path / "r" / "results.nc"))) == ["monte-carlo"]
