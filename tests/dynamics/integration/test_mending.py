"""States that interpolation leaves poor are integrated to: under all that the integration itself obeys."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.dynamics import Ensemble, build
from uqmbd.dynamics.integration.dop853 import Integration
from uqmbd_drivers import SpeedDriver
from uqmbd_joints import Revolute
from uqmbd_springs import PointForce

TIMES = np.linspace(0, 1, 5)


def arms(kind):
    """A driven arm and a free one; between output times a speed jumps, a force is a pulse, or has knots."""
    mechanism = uqmbd.Mechanism("arms", uqmbd.Planar(gravity=(0, -9.81)))
    first = mechanism.body("first", mass=1, inertia=0.1, position=(0.5, 0))
    second = mechanism.body("second", mass=0.4, inertia=0.05, position=(1.5, 0))
    mechanism.add(Revolute("shoulder", mechanism.ground, first, (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("elbow", first, second, (0.5, 0), (-0.5, 0)))
    speed = sympy.Piecewise((1.0, uqmbd.t < 0.6), (3.0, True)) if kind == "speed" else 1
    mechanism.add(SpeedDriver("drive", mechanism.ground, first, speed))
    if kind == "pulse":
        force = 300 * sympy.exp(-(((uqmbd.t - 0.6) / 0.002) ** 2))
        mechanism.add(PointForce("push", second, (0.5, 0), (0, force)))
    if kind == "knots":
        knots = np.linspace(0, 1, 41)
        mechanism.add(PointForce("push", second, (0.5, 0), (0, uqmbd.spline(knots, np.cos(97 * knots)))))
    return Ensemble(build(mechanism), np.zeros((1, 0)))


@pytest.mark.parametrize("kind", ["speed", "pulse", "knots"])
def test_what_is_mended_is_the_motion(kind):
    run = Integration(arms(kind), TIMES, 1e-9, comparing=False, patient=False)
    run.run()
    motion = run.main.result.copy()
    assert np.isfinite(motion).all()
    run.main.poor[:, 1:] = 1
    run.main.result[:, 1:] += 1e-3
    run.main.result[:, 1:3] = motion[:, 1:3]  # what is before is right
    run.main.poor[:, 1:3] = 0
    run.recompute_poor()
    np.testing.assert_allclose(run.main.result, motion, rtol=0, atol=2e-7)
