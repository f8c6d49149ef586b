"""Painleve's rod: where two motions satisfy the laws of contact and friction, the limit of compliant contacts is used."""

from __future__ import annotations

import json
import warnings

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_contact import PlaneContact, PlaneImpact
from uqmbd_montecarlo import MonteCarlo

G = 9.81


def rod(angle: float, speed: float, friction: float, spin=5.0, stiffness: float | None = None) -> uqmbd.Mechanism:
    """A slender rod of 2 m and 1 kg, whose lower end slides at a speed (negative: the rod points against it)."""
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -G)))
    c, s = np.cos(angle), np.sin(angle)
    velocity = (speed - spin * s, spin * c)
    body = mechanism.body(
        "rod", mass=1, inertia=1 / 3, position=(c, s), angle=angle, velocity=velocity, angular_velocity=spin
    )
    at = (mechanism.ground, body, (0, 0), (-1, 0), (0, 1))
    if stiffness is None:
        mechanism.add(PlaneImpact("tip", *at, restitution=0, friction=friction))
    else:
        mechanism.add(PlaneContact("tip", *at, law="linear", stiffness=stiffness, friction=friction, slow=1e-4))
    mechanism.output("tip", body.point((-1, 0))[1], units="m")
    mechanism.output("spin", body.angular_velocity, units="rad/s")
    return mechanism


def response(angle: float, friction: float, spin: float) -> tuple[float, float]:
    """Normal acceleration of the sliding tip per normal force, 1/kg, and without contact, m/s^2."""
    c, s = np.cos(angle), np.sin(angle)
    return 1 + 3 * c * (c - friction * s), -G + s * spin**2


@pytest.mark.parametrize(("angle", "friction", "spin"), [(60, 2.0, 5.0), (50, 2.2, 4.0), (65, 3.0, 6.0)])
def test_a_sliding_rod_lifts_off_where_its_tip_may_also_be_pressed(angle, friction, spin) -> None:
    angle = np.radians(angle)
    per_force, free = response(angle, friction, spin)
    assert per_force < 0 < free
    end = 0.05
    flight = np.sin(angle) + spin * np.cos(angle) * end - G / 2 * end**2 - np.sin(angle + spin * end)
    with pytest.warns(uqmbd.StudyWarning, match=r"at t = 0 s, two motions .* at 'tip' \(Painleve's paradox\)"):
        found = uqmbd.simulate(rod(angle, -1.0, friction, spin), [0, end], check=False)
    assert float(found["tip"][-1]) == pytest.approx(flight, rel=1e-7)
    assert float(found["spin"][-1]) == pytest.approx(spin, rel=1e-9)
    soft = uqmbd.simulate(rod(angle, -1.0, friction, spin, 1e6), [0, end], check=False)
    assert float(soft["tip"][-1]) == pytest.approx(flight, rel=1e-5)


@pytest.mark.parametrize("friction", [0.3, 1.0])
def test_a_rod_with_one_motion_gives_no_warning(friction) -> None:
    per_force, free = response(np.radians(60), friction, 1.0)
    assert per_force > 0 > free
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = uqmbd.simulate(rod(np.radians(60), -1.0, friction, 1.0), [0, 0.02], check=False)
    assert abs(float(found["tip"][-1])) < 1e-9


def test_a_study_counts_the_realisations_with_two_motions() -> None:
    """From a spin of 3.37 rad/s on, the tip lifts off, or may be pressed; below, the rod is wedged."""
    spin = uqmbd.RandomVariable("spin", chaospy.Uniform(2.0, 5.0), units="rad/s")
    study = uqmbd.Study(
        "rod", rod(np.radians(60), -1.0, 2.0, spin), [0, 0.02], [MonteCarlo(samples=16, seed=3, max_failures=1.0)]
    )
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        node = study.propagate(study.propagators[0])
    count = json.loads(node.attrs["solver_counters"])["two_motions"]
    lifts = node["samples"]["inputs"].values.ravel() > np.sqrt(G / np.sin(np.radians(60)))
    good = node["samples"]["status"].values == 0
    assert 0 < count == lifts.sum() == good.sum() < 16
    assert any(f"in {count} realisations, two motions satisfy" in str(one.message) for one in seen)
