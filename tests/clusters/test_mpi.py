"""The processes of MPI do the work: the same bits, and what cannot be done is said by one of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import uqmbd
from uqmbd.results import load
from uqmbd.testing.propagators.moments import difference

pytestmark = pytest.mark.slow

ROOT = Path(uqmbd.__file__).parents[1]

STUDY = """
import chaospy
import numpy as np
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque

import uqmbd
from helper import brake

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
rod = mechanism.body("rod", mass=1.2 * length, inertia=1.2 * length**3 / 12, position=(length / 2, 0))
hinge = Revolute("hinge", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0))
mechanism.add(hinge)
mechanism.output("angle", rod.angle, units="rad")


def control(time, measured):
    return brake(measured)


controller = uqmbd.Controller(measured=["angle"], commanded=["torque"], rate=20, function=control)
mechanism.add(controller)
mechanism.add(Torque("brake", rod, controller.command("torque")))
methods = [MonteCarlo(samples=256, seed=5), Collocation(order=2)]
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 1, 11), methods)
"""


@pytest.fixture
def mpi(tmp_path: Path):
    """Run a command by several processes of MPI, in a folder with a study."""
    pytest.importorskip("mpi4py")
    if shutil.which("mpiexec") is None:
        pytest.skip("there is no mpiexec")
    (tmp_path / "my_study.py").write_text(STUDY)
    (tmp_path / "helper.py").write_text("def brake(measured):\n    return -0.1 * measured\n")

    def run(processes: int, *words: str) -> subprocess.CompletedProcess[str]:
        # for Open MPI: more processes than cores, and as any user, as in a container
        open_mpi = {
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_rmaps_base_oversubscribe": "1",
            "PRTE_ALLOW_RUN_AS_ROOT": "1",
            "PRTE_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        }
        paths = os.pathsep.join([str(ROOT), str(ROOT / "plugins"), os.environ.get("PYTHONPATH", "")])
        return subprocess.run(
            ["mpiexec", "-n", str(processes), sys.executable, "-m", *words],
            cwd=tmp_path,
            env=os.environ | open_mpi | {"PYTHONPATH": paths},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    return run


@pytest.mark.parametrize(
    ("processes", "module"), [(2, ["uqmbd"]), (3, ["uqmbd"]), (2, ["mpi4py.futures", "-m", "uqmbd"])]
)
def test_the_same_bits_as_in_one_process(processes: int, module: list[str], mpi, tmp_path: Path) -> None:
    """Of a study whose controller is a function of the script, which another module beside it serves."""
    done = mpi(processes, *module, "run", "my_study.py", "--out", "many", "--mpi")
    assert done.returncode == 0, done.stderr
    assert mpi(1, "uqmbd", "run", "my_study.py", "--out", "one").returncode == 0
    one, many = (load(tmp_path / name / "results.nc") for name in ("one", "many"))
    for label in ("monte-carlo", "collocation"):
        assert difference(one[label], many[label]) == ""


def test_what_cannot_be_done_is_reported_once(mpi) -> None:
    alone = mpi(1, "uqmbd", "run", "my_study.py", "--mpi")
    assert alone.returncode == 2 and "--mpi: there is one process" in alone.stderr
    missing = mpi(2, "uqmbd", "run", "nothing.py", "--mpi")
    assert missing.returncode == 2 and missing.stderr.count("The file nothing.py does not exist") == 1
