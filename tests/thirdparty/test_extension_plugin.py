"""A law of contact, a sampling design and a command of somebody else's: a file each, and used like those of the core."""

from __future__ import annotations

import json

import numpy as np
import pytest

WRITTEN = {"lankarani": "contact-law", "kronecker": "design", "bodies": "command"}
"""What `uqmbd new plugin` writes, by the names that are given to it."""


STUDY = """
import json

import chaospy
import numpy as np

import uqmbd
from lankarani.contact_law import loss_factor
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneContact
from uqmbd_montecarlo import MonteCarlo

restitution = uqmbd.RandomVariable("restitution", chaospy.Uniform(0.9, 1.0), units="1")
stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(0.9e5, 1.1e5), units="N/m^1.5")
mechanism = uqmbd.Mechanism("ball", uqmbd.Translational())
ball = mechanism.body("ball", mass=1, position=(0, 0), velocity=(0, -2))
mechanism.add(
    PlaneContact(
        "floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), law="lankarani",
        stiffness=stiffness, damping=loss_factor(restitution, 2)
    )
)
mechanism.output("rebound", ball.velocity[1], units="m/s")
study = uqmbd.Study("ball", mechanism, [0, 0.05], rtol=1e-8)
found = {}
for method in (
    MonteCarlo(samples=128, sampling="kronecker", replicates=4),
    Collocation(order=2, method="regression", rule="kronecker"),
    Collocation(order=1, method="regression", rule="kronecker", adaptive="order", label="adaptive"),
):
    statistics = study.propagate(method)["statistics"].isel(time=-1, output=0)
    found[method.node_name] = {name: float(statistics[name]) for name in ("mean", "std", "std_error_mean") if name in statistics}
import uqmbd.plugins
info = next(info for info in uqmbd.plugins.installed() if info.name == "kronecker")
print(json.dumps([found, info.status, info.hooks, info.designs, str(info.errors)]))
"""


@pytest.mark.thorough
def test_study_runs_with_its_law_and_on_its_design(python):
    """The law returns nearly the coefficient that it is made from, the more the nearer it is to 1; times 2 m/s."""
    found, *info = json.loads(python("-W", "error::UserWarning", "-c", STUDY))
    assert info == ["loaded", ["uqmbd_designs"], ["kronecker"], "()"]
    for statistics in found.values():
        assert statistics["mean"] == pytest.approx(2 * 0.95, rel=0.01)
        assert statistics["std"] == pytest.approx(2 * 0.1 / np.sqrt(12), rel=0.15)
    error = found["monte-carlo"]["std_error_mean"]  # of replicates
    assert error > 0
    assert found["monte-carlo"]["mean"] == pytest.approx(found["collocation"]["mean"], abs=4 * error)


FALL = """
import uqmbd
mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
stones = [mechanism.body(f"stone {k}", mass=k) for k in (1, 2)]
mechanism.output("height", stones[0].position[1], units="m")
study = uqmbd.Study("fall", mechanism, [0, 1])
"""


@pytest.mark.thorough
def test_its_command_is_listed_explained_and_run(python, site):
    assert "bodies" in python("-m", "uqmbd", "--help")
    assert "--only NAME" in python("-m", "uqmbd", "bodies", "--help")
    (site.parent / "falling.py").write_text(FALL)
    assert python("-m", "uqmbd", "bodies", "falling.py") == "stone 1\nstone 2\n"
    assert python("-m", "uqmbd", "bodies", "falling.py", "--only", "stone 2") == "stone 2\n"
    row = next(line for line in python("-m", "uqmbd", "plugins").splitlines() if line.startswith("bodies"))
    assert row.split()[3:] == ["loaded", "bodies"]
