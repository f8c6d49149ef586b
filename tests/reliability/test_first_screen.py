"""The first screen shows the most likely violation as a pose and a time: those of an oscillation in closed form."""

from __future__ import annotations

import json
import re

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.report import with_motion, write_report
from uqmbd.results import load, save
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import Reliability
from uqmbd_reliability.reporting import ReliabilitySection
from uqmbd_springs import SpringDamper

pytestmark = pytest.mark.thorough

NAME = "<amplitude>"


def oscillation():
    """A mass about x = 1 m with the period 2 s, which must stay above -0.5 m: the nearest violation is 1.5 m at 1 s."""
    mechanism = uqmbd.Mechanism("oscillation", uqmbd.Line())
    amplitude = uqmbd.RandomVariable(NAME, chaospy.Normal(1, 0.2), units="m")
    phase = uqmbd.RandomVariable("idle", chaospy.Normal(0, 1))
    body = mechanism.body("mass", mass=1, position=1 + amplitude + 0 * phase)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness=float(np.pi**2), free_length=1))
    mechanism.output("x", body.position[0], units="m")
    mechanism.require("<floor>", body.position[0] >= -0.5)
    mechanism.require("size", amplitude <= 1.7)
    return uqmbd.Study(
        "oscillation", mechanism, np.linspace(0, 4, 41), [Reliability(seed=1, max_realisations=600, target_cov=0.2)]
    )


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    study, path = oscillation(), tmp_path_factory.mktemp("rare") / "results.nc"
    save(study.run(), path)
    tree, problem = with_motion(load(path), study)
    assert not problem
    return tree


def test_time_index_and_inputs_are_the_closed_form_and_those_of_the_file(stored):
    screen = ReliabilitySection().first_screen(stored)
    data = stored["reliability/requirements"].to_dataset()
    rows = {row[0]: row[1:] for row in screen.rows}
    assert set(rows) == {"<floor>", "size"}
    time, beta, inputs = rows["<floor>"]
    one = data.sel(requirement="<floor>").isel(point=0)
    assert (time, float(one["design_times"])) == ("1 s", 1.0)
    assert float(beta) == pytest.approx(float(one["beta"]), abs=0.0051) == pytest.approx(2.5, abs=0.02)
    value = float(re.match(rf"{NAME} = ([\d.]+) m", inputs)[1])
    assert value == pytest.approx(float(one["design_points"].sel(input=NAME)), rel=1e-4) == pytest.approx(1.5, abs=0.01)
    # a limit on an input has no time
    assert rows["size"][0] == "\N{EN DASH}" and np.isnan(float(data.sel(requirement="size")["design_times"][0]))
    (said,) = screen.statements
    assert f"{stored['reliability'].attrs['realisations']} realisations" in said.text
    (figure,) = screen.charts
    drawn = dict(zip(figure.charts[0].places, figure.charts[0].curves[0].values, strict=True))
    known = one["design_points_standard"]
    assert drawn == {name: float(known.sel(input=name)) for name in drawn}


@pytest.mark.parametrize(
    ("units", "shown"), [("kg*m^2", "kg·m²"), ("m/s^2", "m/s²"), ("1", ""), ("N m s", "N\u202fm\u202fs")]
)
def test_units_of_the_inputs_are_typeset(stored, units, shown):
    changed = stored.copy(deep=True)
    data = changed["reliability/requirements"].to_dataset()
    names = data["input_units"].copy(data=np.full(data.sizes["input"], units))
    changed["reliability/requirements"] = xr.DataTree(data.assign_coords(input_units=names))
    for row in ReliabilitySection().first_screen(changed).rows:
        assert all(re.fullmatch(rf".* = \S+ {shown}".rstrip(), one) for one in row[-1].split("; "))


def test_the_pose_is_that_of_the_design_point(stored, tmp_path):
    """In the stored motion the mass of the named realisation is at -0.5 m at 1 s."""
    motion = stored["motion"].to_dataset()
    (named,) = json.loads(motion.attrs["named"])
    assert named["name"] == "most likely violation of <floor>" and named["time"] == 1.0
    own = motion.isel(realisation=named["realisation"])
    assert float(own["inputs"].sel(input=NAME)) == pytest.approx(1.5, abs=0.01)
    x = own["pose"].sel(body="mass", coordinate="x").values
    np.testing.assert_allclose(x, 1 + 1.5 * np.cos(np.pi * motion["time"].values), atol=0.02)
    page = write_report(stored, tmp_path / "r.html", sections=[ReliabilitySection()]).read_text(encoding="utf-8")
    assert "Pose of the most likely violation of &lt;floor&gt; at" in page and page.count('<figure class="pose">') == 1
    assert "<floor>" not in page.replace("\\u003c", "") and "Design points of reliability" in page


def test_without_an_analysis_it_adds_nothing():
    study = oscillation()
    tree = study.with_propagators([MonteCarlo(samples=20)]).run()
    assert ReliabilitySection().first_screen(tree) is None and ReliabilitySection().render(tree) == ""
