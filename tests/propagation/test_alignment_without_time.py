"""Alignment follows a motion: where all outputs are without a time it is refused."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_springs import SpringDamper


@pytest.mark.parametrize(
    "method", [Collocation(alignment="phase"), Collocation(alignment="auto"), Galerkin(alignment="phase")]
)
def test_it_is_refused(method):
    stiffness = uqmbd.RandomVariable("k", chaospy.Uniform(9, 11))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=stiffness, free_length=0))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    study = uqmbd.Study("oscillator", mechanism, times=np.linspace(0, 20, 101), propagators=[method])
    with pytest.raises(uqmbd.StudyError, match=r"alignment='\w+' applies to outputs over time"):
        study.propagate(method)
    assert "applies to outputs over time" in method.obstacle(study)
    mechanism.output("x", mass.position[0], units="m")
    both = uqmbd.Study("oscillator", mechanism, times=np.linspace(0, 20, 101), propagators=[method])
    assert "scalars" in both.propagate(method).children


def test_sums_are_those_of_the_times_of_the_study():
    """Realisations that are followed until the last has reached the phase of the first end later: x = 0.1 cos(w t)."""
    stiffness = uqmbd.RandomVariable("k", chaospy.Uniform(9, 11))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=stiffness, free_length=0))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("last", uqmbd.final(mass.position[0]), units="m")
    mechanism.output("area", uqmbd.integral(mass.position[0]), units="m s")
    # 64 nodes are a chunk of their own in both runs, so that what is known of one may be taken in the other
    method = Collocation(alignment="phase", order=5, method="regression", samples=64)
    node = uqmbd.Study("oscillator", mechanism, np.linspace(0, 5, 26), [method]).propagate(method)
    speeds = np.sqrt(np.linspace(9, 11, 20_001))
    data = node["scalars/statistics"].to_dataset()
    for name, exact in (("last", 0.1 * np.cos(5 * speeds)), ("area", 0.1 * np.sin(5 * speeds) / speeds)):
        assert float(data["mean"].sel(output=name)) == pytest.approx(exact.mean(), abs=1e-5)
        assert float(data["std"].sel(output=name)) == pytest.approx(exact.std(), rel=1e-3)
