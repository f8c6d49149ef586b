"""Error against cost as a part of a run: stored, shown, continued, and never the end of the other results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd import report
from uqmbd.errors import StudyError
from uqmbd.results import load, propagator_nodes, save, validate
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

TIMES = np.linspace(0.1, 1.0, 4)
RATE = (1.0, 0.4)
"""Mean and standard deviation of the speed, m/s."""


def study(**changes: Any) -> uqmbd.Study:
    """A body that moves at a normal speed v: its output exp(v t) is lognormal, and known exactly."""
    import sympy

    mechanism = uqmbd.Mechanism("glider", uqmbd.Translational())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(*RATE), units="m/s")
    body = mechanism.body("body", mass=1, velocity=(speed, 0), position=(0.1 * speed, 0))
    mechanism.output("growth", sympy.exp(1.0 * body.position[0]), units="m")
    given = {"propagators": [MonteCarlo(samples=60, seed=1)]} | changes
    return uqmbd.Study("glider", mechanism, TIMES, **given)


def exact() -> xr.Dataset:
    """Mean and standard deviation of the lognormal exp(v t)."""
    mean, std = RATE[0] * TIMES, RATE[1] * TIMES
    first = np.exp(mean + std**2 / 2)
    second = first * np.sqrt(np.expm1(std**2))
    dims = ("output", "time")
    return xr.Dataset({"mean": (dims, first[None]), "std": (dims, second[None])}, attrs={"label": "closed form"})


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    """Return results with curves of a plain and a split chaos, and of Monte Carlo, against the closed form."""
    growth = {
        "propagators": [
            Collocation(verify=0, label="plain"),
            Collocation(order=1, verify=0, label="split"),
            MonteCarlo(seed=1, label="sampled"),
        ],
        "order": {"plain": [1, 2, 3, 5]},
        "elements": {"split": [2, 4]},
        "samples": [20, 80],
        "reference": exact(),
    }
    return study(convergence=growth).run()


@pytest.mark.thorough
def test_it_is_stored_beside_the_methods(tree: xr.DataTree, tmp_path: Path) -> None:
    """The node is no propagator, keeps to the schema, and survives the disk."""
    assert list(propagator_nodes(tree)) == ["monte-carlo"]
    validate(tree)
    save(tree, tmp_path / "results.nc")
    back = load(tmp_path / "results.nc")["convergence"].to_dataset()
    assert [str(v) for v in back["method"].values] == ["plain", "split", "sampled"]
    assert [str(v) for v in back["option"].values] == ["order", "elements", "samples"]
    assert [str(v) for v in back["level_name"].values[1]] == ["elements 2", "elements 4", "", ""]
    assert back.attrs["reference"] == "closed form"


def test_errors_against_the_closed_form(tree: xr.DataTree) -> None:
    """The first order is known in closed form; each further one, and more elements, lower the error."""
    found = tree["convergence"].to_dataset()
    # two Gauss nodes, at one standard deviation on either side, give the first order the coefficient sinh
    one = np.exp(RATE[0] * TIMES) * np.sinh(RATE[1] * TIMES)
    whole = exact()["std"].values[0]
    expected = np.sqrt(np.trapezoid((whole - one) ** 2, TIMES) / np.trapezoid(whole**2, TIMES))
    assert found["std_error_l2"].values[0, 0, 0] == pytest.approx(expected, rel=1e-4)
    plain = found["std_error_l2"].values[0, :, 0]
    assert np.all(np.diff(plain) < 0) and plain[-1] < 1e-5
    assert 0.5 < float(found["std_rate"].values[0, 0]) < 2.5
    assert found["std_error_l2"].values[1, 1, 0] < found["std_error_l2"].values[1, 0, 0]


@pytest.mark.thorough
def test_the_report_shows_it(tree: xr.DataTree, tmp_path: Path) -> None:
    """Curves, words and a table of all levels."""
    text = report.write_report(tree, tmp_path / "r.html", folder=tmp_path / "figures").read_text(encoding="utf-8")
    section = text[text.index('<section id="growth">') :]
    section = " ".join(section[: section.index("</section>")].split())
    for expected in (
        "compared with closed form",
        "order 5",
        "elements 4",
        "samples 80",
        "with each order",
        "plain: the error",
    ):
        assert expected in section, expected
    assert section.count("<tr><th") == 8 + 1 and "could not" not in section
    assert (tmp_path / "figures" / "growth-error-against-cost.svg").exists()


def test_a_label_is_the_reference_and_only_leaves_it_out() -> None:
    """The node of the run itself is taken, not computed again."""
    one = study(convergence={"propagators": Collocation(verify=0), "order": [1], "reference": "monte-carlo"})
    found = one.run()["convergence"]
    assert found.attrs["reference"] == "monte-carlo" and np.isfinite(found["reference_std_error"].values).all()
    assert "convergence" not in one.run(only=["monte-carlo"]).children


@dataclass(frozen=True, kw_only=True)
class Breaking(uqmbd.extend.Propagator):
    """Raises what no framework expects."""

    name: ClassVar[str] = "breaking"
    order: int = 1

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Raise."""
        raise RuntimeError("out of paper")


