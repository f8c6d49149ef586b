"""The work of a report is proportional to the number of outputs."""

from __future__ import annotations

import cProfile
from pathlib import Path

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report import write_report
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo


def calls_of_report(outputs: int, folder: Path) -> int:
    """Count the function calls of a report on a body whose position is observed several times."""
    speed = uqmbd.RandomVariable("v", chaospy.Normal(1, 0.1))
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    body = mechanism.body("b", mass=1, velocity=speed)
    for k in range(outputs):
        mechanism.output(f"x{k}", body.position[0] * (k + 1), units="m")
    methods = [MonteCarlo(samples=20, seed=1), Collocation(order=2, verify=4)]
    tree = uqmbd.Study("s", mechanism, np.linspace(0, 1, 5), methods).run(progress=False)
    write_report(tree, folder / "first.html")  # imports and caches of the first report do not count
    profile = cProfile.Profile()
    profile.runcall(write_report, tree, folder / "report.html")
    return sum(entry.callcount for entry in profile.getstats())


@pytest.mark.thorough
def test_calls_grow_in_proportion_to_the_outputs(tmp_path: Path) -> None:
    """What a further output adds is the same at ten and at forty outputs: the second difference vanishes."""
    few, more, many = (calls_of_report(outputs, tmp_path) for outputs in (10, 20, 40))
    assert many - more < 2.1 * (more - few)
