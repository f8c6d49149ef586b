"""The first screen of a calibration has the numbers of the stored results, and names inputs that it cannot separate."""

from __future__ import annotations

import re

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report import write_report
from uqmbd.results import load, save
from uqmbd_calibration import Calibrated, Record, Series, calibrate
from uqmbd_calibration.reporting import CalibrationSection
from uqmbd_collocation import Collocation

pytestmark = pytest.mark.thorough

TIMES = np.linspace(0, 1, 21)
FIRST, SECOND, NOISE = 0.3, 0.4, 0.02


def study(times=TIMES):
    """Return a stone whose speed is the sum of two inputs: a record of its place determines their sum only."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    one = uqmbd.RandomVariable("<one>", chaospy.Normal(1, FIRST), units="m/s")
    two = uqmbd.RandomVariable("two", chaospy.Normal(1, SECOND), units="m/s")
    start = uqmbd.RandomVariable("start", chaospy.Normal(0.5, 0.2), units="m")
    body = mechanism.body("stone", mass=1, position=start, velocity=one + two)
    mechanism.output("x", body.position[0], units="m")
    return uqmbd.Study("stone", mechanism, times)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Results as they are read from a file."""
    values = 0.6 + 2.2 * TIMES + NOISE * np.random.default_rng(1).standard_normal(21)
    found = calibrate(study(), Record("run", [Series("x", TIMES, values, "m", NOISE)]))
    both = [Collocation(order=1, label="before"), Calibrated(Collocation(order=1), found, label="after")]
    folder = tmp_path_factory.mktemp("calibrated")
    save(study([0.0, 3.0]).with_propagators(both).run(), folder / "results.nc")
    return load(folder / "results.nc"), folder


def numbers(text):
    return [float(one) for one in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text.replace("\N{MINUS SIGN}", "-"))]


def test_numbers_are_those_of_the_file(stored):
    """Each number differs from the stored one by rounding only: half a unit of its last digit."""
    tree, _ = stored
    screen = CalibrationSection().first_screen(tree)
    summary = tree["after/calibration/summary"].to_dataset()
    assert len(screen.rows) == 3
    for name, before, after, interval, learned in screen.rows:
        one = summary.sel(input=name.split(" [")[0])
        known = [float(one[key]) for key in ("prior_mean", "prior_sd", "mean", "sd", "lower", "upper")]
        shown = [text for cell in (before, after, interval) for text in re.findall(r"[\N{MINUS SIGN}\d.]+", cell)]
        for text, number in zip(shown, known, strict=True):
            value, *tail = text.replace("\N{MINUS SIGN}", "-").split(".")
            assert abs(float(".".join([value, *tail])) - number) <= 0.5001 * 10.0 ** -len(tail[0] if tail else "")
        assert numbers(learned)[0] == pytest.approx(100 * float(one["reduction"]), abs=0.051)


def test_inputs_that_a_record_does_not_separate_are_named(stored):
    """The posterior of both inputs, given their sum, has the correlation -1 and known standard deviations."""
    tree, _ = stored
    screen = CalibrationSection().first_screen(tree)
    # given the sum, each has the standard deviation s1 s2 / sqrt(s1^2 + s2^2), as the sum is known far better
    exact = FIRST * SECOND / np.hypot(FIRST, SECOND)
    for name in ("<one> [m/s]", "two [m/s]"):
        after = next(row for row in screen.rows if row[0] == name)[2]
        assert numbers(after)[1] == pytest.approx(exact, rel=0.1)
    (said,) = [one for one in screen.statements if "distinguished" in one.text]
    assert said.level == 1 and {"<one>", "two"} <= set(said.text.replace(",", "").split())
    assert numbers(said.text)[0] == pytest.approx(-1, abs=0.02)
    levels = {one.name: one.level for one in screen.statements}
    assert levels["Fit"] == levels["Posterior"] == levels["Chains"] == 2


def test_bands_and_measured_values_are_those_of_the_file(stored):
    tree, _ = stored
    densities, fits = CalibrationSection().first_screen(tree).charts
    found = tree["after/calibration"]
    fit, residuals = fits.charts
    after, _, measured = fit.curves
    np.testing.assert_array_equal(measured.values, found["observed_data"]["x"].values)
    np.testing.assert_array_equal(after.values, found["fit"]["x"].values)
    np.testing.assert_array_equal(residuals.curves[1].values, found["residuals"]["x"].values)
    for chart in densities.charts:
        after, before = (np.asarray(curve.values) for curve in chart.curves)
        places = np.asarray(chart.places)
        for level, group in ((after, "posterior"), (before, "prior")):
            draws = np.ravel(found[group][chart.title].values)
            mean = np.trapezoid(level * places, places) / np.trapezoid(level, places)
            assert mean == pytest.approx(draws.mean(), abs=0.1 * draws.std())


def test_it_is_the_first_part_of_the_page(stored, tmp_path):
    tree, _ = stored
    page = write_report(tree, tmp_path / "r.html", sections=[CalibrationSection()]).read_text(encoding="utf-8")
    first = re.search(r'<section id="summary".*?\n</section>\n<nav', page, re.DOTALL)[0]
    assert first.index("Calibrated input") < first.index(">Results<") and "&lt;one&gt; [m/s]" in first
    assert first.index("cannot be distinguished") < first.index("Reliability of the results")


def test_a_wrong_model_comes_first(tmp_path):
    values = 0.6 + 2.2 * TIMES - 0.5 * TIMES**2
    with pytest.warns(uqmbd.StudyWarning, match="The model is incomplete"):
        found = calibrate(study(), Record("run", [Series("x", TIMES, values, "m", NOISE)]))
    tree = study([0.0, 3.0]).with_propagators([Calibrated(Collocation(order=1), found, label="after")]).run()
    screen = CalibrationSection().first_screen(tree)
    said = min(screen.statements, key=lambda one: one.level)
    assert said.level == 0 and "the model cannot explain x in record run" in said.text
    assert {row[4] for row in screen.rows} == {"unreliable"}


def test_without_a_calibration_it_adds_nothing():
    assert CalibrationSection().first_screen(study().with_propagators([Collocation(order=1)]).run()) is None
