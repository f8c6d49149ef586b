"""Numbers on requirements on the first screen are those of the stored results."""

import re

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import report, results
from uqmbd.report.overview.answers import ANSWERS
from uqmbd.report.view import StudyResult
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

pytestmark = pytest.mark.thorough

NUMBER = r"[\N{MINUS SIGN}]?\d+(?:\.\d+)?(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?"
DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹\N{MINUS SIGN}", "-0123456789-")


def numbers(text):
    """Read numbers, with powers of ten; per cents are shares."""
    found = []
    for one in re.findall(NUMBER + r"(?: %)?", text.replace("\N{NO-BREAK SPACE}", " ")):
        value, _, power = one.removesuffix(" %").partition(" × 10")
        number = float(value.translate(DIGITS)) * 10.0 ** float(power.translate(DIGITS) or 0)
        found.append(number / 100 if one.endswith("%") else number)
    return found


def tolerances():
    """A stone that flies along a line; its place is known to a thousandth of its way."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    start = uqmbd.RandomVariable("start", chaospy.Normal(0, 1e-4), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(2, 1e-4), units="m/s")
    body = mechanism.body("stone", mass=1, position=start, velocity=speed)
    mechanism.output("way", body.position[0], units="m")
    mechanism.require("wall", body.position[0] <= 2.0002, description="short of the wall")
    mechanism.require("far wall", body.position[0] <= 2.0004)
    return uqmbd.Study(
        "stone", mechanism, np.linspace(0, 1, 11), [MonteCarlo(samples=200, seed=1), Collocation(order=1)]
    )


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("tolerances") / "results.nc"
    results.save(tolerances().run(), path)
    return results.load(path)


def test_table_yield_and_margins_are_those_of_the_file(stored):
    content = ANSWERS.content(StudyResult.of(stored))
    for row in content["results_table"]["rows"]:
        data = stored[f"{row['method']}/requirements"]
        known = data.to_dataset().sel(requirement=row["name"])
        assert numbers(row["value"])[0] == pytest.approx(float(known["violation_probability"]), rel=0.06)
        assert numbers(row["interval"]) == pytest.approx(known["interval"].values, rel=0.06)
        if row["name"] != "any":
            margin = data["statistics"].to_dataset().sel(output=row["name"]).isel(time=-1)
            mean, spread = numbers(row["margin"][0])[0], numbers(row["margin"][1])[0]
            assert [mean, spread] == pytest.approx([float(margin["mean"]), float(margin["std"])], rel=1e-3)
            assert row["margin"][0].endswith(" m") and row["margin"][2] == "m"
    whole = stored["collocation/requirements"].to_dataset().sel(requirement="any")
    share, level, *ends = numbers(content["results_table"]["yield"])
    assert (share, level) == (pytest.approx(1 - float(whole["violation_probability"]), abs=6e-3), 0.95)
    assert ends == pytest.approx(sorted(1 - whole["interval"].values), abs=6e-3)


def test_closest_approach_and_contributors_are_those_of_the_file(stored):
    content = ANSWERS.content(StudyResult.of(stored))
    data = stored["collocation/statistics"].to_dataset().sel(output="way")
    margin = (2.0002 - data["mean"].values) / data["std"].values
    k = int(np.argmin(margin))
    words = content["picture"]["caption"].partition("Closest approach to wall")[2]
    time, distance, deviations = numbers(words)
    assert time == float(data["time"][k]) == 1.0
    assert distance == pytest.approx(2.0002 - float(data["mean"][k]), rel=1e-3)
    assert deviations == pytest.approx(margin[k], rel=6e-3)
    # at the end start and speed have the same share in the margin; along the motion the start has more
    total = stored["collocation/requirements/statistics"].to_dataset()["sobol_total"].sel(output="wall").isel(time=-1)
    bars = {bar["name"]: numbers(bar["text"])[0] for bar in content["matters"]["bars"]}
    for name, share in bars.items():
        assert share == pytest.approx(float(total.sel(input=name)), abs=6e-3) == pytest.approx(0.5, abs=0.01)
    assert set(content["matters"]["halved"]["text"]) == {"start", "speed"}


def test_deviations_come_first_where_the_band_cannot_be_seen(stored, tmp_path):
    page = report.write_report(stored, tmp_path / "r.html").read_text(encoding="utf-8")
    first = re.search(r'<figure id="in-view".*?</figure>', page, re.DOTALL)[0]
    assert '"title":"deviation"' in first and '"title":"over time"' in first and '"seen":0' in first
    assert '<th scope="col">Mean margin</th>' in page and 'class="yield"' in page
