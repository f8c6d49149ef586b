"""What a user has in the folder of a run is there afterwards, as it was; else the run is refused before it computes."""

from __future__ import annotations

import json
import os
import random
import stat
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.cli.compare.compare import show_comparison
from uqmbd.cli.report import rewrite_report
from uqmbd.cli.run.run import run_study
from uqmbd.errors import StudyError
from uqmbd.propagation.execution.run_folder import claimed, set_aside
from uqmbd.results import load, save
from uqmbd.results.storage import in_manifest, is_ours, record
from uqmbd_montecarlo import MonteCarlo

STUDY = """
import chaospy
import numpy as np
import uqmbd
from uqmbd_montecarlo import MonteCarlo
v = uqmbd.RandomVariable("v", chaospy.Normal(1, 0.1))
m = uqmbd.Mechanism("m", uqmbd.Line())
b = m.body("b", mass=1, velocity=v)
m.output("x", b.position[0], units="m")
study = uqmbd.Study("s", m, np.linspace(0, 1, 3), [MonteCarlo(samples=40, seed=1, keep=10)])
"""

NAMES = [
    "results.nc", "report.html", "motion.nc", "pose_surrogate.nc", "figures", "previous", "previous-1", "previous-2",
    ".previous", "unfinished", "unsaved", "measured-samples.nc", "monte-carlo-samples.nc", "monte-carlo-samples.zarr",
    "other-samples.zarr", ".uqmbd-lock", ".uqmbd-probe", ".uqmbd-manifest.json", ".uqmbd-abcdefgh.part",
    ".uqmbd-mine.part", ".uqmbd", "asked.json", "budget.json", "notes.txt", "data.zarr",
]  # fmt: skip
INNER = [
    "chapter.txt", "figures", "results.nc", "asked.json", "results", "new", "old", "uqmbd", ".zattrs", ".zgroup", "0",
    "response", "0123456789abcdef", "a.svg", ".uqmbd", ".uqmbd-manifest.json", "chunk.npz",
]  # fmt: skip


def build() -> uqmbd.Study:
    v = uqmbd.RandomVariable("v", chaospy.Normal(1, 0.1))
    m = uqmbd.Mechanism("m", uqmbd.Line())
    b = m.body("b", mass=1, velocity=v)
    m.output("x", b.position[0], units="m")
    return uqmbd.Study("s", m, np.linspace(0, 1, 3), [MonteCarlo(samples=40, seed=1, keep=10)])


Known = dict[str, tuple[Any, ...]]


def fill(folder: Path, dice: random.Random, elsewhere: Path, *, many: int = 4) -> None:
    """Make files, folders, links and a pipe under names that uqmbd uses, and others."""
    for name in dice.sample(NAMES, dice.randint(1, many)):
        make(folder / name, dice, elsewhere, 0)


def make(place: Path, dice: random.Random, elsewhere: Path, depth: int) -> None:
    if os.path.lexists(place):
        return
    kind = dice.choice(
        ["file", "file", "empty", "folder", "folder", "nothing", "link", "linked folder", "gone", "pipe"]
    )
    if kind == "file":
        place.write_bytes(dice.choice([b"text\n", b"\x89HDF\r\n\x1a\n", b"{}", dice.randbytes(dice.randint(1, 99))]))
        place.chmod(dice.choice([0o644, 0o600, 0o444, 0o755]))
    elif kind == "empty":
        place.touch()
    elif kind == "folder":
        place.mkdir()
        if depth < 3:
            for name in dice.sample(INNER, dice.randint(1, 3)):
                make(place / name, dice, elsewhere, depth + 1)
    elif kind == "nothing":
        place.mkdir()
    elif kind == "link":
        place.symlink_to(elsewhere / "victim.txt")
    elif kind == "linked folder":
        place.symlink_to(elsewhere)
    elif kind == "gone":
        place.symlink_to(elsewhere / "nowhere")
    else:
        os.mkfifo(place)


def seen(*folders: Path) -> Known:
    """What is in folders: types, modes, contents, and where links lead."""
    found: Known = {}
    for folder in folders:
        for at, inner, files in os.walk(folder):
            for name in (*inner, *files):
                path = Path(at, name)
                about = path.lstat()
                if stat.S_ISLNK(about.st_mode):
                    found[str(path)] = ("link", os.readlink(path))
                elif stat.S_ISREG(about.st_mode):
                    found[str(path)] = (stat.S_IMODE(about.st_mode), path.read_bytes())
                else:
                    found[str(path)] = (about.st_mode,)
    return found


class Interrupted(BaseException):
    """As ctrl-c."""


def attempt(action: Callable[[], object], before: Known, *folders: Path) -> bool:
    """Do something; what was there before is there as it was; return whether it was not refused."""
    done = True
    try:
        action()
    except Interrupted:
        pass
    except StudyError as error:
        assert "but uqmbd did not write" in str(error), error
        done = False
    now = seen(*folders)
    assert {name: now.get(name) for name in before} == before
    return done


