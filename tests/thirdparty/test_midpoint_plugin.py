"""An implicit integrator of a third party, on the numeric residual and Jacobian of an ensemble."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

PACKAGE = Path(__file__).parent / "uqmbd-midpoint-plugin"

STUDY = """
import json

import chaospy

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
rod = mechanism.body("rod", mass=2.0, inertia=2 * length**2 / 12, position=(length / 2, 0), angle=0.0)
pivot = mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
mechanism.output("tip", rod.point((length / 2, 0))[1], units="m")
mechanism.output("reaction", pivot.reaction_force[1], units="N")
found = []
for integrator in ("midpoint", "auto"):
    study = uqmbd.Study("pendulum", mechanism, [0, 0.2, 0.5], integrator=integrator)
    node = study.propagate(MonteCarlo(samples=6, seed=1))
    found.append([node.attrs["integrated_by"], node.attrs["failures"], node["samples"]["response"].values.tolist()])
print(json.dumps(found))
"""


@pytest.mark.thorough
def test_a_study_runs_by_it(python):
    (by, failures, mine), (_, _, core) = json.loads(python("-W", "error::UserWarning", "-c", STUDY))
    assert (by, failures) == ("midpoint", 0)
    np.testing.assert_allclose(mine, core, rtol=1e-4, atol=1e-5)


@pytest.mark.slow
def test_it_passes_the_check(python):
    check = (
        "from uqmbd.testing import check_integrator; from uqmbd_midpoint import Midpoint; check_integrator(Midpoint)"
    )
    assert not python("-c", check)
