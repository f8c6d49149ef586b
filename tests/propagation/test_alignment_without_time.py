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
    with pytest.raises(uqmbd.StudyError, match=r"alignment='\w+' is about outputs over time"):
        study.propagate(method)
    assert "is about outputs over time" in method.obstacle(study)
    mechanism.output("x", mass.position[0], units="m")
    both = uqmbd.Study("oscillator", mechanism, times=np.linspace(0, 20, 101), propagators=[method])
    assert "scalars" in both.propagate(method).children
