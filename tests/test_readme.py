"""The blocks of the README and of the page on features run as they stand: in order, each alone, and as plain scripts."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import uqmbd

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TEXT = README + (ROOT / "docs" / "features.md").read_text(encoding="utf-8")
BLOCKS = [
    pytest.param(found[1], id=f"block {number}")
    for number, found in enumerate(re.finditer(r"^```python\n(.*?)^```$", TEXT, re.M | re.S))
]
PENDULUM, RUN = (block.values[0] for block in BLOCKS[:2])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the first script."""
    (tmp_path / "pendulum.py").write_text(PENDULUM, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "pendulum", raising=False)
    yield tmp_path
    sys.modules.pop("pendulum", None)


def execute(source, namespace):
    exec(compile(source, "README.md", "exec"), namespace)
    return namespace


def test_there_are_blocks():
    assert len(BLOCKS) >= 3 and TEXT.count("```python") == len(BLOCKS)


def test_the_first_block_is_the_study_of_its_name():
    """Up to its first line, which is for readers of the file, and how it is formatted."""
    script = (ROOT / "studies" / "pendulum.py").read_text(encoding="utf-8")
    assert PENDULUM.split("\n\n", 1)[1].split() == script[script.index("length =") :].split()


@pytest.mark.thorough
def test_all_blocks_in_order(folder):
    namespace = {"__name__": "__main__"}
    for block in BLOCKS:
        execute(block.values[0], namespace)
    assert float(namespace["once"]["tip_height"].min()) < -0.9
    assert namespace["Circle"].signature() == "(name, body, radius)"


@pytest.mark.thorough
@pytest.mark.parametrize("source", BLOCKS)
def test_block_alone(folder, source):
    """In one process: scripts with workers are run as they stand below."""
    execute(source.replace("workers=2", "workers=1"), {"__name__": "__main__"})


def run_file(path):
    return subprocess.run([sys.executable, path], capture_output=True, text=True, check=False)


@pytest.mark.thorough
def test_block_that_asks_for_two_workers_is_a_script_that_runs_as_written(folder):
    """Beside the study, and without a guard."""
    (folder / "mine.py").write_text(RUN, encoding="utf-8")
    run = run_file("mine.py")
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.slow
def test_study_and_run_in_one_file_are_a_script_that_runs_as_written(folder):
    """The line that imports the study is left out, as the page on features says."""
    source = PENDULUM + RUN.replace("from pendulum import mechanism, study\n", "")
    (folder / "mine.py").write_text(source + 'print("once")\n', encoding="utf-8")
    (folder / "pendulum.py").unlink()
    run = run_file("mine.py")
    assert (run.returncode, run.stdout, run.stderr) == (0, "once\n", "")


def test_public_modules_are_there_and_cost_nothing_before_they_are_used():
    code = """
import sys, uqmbd
print(*[name for name in ("numpy", "sympy", "xarray", "matplotlib") if name in sys.modules])
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.stdout.splitlines() == [""], run.stderr
    assert uqmbd.report.error_cost and uqmbd.results.load and uqmbd.testing.check_component
    assert all(hasattr(uqmbd, name) for name in dir(uqmbd))


@pytest.mark.thorough
def test_a_run_begins_without_what_it_may_not_need():
    """Statistics, splines and optimisation of SciPy, figures and files are loaded when they are used."""
    code = """
import sys, uqmbd.cli.run.run, uqmbd.report
late = "scipy.stats", "scipy.interpolate", "scipy.optimize", "scipy.integrate", "matplotlib", "h5py", "dask", "IPython"
print(*[name for name in late if name in sys.modules])
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.stdout.splitlines() == [""], run.stderr


@pytest.mark.thorough
def test_a_run_with_its_report_needs_no_matplotlib(folder):
    """Charts are drawn in the browser, and drawings of the first screen are written without it; files of figures need it."""
    command = [sys.executable, "-X", "importtime", "-m", "uqmbd"]
    run = subprocess.run([*command, "run", "pendulum.py"], capture_output=True, text=True, check=False, cwd=folder)
    assert run.returncode == 0 and (folder / "results/report.html").exists(), run.stderr
    assert "jinja2" in run.stderr and not re.search(r"\| +matplotlib$", run.stderr, re.MULTILINE)
    again = subprocess.run(
        [*command, "report", "results", "--figures"], capture_output=True, text=True, check=False, cwd=folder
    )
    assert "matplotlib" in again.stderr
    assert any((folder / "results/figures").glob("*time-history-histogram.svg"))
