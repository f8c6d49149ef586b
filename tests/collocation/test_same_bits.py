"""The same nodes give the same bits, whoever computes them; a killed adaptive run goes on where it was."""

from __future__ import annotations

import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from uqmbd.errors import StudyWarning
from uqmbd.propagation.studies.script import load_study
from uqmbd_collocation import Collocation

STUDY = """
import chaospy
import numpy as np
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute

import uqmbd

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.05), units="m")
angle = uqmbd.RandomVariable("angle", chaospy.Uniform(-0.5, 0.5), units="rad")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
rod = mechanism.body("rod", mass=1.2 * length, inertia=length**3 / 10, position=(length / 2, 0), angle=angle)
mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
mechanism.output("angle", rod.angle, units="rad")
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 2, 11), [Collocation({}order=1)])
"""

KILLED = """
import os, signal, sys
from concurrent.futures import Executor, Future
from pathlib import Path
from uqmbd.propagation.studies.script import load_study

class Deadly(Executor):
    left = int(sys.argv[3])

    def submit(self, function, /, *arguments):
        if not self.left:
            os.kill(os.getpid(), signal.SIGKILL)
        self.left -= 1
        future = Future()
        future.set_result(function(*arguments))
        return future

load_study(Path(sys.argv[1])).run(Deadly(), folder=Path(sys.argv[2]))
"""


def bits(node):
    """Everything that was computed, as bytes."""
    return {
        f"{part.path}/{name}": np.ascontiguousarray(value.values).tobytes()
        for part in node.subtree
        for name, value in part.to_dataset().data_vars.items()
        if value.dtype.kind in "fiu"
    }


@pytest.fixture
def script(tmp_path):
    def write(adaptive):
        path = tmp_path / "pendulum_study.py"
        path.write_text(STUDY.format("" if adaptive == "no" else f"adaptive={adaptive!r}, tolerance=1e-5, "))
        return path

    return write


@pytest.mark.thorough
@pytest.mark.parametrize(
    "options", [{"order": 9}, pytest.param({"method": "omp", "order": 8}, marks=pytest.mark.slow)], ids=str
)
def test_any_executor_gives_the_same_bits(script, inline, options):
    study = load_study(script("no"))
    collocation = Collocation(**options)
    alone = bits(study.propagate(collocation))
    assert bits(study.propagate(collocation)) == alone
    assert bits(study.propagate(collocation, workers=inline())) == alone
    with ThreadPoolExecutor(3) as threads:
        assert bits(study.propagate(collocation, workers=threads)) == alone


@pytest.mark.thorough
def test_one_worker_and_two_give_the_same_bits(script):
    """100 nodes and 8 points of verification are two chunks."""
    study = load_study(script("no"))
    assert bits(study.propagate(Collocation(order=9), workers=2)) == bits(study.propagate(Collocation(order=9)))


@pytest.mark.slow
@pytest.mark.parametrize("adaptive", ["order", "dimension"])
def test_killed_adaptive_run_resumes(script, tmp_path, inline, adaptive):
    path = script(adaptive)
    whole = inline()
    undisturbed = load_study(path).run(whole, folder=tmp_path / "undisturbed")
    assert whole.chunks > 4
    runner, folder = tmp_path / "killed.py", tmp_path / "killed"
    runner.write_text(KILLED)
    stop = whole.chunks - 2
    process = subprocess.run([sys.executable, str(runner), str(path), str(folder), str(stop)], capture_output=True)
    assert process.returncode == -signal.SIGKILL, process.stderr.decode()
    kept = len(list((folder / "unfinished").rglob("*.npz")))
    assert 0 < kept <= stop
    rest = inline()
    resumed = load_study(path).run(rest, folder=folder, resume=True)
    assert rest.chunks == whole.chunks - kept
    assert bits(resumed["collocation"]) == bits(undisturbed["collocation"])
    assert resumed["collocation"].attrs["realisations"] == undisturbed["collocation"].attrs["realisations"]
    assert not (folder / "unfinished").exists()


@pytest.mark.thorough
def test_another_option_computes_nothing_again_that_is_the_same(script, tmp_path, inline):
    """An interrupted run with a tolerance is gone on with a finer one: its steps are the first ones of the new run."""
    path = script("dimension")
    first = load_study(path)
    coarse, fine = Collocation(adaptive="dimension", tolerance=1e-2), Collocation(adaptive="dimension", tolerance=1e-5)
    needed, interrupted = inline(), inline()
    first.with_propagators([fine]).run(needed, folder=tmp_path / "fine")
    first.propagate(coarse, workers=interrupted)
    with pytest.raises(RuntimeError, match="no more than"):
        first.with_propagators([coarse]).run(inline(interrupted.chunks - 1), folder=tmp_path / "both")
    rest = inline()
    with pytest.warns(StudyWarning, match="(tolerance=1e-05, not 0.01)".replace("(", r"\(").replace(")", r"\)")):
        first.with_propagators([fine]).run(rest, folder=tmp_path / "both", resume=True)
    assert rest.chunks == needed.chunks - (interrupted.chunks - 1)
