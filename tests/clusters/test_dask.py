"""A Dask cluster does the work: the same bits, and nothing is lost when its scheduler dies."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import uqmbd
from uqmbd.propagation.script import load_study
from uqmbd.results import load

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

STUDY = """
import chaospy
import numpy as np
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

import uqmbd

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
rod = mechanism.body("rod", mass=1.2 * length, inertia=1.2 * length**3 / 12, position=(length / 2, 0))
mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
mechanism.output("angle", rod.angle, units="rad")
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 3, 31), [MonteCarlo(samples=384, seed=5)], integrator="ida")
"""

ROOT = Path(uqmbd.__file__).parents[1]
ENVIRONMENT = dict(
    os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), str(ROOT / "plugins"), os.environ.get("PYTHONPATH", "")])
)


def dask(*arguments: str) -> subprocess.Popen[bytes]:
    code = "import sys; from dask.__main__ import main; sys.argv[0] = 'dask'; main()"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-c", code, *arguments], env=ENVIRONMENT, **quiet)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Address and process of a scheduler with one worker."""
    about = tmp_path / "scheduler.json"
    scheduler = dask(
        "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(about)
    )
    worker = dask("worker", "--scheduler-file", str(about), "--nthreads", "1", "--no-nanny", "--no-dashboard")
    try:
        deadline = time.monotonic() + 60
        while not (about.exists() and about.read_text().endswith("}")) and time.monotonic() < deadline:
            time.sleep(0.1)
        yield json.loads(about.read_text())["address"], scheduler
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait()


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "pendulum_study.py"
    path.write_text(STUDY)
    return path


def command(script: Path, out: Path, *more: str) -> list[str]:
    code = "import sys; from uqmbd.cli import main; main(sys.argv[1:])"
    return [sys.executable, "-c", code, "run", str(script), "--out", str(out), *more]


def test_scheduler_that_dies_costs_nothing_that_is_finished(
    tmp_path: Path, script: Path, cluster: tuple[str, subprocess.Popen[bytes]]
) -> None:
    address, scheduler = cluster
    out = tmp_path / "out"
    run = subprocess.Popen(
        command(script, out, "--dask", address),
        env=ENVIRONMENT,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    while len(list((out / "unfinished").rglob("*.npz"))) < 2:
        assert run.poll() is None, run.communicate()
        time.sleep(0.02)
    scheduler.kill()
    _, said = run.communicate(timeout=120)
    assert run.returncode == 1
    assert "The executor that does the work has given up" in said and "--resume" in said
    assert "mistake in uqmbd" not in said and "Traceback" not in said
    kept = {p: p.stat().st_mtime_ns for p in (out / "unfinished").rglob("*.npz")}
    assert len(kept) >= 2
    tree = load_study(script).run(folder=out, resume=True)
    assert {p: p.stat().st_mtime_ns for p in (out / "unsaved").rglob("*.npz")}.items() >= {
        out / "unsaved" / p.relative_to(out / "unfinished"): t for p, t in kept.items()
    }.items()
    whole = load_study(script).run()
    bits = [t["monte-carlo/samples"]["response"].values.tobytes() for t in (tree, whole)]
    assert bits[0] == bits[1]


def test_cluster_gives_the_same_bits(
    tmp_path: Path, script: Path, cluster: tuple[str, subprocess.Popen[bytes]]
) -> None:
    out = tmp_path / "out"
    done = subprocess.run(
        command(script, out, "--dask", cluster[0]), env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = load(out / "results.nc")["monte-carlo/samples"]["response"].values
    assert found.tobytes() == load_study(script).run()["monte-carlo/samples"]["response"].values.tobytes()
