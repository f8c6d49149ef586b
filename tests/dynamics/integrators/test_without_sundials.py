"""What runs where scikit-sundae is not installed: the explicit method, and a message for the implicit one."""

from __future__ import annotations

import sys

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper


@pytest.fixture
def no_sundials(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every import of scikit-sundae fail."""
    for name in ("sksundae", "sksundae.ida"):
        monkeypatch.setitem(sys.modules, name, None)


def _study(integrator: str, damping: float = 0.0) -> uqmbd.Study:
    """A pendulum of random length, with a damper from its tip to the ground."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body("rod", mass=1.0, inertia=length**2 / 12, position=(length / 2, 0), angle=0.0)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    mechanism.add(
        SpringDamper(
            "damper", mechanism.ground, rod, point_i=(0, -3), point_j=(length / 2, 0),
            stiffness=0.0, damping=damping, free_length=1.0,
        )
    )  # fmt: skip
    mechanism.output("angle", rod.angle, units="rad")
    return uqmbd.Study(
        "pendulum", mechanism, np.linspace(0, 0.5, 6), [MonteCarlo(samples=4, seed=1)], integrator=integrator
    )


@pytest.mark.parametrize("damping", [0.0, 3000.0])
def test_auto_needs_the_explicit_method_only(damping: float, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = _study("auto", damping).run(progress=False)["monte-carlo/statistics"]["mean"]
    for name in ("sksundae", "sksundae.ida"):
        monkeypatch.setitem(sys.modules, name, None)
    found = _study("auto", damping).run(progress=False)["monte-carlo/statistics"]["mean"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5)


@pytest.mark.usefixtures("no_sundials")
def test_the_implicit_method_says_what_it_needs() -> None:
    with pytest.raises(uqmbd.StudyError, match="needs scikit-sundae, which is not installed.*integrator='dop853'"):
        _study("ida").run(progress=False)
