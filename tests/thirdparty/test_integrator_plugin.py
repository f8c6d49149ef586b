"""An integrator of somebody else's that follows impacts: one file, on the public interface only."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

PACKAGE = Path(__file__).parent / "uqmbd-runge-kutta-plugin"

STUDY = """
import json

import chaospy

import uqmbd
import uqmbd.plugins
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import MonteCarlo

height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
ball = mechanism.body("ball", mass=1, position=(0, height), velocity=(1, 0))
floor = mechanism.add(
    PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.8, friction=0.05)
)
mechanism.output("height", ball.position[1], units="m")
mechanism.output("speed", ball.velocity[0], units="m/s")
mechanism.output("second", floor.event_time("impact", 2), units="s")
found = {}
for integrator in ("runge-kutta", "auto"):
    study = uqmbd.Study("ball", mechanism, [0, 0.5, 1.0, 1.5], integrator=integrator)
    node = study.propagate(MonteCarlo(samples=20, seed=1))
    found[integrator] = [
        node.attrs["integrated_by"],
        int(node.attrs["failures"]),
        *(node["statistics"][name].values.tolist() for name in ("mean", "std")),
        *(node["scalars/statistics"][name].values.tolist() for name in ("mean", "std")),
    ]
info = next(info for info in uqmbd.plugins.installed() if info.name == "runge-kutta")
print(json.dumps([found, info.status, info.integrators, str(info.errors)]))
"""


@pytest.mark.thorough
def test_a_study_with_impacts_runs_by_it(python):
    """With friction of the impulses; moments are those of the integrator of the core on the same samples."""
    found, *info = json.loads(python("-W", "error::UserWarning", "-c", STUDY))
    assert info == ["loaded", ["runge-kutta"], "()"]
    by, failures, *moments = found["runge-kutta"]
    assert (by, failures) == ("runge-kutta", 0)
    for mine, core in zip(moments, found["auto"][2:], strict=True):
        np.testing.assert_allclose(mine, core, rtol=1e-5, atol=1e-6)
    assert found["auto"][0] == "dop853"


SUMS = """
import json

import chaospy

import uqmbd
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import MonteCarlo
from uqmbd_runge_kutta import RungeKutta

asked, integrate = [], RungeKutta.integrate


def counted(self, ensemble, times, rtol):
    asked.append(len(times) * len(ensemble))
    return integrate(self, ensemble, times, rtol)


RungeKutta.integrate = counted
height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
ball = mechanism.body("ball", mass=1, position=(0, height))
mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.8))
y, v = ball.position[1], ball.velocity[1]
mechanism.output("fall", uqmbd.maximum(-v), units="m/s")
mechanism.output("rise", uqmbd.maximum(v), units="m/s")
mechanism.output("when", uqmbd.time_of_maximum(v), units="s")
mechanism.output("upwards", uqmbd.first_time(v >= 1), units="s")
mechanism.output("area", uqmbd.integral(y), units="m s")
mechanism.require("slow", v <= 3.6)
study = uqmbd.Study("ball", mechanism, [0, 1.5], integrator="runge-kutta")
node = study.propagate(MonteCarlo(samples=2, seed=1))
samples, violated = node["scalars/samples"], node["requirements"]["violations"].values.tolist()
print(json.dumps([asked, violated, samples["inputs"].values.tolist(), samples["response"].values.tolist()]))
"""


@pytest.mark.slow
def test_what_sums_impacts_up_is_that_of_the_closed_form(python):
    """Both sides of a jump count, and it is closed in on: not everything is asked for at thousands of times."""
    asked, violated, inputs, found = json.loads(python("-W", "error::UserWarning", "-c", SUMS))
    height, e, g, end = np.array(inputs)[:, 0], 0.8, 9.81, 1.5
    falling = np.sqrt(2 * height / g)
    fall, again = g * falling, end - (1 + 2 * e) * falling
    flight = (2 * e * fall) ** 3 / (12 * g**2)
    area = 2 / 3 * height * falling + flight + e**2 * fall * again**2 / 2 - g * again**3 / 6
    np.testing.assert_allclose(found, np.stack([fall, e * fall, falling, falling, area], axis=1), rtol=2e-6)
    assert violated == [np.count_nonzero(e * fall > 3.6)]
    assert sum(asked) < 2 * 4096


@pytest.mark.slow
def test_its_own_test_suite_passes(python):
    """Which is the conformance kit."""
    assert "1 passed" in python("-m", "pytest", "-q", "-p", "no:cacheprovider", str(PACKAGE / "tests"))
