"""Packages of others: installed into a folder of their own, and run where nothing else of a test is known."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib

import pytest


@pytest.fixture(scope="module")
def site(request, tmp_path_factory):
    """Install the package ``PACKAGE`` of a module by hand, which is quicker than by pip: its files, and its metadata."""
    package, folder = request.module.PACKAGE, tmp_path_factory.mktemp("thirdparty") / "site"
    declared = tomllib.loads((package / "pyproject.toml").read_text())
    project = declared["project"]
    for name in declared["tool"]["setuptools"]["packages"]:
        shutil.copytree(package / name, folder / name)
    information = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = []
    for group, points in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in points.items())]
    (information / "entry_points.txt").write_text("\n".join([*lines, ""]))
    return folder


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
