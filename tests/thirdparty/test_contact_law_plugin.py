"""A contact law of a third party, which contacts use by its name."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

PACKAGE = Path(__file__).parent / "uqmbd-flores-plugin"

STUDY = """
import json

import chaospy

import uqmbd
import uqmbd.plugins
from uqmbd_contact import PlaneContact
from uqmbd_flores import flores_damping
from uqmbd_montecarlo import MonteCarlo

restitution = uqmbd.RandomVariable("restitution", chaospy.Uniform(0.4, 0.95), units="1")
mechanism = uqmbd.Mechanism("ball", uqmbd.Line())
ball = mechanism.body("ball", mass=1, position=0.001, velocity=-2)
mechanism.add(
    PlaneContact(
        "floor", mechanism.ground, ball, (0,), (0,), (1,), law="flores", stiffness=1e5,
        damping=flores_damping(restitution, 2),
    )
)
mechanism.output("rebound", ball.velocity[0], units="m/s")
study = uqmbd.Study("ball", mechanism, [0, 0.2], rtol=1e-8)
samples = study.propagate(MonteCarlo(samples=12, seed=1))["samples"]
info = next(info for info in uqmbd.plugins.installed() if info.name == "flores")
try:
    mechanism.add(PlaneContact("f", mechanism.ground, ball, (0,), (0,), (1,), law="florez"))
except uqmbd.StudyError as error:
    told = str(error)
print(json.dumps([
    samples["inputs"].values[:, 0].tolist(), samples["response"].values[:, 0, -1].tolist(),
    [info.status, list(info.hooks), list(info.contact_laws), list(info.errors)], told,
]))
"""


def rebound(restitution, speed=2.0):
    """Return the speed after the contact: ``v' = -K d^n (1 + D v) / m`` is integrated over the depth in closed form."""
    rate = 8 * (1 - restitution) / (5 * restitution * speed)

    def lost(v):
        return v / rate - np.log1p(rate * v) / rate**2

    return -brentq(lambda v: lost(v) - lost(speed), -1 / rate * (1 - 1e-14), 0.0, xtol=1e-14)


@pytest.mark.thorough
def test_a_study_uses_it_by_name(python):
    restitution, found, info, told = json.loads(python("-W", "error::UserWarning", "-c", STUDY))
    assert info == ["loaded", ["uqmbd_contact_laws"], ["flores"], []]
    np.testing.assert_allclose(found, [rebound(e) for e in restitution], rtol=1e-5)
    assert told.endswith(
        "law is the text 'florez'; expected one of 'linear', 'hertz', 'hunt-crossley', 'kelvin-voigt', 'flores', ContactLaw."
    )


CHECK = """
import uqmbd
from uqmbd.testing import check_component
from uqmbd_contact import ContactLaw, PlaneContact, damping, depth, depth_rate, stiffness

given = {"law": "flores", "exponent": None, "friction": None, "slow": None}
check_component(PlaneContact, spaces=(uqmbd.Line,), given=given, propagators=())
wrong = ContactLaw(stiffness * depth * (1 - damping * depth_rate))  # it pushes harder while it opens
try:
    check_component(PlaneContact, spaces=(uqmbd.Line,), given={**given, "law": wrong}, propagators=())
except AssertionError as error:
    assert "its virtual work generates energy" in str(error), error
    print("found")
"""


@pytest.mark.thorough
def test_the_check_of_a_contact_with_it(python):
    assert python("-c", CHECK).split() == ["found"]


@pytest.mark.thorough
def test_the_command_lists_it(python):
    assert "flores" in python("-m", "uqmbd", "plugins")
