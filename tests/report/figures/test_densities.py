"""Densities of several methods in one figure, also of those that hold a surrogate only."""

from __future__ import annotations

import re

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import report
from uqmbd.results import load, save
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo


@pytest.fixture(scope="module")
def result():
    """A body at rest; its output is normal with mean 3 and standard deviation 0.5 at all times."""
    x = uqmbd.RandomVariable("x", chaospy.Normal(3, 0.5), units="1")
    mechanism = uqmbd.Mechanism("rest", uqmbd.Translational())
    mechanism.body("body", mass=1)
    mechanism.output("ratio", x, units="1")
    methods = [MonteCarlo(samples=400, seed=2), Collocation(order=2)]
    study = uqmbd.Study("rest", mechanism, [0, 0.4, 1], methods, report_times=[0.4])
    return study.run()


@pytest.mark.thorough
def test_a_surrogate_is_drawn_beside_samples(result):
    """The curve of the chaos is that of the normal distribution; the far tails do not stretch the axis."""
    figure = report.histograms(result, "ratio", [0.4])
    (axes,) = figure.axes
    assert axes.get_title("right") == "t = 0.4 s"
    assert axes.get_ylabel() == "density"
    (_, _, chaos) = axes.get_lines()
    z, density = np.transpose([(x, y) for x, y in zip(*chaos.get_data(), strict=True) if np.isfinite(y)])
    exact = np.exp(-(((z - 3) / 0.5) ** 2) / 2) / (0.5 * np.sqrt(2 * np.pi))
    np.testing.assert_allclose(density, exact, atol=0.06 * exact.max())
    low, high = axes.get_xlim()
    assert 0.5 < low
    assert high < 5.5
    assert [t.get_text() for t in figure.legends[0].get_texts()] == [
        "histogram of monte-carlo", "monte-carlo", "collocation"
    ]  # fmt: skip


def test_a_surrogate_alone_has_a_curve_and_no_bars(result):
    figure = report.histograms(result["collocation"], "ratio", [0.4])
    assert len(figure.axes[0].get_lines()) == 1
    assert not figure.axes[0].collections


@pytest.mark.thorough
def test_the_report_shows_the_times_that_the_study_asks_for(result, tmp_path):
    stored = save(result, tmp_path / "results.nc")
    page = report.write_report(load(stored), tmp_path / "report.html").read_text(encoding="utf-8")
    assert re.findall(r'"title":"(t = [^"]*)"', page) == ["t = 0.4 s"]


def test_report_times_must_lie_within_the_study():
    mechanism = uqmbd.Mechanism("rest", uqmbd.Translational())
    with pytest.raises(uqmbd.StudyError, match="report_times contains 3 s; expected times between 0 and 1 s"):
        uqmbd.Study("rest", mechanism, [0, 1], report_times=[3])
