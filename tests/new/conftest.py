"""Packages that `uqmbd new` wrote, installed as somebody would, in an environment of their own beside that of the tests."""

from __future__ import annotations

import os
import site
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from uqmbd.new import PLUGIN_KINDS, new_plugin

ROOT = Path(__file__).parents[2]


def name_of(kind):
    """Hyphens become underscores in packages, and capitals in classes."""
    return f"sample-{kind}"


@pytest.fixture(scope="session")
def written(tmp_path_factory):
    """Write a package of each kind; return the folder of all."""
    folder = tmp_path_factory.mktemp("written")
    for kind in PLUGIN_KINDS:
        new_plugin(name_of(kind), kind, folder)
    return folder


@pytest.fixture(scope="session")
def python(written, tmp_path_factory):
    """Install all packages, editable, by one call of pip that asks no index; return what runs Python there."""
    environment = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    here = "Scripts" if os.name == "nt" else "bin"
    executable = environment / here / Path(sys.executable).name
    paths = {"base": str(environment), "platbase": str(environment)}
    folder = Path(sysconfig.get_path("purelib", "venv", vars=paths))
    known = [path for path in (*site.getsitepackages(), sysconfig.get_path("purelib")) if Path(path).is_dir()]
    lines = [f"import site; site.addsitedir({path!r})" for path in dict.fromkeys(known)]
    (folder / "of_the_tests.pth").write_text("\n".join(lines))

    def run(*words, cwd=written):
        path = os.pathsep.join([str(ROOT), str(ROOT / "plugins")])
        return subprocess.run(
            [executable, *words],
            capture_output=True,
            text=True,
            check=False,
            cwd=cwd,
            env={**os.environ, "PYTHONPATH": path, "PYTEST_ADDOPTS": "-p no:cacheprovider"},
        )

    packages = [word for kind in PLUGIN_KINDS for word in ("--editable", str(written / name_of(kind)))]
    found = run("-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", *packages)
    assert found.returncode == 0, found.stdout + found.stderr
    return run
