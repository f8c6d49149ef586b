"""A result that ends early is shown up to its end, and said to."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import report
from uqmbd_galerkin import Galerkin
from uqmbd_springs import SpringDamper


@pytest.mark.thorough
def test_a_report_of_a_run_that_stopped(tmp_path, recwarn):
    """Order 1 of an oscillator whose phase spreads: known until its stated error passes the limit."""
    k = uqmbd.RandomVariable("k", chaospy.Uniform(80, 120))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), k))
    mechanism.output("x", mass.position[0], units="m")
    study = uqmbd.Study("oscillator", mechanism, np.linspace(0, 4, 81), [Galerkin(order=2, stop_at=0.2)])
    tree = study.run()
    end = tree["galerkin"].attrs["ends_at"]
    assert 0 < end < 4
    page = report.write_report(tree, tmp_path / "report.html").read_text()
    assert f"Results of galerkin end at t = {end:g} s" in page
    assert "unknown m" not in page
    assert "could not be drawn" not in page
    assert "have no influence" not in page
