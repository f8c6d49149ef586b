"""Commands that plugins offer: listed, explained and run like those of uqmbd, and one that is wrong harms nobody else."""

from __future__ import annotations

import importlib.metadata
import json
import subprocess
import sys
import textwrap
from typing import Annotated

import pytest
import typer

import uqmbd
from uqmbd import plugins
from uqmbd.cli import commands
from uqmbd.cli.app import app
from uqmbd.testing import check_command

GOOD = """
from typing import Annotated
import typer, uqmbd

class Fail:
    name = "fail-as"
    help = "Fail in some way."
    def run(self, how: Annotated[str, typer.Argument(help="How.")], loud: Annotated[bool, typer.Option("--loud")] = False):
        if how == "unusable":
            raise uqmbd.StudyError("no such thing")
        if how == "failed":
            raise uqmbd.IntegrationError("it stopped")
        if how == "mistake":
            1 / 0
        if how == "status":
            raise SystemExit(7)
        print(how.upper() if loud else how)

@uqmbd.hookimpl
def uqmbd_commands():
    return [Fail]
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install plugins by hand: a module and its entry point in the group of commands, and load these only."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    known: list[importlib.metadata.EntryPoint] = []

    def write(module, source, group="uqmbd.commands"):
        (folder / f"{module}.py").write_text(textwrap.dedent(source))
        known.append(importlib.metadata.EntryPoint(module, module, group))

    def found(group):
        return [point for point in known if point.group == group]

    monkeypatch.setattr(importlib.metadata, "entry_points", found)
    caches = (plugins.registry.registered, plugins.registry.registered_commands, commands.plugin_commands)
    for cache in caches:
        cache.cache_clear()
    yield write
    for cache in caches:
        cache.cache_clear()
    for path in folder.glob("*.py"):
        sys.modules.pop(path.stem, None)


def test_a_command_is_listed_explained_and_run(install, command_line):
    install("plugin_good", GOOD)
    status, out, err = command_line("--help")
    assert status == 0 and err == ""
    assert [line.split() for line in out.splitlines() if "fail-as" in line] == [
        ["fail-as", "Fail", "in", "some", "way."]
    ]
    status, out, _ = command_line("fail-as", "-h")
    assert status == 0 and "--loud" in out and "Fail in some way." in out
    assert command_line("fail-as", "never", "--loud") == (0, "NEVER\n", "")


@pytest.mark.parametrize(
    ("how", "status", "said"),
    [
        ("unusable", 2, "Error: no such thing"),
        ("failed", 1, "Error: it stopped"),
        ("mistake", 1, "Error: ZeroDivisionError: division by zero"),
        ("status", 7, ""),
    ],
)
def test_its_errors_are_reported_as_those_of_any_command(install, command_line, how, status, said):
    install("plugin_good", GOOD)
    found, _, err = command_line("fail-as", how)
    assert found == status and err.startswith(said) and "Traceback" not in err
    _, _, err = command_line("fail-as", how, "--debug")
    assert ("Traceback" in err) == (how != "status")


def test_wrong_options_are_refused(install, command_line):
    install("plugin_good", GOOD)
    for words in ((), ("a", "b"), ("a", "--quiet")):
        status, _, err = command_line("fail-as", *words)
        assert status == 2 and err.startswith("Usage: uqmbd fail-as")


WRONG = {
    "raise RuntimeError('no licence found')": "it cannot be loaded: RuntimeError: no licence found",
    "import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_commands(): return 1 / 0": "raised ZeroDivisionError",
    "import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_commands(): return [int]": "which has no method 'run'",
    "import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_components(): return []": "belongs in a module of the entry-point "
    "group 'uqmbd': in pyproject",
    GOOD.replace("fail-as", "check"): "whose name 'check' is that of a command of uqmbd",
    GOOD.replace("fail-as", "Fail"): "whose name 'Fail' is not a word of lower-case letters",
    GOOD.replace("fail-as", "--fail"): "whose name '--fail' is not a word of lower-case letters",
    GOOD.replace('help = "Fail in some way."', "help = None"): "whose class attribute `help`",
    GOOD.replace("how: Annotated[str,", "how: Annotated[str | int,"): "omitted: AssertionError: Typer",
    GOOD.replace(
        'name = "fail-as"', 'name = "fail-as"\n    def __init__(self): raise SystemExit("no")'
    ): "omitted: SystemExit: no",
}


@pytest.mark.parametrize("source", WRONG, ids=lambda source: WRONG[source][:40])
def test_a_command_that_is_wrong_is_reported_and_harms_nobody(install, command_line, source):
    install("plugin_broken", source)
    install(
        "plugin_good", GOOD.replace("fail-as", "good").replace("class Fail", "class Good").replace("[Fail]", "[Good]")
    )
    status, out, err = command_line("--help")
    assert status == 0 and "good" in out and "fail-as" not in out
    (line,) = err.splitlines()
    assert line.startswith("Warning: ") and WRONG[source] in line and "plugin_broken" in line
    assert command_line("good", "fine")[:2] == (0, "fine\n")
    # it may be what was meant
    status, _, err = command_line("fail-as")
    assert status == 2 and "No such command 'fail-as'" in err
    if "omitted" not in WRONG[source]:
        assert "Could not be loaded completely: plugin 'plugin_broken'" in " ".join(err.split())


ERRORS = ("RuntimeError", "SystemExit", "KeyboardInterrupt", "StopIteration", "GeneratorExit")
PLACES = {
    "its import": ("from typing", "raise {error}('as told')\nfrom typing"),
    "its hook": ("    return [Fail]", "    raise {error}('as told')"),
    "its class": ('    name = "fail-as"', '    name = "fail-as"\n    def __init__(self): raise {error}("as told")'),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("error", ERRORS)
def test_whatever_a_plugin_raises_is_reported_and_the_other_commands_are_there(install, command_line, place, error):
    old, new = PLACES[place]
    assert old in GOOD
    install("plugin_broken", GOOD.replace(old, new.format(error=error), 1))
    install("plugin_good", GOOD.replace("fail-as", "good"))
    status, out, err = command_line("--help")
    assert status == 0 and "good" in out and "fail-as" not in out
    assert err.startswith("Warning: ") and f"{error}: as told" in err and "plugin_broken" in err
    assert command_line("good", "fine")[:2] == (0, "fine\n")


def test_an_unknown_command_says_what_there_is(install, command_line):
    install("plugin_good", GOOD)
    assert "Did you mean 'fail-as'?" in command_line("fail-us")[2]
    assert "Did you mean 'check'?" in command_line("chek")[2]
    assert "There are run, check, animate, export, view, plugins, report, compare, new, fail-as." in " ".join(
        command_line("xyz")[2].split()
    )


def test_commands_of_uqmbd_load_no_plugin(install, command_line):
    install("plugin_broken", "raise RuntimeError('no licence found')")
    assert command_line("check", "--help")[2] == ""


def test_a_plugin_that_implements_the_hook_where_it_is_not_looked_for_is_reported_where(install, command_line):
    install("plugin_good", GOOD, group="uqmbd")
    status, out, _ = command_line("plugins")
    assert status == 0 and "failed" in out
    assert '[project.entry-points."uqmbd.commands"] plugin_good = "MODULE"' in out


def test_a_plugin_with_commands_and_more_is_listed_once(install, command_line):
    install("plugin_good", GOOD)
    install("other", "import uqmbd\n@uqmbd.hookimpl\ndef uqmbd_components(): return []", group="uqmbd")
    (info,) = json.loads(command_line("plugins", "--json")[1])[1:]
    assert info["commands"] == ["fail-as"] and info["status"] == "loaded"
    assert plugins.owner("commands", "fail-as").startswith("plugin 'plugin_good'")
    one = plugins.PluginInfo("a", "a", "1", components=("Magnet",), hooks=("uqmbd_components",))
    two = plugins.PluginInfo("a", "a", "1", status="failed", errors=("no",))
    other = plugins.PluginInfo("a", "b", "1")
    joined = plugins.PluginInfo("a", "a", "1", "incomplete", ("uqmbd_components",), ("Magnet",), errors=("no",))
    assert plugins.merged([one, other, two]) == (joined, other)


def test_a_plugin_that_is_disabled_offers_no_command(install, command_line, monkeypatch):
    monkeypatch.setenv("UQMBD_DISABLE_PLUGINS", "plugin_good")
    install("plugin_good", GOOD)
    assert "fail-as" not in command_line("--help")[1]


def test_the_names_of_commands_of_uqmbd_are_reserved():
    own = [
        *(one.callback.__name__ for one in app.registered_commands),
        *(one.typer_instance.info.name for one in app.registered_groups),
    ]
    assert plugins.KINDS["commands"].reserved == tuple(own)


class Count:
    """Count to a number."""

    name = "count"
    help = "Count."

    def run(self, end: Annotated[int, typer.Argument(help="Where to end.")] = 3) -> None:
        print(end)


class Silent(Count):
    """An option without a help."""

    def run(self, end: int = 3) -> None:
        print(end)


class Debug(Count):
    """An option that is not its own."""

    def run(self, debug: Annotated[bool, typer.Option("--debug", help="More.")] = False) -> None:
        print(debug)


class Unmade(Count):
    """A class that wants arguments."""

    def __init__(self, one):
        pass


@pytest.mark.parametrize(
    ("command", "module", "said"),
    [
        (Silent, "", "'end' has no help"),
        (Debug, "", "which uqmbd reserves"),
        (Unmade, "", "cannot be converted to a command of the command line: TypeError"),
        (type("Named", (Count,), {"name": "Count", "__doc__": "x"}), "", "not a word of lower-case letters"),
        (type("Plain", (Count,), {"__doc__": None}), "", "no docstring"),
    ],
)
def test_the_check_of_commands_says_what_is_wrong(command, module, said):
    with pytest.raises(AssertionError, match=said):
        check_command(command, module)


@pytest.mark.thorough
def test_the_check_of_commands_finds_modules_that_are_heavy():
    check_command(Count, "json")
    with pytest.raises(AssertionError, match="module scipy also imports numpy, scipy"):
        check_command(Count, "scipy")
    with pytest.raises(AssertionError, match="cannot be imported"):
        check_command(Count, "no_such_module")


@pytest.mark.thorough
def test_commands_of_plugins_are_loaded_alone():
    """`uqmbd --help` imports the modules of the group of commands, and none of the others."""
    code = "import sys; from uqmbd import plugins; plugins.commands(); print(*(x for x in sys.modules if x.startswith('uqmbd_')))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {name.partition(".")[0] for name in run.stdout.split()} <= {"uqmbd_calibration", "uqmbd_calibration.command"}
    assert uqmbd.extend.Command is plugins.Command
