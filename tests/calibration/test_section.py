"""The report's section on calibrations."""

from __future__ import annotations

import re

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report import write_report
from uqmbd.testing import check_section
from uqmbd_calibration import Calibrated, Record, Series, calibrate
from uqmbd_calibration.reporting import CalibrationSection
from uqmbd_calibration.reporting.charts import posterior_charts, record_charts, reduction_chart
from uqmbd_collocation import Collocation

pytestmark = pytest.mark.thorough

TIMES = np.linspace(0, 1, 21)


def study(times=TIMES):
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    place = uqmbd.RandomVariable("<place>", chaospy.Normal(0.5, 0.2), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(2, 0.3), units="m/s")
    body = mechanism.body("stone", mass=1, position=place, velocity=speed)
    mechanism.output("<x>", body.position[0], units="m")
    return uqmbd.Study("stone", mechanism, times)


def tree_of(values):
    record = Record("run & 1", [Series("<x>", TIMES, values, "m", 0.02)])
    found = calibrate(study(), record)
    both = [Collocation(order=1, label="before"), Calibrated(Collocation(order=1), found, label="after")]
    return study([0.0, 3.0]).with_propagators(both).run()


def page_of(values, path):
    return write_report(tree_of(values), path, sections=[CalibrationSection()]).read_text(encoding="utf-8")


def test_it_keeps_to_the_rules_of_sections():
    noise = 0.02 * np.random.default_rng(1).standard_normal(21)
    check_section(CalibrationSection, trees=[tree_of(0.6 + 2.2 * TIMES + noise)])


def section_of(page):
    return re.search(r"<h2>Calibration</h2>.*?</section>", page, re.DOTALL)[0]


def test_it_says_and_shows_what_was_learned(tmp_path):
    noise = 0.02 * np.random.default_rng(1).standard_normal(21)
    section = section_of(page_of(0.6 + 2.2 * TIMES + noise, tmp_path / "report.html"))
    assert section.count('<figure class="charted"') == 4 and "could not be drawn" not in section
    stills = re.findall(
        r"<figure class=.charted.*?<.figure>", section, re.DOTALL
    )  # pictures for readers without scripts
    assert section.count("<img") == sum(still.count("<img") for still in stills) == 4
    assert "after takes the inputs from the record run &amp; 1: 21 values of &lt;x&gt;" in section
    assert "<x>" not in section and "<place>" not in section
    assert "The residuals of &lt;x&gt; in record run &amp; 1 are consistent with the noise" in section
    # the posterior of a line through 21 points: 0.02 / sqrt(sum of squares about the mean) for the speed
    exact = 1 / np.sqrt(np.sum((TIMES - 0.5) ** 2) / 0.02**2 + 1 / 0.3**2)
    row = re.search(r'<th scope="row">speed \[m/s\]</th>.*?</tr>', section)[0]
    shown = float(re.findall(r"± ([0-9.e-]+)<", row)[1])
    assert shown == pytest.approx(exact, rel=0.1)


def test_a_wrong_model_is_rejected_in_it(tmp_path):
    with pytest.warns(uqmbd.StudyWarning, match="The model is incomplete"):
        page = page_of(0.6 + 2.2 * TIMES - 0.5 * TIMES**2, tmp_path / "report.html")
    assert "The model does not explain the values of &lt;x&gt;" in section_of(page)


def test_without_a_calibration_there_is_no_section(tmp_path):
    tree = study().with_propagators([Collocation(order=1)]).run()
    page = write_report(tree, tmp_path / "report.html", sections=[CalibrationSection()]).read_text(encoding="utf-8")
    assert "Calibration" not in page


def test_its_charts_are_those_of_the_calibration(tmp_path):
    """What was measured, the ends of bands and the densities are those of the draws; each density has its maximum."""
    values = 0.6 + 2.2 * TIMES + 0.02 * np.random.default_rng(1).standard_normal(21)
    found = calibrate(study(), Record("run", [Series("<x>", TIMES, values, "m", 0.02)]))
    tree = study([0.0, 3.0]).with_propagators([Calibrated(Collocation(order=1), found, label="after")]).run()
    part = next(one for one in tree.subtree if one.name == "calibration")
    after, before, measured = record_charts(part, "<x>")[0].curves
    np.testing.assert_array_equal(measured.values, values)
    draws = part["posterior_predictive"].to_dataset()["<x>"].values.reshape(-1, 21)
    np.testing.assert_allclose(after.bands[0].low, np.quantile(draws, 0.025, axis=0))
    assert np.all(np.asarray(before.bands[0].high) > np.asarray(after.bands[0].high))
    for chart in posterior_charts(part):
        assert [float(np.max(curve.values)) for curve in chart.curves] == pytest.approx([1.0, 1.0])
        own = part["posterior"].to_dataset()[chart.title].values
        middle, level = np.asarray(chart.places), np.asarray(chart.curves[0].values)
        assert np.average(middle, weights=level) == pytest.approx(own.mean(), abs=0.2 * own.std())
    (bars,) = reduction_chart(part).curves
    summary = part["summary"].to_dataset()
    ratio = [float(summary["sd"].sel(input=n) / summary["prior_sd"].sel(input=n)) for n in reduction_chart(part).places]
    np.testing.assert_allclose(bars.values, 100 * np.array(ratio), rtol=0.05)
