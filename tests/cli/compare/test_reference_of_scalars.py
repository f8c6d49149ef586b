"""Outputs over time and scalar outputs have separate references, in a run, a comparison and a report alike."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.report import write_report
from uqmbd.results import assess, load, save
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo


def with_rare_peaks() -> uqmbd.Mechanism:
    """Return a stone whose height is known from few samples, and a rate of peaks that is not."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3.0, 0.3), units="m/s")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    stone = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.output("height", stone.position[0], units="m")
    mechanism.output("lift_off", uqmbd.maximum(sympy.exp(5 * (stone.velocity[0] - 3))), units="1/s")
    return mechanism


@pytest.mark.thorough
def test_the_accurate_method_is_the_reference_of_scalar_outputs(tmp_path, command_line) -> None:
    methods = [MonteCarlo(samples=300, seed=1), Collocation(order=8)]
    tree = uqmbd.Study("throw", with_rare_peaks(), np.linspace(0, 0.5, 11), methods).run()
    compared = tree["comparison"].to_dataset()
    assert compared.attrs["reference"] == "monte-carlo" and compared.attrs["scalar_reference"] == "collocation"
    kinds = compared["scalar_verdict_kind"].sel(scalar="lift_off")
    assert kinds.sel({"method": "collocation"}) == "reference"
    assert kinds.sel({"method": "monte-carlo"}) == "too few samples"
    (line,) = assess(tree).of("lift_off", "scalar")
    assert line.method == "collocation" and line.level == 2 and "too few samples" not in line.reason

    page = write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "reference: monte-carlo; for scalar outputs collocation" in page
    path = save(tree, tmp_path / "results.nc")
    status, out, _ = command_line("compare", str(path), "--out", str(tmp_path / "both"))
    assert status == 0
    assert "A collocation compared with A monte-carlo" in out and "A monte-carlo compared with A collocation" in out
    again = load(tmp_path / "both" / "comparison.nc")["comparison"].attrs
    assert (again["reference"], again["scalar_reference"]) == ("A monte-carlo", "A collocation")
    # a chosen reference is the reference of all outputs
    status, out, _ = command_line("compare", str(path), "--reference", "monte-carlo", "--out", str(tmp_path / "one"))
    one = load(tmp_path / "one" / "comparison.nc")
    again = one["comparison"].attrs
    assert status == 0 and again["reference"] == "A monte-carlo" and "scalar_reference" not in again
    # its few samples say nothing about the other method
    row = one["comparison"].to_dataset().sel({"method": "A collocation", "scalar": "lift_off"})
    assert row["scalar_verdict_kind"] == "not verified"
    assert (
        row["scalar_verdict"].item().startswith("not verified, too few samples of the reference: A monte-carlo has 300")
    )
    (line,) = assess(one).of("lift_off", "scalar")
    assert line.method == "A collocation" and line.level == 2 and "accurate enough for a comparison" in line.reason
