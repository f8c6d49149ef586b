"""Every command that writes into a folder leaves what the user has there as it was, or refuses before it computes."""

from __future__ import annotations

import dataclasses
import random
import re
import time
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import typer
import xarray as xr

import uqmbd
from tests.propagation.execution.test_users_files import STUDY, attempt, build, fill, make, seen
from uqmbd import plugins
from uqmbd.cli.app import app
from uqmbd.cli.compare.compare import show_comparison
from uqmbd.cli.export import export_study
from uqmbd.cli.report import rewrite_report
from uqmbd.cli.run.run import run_study
from uqmbd.errors import StudyError
from uqmbd.new import new_plugin, new_study
from uqmbd.propagation import writable
from uqmbd.results import load, save
from uqmbd.viewer import FileViewer
from uqmbd.viewer.server import PageServer
from uqmbd_calibration import Calibration
from uqmbd_calibration.command import Calibrate, running

RECORD = "time [s],x [m]\n0.5,0.52\n1,1.04\n"
NAMES = [
    "calibration.nc",
    "comparison.nc",
    "results.nc",
    "report.html",
    "figures",
    "previous",
    "harbour.py",
    ".uqmbd-lock",
]


def _calibrate(place: Path, out: Path) -> None:
    (place / "record.csv").write_text(RECORD)
    running.run(place / "s.py", [place / "record.csv"], out, running.Options(noise=("x=0.02",)))


def _compare(place: Path, out: Path) -> None:
    if not (place / "a.nc").exists():
        for name in "ab":
            save(build().run(), place / f"{name}.nc")
    show_comparison([place / "a.nc", place / "b.nc"], out=out)


def _report(place: Path, out: Path) -> None:
    if (out / "results.nc").is_file():
        rewrite_report(out, figures=True)


INTO_A_FOLDER = {
    "run": lambda place, out: run_study(place / "s.py", out=out, figures=True),
    "compare": _compare,
    "calibrate": _calibrate,
    "report": _report,
    "new study": lambda place, out: new_study("harbour", out),
    "new plugin": lambda place, out: new_plugin("friction", kind="component", folder=out),
}
ONE_FILE = {"animate", "check", "export"}
"""Commands that write one file, whose name is given: it is replaced, as by other programs."""
NOTHING = {"plugins", "view"}


def _commands() -> dict[str, set[str]]:
    """Return all commands and their options; those of plugins are found without an installation."""
    found = {}
    for command in (typer.main.get_command(app), plugins.command_line(Calibrate)):
        for name, one in getattr(command, "commands", {command.name: command}).items():
            for under, each in getattr(one, "commands", {"": one}).items():
                found[f"{name} {under}".strip()] = {word for option in each.params for word in option.opts}
    return found


def test_all_commands_are_tried() -> None:
    found = _commands()
    assert {name for name in found if "--out" in found[name]} >= {"run", "animate", "compare", "calibrate"}
    assert set(found) == {*INTO_A_FOLDER, *ONE_FILE, *NOTHING}
    assert not any(word in ("--out", "--figure") for name in NOTHING for word in found[name])


@dataclasses.dataclass(frozen=True)
class Outline:
    """Exporter of the names of the bodies."""

    name = "outline"
    suffix = ".outline"
    exports = ("mechanism",)

    def refusal(self, what: str, study: Any) -> str:
        return ""

    def export(self, source: Any, path: Path, study: Any) -> str:
        path.write_text(",".join(source.bodies))
        return str(path)


@pytest.mark.parametrize("seed", range(4))
def test_an_export_replaces_its_file_and_no_other(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "exporters", lambda: {"outline": Outline})
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    for folder in (out, elsewhere):
        folder.mkdir()
    (tmp_path / "s.py").write_text(STUDY)
    (elsewhere / "victim.txt").write_text("precious")
    fill(out, random.Random(seed), elsewhere)
    (out / "taken.outline").mkdir()
    (out / "taken.outline" / "notes.txt").write_text("the user's")
    before = seen(out, elsewhere)
    export = partial(export_study, tmp_path / "s.py", what=None, method=None, results=None, words=())
    (out / "a.outline").write_text("an earlier export")
    export(to=out / "a.outline")
    assert (out / "a.outline").read_text() == "b"
    with pytest.raises(StudyError, match="taken.outline cannot be written: Is a directory"):
        export(to=out / "taken.outline")
    (out / "a.outline").unlink()
    assert seen(out, elsewhere) == before


@pytest.mark.thorough
def test_viewing_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    script = tmp_path / "s.py"
    script.write_text(STUDY)
    fill(tmp_path, random.Random(1), tmp_path)
    before, sent = seen(tmp_path), []
    monkeypatch.setattr(PageServer, "send", lambda server, answer: sent.append(answer["kind"]))
    viewer = FileViewer(script, 20.0)
    try:
        for _ in range(1200):
            if {"scene", "findings"} <= set(sent):
                break
            time.sleep(0.05)
        else:
            pytest.fail(f"the study was not drawn and checked: {sent}")
    finally:
        viewer.close()
    assert seen(tmp_path) == before


