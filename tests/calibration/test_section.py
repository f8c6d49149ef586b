"""The report's section on calibrations."""

from __future__ import annotations

import re

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report import write_report
from uqmbd_calibration import Calibrated, Record, Series, calibrate
from uqmbd_calibration.reporting import CalibrationSection
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


def page_of(values, path):
    record = Record("run & 1", [Series("<x>", TIMES, values, "m", 0.02)])
    found = calibrate(study(), record)
    both = [Collocation(order=1, label="before"), Calibrated(Collocation(order=1), found, label="after")]
    tree = study([0.0, 3.0]).with_propagators(both).run()
    return write_report(tree, path, sections=[CalibrationSection()]).read_text(encoding="utf-8")


def section_of(page):
    return re.search(r"<h2>Calibration</h2>.*?</section>", page, re.DOTALL)[0]


def test_it_says_and_shows_what_was_learned(tmp_path):
    noise = 0.02 * np.random.default_rng(1).standard_normal(21)
    section = section_of(page_of(0.6 + 2.2 * TIMES + noise, tmp_path / "report.html"))
    assert section.count("<figure>") == 3 and "could not be drawn" not in section
    assert "after takes the inputs from the record run &amp; 1: 21 values of &lt;x&gt;" in section
    assert "<x>" not in section and "<place>" not in section
    assert "The residuals of &lt;x&gt; in record run &amp; 1 are those of the noise" in section
    # the posterior of a line through 21 points: 0.02 / sqrt(sum of squares about the mean) for the speed
    exact = 1 / np.sqrt(np.sum((TIMES - 0.5) ** 2) / 0.02**2 + 1 / 0.3**2)
    row = re.search(r'<th scope="row">speed \[m/s\]</th>.*?</tr>', section)[0]
    shown = float(re.findall(r"± ([0-9.e-]+)<", row)[1])
    assert shown == pytest.approx(exact, rel=0.1)


def test_a_wrong_model_is_doubted_in_it(tmp_path):
    with pytest.warns(uqmbd.StudyWarning, match="something is missing in the model"):
        page = page_of(0.6 + 2.2 * TIMES - 0.5 * TIMES**2, tmp_path / "report.html")
    assert "The model is doubted: it does not give such values of &lt;x&gt;" in section_of(page)


def test_without_a_calibration_there_is_no_section(tmp_path):
    tree = study().with_propagators([Collocation(order=1)]).run()
    page = write_report(tree, tmp_path / "report.html", sections=[CalibrationSection()]).read_text(encoding="utf-8")
    assert "Calibration" not in page
