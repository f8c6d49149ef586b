"""A first step that is far too long costs a refusal, not the run: stiff contacts, output times far apart."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_contact import ClearanceJoint
from uqmbd_drivers import RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Revolute

CRANK, COUPLER, ROCKER, FRAME = 0.1, 0.35, 0.25, 0.4  # m
DRAWN = 0.6  # angle of the crank, rad


def four_bar_with_clearance():
    """A driven four-bar; the pin of coupler and rocker starts in the middle of a larger bore."""
    clearance = uqmbd.RandomVariable("clearance", chaospy.Uniform(1e-4, 5e-4), units="m")
    friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.05, 0.15))
    end = CRANK * np.array([np.cos(DRAWN), np.sin(DRAWN)])
    bearing = np.array([FRAME, 0.0])
    apart = np.linalg.norm(bearing - end)
    along = (COUPLER**2 - ROCKER**2 + apart**2) / (2 * apart)
    forward = (bearing - end) / apart
    pin = end + along * forward + np.sqrt(COUPLER**2 - along**2) * np.array([-forward[1], forward[0]])

    mechanism = uqmbd.Mechanism("four_bar", uqmbd.Planar(gravity=(0, -9.81)))
    ground, bodies = mechanism.ground, {}
    for name, mass, length, a, b in (
        ("crank", 0.3, CRANK, np.zeros(2), end),
        ("coupler", 0.5, COUPLER, end, pin),
        ("rocker", 0.4, ROCKER, bearing, pin),
    ):
        angle = float(np.arctan2(*(b - a)[::-1]))
        bodies[name] = mechanism.body(
            name, mass=mass, inertia=mass * length**2 / 12, position=tuple((a + b) / 2), angle=angle
        )
    crank, coupler, rocker = bodies.values()
    mechanism.add(Revolute("A", ground, crank, (0, 0), (-CRANK / 2, 0)))
    mechanism.add(Revolute("B", crank, coupler, (CRANK / 2, 0), (-COUPLER / 2, 0)))
    mechanism.add(Revolute("D", ground, rocker, (FRAME, 0), (-ROCKER / 2, 0)))
    ends = {"point_i": (COUPLER / 2, 0), "point_j": (ROCKER / 2, 0)}
    law = {"law": "hunt-crossley", "stiffness": 1e8, "damping": 0.5, "friction": friction, "slow": 0.01}
    mechanism.add(ClearanceJoint("C", coupler, rocker, **ends, radius=0.01, clearance=clearance, **law))
    mechanism.add(RotationDriver("drive", ground, crank, angle=DRAWN + 20 * uqmbd.t))
    mechanism.output("angle", rocker.angle, units="rad")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize(
    "times",
    [np.linspace(0, 0.004, 3), pytest.param(np.linspace(0, 1, 501), marks=pytest.mark.slow)],
    ids=["short", "long"],
)
def test_a_run_starts_however_far_apart_its_output_times_are(times):
    mechanism = four_bar_with_clearance()
    node = uqmbd.Study("start", mechanism, times, []).propagate(Galerkin(order=2, verify=0))
    assert "ends_at" not in node.attrs
    fine = np.linspace(0, 0.002, 11)
    short = uqmbd.Study("start", mechanism, fine, []).propagate(Galerkin(order=2, verify=0))
    at = 0.002
    for name in ("mean", "std"):
        a, b = (x["statistics"][name].sel(output="angle", time=at, method="nearest") for x in (node, short))
        assert a.item() == pytest.approx(b.item(), abs=1e-7)