def torture(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """Fill a folder, then run, interrupt, resume, run again and report in it; return runs that went through, and not."""
    dice = random.Random(seed)
    out, elsewhere = tmp_path / f"out{seed}", tmp_path / f"elsewhere{seed}"
    out.mkdir()
    elsewhere.mkdir()
    (elsewhere / "victim.txt").write_text("precious")
    places, script = (out, elsewhere), tmp_path / "s.py"
    script.write_text(STUDY)
    counts, resume = [0, 0], False
    if dice.random() < 0.3:
        run_study(script, out=out, report=False)
    fill(out, dice, elsewhere)
    # only what the user made counts; what an earlier run wrote uqmbd may move
    own = seen(*places)
    before = {name: about for name, about in own.items() if not written_by_us(out, Path(name))}
    for _ in range(dice.randint(2, 4)):
        what = dice.choice(["run", "run", "resume", "interrupt", "python", "report"])
        if what == "interrupt":
            with monkeypatch.context() as patch:
                patch.setattr("uqmbd.results.save", interrupt)
                done = attempt(lambda: run_study(script, out=out, report=False), before, *places)
        elif what == "python":
            done = attempt(partial(build().run, folder=out, resume=resume), before, *places)
        elif what == "report":
            if not (out / "results.nc").is_file() or not is_ours(out, "results.nc"):
                continue
            done = attempt(lambda: rewrite_report(out), before, *places)
        else:
            done = attempt(partial(run_study, script, out=out, report=False, resume=what == "resume"), before, *places)
        counts[not done] += 1
        resume = dice.random() < 0.5
        if dice.random() < 0.3:
            known = seen(*places)
            fill(out, dice, elsewhere, many=2)
            before |= {name: about for name, about in seen(*places).items() if name not in known}
    return counts[0], counts[1]


def written_by_us(out: Path, path: Path) -> bool:
    if not path.is_relative_to(out):
        return False
    name = path.relative_to(out).parts[0]
    return name == ".uqmbd-manifest.json" and not path.is_symlink() and bool(in_manifest(out)) or is_ours(out, name)


def interrupt(*_: object, **__: object) -> None:
    raise Interrupted


@pytest.fixture
def quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports of the first screen alone: their sections do not matter here."""
    monkeypatch.setattr("uqmbd.report.html.ABOUT_RESULTS", ())
    monkeypatch.setattr("uqmbd.report.html.ABOUT_METHODS", ())


@pytest.mark.thorough
@pytest.mark.parametrize(("first", "count"), [(0, 12), pytest.param(1000, 400, marks=pytest.mark.slow)])
def test_the_users_files_are_there_as_they_were(
    first: int, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, quiet: None
) -> None:
    done = refused = 0
    for seed in range(first, first + count):
        went, not_ = torture(seed, tmp_path, monkeypatch)
        done, refused = done + went, refused + not_
    print(f"{done} went through, {refused} were refused")
    assert done > count / 3 and refused > count / 6, (done, refused)


@pytest.mark.parametrize("name", ["results.nc", "unfinished", "unsaved", "monte-carlo-samples.zarr", ".uqmbd-lock"])
def test_nothing_is_computed_where_a_name_is_taken(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "s.py").write_text(STUDY)
    out = tmp_path / "out"
    out.mkdir()
    (out / name).write_text("the user's")
    monkeypatch.setattr("uqmbd.propagation.studies.study.run_methods", None)
    before = seen(out)
    with pytest.raises(StudyError, match=rf"{name} exists, but uqmbd did not write.*(Move|Remove).*--out DIR"):
        run_study(tmp_path / "s.py", out=out, report=False)
    assert seen(out) == before
    if name != "results.nc":  # Python writes none
        with pytest.raises(StudyError, match=f"{name} exists, but uqmbd"):
            build().run(folder=out)
        assert seen(out) == before


def test_results_without_a_manifest_are_kept_for_good(tmp_path: Path) -> None:
    tree = xr.DataTree(xr.Dataset({"x": ("sample", [1.0, 2.0])}, attrs={"study": "earlier"}))
    other = tmp_path / "other"
    for number in (1, 2):
        os.replace(save(tree, other / "results.nc"), tmp_path / "results.nc")
        with claimed(tmp_path):
            assert set_aside(tmp_path) == tmp_path / f"previous-{number}"
    save(tree, tmp_path / "results.nc")
    record(tmp_path, ["results.nc"])
    with claimed(tmp_path):
        assert set_aside(tmp_path) == tmp_path / "previous"
    for name in ("previous", "previous-1", "previous-2"):
        assert load(tmp_path / name / "results.nc").identical(tree)


def test_a_changed_result_is_the_users(tmp_path: Path) -> None:
    record(tmp_path, [])
    save(xr.DataTree(xr.Dataset(attrs={"a": "first"})), tmp_path / "results.nc")
    other = tmp_path / "other"
    other.mkdir()
    changed = xr.DataTree(xr.Dataset(attrs={"a": "by hand"}))
    os.replace(save(changed, other / "results.nc"), tmp_path / "results.nc")
    with claimed(tmp_path):
        assert set_aside(tmp_path) == tmp_path / "previous-1"
    assert load(tmp_path / "previous-1" / "results.nc").identical(changed)


@pytest.mark.parametrize(
    "name",
    ["../victim.txt", "/{there}/victim.txt", "figures/../../victim.txt", "notes.txt", "figures/..", "..", ".", ""],
)
def test_a_manifest_never_leads_elsewhere(name: str, tmp_path: Path) -> None:
    import hashlib

    victim, out = tmp_path / "victim.txt", tmp_path / "out"
    victim.write_text("precious")
    (out / "figures").mkdir(parents=True)
    (out / "notes.txt").write_text("precious")
    digest = hashlib.sha256(b"precious").hexdigest()
    save(xr.DataTree(xr.Dataset(attrs={"a": "b"})), out / "results.nc")
    record(out, ["results.nc"])
    manifest = out / ".uqmbd-manifest.json"
    for place in (out, out / "previous"):
        place.mkdir(exist_ok=True)
        found = json.loads(manifest.read_text())
        found["written"][name.format(there=str(tmp_path)[1:])] = digest
        (place / manifest.name).write_text(json.dumps(found))
    with claimed(out):
        set_aside(out)
    assert victim.read_text() == "precious" and (out / "notes.txt").read_text() == "precious"


def test_a_manifest_does_not_follow_links(tmp_path: Path) -> None:
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    elsewhere.mkdir()
    out.mkdir()
    (elsewhere / "a.svg").write_text("precious")
    save(xr.DataTree(xr.Dataset(attrs={"a": "b"})), out / "results.nc")
    (out / "figures").mkdir()
    (out / "figures" / "a.svg").write_text("precious")
    record(out, ["results.nc", "figures/a.svg"])
    (out / "figures" / "a.svg").unlink()
    (out / "figures").rmdir()
    (out / "figures").symlink_to(elsewhere)
    assert not is_ours(out, "figures/a.svg")
    with claimed(out):
        set_aside(out)
    assert (elsewhere / "a.svg").read_text() == "precious" and (out / "figures").is_symlink()


@pytest.mark.parametrize("text", ["", "[]", "{}", "\x00", "[" * 100_000, '{"form": "uqmbd manifest 1", "written": []}'])
def test_a_damaged_manifest_is_not_used(text: str, tmp_path: Path) -> None:
    (tmp_path / ".uqmbd-manifest.json").write_text(text)
    with claimed(tmp_path), pytest.raises(StudyError, match="manifest.json exists, but uqmbd"):
        set_aside(tmp_path)
    assert (tmp_path / ".uqmbd-manifest.json").read_text() == text


def test_a_folder_of_an_earlier_version_is_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither manifest nor marks: what is unfinished is used, to the bit, and removed at the end."""
    expected = build().run()
    monkeypatch.setattr("uqmbd.propagation.studies.study.joined", interrupt)
    with pytest.raises(Interrupted):
        build().run(folder=tmp_path)
    monkeypatch.undo()
    (tmp_path / ".uqmbd-manifest.json").unlink()
    (tmp_path / "unfinished" / ".uqmbd").unlink()
    found = build().run(folder=tmp_path, resume=True)
    for name in ("mean", "std"):
        one, other = (np.asarray(tree[f"monte-carlo/statistics/{name}"]) for tree in (found, expected))
        assert one.tobytes() == other.tobytes()
    save(found, tmp_path / "results.nc")
    assert not (tmp_path / "unfinished").exists() and not (tmp_path / "unsaved").exists()


@pytest.mark.thorough
def test_a_comparison_leaves_the_users_files(tmp_path: Path, quiet: None) -> None:
    (one, other), out = (save(build().run(), tmp_path / f"{name}.nc") for name in "ab"), tmp_path / "out"
    out.mkdir()
    for name in ("comparison.nc", "report.html"):
        (out / name).write_text("the user's")
        with pytest.raises(StudyError, match=f"{name} exists, but uqmbd"):
            show_comparison([one, other], out=out)
        assert [(p.name, p.read_text()) for p in out.iterdir()] == [(name, "the user's")]
        (out / name).unlink()
    written = [".uqmbd-manifest.json", "comparison.nc", "report.html"]
    show_comparison([one, other], out=out)
    assert sorted(p.name for p in out.iterdir()) == written
    earlier = {name: (out / name).read_bytes() for name in written[1:]}
    show_comparison([one, other], out=out)
    assert {name: (out / "previous" / name).read_bytes() for name in written[1:]} == earlier
    show_comparison([one, other], out=out)  # in the place of the one before
    assert sorted(p.name for p in out.iterdir()) == sorted([*written, "previous"])
