"""The folder of a run: one run at a time, earlier results set aside, nothing lost on a full disk, no orphans."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from uqmbd.cli.run.run import run_study
from uqmbd.errors import StudyError
from uqmbd.propagation.execution.run_folder import claimed, set_aside
from uqmbd.results import load
from uqmbd.results.storage import record

STUDY = """
import chaospy
import numpy as np
from uqmbd_joints import Distance
from uqmbd_montecarlo import MonteCarlo

import uqmbd

mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(0.2, 0))
mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=length))
mechanism.output("x", bob.position[0], units="m")
times = np.linspace(0, {end}, {times})
study = uqmbd.Study("swing", mechanism, times, [MonteCarlo(samples={samples}, seed=3)], integrator="{integrator}")
"""

HOLDER = """
import sys, time
from pathlib import Path
from uqmbd.propagation.execution.run_folder import claimed
with claimed(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


def script(
    folder: Path, samples: int = 64, times: int = 3, end: float = 0.1, integrator: str = "auto", name: str = "swing"
) -> Path:
    path = folder / f"{name}_study.py"
    path.write_text(STUDY.format(samples=samples, times=times, end=end, integrator=integrator))
    return path


def uqmbd_run(*arguments: object, limit: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own, without a report, perhaps with a limit on the size of its files."""
    code = "import sys, uqmbd.cli.run.run; uqmbd.cli.run.run.write = lambda tree, path, **_: path; from uqmbd.cli import main; main(sys.argv[1:])"
    if limit is not None:
        code = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit})); " + code
    command = [sys.executable, "-c", code, "run", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def holder(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that runs in the folder `out`."""
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "out")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


@pytest.mark.thorough
def test_second_run_into_a_folder_is_refused_until_the_first_ends_however(
    tmp_path: Path, holder: subprocess.Popen[str]
) -> None:
    out = tmp_path / "out"
    (out / "results.nc").write_text("of the first")
    for _ in range(2):
        with pytest.raises(StudyError, match=rf"out: another run .*process {holder.pid} on .*--out DIR"):
            run_study(script(tmp_path), out=out)
    assert (out / "results.nc").read_text() == "of the first"
    assert not (out / "previous").exists()
    os.kill(holder.pid, signal.SIGKILL)
    holder.wait()
    with claimed(out):
        pass
    assert sorted(p.name for p in out.iterdir()) == ["results.nc"], "the claim leaves nothing"


@pytest.mark.thorough
def test_study_in_python_is_refused_as_well(tmp_path: Path, holder: subprocess.Popen[str]) -> None:
    from uqmbd.propagation.studies.script import load_study

    stale = tmp_path / "out" / "unfinished" / "method" / "chunk.npz"
    stale.parent.mkdir(parents=True)
    stale.write_bytes(b"of the first")
    with pytest.raises(StudyError, match=f"process {holder.pid}"):
        load_study(script(tmp_path)).run(folder=tmp_path / "out")
    assert stale.exists()


def test_of_many_that_want_a_folder_at_once_one_gets_it(tmp_path: Path) -> None:
    inside, most, refused = [0], [0], [0]

    def work() -> None:
        for _ in range(50):
            try:
                with claimed(tmp_path), claimed(tmp_path):
                    inside[0] += 1
                    most[0] = max(most[0], inside[0])
                    time.sleep(0)
                    inside[0] -= 1
            except StudyError:
                refused[0] += 1

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1]
    assert refused[0] < 400
    assert not list(tmp_path.iterdir())


def test_results_that_are_there_are_set_aside(tmp_path: Path) -> None:
    """Nothing asks, and nothing is mixed: the last results but one are in `previous`, and no earlier ones."""
    out, mine = tmp_path / "out", ["results.nc", "report.html", "motion.nc"]
    (out / "figures").mkdir(parents=True)
    (out / "notes.txt").write_text("the user's own")
    (out / "monte-carlo-samples.nc").write_text("the user's own")
    for version in "123":
        names = [*mine, "figures/a.svg", *(["figures/old.svg"] if version == "1" else [])]
        (out / "figures").mkdir(exist_ok=True)
        for name in names:
            (out / name).write_text(version)
        record(out, names)
        with claimed(out):
            assert set_aside(out) == out / "previous"
        found = {str(p.relative_to(out)): p.read_text() for p in out.rglob("*") if p.is_file() and p.name[0] != "."}
        users = dict.fromkeys(["notes.txt", "monte-carlo-samples.nc"], "the user's own")
        assert found == {**users, **{f"previous/{name}": version for name in names}}
    with claimed(out):
        assert set_aside(out) is None, "there are none"
    assert (out / "previous" / "results.nc").read_text() == "3"


