"""A run that is killed goes on where it was, and ends with the same bits as one that was not."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from uqmbd.errors import StudyWarning
from uqmbd.propagation import load_study
from uqmbd.results import load, save

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
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 1, 51), [MonteCarlo(samples=960, seed=5)])
"""


RUNNER = """
import os
import signal
import sys
from pathlib import Path

from uqmbd.propagation.studies.script import load_study
from uqmbd.results import save


class Killed:
    # kills the run when so many chunks are stored, and never at 0
    def __init__(self, chunks):
        self.left = chunks

    def start(self, label, total):
        pass

    def advance(self, label, count=1):
        self.left -= 1
        if not self.left:
            os.kill(os.getpid(), signal.SIGKILL)

    def finish(self, label):
        pass


if __name__ == "__main__":
    script, out, resume, workers, chunks = sys.argv[1:]
    study = load_study(Path(script))
    tree = study.run(int(workers), folder=Path(out), resume=resume == "resume", progress=Killed(int(chunks)))
    save(tree, Path(out) / "results.nc")
"""


def _run(script: Path, out: Path, resume: str = "anew", workers: int = 1, chunks: int = 0) -> int:
    """Run without a report, which takes longer than the study, until so many chunks are stored; return the code."""
    runner = script.with_name("runner.py")
    runner.write_text(RUNNER)
    out.mkdir(exist_ok=True)
    command = [sys.executable, str(runner), str(script), str(out), resume, str(workers), str(chunks)]
    return subprocess.run(command, capture_output=True).returncode


def _response(out: Path) -> bytes:
    return load(out / "results.nc")["monte-carlo/samples"]["response"].values.tobytes()


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "pendulum_study.py"
    path.write_text(STUDY)
    return path


def _chunks(out: Path) -> int:
    # files come and go while a run writes: os.walk leaves out what has just gone, Path.rglob raises
    return sum(name.endswith(".npz") for _, _, names in os.walk(out / "unfinished") for name in names)


def _interrupted_command(command: list[str], out: Path, chunks: int) -> tuple[int, str]:
    """Run and interrupt when so many chunks are stored; return the code and the text of both streams."""
    # a process group of its own, so that workers die with it
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        # a test run in the background of a shell ignores the signal, and so would its children
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    with process:
        try:
            while process.poll() is None and _chunks(out) < chunks:
                time.sleep(0.005)
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
            said, _ = process.communicate(timeout=60)
            return process.returncode, said
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


class Impatient:
    """Progress that interrupts a run when so many chunks are stored."""

    def __init__(self, chunks: int) -> None:
        self.left = chunks

    def start(self, label: str, total: int) -> None:
        """Nothing to say."""

    def advance(self, label: str, count: int = 1) -> None:
        """Count a chunk."""
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt

    finish = start


def _interrupted(script: Path, out: Path, chunks: int) -> None:
    """Run in this process until so many chunks are stored."""
    with pytest.raises(KeyboardInterrupt):
        load_study(script).run(folder=out, progress=Impatient(chunks))
    assert _chunks(out) >= chunks


def _computed(script: Path, out: Path | None = None, resume: bool = False) -> bytes:
    tree = load_study(script).run(folder=out, resume=resume)
    if out is not None:
        save(tree, out / "results.nc")
    return tree["monte-carlo/samples"]["response"].values.tobytes()


@pytest.mark.thorough
def test_killed_and_resumed_run_has_the_bits_of_an_undisturbed_one(script: Path, tmp_path: Path) -> None:
    out = tmp_path / "killed"
    assert _run(script, out, chunks=3) == -signal.SIGKILL
    assert _chunks(out) >= 3
    assert _computed(script, out, resume=True) == _computed(script)
    assert not (out / "unfinished").exists()


@pytest.mark.slow
def test_run_that_is_killed_again_and_again_has_the_bits_of_an_undisturbed_one(script: Path, tmp_path: Path) -> None:
    out = tmp_path / "killed"
    generator = random.Random(1)
    kills, stored = 0, 0
    while not (out / "results.nc").exists():
        resume = "resume" if kills else "anew"
        if kills < 2:
            kills += _run(script, out, resume, chunks=generator.randint(1, 4)) == -signal.SIGKILL
        else:
            assert _run(script, out, resume, workers=2) == 0
        assert _chunks(out) >= stored or (out / "results.nc").exists(), "a stored chunk was lost"
        stored = _chunks(out)
    assert kills == 2
    assert _response(out) == _computed(script)
    assert not (out / "unfinished").exists()


@pytest.mark.thorough
def test_interrupt_keeps_what_is_done_and_says_how_to_go_on(script: Path, tmp_path: Path) -> None:
    # a motion so long that the signal arrives before the last chunk, on a busy machine too
    script.write_text(STUDY.replace("np.linspace(0, 1, 51)", "np.linspace(0, 400, 51)"))
    out = tmp_path / "interrupted"
    command = [sys.executable, "-m", "uqmbd.cli", "run", str(script), "--out", str(out)]
    code, said = _interrupted_command(command, out, 2)
    assert code == 130
    assert "--resume" in said
    assert "Traceback" not in said
    assert _chunks(out) >= 2


@pytest.mark.thorough
def test_damaged_chunk_is_computed_again(script: Path, tmp_path: Path) -> None:
    out = tmp_path / "damaged"
    _interrupted(script, out, 3)
    for path in (out / "unfinished").rglob("*.npz"):
        path.write_bytes(path.read_bytes()[:-100])
    assert _computed(script, out, resume=True) == _computed(script)


def test_without_resume_a_run_starts_over(script: Path, tmp_path: Path) -> None:
    out = tmp_path / "again"
    stale = out / "unfinished" / "0123456789abcdef" / f"{'0' * 32}.npz"
    stale.parent.mkdir(parents=True)
    (out / "unfinished" / "asked.json").write_text(json.dumps({"study": "0" * 32, "methods": {}}))
    stale.write_bytes(b"left by an earlier run")
    _interrupted(script, out, 2)
    assert not stale.exists()


@pytest.mark.thorough
def test_resume_after_a_change_of_the_study_computes_anew(script: Path, tmp_path: Path) -> None:
    """The change acts late and in an output alone: nothing that is sampled at the start would show it."""
    output = 'mechanism.output("angle", rod.angle, units="rad")'
    late = 'mechanism.output("angle", rod.angle * uqmbd.step(uqmbd.t, 0.5, 1, 0.6, {}), units="rad")'
    text, out = script.read_text(), tmp_path / "changed"
    script.write_text(text.replace(output, late.format(3)))
    _interrupted(script, out, 3)
    script.write_text(text.replace(output, late.format(7)))
    with pytest.warns(StudyWarning, match="belong to another study"):
        found = _computed(script, out, resume=True)
    assert found == _computed(script)
