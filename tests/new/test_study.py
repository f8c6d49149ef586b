"""`uqmbd new study` writes a script that runs and is linted, and nothing else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from uqmbd import results

RULES = ["ANN", "B", "D", "E", "F", "I", "UP", "W"]


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def files(folder=Path()):
    return sorted(str(path) for path in folder.rglob("*") if path.is_file())


def test_it_writes_one_file_and_says_what_comes_next(command):
    run = command("new", "study", "crank")
    assert (run.returncode, run.stderr) == (0, "")
    assert files() == ["crank.py"]
    assert run.stdout.split() == "wrote crank.py Next: uqmbd check crank.py uqmbd run crank.py".split()


def test_a_hint_for_checkers_is_written_where_it_is_asked_for(command):
    command("new", "study", "crank", "--folder", "studies", "--typings")
    assert files() == ["studies/crank.py", "studies/typings/chaospy/__init__.pyi"]


def test_nothing_is_overwritten_unasked(command):
    Path("crank.py").write_text("mine")
    run = command("new", "study", "crank", "--typings")
    assert run.returncode == 2
    assert run.stderr == "Error: crank.py exists already, and nothing was written; use --force to overwrite.\n"
    assert files() == ["crank.py"] and Path("crank.py").read_text() == "mine"
    assert command("new", "study", "crank", "--force").returncode == 0
    assert "uqmbd.Study(" in Path("crank.py").read_text()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("crank.py", "omit the suffix .py; `uqmbd new study crank` writes crank.py"),
        ("studies/crank", "expected a name, not a path; use --folder"),
        ("slider-crank", "letters, digits and underscores, and does not begin with a digit. Try 'slider_crank'"),
        ("2nd", "Try 'study_2nd'"),
        ("a b", "Try 'a_b'"),
        ("...", "Try 'study'"),
        ("lambda", "lambda is a reserved word of Python"),
        ("numpy", "a module numpy exists already"),
        ("uqmbd", "a module uqmbd exists already"),
        ("time", "a module time exists already (part of Python)"),
        ("sys", "part of Python"),
        ("CON", "Windows reserves CON for a device"),
        ("nul", "Windows reserves nul for a device"),
        ("Lpt9", "Windows reserves Lpt9 for a device"),
        ("__init__", "reserves file names of this form"),
        ("__main__", "reserves file names of this form"),
        ("", "the name is empty"),
        ("c" * 41, "the name has 41 characters; the maximum is 40"),
    ],
)
def test_names_that_cannot_be_are_reported(command, name, why):
    run = command("new", "study", name)
    assert run.returncode == 2 and why in run.stderr, run.stderr
    assert files() == []


@pytest.mark.parametrize("name", ["crank", "c" * 40, "größe"])
@pytest.mark.parametrize("length", [[], ["--line-length", "120"]])
def test_it_is_linted_and_formatted_by_rules_of_the_user_and_of_ours(command, name, length):
    command("new", "study", name)
    ruff = [sys.executable, "-m", "ruff"]
    for words in (["check"], ["check", "--select", ",".join(RULES), *length], ["format", "--check", *length]):
        run = subprocess.run([*ruff, *words, "--isolated", f"{name}.py"], capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.thorough
def test_it_runs_and_its_methods_agree(command):
    """The tip swings below where it comes to rest, and the requirement is violated now and then, not always."""
    command("new", "study", "crank")
    assert "clearance" in command("check", "crank.py").stdout
    run = command("run", "crank.py")
    assert (run.returncode, "Warning" in run.stderr) == (0, False), run.stderr
    tree = results.load(Path("results") / "results.nc")
    assert "failed" not in tree.attrs
    for method in ("monte-carlo", "collocation"):
        probability = tree[method]["requirements"]["violation_probability"].values
        assert 0.005 < probability[0] < 0.5
        lowest = tree[method]["scalars/statistics"]["mean"].sel(output="lowest_tip").item()
        assert lowest < tree[method]["statistics"]["mean"].sel(output="tip_height").values[-1] < 0
    assert "agrees with monte-carlo" in run.stdout


@pytest.mark.slow
def test_checkers_of_types_find_nothing_in_it(command):
    """By mypy without settings but one, and by pyright with the hint that is written beside it."""
    assert command("new", "study", "rocker", "--typings").returncode == 0
    for words in (
        ["mypy", "--config-file=", "--ignore-missing-imports", "--strict", "rocker.py"],
        ["pyright", "--pythonpath", sys.executable, "rocker.py"],
    ):
        run = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout + run.stderr