@pytest.mark.thorough
def test_command_sets_results_aside_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], no_report: None
) -> None:
    out = tmp_path / "out"
    run_study(script(tmp_path), out=out)
    first = (out / "results.nc").read_bytes()
    assert "previous" not in capsys.readouterr().err
    run_study(script(tmp_path, samples=70), out=out)
    assert f"moved to {out / 'previous'}." in capsys.readouterr().err
    assert (out / "previous" / "results.nc").read_bytes() == first
    assert load(out / "results.nc")["monte-carlo"].attrs["realisations"] == 70
    assert {p.name for p in out.iterdir()} == {p.name for p in (out / "previous").iterdir()} | {"previous"}


@pytest.mark.thorough
def test_full_disk_at_the_end_loses_nothing(tmp_path: Path, no_report: None) -> None:
    """Chunks fit, the results do not: the file, the way out, and then all is there without being computed again."""
    pytest.importorskip("resource")
    study, out = script(tmp_path, samples=640, times=101), tmp_path / "out"
    failed = uqmbd_run(study, "--out", out, limit=200_000)
    assert failed.returncode == 2
    assert "results.nc" in failed.stderr and "File too large" in failed.stderr and "--resume" in failed.stderr
    assert "Traceback" not in failed.stderr
    kept = {p: p.stat().st_mtime_ns for p in (out / "unfinished").rglob("*.npz")}
    assert len(kept) >= 10
    assert sorted(p.name for p in out.iterdir()) == [".uqmbd-manifest.json", "unfinished"]
    run_study(study, out=out, resume=True)
    assert load(out / "results.nc")["monte-carlo"].attrs["realisations"] == 640
    assert not (out / "unfinished").exists() and not (out / "unsaved").exists()


@pytest.mark.thorough
def test_full_disk_on_the_way_is_reported(tmp_path: Path) -> None:
    pytest.importorskip("resource")
    out = tmp_path / "out"
    failed = uqmbd_run(script(tmp_path, samples=200, times=101), "--out", out, limit=20_000)
    assert failed.returncode in (1, 2)
    assert ".npz cannot be written: File too large" in failed.stderr and "--resume" in failed.stderr
    assert "Traceback" not in failed.stderr
    found = sorted(p.name for p in out.rglob("*") if p.is_file())
    assert found == [".uqmbd", ".uqmbd-manifest.json", "asked.json"], "nothing half written"


def alive(session: int) -> list[int]:
    """Processes of a session that run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, owner = stat.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(owner) == session and state != "Z":
            found.append(int(stat.parent.name))
    return found


@pytest.mark.thorough
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="tells processes by /proc")
def test_workers_end_with_their_parent_when_it_is_killed(tmp_path: Path) -> None:
    study, out = script(tmp_path, samples=64_000, times=51, end=5.0, integrator="ida"), tmp_path / "out"
    code = "import sys; from uqmbd.cli import main; main(sys.argv[1:])"
    command = [sys.executable, "-c", code, "run", str(study), "--out", str(out), "--workers", "2"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        # folders come and go: os.walk leaves out what has just gone, Path.rglob raises
        while not any(
            name[0] != "." for at, _, names in os.walk(out / "unfinished") if at.endswith("response") for name in names
        ):
            assert process.poll() is None
            time.sleep(0.02)
        assert len(alive(process.pid)) >= 3
        process.kill()
        process.wait()
        deadline = time.monotonic() + 60
        while alive(process.pid) and time.monotonic() < deadline:
            time.sleep(0.02)
        assert alive(process.pid) == []
    finally:
        for orphan in alive(process.pid):
            os.kill(orphan, signal.SIGKILL)
