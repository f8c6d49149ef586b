"""Failures: grouped by reason, explained by inputs, in words and figures."""

from __future__ import annotations

import io

import numpy as np
import pytest
import xarray as xr

from uqmbd import extend, report, results
from uqmbd.errors import StudyError
from uqmbd.report.figures.failures import failure_reasons, failure_words, separating_inputs


def _samples(drawn: np.ndarray, status: np.ndarray, messages: list[str], names: list[object]) -> xr.Dataset:
    axes = extend.labels(["x"], names, [0.0])
    return extend.sample_dataset(np.zeros((len(drawn), 1, 1)), drawn, axes, status=status, messages=messages)


@pytest.fixture(scope="module")
def rods() -> xr.Dataset:
    """Return samples of three inputs; long rods fail at assembly, and both ends of the mass range at integration."""
    rng = np.random.default_rng(0)
    drawn = np.stack([rng.uniform(0.8, 1.2, 400), rng.uniform(0.3, 0.44, 400), rng.normal(size=400)], axis=1)
    long, odd = drawn[:, 1] > 0.41, np.abs(drawn[:, 0] - 1) > 0.18
    status = np.where(long, 1, np.where(odd, 2, 0))
    messages = [
        f"joint 'rod 2' cannot be closed: residual {k * 1e-3:.3g} m (with '{k}')"
        if s == 1
        else "step too small"
        if s
        else ""
        for k, s in enumerate(status)
    ]
    return _samples(drawn, status, messages, [("mass", "kg"), ("rod_length", "m"), "gap"])


def test_reasons_are_grouped(rods: xr.Dataset) -> None:
    """Numbers aside messages are equal; names in quotes stay apart; counts add up, the most frequent first."""
    reasons = failure_reasons(rods)
    assert [r.kind for r in reasons] == ["assembly failed", "integration failed"]
    assert sum(len(r.samples) for r in reasons) == int((rods["status"] != 0).sum())
    assert reasons[0].text.startswith("joint 'rod 2' cannot be closed: residual 0") and " to 0." in reasons[0].text
    assert reasons[1].text == "step too small"
    other = _samples(
        np.zeros((3, 1)), np.array([1, 1, 1]), ["pin 'a1' at -1e-3", "pin 'a1' at 2.5", "pin 'a2' at 1"], ["k"]
    )
    assert [(r.text, len(r.samples)) for r in failure_reasons(other)] == [
        ("pin 'a1' at -1e-3 to 2.5", 2),
        ("pin 'a2' at 1", 1),
    ]


def test_inputs_that_cause_them_are_found(rods: xr.Dataset) -> None:
    """The rod's length explains the first reason, both ends of the mass the second, and nothing else does."""
    reasons = failure_reasons(rods)
    for reason, expected in zip(reasons, (1, 0), strict=True):
        found = separating_inputs(rods, reason)
        assert found[0].index == expected
        assert [s.index for s in found if s.clear] == [expected]
    (rod,), (mass,) = (failure_words(rods, reason) for reason in reasons)
    assert rod.startswith("rod_length: failed samples lie between 0.41 and 0.44 m (all samples 0.301 to 0.44 m)")
    assert rod.endswith("no sample with such a value succeeded.")
    assert mass.startswith("mass: failed samples lie between 0.8 and 0.817 or between 1.18 and 1.2 kg")


def test_too_few_and_unexplained_failures() -> None:
    """One failure explains nothing, and failures at random are said to be unexplained."""
    drawn = np.random.default_rng(1).random((300, 2))
    one = _samples(drawn, np.arange(300) == 5, [""] * 300, ["a", "b"])
    assert failure_words(one, failure_reasons(one)[0]) == [
        "These samples are too few to identify the responsible input."
    ]
    some = _samples(drawn, np.arange(300) % 20 == 0, [""] * 300, ["a", "b"])
    assert failure_words(some, failure_reasons(some)[0]) == [
        "No single input separates these samples from the successful ones."
    ]
    assert failure_reasons(some)[0].text == "no reason was reported"


def test_figure_shows_the_two_best_inputs(rods: xr.Dataset) -> None:
    """All samples of the reason and those that succeeded are points; one input is a strip; a missing reason an error."""
    figure = report.failure_inputs(rods)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "rod_length [m]"
    fine, failed = axes.lines
    assert len(fine.get_xdata()) == int((rods["status"] == 0).sum())
    assert failed.get_xdata().min() > 0.41 > fine.get_xdata().max()
    figure.savefig(io.BytesIO(), format="svg")
    strip = report.failure_inputs(rods.isel(input=[1]), 1)
    assert strip.axes[0].get_yticks().size == 0
    with pytest.raises(StudyError, match="2 reasons"):
        report.failure_inputs(rods, 2)
    with pytest.raises(StudyError, match="no random inputs"):
        report.failure_inputs(rods.isel(input=[]), 0)


def test_report_explains_them(rods: xr.Dataset, tmp_path: object) -> None:
    """The page has the reasons with counts and shares, the words, and a figure for each."""
    node = results.propagator_node(
        "a", extend.statistics_of_samples(rods), rods, propagator="p", realisations=400, wall_time=1.0
    )
    tree = results.study_tree([node], study="s", mechanism="m")
    page = report.write_report(tree, f"{tmp_path}/a.html").read_text(encoding="utf-8")
    reasons = failure_reasons(rods)
    assert f"Assembly failed: {len(reasons[0].samples)} samples (" in page
    assert page.count('alt="Inputs of failed and successful samples. ') == 2
    assert "rod_length: failed samples lie between 0.41 and 0.44 m" in page
    assert "could not be drawn" not in page