@pytest.mark.thorough
def test_failure_keeps_the_other_results(tmp_path: Path) -> None:
    """A warning, a note in the report, and all else as ever."""
    one = study(convergence={"propagators": Breaking(), "order": [1, 2]})
    with pytest.warns(
        UserWarning,
        match="the curves of error against cost could not be computed: .* Reason of the first failure: RuntimeError: out of paper",
    ):
        tree = one.run()
    validate(tree)
    text = report.write_report(tree, tmp_path / "r.html").read_text(encoding="utf-8")
    assert "Reason of the first failure: RuntimeError: out of paper" in text and "monte-carlo" in text


class RecordedProgress:
    """Records the computed tasks, and stops at a label."""

    def __init__(self, stop: str = "") -> None:
        self.stop, self.done = stop, dict[str, int]()

    def start(self, label: str, total: int) -> None:
        """Stop where asked."""
        if label == self.stop:
            raise KeyboardInterrupt

    def advance(self, label: str, count: int) -> None:
        """Count."""
        self.done[label] = self.done.get(label, 0) + count

    def finish(self, label: str) -> None:
        """Nothing."""

    def message(self, text: str) -> None:
        """Nothing."""


@pytest.mark.thorough
def test_an_interrupted_run_goes_on(tmp_path: Path) -> None:
    """Chunks of methods and of levels are kept apart and used again: the result is that of a run in one go."""
    growth = {"propagators": MonteCarlo(seed=3), "samples": [30, 90], "reference": "monte-carlo"}
    whole = study(convergence=growth).run()
    with pytest.raises(KeyboardInterrupt):
        study(convergence=growth).run(progress=RecordedProgress("monte-carlo-90"), folder=tmp_path)
    assert len(list((tmp_path / "unfinished").rglob("*.npz"))) >= 2
    again = study(convergence=growth).run(progress=RecordedProgress(), folder=tmp_path, resume=True)
    same = ["mean_error_l2", "std_error_l2", "realisations"]
    xr.testing.assert_identical(again["convergence"].to_dataset()[same], whole["convergence"].to_dataset()[same])
    assert not (tmp_path / "unfinished").exists()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([1, 2], "expected the arguments of study.converge"),
        ({"order": [1]}, "has no key 'propagators'"),
        ({"propagators": Collocation}, "no levels are given"),
        ({"propagators": Collocation, "order": [1], "reference": "galerkin"}, "expected a propagator of this study"),
        ({"propagators": Collocation, "order": {"plain": [1]}}, "or no levels are given for it"),
        ({"propagators": Collocation, "order": [1], "samples": {"mc": [3]}}, "levels are given for 'mc'"),
        ({"propagators": Collocation, "order": []}, "expected a list of levels"),
    ],
)
def test_bad_input(given: object, message: str) -> None:
    """One clear error each, when the study is made."""
    with pytest.raises(StudyError, match=message):
        study(convergence=given)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.drop_vars("std"), "the reference has no variable 'std'"),
        (lambda data: data.isel(time=slice(2)), "has the shape \\(1, 2\\); expected .* \\(1, 4\\)"),
        (lambda data: data.assign_coords(output=["other"]), "expected \\['growth'\\]"),
    ],
)
def test_bad_exact_reference(change: Any, message: str) -> None:
    """A dataset that does not fit the study."""
    with pytest.raises(StudyError, match=message):
        study().converge(Collocation(verify=0), order=[1], reference=change(exact()))


def test_a_whole_tree_is_no_reference(tree: xr.DataTree) -> None:
    """The node of one method is."""
    with pytest.raises(StudyError, match="expected the node of one method"):
        study().converge(Collocation(verify=0), order=[1], reference=tree)
