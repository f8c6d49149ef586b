"""`uqmbd new plugin` writes packages of every kind; names that cannot be are told, and nothing is overwritten."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from uqmbd import plugins
from uqmbd.new import PLUGIN_KINDS

ROOT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def files():
    return sorted(str(path) for path in Path().rglob("*") if path.is_file())


def test_every_hook_has_a_kind_and_every_kind_a_page():
    # a check is one class with one method, which its page shows in full
    others = {"checks": "check.md"}
    written = {kind.registry for kind in PLUGIN_KINDS.values()} | {kind.fitted for kind in PLUGIN_KINDS.values()} - {""}
    assert written == set(plugins.KINDS) - set(others)
    pages = {path.name for path in (ROOT / "docs" / "how-to" / "plugins").glob("*.md")}
    assert {"index.md", *others.values()} <= pages
    # a random process is an object that a component is given, and has no hook
    pages -= {"index.md", "excitation.md", *others.values()}
    assert pages <= {Path(kind.page).name for kind in PLUGIN_KINDS.values()}
    for kind in PLUGIN_KINDS.values():
        assert (ROOT / "docs" / kind.page).exists()


def test_it_writes_a_package_and_says_what_comes_next(command):
    run = command("new", "plugin", "uqmbd-wire-rope", "--kind", "component")
    assert (run.returncode, run.stderr) == (0, "")
    package = [
        ".github/workflows/tests.yml",
        ".gitignore",
        "README.md",
        "pyproject.toml",
        "src/uqmbd_wire_rope/__init__.py",
        "src/uqmbd_wire_rope/component.py",
        "src/uqmbd_wire_rope/py.typed",
        "tests/test_uqmbd_wire_rope.py",
    ]
    assert files() == [f"uqmbd-wire-rope/{path}" for path in package]
    assert all(path in run.stdout for path in files()) and "docs/how-to/plugins/component.md" in run.stdout
    assert "class WireRope(" in Path("uqmbd-wire-rope/src/uqmbd_wire_rope/component.py").read_text()
    project = tomllib.loads(Path("uqmbd-wire-rope/pyproject.toml").read_text())["project"]
    assert project["entry-points"] == {"uqmbd": {"wire-rope": "uqmbd_wire_rope"}}
    assert "license" not in project  # it is the author's to choose


def test_nothing_is_overwritten_unasked(command):
    command("new", "plugin", "rope", "--kind", "component")
    mine = Path("rope/src/rope/component.py")
    mine.write_text("mine")
    run = command("new", "plugin", "rope", "--kind", "law")
    assert run.returncode == 2 and "exist already, and nothing was written; use --force to overwrite" in run.stderr
    assert mine.read_text() == "mine"
    assert command("new", "plugin", "rope", "--kind", "law", "--force").returncode == 0
    assert "law_at(" in mine.read_text()


@pytest.mark.parametrize(
    ("name", "kind", "why"),
    [
        ("WireRope", "component", "lower-case letters and digits, with single hyphens or underscores between words"),
        ("WireRope", "component", "Try 'wire-rope'"),
        ("2ropes", "component", "Try 'plugin-2ropes'"),
        ("rope_", "component", "Try 'rope'"),
        ("größe", "component", "Try 'gr-e'"),
        ("a/rope", "component", "expected a name, not a path"),
        ("", "component", "the name is empty"),
        ("r" * 41, "component", "the maximum is 40"),
        ("numpy", "component", "a module numpy exists already"),
        ("uqmbd-joints", "component", "a module uqmbd_joints exists already"),
        ("uqmbd-springs", "section", "a module uqmbd_springs exists already"),
        ("json", "command", "part of Python"),
        ("uqmbd-r", "component", "the name has a single letter"),
        ("lambda", "contact-law", "lambda is a reserved word"),
        ("uqmbd-true", "component", "True is a reserved word"),
        ("uqmbd-exception", "component", "would be named Exception, which is a built-in name"),
        ("uqmbd-any", "law", "would be named Any, like typing.Any, which the example uses"),
        ("uqmbd-path", "command", "would be named Path, like pathlib.Path, which the example uses"),
        (
            "uqmbd-contact-law",
            "contact-law",
            "would be named ContactLaw, like uqmbd_contact.ContactLaw, which the example uses",
        ),
        ("hertz", "contact-law", "the contact law 'hertz' belongs to plugin 'contact' of uqmbd"),
        ("collocation", "surrogate", "the propagator 'collocation' belongs to plugin 'collocation' of uqmbd"),
        ("test-rig", "component", "pytest treats functions of this name as tests"),
        ("revolute", "component", "the component 'Revolute' belongs to plugin 'joints' of uqmbd"),
        ("galerkin", "propagator", "the propagator 'galerkin' belongs to plugin 'galerkin' of uqmbd"),
        ("dop853", "integrator", "the integrator 'dop853' belongs to uqmbd itself"),
        ("sobol", "design", "the sampling design 'sobol' belongs to uqmbd itself"),
        ("run", "command", "the command 'run' belongs to uqmbd itself"),
        ("new", "command", "the command 'new' belongs to uqmbd itself"),
        ("urdf", "reader", "the reader of model files 'urdf' belongs to plugin 'models' of uqmbd"),
    ],
)
def test_names_that_cannot_be_are_reported(command, name, kind, why):
    run = command("new", "plugin", name, "--kind", kind)
    assert run.returncode == 2 and why in run.stderr, run.stderr
    assert files() == []


def test_kinds_that_are_not_there_are_reported(command):
    run = command("new", "plugin", "rope", "--kind", "joint")
    assert run.returncode == 2 and "component" in run.stderr and files() == []
    assert "--kind" in command("new", "plugin", "rope").stderr


def test_what_ci_runs_is_what_the_readme_says(command):
    command("new", "plugin", "rope", "--kind", "component")
    steps = re.findall(r"- run: (.*)", Path("rope/.github/workflows/tests.yml").read_text())
    told = re.findall(r"^python .*$", Path("rope/README.md").read_text(), re.M)
    assert [word for line in told for word in line.split(" && ")] == steps
    assert {"pytest", "ruff", "mypy", "pyright"} <= {word for step in steps for word in step.split()}


@pytest.mark.parametrize("length", [2, 14, 40])
def test_all_kinds_are_linted_and_formatted_whatever_their_names_are(command, length):
    for number, kind in enumerate(PLUGIN_KINDS):
        name = (chr(ord("b") + number) + "quite-long" * 4)[:length].rstrip("-")
        assert command("new", "plugin", name, "--kind", kind).returncode == 0
    for words in (["check"], ["format", "--check"]):
        run = subprocess.run(
            [sys.executable, "-m", "ruff", *words, "--no-cache", "."], capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stdout + run.stderr
