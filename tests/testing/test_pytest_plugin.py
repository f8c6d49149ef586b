"""The fixtures of pytest: those of all checks, and nothing of uqmbd is imported where none is used."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import uqmbd.testing
import uqmbd_pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(tmp_path):
    """Run pytest on a test module, with the plugin, in an interpreter of its own."""

    def start(source, *words):
        (tmp_path / "test_it.py").write_text(source)
        path = os.pathsep.join([str(ROOT), str(ROOT / "plugins")])
        return subprocess.run(
            # the entry point is that of the installed package, which may be older; loaded once if both are there
            [sys.executable, "-m", "pytest", "-q", "-p", "uqmbd_pytest", "-p", "no:cacheprovider", *words],
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            # other plugins of pytest import NumPy
            env={**os.environ, "PYTHONPATH": path, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_ADDOPTS": ""},
        )

    return start


def test_there_is_a_fixture_for_each_check():
    assert {f"check_{name.removeprefix('uqmbd_')}" for name in uqmbd_pytest.__all__} == set(uqmbd.testing.__all__)


def test_pytest_knows_it_by_its_entry_point():
    """By the name of the module, so that `-p uqmbd_pytest` loads it once."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"uqmbd_pytest": "uqmbd_pytest"}


UNUSED = """
import sys

def test_nothing_is_imported():
    heavy = ("uqmbd", "numpy", "scipy", "sympy", "xarray")
    assert "uqmbd_pytest" in sys.modules and [name for name in heavy if name in sys.modules] == []
"""


@pytest.mark.thorough
def test_nothing_of_uqmbd_is_imported_before_a_fixture_is_used(run):
    found = run(UNUSED, "-W", "error")
    assert found.returncode == 0 and "1 passed" in found.stdout, found.stdout + found.stderr


USED = """
class Nothing:
    pass

def test_component(uqmbd_component):
    uqmbd_component(Nothing)

def test_propagator(uqmbd_propagator):
    uqmbd_propagator(Nothing())

def test_integrator(uqmbd_integrator):
    uqmbd_integrator(Nothing)

def test_design(uqmbd_design):
    uqmbd_design(Nothing)

def test_command(uqmbd_command):
    uqmbd_command(Nothing)
"""


@pytest.mark.thorough
def test_each_fixture_refuses_what_is_none_of_its_kind(run):
    found = run(USED)
    assert "5 failed" in found.stdout, found.stdout + found.stderr
    for kind in ("component", "propagator", "integrator", "design", "command"):
        assert f"test_it.py::test_{kind}" in found.stdout
    assert "fixture" not in found.stdout.partition("short test summary")[2]


RIGHT = """
import uqmbd

class Spring(uqmbd.Component):
    \"\"\"A spring without length.\"\"\"

    stiffness = uqmbd.Parameter("N/m", "spring rate")

    def terms(self, p):
        d = p.body_j.position - p.body_i.position
        yield uqmbd.Potential(p.stiffness * d.dot(d) / 2)

def test_spring(uqmbd_component):
    uqmbd_component(Spring, spaces=(uqmbd.Planar,), propagators=())
"""


@pytest.mark.thorough
def test_a_component_passes_by_its_fixture(run):
    found = run(RIGHT, "-W", "error")
    assert found.returncode == 0, found.stdout + found.stderr
