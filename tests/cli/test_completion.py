"""Shells complete commands, studies and labels of methods, quickly: nothing is run, and no NumPy is imported."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from uqmbd import plugins
from uqmbd.cli import completion

ROOT = Path(__file__).parents[2]

STUDY = """
import sys
sys.exit("it is read, not run")
methods = [MonteCarlo(samples=10), uqmbd_collocation.Collocation(order=2, label="order 2"), Collocation(label=chosen)]
last = Galerkin(order=1)
study = uqmbd.Study("crank", mechanism, [0, 1], [*some, last, MonteCarlo(label="mc")] if 0 else methods)
other = uqmbd.Study("other", mechanism, times, [last, MonteCarlo(label="mc"), make()], rtol=1e-6)
study = uqmbd.Study("crank", mechanism, times=[0, 1], propagators=methods)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A study, a script that is none, one that cannot be read, and a folder with a study."""
    monkeypatch.chdir(tmp_path)
    Path("crank.py").write_text(STUDY)
    Path("create_tables.py").write_text("table = 1\n")
    Path("cruel.py").write_bytes(b"study = \xff(")
    Path("studies").mkdir()
    Path("studies", "crane.py").write_text("study: uqmbd.Study = 1\n")


@pytest.fixture
def complete(tmp_path):
    """Ask as a shell does: the words so far, of which the last is completed."""

    def ask(*words, code="from uqmbd.cli import main; main()"):
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "plugins")]),
            "_UQMBD_COMPLETE": "complete_bash",
            "COMP_WORDS": "\n".join(["uqmbd", *words]),
            "COMP_CWORD": str(len(words)),
        }
        run = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment, cwd=tmp_path
        )
        assert (run.returncode, run.stderr) == (0, "")
        return run.stdout.splitlines()

    return ask


def test_studies_are_those_of_the_folder_that_is_typed():
    assert completion.studies("") == ["crank.py", "cruel.py"]
    assert completion.studies("cra") == ["crank.py"]
    assert completion.studies("./cra") == ["./crank.py"]
    assert completion.studies("studies/") == completion.studies("studies/c") == ["studies/crane.py"]
    assert completion.studies("stu") == completion.studies("nowhere/") == []  # the shell lists folders


class Context:
    """What typer gives: the arguments before."""

    def __init__(self, script, *words):
        self.params, self.args = {"script": script}, list(words)


def test_labels_are_those_that_a_script_states():
    assert completion.labels(Context(Path("crank.py")), "") == ["galerkin", "mc", "make", "monte-carlo", "order 2"]
    assert completion.labels(Context(Path("crank.py")), "mo") == ["monte-carlo"]
    assert completion.labels(Context(None, "crank.py"), "g") == ["galerkin"]
    for script in (None, Path("cruel.py"), Path("create_tables.py"), Path("nowhere.py"), Path("studies")):
        assert completion.labels(Context(script), "") == []


def test_names_of_methods_are_guessed_right():
    """From their classes: this holds for all that are installed."""
    for name, method in plugins.propagators().items():
        Path("plain.py").write_text(f"study = Study('s', m, [0, 1], [{method.__name__}()])\n")
        assert completion.labels(Context(Path("plain.py")), "") == [name]


@pytest.mark.thorough
def test_what_a_shell_receives(complete):
    assert complete("ru") == ["run"]
    assert complete("run", "cra") == ["crank.py"]
    assert complete("run", "crank.py", "--only", "mon") == ["monte-carlo"]
    assert complete("animate", "crank.py", "--method", "ga") == ["galerkin"]
    assert complete("check", "studies/") == ["studies/crane.py"]
    assert complete("new", "plugin", "rope", "--kind", "comp") == ["component"]
    assert complete("run", "crank.py", "--out", "res") == [""]  # the shell lists folders


@pytest.mark.thorough
def test_it_is_quick_because_nothing_heavy_is_imported(complete):
    code = """
import sys
from uqmbd.cli import main
try:
    main()
finally:
    print([name for name in ("numpy", "scipy", "sympy", "xarray", "matplotlib") if name in sys.modules])
"""
    assert complete("run", "crank.py", "--only", "mon", code=code) == ["monte-carlo", "[]"]


SHELLS = {
    "bash": """
{show}
COMP_WORDS=(uqmbd run cra) COMP_CWORD=2
_uqmbd_completion uqmbd cra run
echo "[${{COMPREPLY[*]}}]"
""",
    "fish": """
{show}
echo [(complete --do-complete 'uqmbd run cra')]
""",
    "zsh": """
autoload -Uz compinit; compinit -u -D
_arguments() {{ print -r -- "[$*]" }}
_files() {{ print -r -- "[files]" }}
{show}
words=(uqmbd run cra) CURRENT=3
_uqmbd_completion
""",
}


@pytest.mark.thorough
@pytest.mark.parametrize("shell", SHELLS)
def test_the_scripts_of_shells_work(shell, tmp_path):
    """Where a shell is installed: its script is read, and asks the command."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    program = tmp_path / "bin" / "uqmbd"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m uqmbd "$@"\n')
    program.chmod(0o755)
    environment = {
        **os.environ,
        "PATH": os.pathsep.join([str(program.parent), os.environ["PATH"]]),
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "plugins")]),
        "HOME": str(tmp_path),
    }
    show = subprocess.run(
        ["uqmbd"], capture_output=True, text=True, check=True, env={**environment, "_UQMBD_COMPLETE": f"source_{shell}"}
    ).stdout
    script = tmp_path / "script"
    script.write_text(SHELLS[shell].format(show=show))
    run = subprocess.run([shell, str(script)], capture_output=True, text=True, check=False, env=environment)
    assert "crank.py" in run.stdout and "cruel" not in run.stdout, run.stdout + run.stderr
