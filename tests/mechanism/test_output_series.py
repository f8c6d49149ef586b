"""Series of scalar outputs: their outputs, their axis in results and reports, and what they refuse."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report import write_report
from uqmbd.results import by_output, load, output, save
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

MASSES = (1.0, 3.0, 40.0)


def springs():
    """Mass on a spring, whose frequency with several added masses is a series over the mass."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(90, 110), units="N/m")
    mechanism = uqmbd.Mechanism("springs", uqmbd.Line())
    body = mechanism.body("body", mass=1.0, position=1.0)
    mechanism.add(SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness, damping=0.0, free_length=1))
    frequency = uqmbd.eigenfrequency(1)
    series = uqmbd.extend.OutputSeries([frequency / np.sqrt(1 + m) for m in MASSES], MASSES, "added_mass", "kg")
    mechanism.output("frequency", series, units="Hz")
    mechanism.output("alone", frequency, units="Hz")
    return mechanism


@pytest.fixture(scope="module")
def tree():
    methods = [Collocation(order=4), MonteCarlo(samples=64, seed=1)]
    return uqmbd.Study("s", springs(), propagators=methods).run()


def exact():
    nodes, weights = np.polynomial.legendre.leggauss(12)
    roots = np.sqrt(100 + 10 * nodes) / (2 * np.pi)
    mean = weights @ roots / 2
    return mean, np.sqrt(weights @ roots**2 / 2 - mean**2)


def test_a_series_is_recorded_as_scalar_outputs():
    mechanism = springs()
    assert list(mechanism.scalars) == ["frequency at 1 kg", "frequency at 3 kg", "frequency at 40 kg", "alone"]
    found = uqmbd.simulate(mechanism, [0, 1])
    np.testing.assert_allclose(found["frequency at 3 kg"], 10 / (2 * np.pi) / 2, rtol=1e-9)


def test_results_have_the_axis_of_a_series(tree, tmp_path):
    mean, std = exact()
    save(tree, tmp_path / "results.nc")
    for one in (tree, load(tmp_path / "results.nc")):
        found = output(one, "frequency")
        assert found["mean"].dims == ("propagator", "added_mass")
        assert found["added_mass"].values.tolist() == list(MASSES) and found["added_mass"].attrs["units"] == "kg"
        assert found["mean"].attrs["units"] == "Hz" and found["mean"].attrs["long_name"] == "frequency: mean"
        scale = 1 / np.sqrt(1 + np.array(MASSES))
        np.testing.assert_allclose(found["mean"].sel(propagator="collocation"), mean * scale, rtol=1e-7)
        np.testing.assert_allclose(found["std"].sel(propagator="collocation"), std * scale, rtol=1e-6)
        single = output(one["collocation"], "frequency")
        assert single["sobol_total"].dims == ("added_mass", "input")
    alone = output(tree["collocation"], "alone")
    assert not {"output_series", "output_position"} & set(alone.coords)
    assert "frequency at 3 kg" in by_output(tree["collocation"])


def test_other_results_have_no_coordinates_of_series():
    mechanism = springs()
    mechanism.scalars.pop("frequency at 1 kg"), mechanism.scalars.pop("frequency at 3 kg")
    mechanism.scalars.pop("frequency at 40 kg")
    tree = uqmbd.Study("s", mechanism, propagators=[Collocation(order=2)]).run()
    assert not [name for name in tree["collocation/scalars/statistics"].coords if "series" in str(name)]


def test_a_report_draws_a_series_once(tree, tmp_path):
    text = write_report(tree, tmp_path / "report.html").read_text()
    section = text[text.index("<h2>Scalar outputs</h2>") :]
    table = section[: section.index("</table>")]
    assert "alone" in table and "frequency at" not in table
    assert "Series of scalar outputs: mean, and band of 95" in section
    first_screen = text[: text.index("<h2>What-if</h2>")]
    for label in ("collocation", "monte-carlo"):
        assert first_screen.count("frequency at") <= 2, label


def test_an_unknown_name_is_answered_with_the_names_of_series(tree):
    with pytest.raises(uqmbd.StudyError, match=r"There is no output 'frequenzy'.*'alone'"):
        output(tree["collocation/scalars/statistics"], "frequenzy")


def test_what_a_series_refuses():
    mechanism = springs()
    with pytest.raises(uqmbd.StudyError, match="output 'frequency at 1 kg': an output with this name exists already"):
        mechanism.output("frequency", uqmbd.extend.OutputSeries([uqmbd.eigenfrequency(1)], [1.0], "mass", "kg"))
    body = mechanism.bodies["body"]
    with pytest.raises(uqmbd.StudyError, match="series over mass: 1 positions are given for 2 quantities"):
        uqmbd.extend.OutputSeries([uqmbd.eigenfrequency(1)] * 2, [2.0], "mass", "kg")
    with pytest.raises(uqmbd.StudyError, match="increasing"):
        uqmbd.extend.OutputSeries([uqmbd.eigenfrequency(1)] * 2, [2.0, 2.0], "mass", "kg")
    with pytest.raises(uqmbd.StudyError, match="is not a scalar quantity"):
        mechanism.output("moving", uqmbd.extend.OutputSeries([body.position[0]], [2.0], "mass", "kg"))
    with pytest.raises(uqmbd.StudyError, match="axis"):
        uqmbd.extend.OutputSeries([uqmbd.eigenfrequency(1)], [2.0], "time", "s")


def test_positions_that_differ_little_have_different_names():
    positions = [1000.0, 1000.001, 1000.0010001]
    found = uqmbd.extend.OutputSeries([uqmbd.eigenfrequency(1)] * 3, positions, "mass", "kg").named("f")
    assert list(found) == ["f at 1000 kg", "f at 1000.001 kg", "f at 1000.0010001 kg"]
    assert [place.position for _, place in found.values()] == positions
