"""Memory does not grow with the number of samples."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import resource
import sys
from pathlib import Path

import chaospy
import numpy as np
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

import uqmbd

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
rod = mechanism.body("rod", mass=1.2, inertia=length**2 / 10, position=(length / 2, 0))
mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
mechanism.output("angle", rod.angle, units="rad")
method = MonteCarlo(samples=int(sys.argv[1]), seed=1, keep=1000)
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 0.2, 201), [method])
study.run(folder=Path(sys.argv[2]))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the resource module is of Unix")
def test_hundred_thousand_samples_need_no_more_memory_than_five_thousand(tmp_path: Path) -> None:
    """All responses of the larger run are 160 MB; kilobytes on Linux, bytes on macOS: the ratio counts."""
    peaks = []
    for samples in (5_000, 100_000):
        out = tmp_path / str(samples)
        out.mkdir()
        command = [sys.executable, "-c", SCRIPT, str(samples), str(out)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        peaks.append(int(done.stdout.split()[-1]))
        assert (out / "monte-carlo-samples.zarr").exists()
    assert peaks[1] < 1.15 * peaks[0]
