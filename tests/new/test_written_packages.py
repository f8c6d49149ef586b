"""Packages that `uqmbd new plugin` wrote are installed, found, pass their tests, and are typed: all kinds at once."""

from __future__ import annotations

import json
import re

import pytest

from uqmbd.new import PLUGIN_KINDS

from .conftest import name_of

pytestmark = pytest.mark.thorough


def test_they_are_found_by_their_entry_points(python):
    run = python("-m", "uqmbd", "plugins", "--json")
    found = {info["distribution"]: info for info in json.loads(run.stdout)}
    for name, kind in PLUGIN_KINDS.items():
        if kind.registered:
            info = found[name_of(name)]
            assert (info["status"], info["errors"], info["hooks"]) == ("loaded", [], [kind.registered.hook])
            assert len(info[kind.registry]) == 1
        else:
            assert name_of(name) not in found


def test_their_own_tests_pass(python, written):
    """With the settings of one of them, which are those of all: warnings are errors."""
    tests = [str(written / name_of(kind) / "tests") for kind in PLUGIN_KINDS]
    settings = str(written / name_of("component") / "pyproject.toml")
    run = python("-m", "pytest", "-q", "-c", settings, "--rootdir", str(written), *tests)
    assert run.returncode == 0, run.stdout + run.stderr
    assert int(re.search(r"(\d+) passed", run.stdout)[1]) >= 2 * len(PLUGIN_KINDS)


def test_examples_of_their_readmes_run(python, written, tmp_path):
    """One after the other in one interpreter, which takes a tenth of the time."""
    texts = [(written / name_of(kind) / "README.md").read_text(encoding="utf-8") for kind in PLUGIN_KINDS]
    blocks = [block for text in texts for block in re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)]
    assert len(blocks) == len(PLUGIN_KINDS) - 1  # that of a command is typed in a shell
    code = f"for block in {blocks!r}:\n    exec(block, {{}})\n    print('next')"
    run = python("-W", "error::UserWarning", "-c", code, cwd=tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    said = [text.strip() for text in run.stdout.split("next")[:-1]]
    assert len(said) == len(blocks) and "" not in said and "False" not in said


def test_mypy_finds_nothing_in_them(python, written):
    """By the settings that are written, which are strict."""
    folders = [str(written / name_of(kind) / folder) for kind in PLUGIN_KINDS for folder in ("src", "tests")]
    run = python("-m", "mypy", "--config-file", str(written / name_of("component") / "pyproject.toml"), *folders)
    assert run.returncode == 0, run.stdout + run.stderr
    # three files of each
    assert f"no issues found in {3 * len(PLUGIN_KINDS)} source files" in run.stdout


@pytest.mark.slow
def test_pyright_finds_nothing_in_them(python, written):
    pytest.importorskip("pyright")
    folders = [f"{name_of(kind)}/{folder}" for kind in PLUGIN_KINDS for folder in ("src", "tests")]
    (written / "pyrightconfig.json").write_text(json.dumps({"include": folders}))
    executable = python("-c", "import sys; print(sys.executable)").stdout.strip()
    run = python("-m", "pyright", "--stats", "--pythonpath", executable)
    assert run.returncode == 0, run.stdout + run.stderr
    assert f"Found {3 * len(PLUGIN_KINDS)} source files" in run.stdout