def _tried(command: str, seed: int, tmp_path: Path) -> tuple[int, int]:
    """Run a command three times in a folder that the user fills; return how often it did, and did not, go through."""
    dice = random.Random(seed)
    place, out, elsewhere = (tmp_path / f"{name}{seed}" for name in ("place", "out", "elsewhere"))
    for folder in (place, out, elsewhere):
        folder.mkdir()
    (place / "s.py").write_text(STUDY)
    (elsewhere / "victim.txt").write_text("precious")
    if command == "report":
        save(build().run(), out / "results.nc")
    fill(out, dice, elsewhere)
    for name in dice.sample(NAMES, dice.randint(0, 2)):
        make(out / name, dice, elsewhere, 0)
    before, counts = seen(out, elsewhere), [0, 0]
    for _ in range(3):
        try:
            done = attempt(partial(INTO_A_FOLDER[command], place, out), before, out, elsewhere)
        except AssertionError as error:  # messages of these commands say the same in other words
            assert re.search("there already|not a folder|cannot be (read|written|opened)|is a folder", str(error)), (
                error
            )
            assert {name: seen(out, elsewhere).get(name) for name in before} == before
            done = False
        counts[not done] += 1
    return counts[0], counts[1]


@pytest.mark.slow
@pytest.mark.parametrize("command", INTO_A_FOLDER)
@pytest.mark.parametrize(("first", "count"), [(0, 2), pytest.param(100, 40, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_command_leaves_the_users_files(command: str, first: int, count: int, tmp_path: Path) -> None:
    done = refused = 0
    for seed in range(first, first + count):
        went, not_ = _tried(command, seed, tmp_path)
        done, refused = done + went, refused + not_
    print(f"{command}: {done} went through, {refused} were refused")
    assert done + refused == 3 * count and (count < 10 or min(done, refused) > 3)


@pytest.mark.thorough
def test_a_calibration_is_replaced_by_the_next_and_not_by_what_the_user_changed(tmp_path: Path) -> None:
    (tmp_path / "s.py").write_text(STUDY)
    out = tmp_path / "out"
    for _ in range(2):
        _calibrate(tmp_path, out)
    names = {"calibration.nc", "results.nc", "report.html", "figures", "previous", ".uqmbd-manifest.json"}
    assert {one.name for one in out.iterdir()} == names
    assert {one.name for one in (out / "previous").iterdir()} == names - {"previous"}
    (out / "report.html").write_text("notes of the user")
    before = seen(out)
    with pytest.raises(StudyError, match="report.html exists, but uqmbd"):
        _calibrate(tmp_path, out)
    assert seen(out) == before
    (out / "report.html").rename(out / "notes.txt")
    made = Calibration.load(out / "calibration.nc")
    made.tree.attrs["remark"] = "changed by the user"
    (out / "calibration.nc").unlink()
    Calibration(made.tree).save(tmp_path / "other" / "calibration.nc").rename(out / "calibration.nc")
    _calibrate(tmp_path, out)
    kept = load(out / "previous-1" / "calibration.nc")
    assert kept.attrs["remark"] == "changed by the user" and (out / "notes.txt").read_text() == "notes of the user"


@pytest.mark.parametrize(
    "names", ["a.nc", ["a.txt"], ["../a.nc"], [".nc"], [".a.nc"], ["a/b.nc"], ["a\\b.nc"], [3], [""]]
)
def test_names_that_are_none_of_results_are_refused(names: object, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="output_folder: names"), uqmbd.extend.output_folder(tmp_path / "out", names):
        pass


@pytest.mark.parametrize("names", [None, 3, b"a.nc", iter(["a.nc"]), {"a.nc": 1, 2: 3}, [None]])
def test_what_is_no_list_of_names_is_refused_before_a_folder_is_made(names: object, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="output_folder: names"), uqmbd.extend.output_folder(tmp_path / "out", names):
        pass
    assert not (tmp_path / "out").exists()


def test_a_folder_on_whose_way_nothing_may_be_searched_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a user who is not root meets it."""

    def denied(path: object, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("os.stat", denied)
    monkeypatch.setattr("os.mkdir", denied)
    with pytest.raises(StudyError, match=r"uqmbd cannot write to this folder \(Permission denied\)"):
        writable(tmp_path / "locked" / "out")


@pytest.mark.parametrize("folder", [None, 3, "a\0b", "file", "file/below", "x" * 300, "x" * 300 + "/y", b"out"])
def test_a_folder_that_there_cannot_be_is_refused(
    folder: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("the user's")
    with pytest.raises(StudyError), uqmbd.extend.output_folder(folder, ["a.nc"]):
        pass
    assert Path("file").read_text() == "the user's"


def test_a_second_command_keeps_what_the_first_one_wrote(tmp_path, capsys):
    for k in range(3):
        with uqmbd.extend.output_folder(tmp_path, ["fit.nc"]) as folder:
            save(xr.DataTree(xr.Dataset(attrs={"study": f"crank {k}"})), folder / "fit.nc")
    assert load(tmp_path / "fit.nc").attrs["study"] == "crank 2"
    assert load(tmp_path / "previous" / "fit.nc").attrs["study"] == "crank 1"
    assert "were moved to" in capsys.readouterr().err


def test_a_command_that_ends_early_takes_no_file_of_others_for_its_own(tmp_path):
    with pytest.raises(ZeroDivisionError), uqmbd.extend.output_folder(tmp_path, ["fit.nc"]) as folder:
        (folder / "fit.nc").write_bytes(b"data of the user")
        raise ZeroDivisionError
    with pytest.raises(StudyError, match=r"fit.nc exists, but uqmbd"), uqmbd.extend.output_folder(tmp_path, ["fit.nc"]):
        pass
    assert (tmp_path / "fit.nc").read_bytes() == b"data of the user"
