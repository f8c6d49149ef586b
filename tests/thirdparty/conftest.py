"""Packages of others: installed into a folder of their own, and run where nothing else of a test is known."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib

import pytest

from uqmbd.new import new_plugin


@pytest.fixture(scope="module")
def site(request, tmp_path_factory):
    """Install packages by hand, which is quicker than by pip: their files, and their metadata.

    A module names the folder of one, ``PACKAGE``, or those that `uqmbd new plugin` writes: ``WRITTEN``, kinds by names.
    """
    work = tmp_path_factory.mktemp("thirdparty")
    packages = [request.module.PACKAGE] if hasattr(request.module, "PACKAGE") else []
    for name, kind in getattr(request.module, "WRITTEN", {}).items():
        new_plugin(name, kind, work)
        packages.append(work / name)
    for package in packages:
        _install(package, work / "site")
    return work / "site"


def _install(package, folder):
    declared = tomllib.loads((package / "pyproject.toml").read_text())
    project, tool = declared["project"], declared["tool"]["setuptools"]
    for name in tool["packages"]:
        shutil.copytree(package / tool.get("package-dir", {}).get("", ".") / name, folder / name)
    information = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = []
    for group, points in project.get("entry-points", {}).items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in points.items())]
    (information / "entry_points.txt").write_text("\n".join([*lines, ""]))


@pytest.fixture(scope="module")
def python(site):
    """Run Python with the folder on its path; the result is what it prints."""

    def run(*words):
        path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
        found = subprocess.run(
            [sys.executable, *words],
            capture_output=True,
            text=True,
            check=False,
            cwd=site.parent,
            env={**os.environ, "PYTHONPATH": path},
        )
        assert found.returncode == 0, found.stdout + found.stderr
        return found.stdout

    return run
