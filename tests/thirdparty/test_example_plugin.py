"""A package of somebody else's is discovered by its entry point alone: installed into a folder, and put on the path."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent / "uqmbd-example-plugin"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Install the example package into a folder of its own, with what the test environment has: no index is asked."""
    work = tmp_path_factory.mktemp("thirdparty")
    source = shutil.copytree(PACKAGE, work / "source")  # the build leaves files beside the sources
    target = work / "site"
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    command += ["--disable-pip-version-check", "--target", str(target), str(source)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return target


def python(site, *words, **environment):
    """Run Python with the folder on its path, where nothing else of this test is known."""
    path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=site.parent,
        env={**os.environ, "PYTHONPATH": path, **environment},
    )


def listed(site, **environment):
    run = python(site, "-m", "uqmbd.cli", "plugins", "--json", **environment)
    assert run.returncode == 0, run.stderr
    return {info["name"]: info for info in json.loads(run.stdout)}


def test_it_is_discovered_by_its_entry_point_alone(site):
    info = listed(site)["example"]
    assert (info["distribution"], info["version"]) == ("uqmbd-example-plugin", "1.2.3")
    assert info["status"] == "loaded", info["errors"]
    assert info["hooks"] == ["uqmbd_components", "uqmbd_propagators"]
    assert info["components"] == ["Magnet"] and info["propagators"] == ["mean-value"]


def test_it_can_be_switched_off(site):
    assert listed(site, UQMBD_DISABLE_PLUGINS="uqmbd-example-plugin")["example"]["status"] == "disabled"


def test_its_classes_are_registered_beside_the_built_in_ones(site):
    code = "import uqmbd.plugins as p; print(p.component('Magnet').__module__, 'Revolute' in p.components())"
    run = python(site, "-W", "error::UserWarning", "-c", code)
    assert run.stdout.split() == ["uqmbd_example.magnet", "True"], run.stderr


def test_broken_neighbour_is_a_warning_and_no_obstacle(site, tmp_path):
    """A package that raises on import, installed by hand: a module and its metadata."""
    broken = tmp_path / "broken"
    information = broken / "uqmbd_broken-0.4.dist-info"
    information.mkdir(parents=True)
    (broken / "uqmbd_broken.py").write_text("raise OSError('the driver of the device is missing')\n")
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: uqmbd-broken\nVersion: 0.4\n")
    (information / "entry_points.txt").write_text("[uqmbd]\nbroken = uqmbd_broken\n")
    code = "import uqmbd.plugins as p; print('Magnet' in p.components())"
    run = python(site, "-c", code, PYTHONPATH=os.pathsep.join([str(site), str(broken)]))
    assert run.stdout.strip() == "True"
    assert "PluginWarning: plugin 'broken' of uqmbd-broken 0.4: it cannot be loaded: " in run.stderr
    assert "OSError: the driver of the device is missing" in run.stderr
    assert "Traceback" not in run.stderr
