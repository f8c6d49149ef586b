"""Tables of requirements: conditions and descriptions, units of margins, and numbers that are not zero."""

from __future__ import annotations

import re
from dataclasses import replace

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.report import write_report
from uqmbd.report.overview.answers import ANSWERS
from uqmbd.report.overview.influences import Influences
from uqmbd.report.view import StudyResult
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3.0, 0.1), units="m/s")
    mass = uqmbd.RandomVariable("mass", chaospy.Normal(1.0, 0.05), units="kg")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    stone = mechanism.body("stone", mass=mass, velocity=speed)
    mechanism.output("highest", uqmbd.maximum(stone.position[0]), units="m")
    mechanism.require("low", stone.position[0] <= 0.56, description="stays below the roof")
    mechanism.require("slow", mass * stone.velocity[0] ** 2 <= 12)
    mechanism.require("scaled", 1000 * stone.position[0] <= 2000)
    methods = [MonteCarlo(samples=60, seed=1), Collocation(order=3)]
    return uqmbd.Study("throw", mechanism, np.linspace(0, 0.5, 11), methods).run()


def test_margins_have_the_units_of_the_relation(tree: xr.DataTree) -> None:
    """A number may have any units, so those of the scaled position are unknown."""
    units = tree["collocation/requirements/statistics"]["output_units"].values.tolist()
    assert (units[0], units[2]) == ("m", "") and uqmbd.extend.same_units(units[1], "J")
    rows = {row["name"]: row["margin"] for row in ANSWERS.content(StudyResult.of(tree))["results_table"]["rows"]}
    assert rows["low"][0].endswith(" m") and rows["low"][2] == "m" and rows["slow"][2]


def test_descriptions_are_not_conditions(tree: xr.DataTree, tmp_path) -> None:
    page = write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    (section,) = re.findall(r'<section id="requirements".*?</table>', page, re.DOTALL)
    assert section.count("stays below the roof</span></th>") == 2 and "Condition" in section
    assert section.count('data-name="Condition">stone.x &lt;= 0.56</td>') == 2


def test_no_violation_of_a_tighter_input_is_a_bound(tree: xr.DataTree) -> None:
    content = ANSWERS.content(StudyResult.of(tree))["matters"]
    assert content["of"] == "low" and content["halved"]["text"]["speed"].startswith("at most ")


def test_signs_of_effects_are_words() -> None:
    found = Influences(("length",), (-1.0,), "effects", signed=True)
    assert found.words == "length (100 %, decreases it)"
    assert replace(found, shares=(0.5,)).words == "length (50 %, increases it)"
    assert replace(found, correlations=True).words == "length (correlation −1.00)"
    assert replace(found, shares=(0.5,), signed=False).words == "length (50 %)"
