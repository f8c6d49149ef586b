"""The command line: a user's mistake is one clear message and an exit status, never a traceback."""

from __future__ import annotations

import dataclasses
import io
import json
import os
import re
import subprocess
import sys
import textwrap
import types
import warnings
from pathlib import Path
from typing import ClassVar, Literal

import chaospy
import numpy as np
import pytest

import uqmbd
import uqmbd.report
from uqmbd import extend, plugins, results
from uqmbd.cli import tables
from uqmbd.cli.check.check import described_equations
from uqmbd.cli.run.settings import apply_settings, parse_value
from uqmbd.cli.terminal import progress
from uqmbd.results.storage import record
from uqmbd_joints import Revolute
from uqmbd_springs import SpringDamper


@dataclasses.dataclass(frozen=True, kw_only=True)
class FakeMonteCarlo:
    """Stands for a propagator: options as fields."""

    name: ClassVar[str] = "monte-carlo"
    samples: int = 100
    seed: int | None = None
    rule: Literal["random", "sobol"] = "random"
    label: str | None = None

    def __post_init__(self):
        if self.samples < 2:
            raise ValueError(f"samples is {self.samples}; at least 2 are needed")

    @property
    def node_name(self):
        return self.label or self.name


@dataclasses.dataclass(frozen=True, kw_only=True)
class FakeStudy:
    """Stands for a study: its results are numbers that say which options arrived."""

    propagators: tuple = (FakeMonteCarlo(),)
    name: str = "fake"
    mechanism: object = dataclasses.field(
        default_factory=lambda: types.SimpleNamespace(name="machine", requirements={}, bodies={})
    )
    times: object = dataclasses.field(default_factory=lambda: np.array([0.0, 1.0]))
    error: BaseException | None = None
    failures: int = 0

    def with_propagators(self, propagators):
        return dataclasses.replace(self, propagators=tuple(propagators))

    def run(self, workers=1, *, only=None, progress=None, folder=None, resume=False):
        if self.error is not None:
            raise self.error
        warnings.warn("the second crank hangs in the air", uqmbd.RedundantConstraintWarning, stacklevel=1)
        nodes = []
        for one in self.propagators:
            if only and one.node_name not in only:
                continue
            progress.start(one.node_name, one.samples)
            progress.advance(one.node_name, one.samples)
            progress.finish(one.node_name)
            axes = extend.labels([("slider_x", "m"), ("angle [1]", "")], [("length", "m", "Normal")], self.times)
            mean, std = np.full((2, 2), float(one.samples)), np.full((2, 2), 0.031)
            statistics = extend.statistics_dataset(axes, mean=mean, std=std)
            nodes.append(
                results.propagator_node(
                    one.node_name,
                    statistics,
                    propagator=one.name,
                    realisations=one.samples,
                    wall_time=1.5,
                    failures=self.failures,
                )
            )
        return results.study_tree(nodes, study=self.name, mechanism="machine")


def fake_report(tree, path, *, sections=(), folder=None):
    path.write_text("<html>" + "".join(section.render(tree) for section in sections))
    if folder is not None:
        folder.mkdir(exist_ok=True)
        (folder / "x-bands.svg").write_text("<svg/>")
        record(path.parent, ["figures/x-bands.svg"])
    record(path.parent, [path.name])
    return path


class Friction:
    """A report section of a plugin."""

    title = "Friction"

    def render(self, tree):
        return "<p>so much friction</p>"


class Unmade:
    """A report section that cannot be made."""

    def __init__(self):
        raise RuntimeError("no colours left")


@pytest.fixture
def cli(command_line, monkeypatch):
    """Run the command line in an empty folder with fakes for what takes long."""
    monkeypatch.setattr("uqmbd.propagation.studies.script.Study", FakeStudy)
    monkeypatch.setattr(plugins.registry, "registered", lambda: plugins.load([]))
    monkeypatch.setattr(plugins.registry, "registered_commands", lambda: plugins.load([], group="uqmbd.commands"))
    monkeypatch.setitem(sys.modules, "fakes", sys.modules[__name__])
    monkeypatch.setattr(uqmbd.report, "write_report", fake_report, raising=False)
    return command_line


@pytest.fixture
def study(cli, tmp_path):
    """Write a study script of this text and return its name."""

    def write(text="study = FakeStudy()"):
        (tmp_path / "my_study.py").write_text("from fakes import FakeMonteCarlo, FakeStudy\n" + textwrap.dedent(text))
        return "my_study.py"

    return write


@pytest.mark.thorough
def test_run_writes_results_and_report(cli, study, tmp_path):
    status, out, err = cli("run", study(), "--out", "new/folder")
    assert (status, err) == (0, err), err
    tree = results.load(tmp_path / "new" / "folder" / "results.nc")
    assert list(results.propagator_nodes(tree)) == ["monte-carlo"]
    assert (tmp_path / "new" / "folder" / "report.html").exists()
    assert "mean ± standard deviation at t = 1 s" in out
    assert "slider_x" in out and "100.000 ± 0.031" in out and "0 of 100" in out and "1.5 s" in out
    assert "angle [1]" in out  # square brackets are no markup here
    written = {path.name for path in (tmp_path / "new" / "folder").iterdir()} - {".uqmbd-manifest.json"}
    assert "report.html" in written and all(f"new/folder/{name}\n" in out for name in written)
    assert "monte-carlo: 0 of 100" in err  # no terminal: progress by lines
    assert err.index("monte-carlo: 0 of 100") < err.index("writing the report ...")
    assert "Warning: the second crank hangs in the air" in err and "RedundantConstraintWarning" not in err


@pytest.mark.thorough
def test_options_reach_the_study(cli, study, tmp_path):
    script = study("study = FakeStudy(propagators=(FakeMonteCarlo(), FakeMonteCarlo(label='b.2')))")
    status, _, _ = cli(
        "run", script, "--set", "b.2.samples=1e3", "--set", "b.2.rule=sobol", "--only", "b.2", "--out", "r"
    )
    assert status == 0
    tree = results.load(tmp_path / "r" / "results.nc")
    assert list(results.propagator_nodes(tree)) == ["b.2"]
    assert tree["b.2"].attrs["realisations"] == 1000


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            ["--only", "galerkin"],
            ["--only galerkin", "no propagator", "Its propagators: monte-carlo (FakeMonteCarlo).\n"],
        ),
        (
            ["--only", "montecarlo"],
            ["with this label; did you mean 'monte-carlo'?\nIts propagators: monte-carlo (Fake"],
        ),
        (
            ["--set", "montecarlo.samples=3"],
            ["no propagator 'montecarlo'; did you mean 'monte-carlo'?\nIts propagators: monte"],
        ),
        (["--set", "galerkin.order=3"], ["no propagator 'galerkin'", "monte-carlo (FakeMonteCarlo)"]),
        (
            ["--set", "monte-carlo.sample=3"],
            [
                "no option 'sample'; did you mean 'samples'? Its options:\n",
                "samples: int, default 100",
                "seed: int or none, default None",
                "'random' or 'sobol'",
            ],
        ),
        (["--set", "monte-carlo.samples=many"], ["samples cannot be 'many'; expected int"]),
        (["--set", "monte-carlo.rule=halton"], ["rule cannot be 'halton'; expected 'random' or 'sobol'"]),
        (["--set", "samples=3"], ["expected LABEL.option=value, such as monte-carlo.samples=100"]),
        (["--set", "monte-carlo.samples=1"], ["--set monte-carlo.samples=1: samples is 1; at least 2 are needed"]),
        (["--out", "my_study.py"], ["--out my_study.py is a file; expected a folder"]),
        (["--workers", "0"], ["--workers", "1"]),
        (["--workers", "2", "--dask", "tcp://x:1"], ["either --workers or --dask"]),
        (["--sampels", "3"], ["No such option", "--sampels"]),
    ],
)
def test_mistakes_on_the_command_line(cli, study, words, parts):
    status, out, err = cli("run", study(), *words)
    assert status == 2
    assert "Traceback" not in err and out == ""
    for part in parts:
        assert part in err
    assert ("samples: int" in err) == any(
        "no option" in part for part in parts
    )  # options only where they are asked for


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("study = 1 / 0", ["my_study.py, line 2:\n    study = 1 / 0\nZeroDivisionError: division by zero"]),
        ("problem = 1", ["my_study.py has no module-level `study`"]),
        ("study = FakeStudy(propagators=())", ["the study has no propagators"]),
    ],
)
def test_mistakes_in_the_script(cli, study, text, parts):
    status, _, err = cli("run", study(text))
    assert status == 2
    assert "\nError: " in err and "Traceback" not in err
    for part in parts:
        assert part in err


def test_missing_script(cli):
    status, _, err = cli("run", "nowhere.py")
    assert status == 2
    assert "\nError: The file nowhere.py does not exist" in err


@pytest.mark.parametrize("place", ["before", "after"])
def test_debug_shows_the_traceback(cli, study, place):
    words = ["run", study("study = 1 / 0")]
    status, _, err = cli(*(["--debug", *words] if place == "before" else [*words, "--debug"]))
    assert status == 2
    assert "Traceback" in err and "ZeroDivisionError" in err


@pytest.mark.parametrize(
    ("error", "status", "text"),
    [
        ("uqmbd.AssemblyError('joint A: 0.1 m')", 1, "Error: joint A: 0.1 m"),
        ("uqmbd.IntegrationError('stopped at 0.3 s')", 1, "Error: stopped at 0.3 s"),
        ("uqmbd.StudyError('no such integrator')", 2, "Error: no such integrator"),
        (
            "KeyError('x')",
            1,
            "Error: KeyError: 'x'\nThe error is in uqmbd, in a plugin or in the study. Run the command with --",
        ),
        ("MemoryError()", 1, "out of memory"),
        ("OSError(28, 'No space left on device', 'results.nc')", 2, "Error: results.nc: No space left on device"),
        ("KeyboardInterrupt()", 130, "Interrupted."),
    ],
)
def test_exit_status_of_failures(cli, study, error, status, text):
    found, _, err = cli("run", study(f"import uqmbd\nstudy = FakeStudy(error={error})"))
    assert found == status
    assert text in err and "Traceback" not in err


@pytest.mark.thorough
def test_failed_samples_are_counted(cli, study):
    _, out, _ = cli("run", study("study = FakeStudy(failures=3)"))
    assert "3 of 100" in out


@pytest.mark.thorough
def test_report_is_written_again(cli, study, tmp_path):
    cli("run", study())
    (tmp_path / "results" / "report.html").unlink()
    for argument in ("results", "results/results.nc"):
        status, out, _ = cli("report", argument)
        assert status == 0 and "results/report.html" in out
        assert (tmp_path / "results" / "report.html").exists()


@pytest.mark.thorough
def test_report_has_the_sections_of_plugins(cli, study, tmp_path, monkeypatch):
    monkeypatch.setattr(plugins, "report_sections", lambda: {"Friction": Friction, "Unmade": Unmade})
    status, _, err = cli("run", study())
    assert status == 0
    assert "so much friction" in (tmp_path / "results" / "report.html").read_text()
    assert "Warning: report section 'Unmade' of" in err and "RuntimeError: no colours left" in err


def test_report_without_results(cli):
    status, _, err = cli("report", "nowhere")
    assert status == 2
    assert "nowhere/results.nc does not exist; expected the folder that `uqmbd run" in err.replace(os.sep, "/")


@pytest.mark.thorough
def test_compare(cli, study):
    script = study()
    cli("run", script, "--out", "a")
    cli("run", script, "--out", "b", "--set", "monte-carlo.samples=101")
    status, out, err = cli("compare", "a/results.nc", "b/results.nc")
    assert status == 0, err
    assert "slider_x" in out and "1 (3.23e+03 %)" in out
    status, _, err = cli("compare", "a/results.nc", "c.nc")
    assert status == 2 and "c.nc" in err
    for missing in ("missing", "missing.nc"):
        status, _, err = cli("compare", "a", missing)
        assert status == 2 and f"{missing}: no such file or folder;" in err


@pytest.mark.thorough
def test_compare_names_what_only_one_mechanism_has(cli, study):
    """Parts that both results state are compared; of a result that states none nothing is said."""
    paths = []
    for name, components in (("a", {"A": "Revolute", "k": "SpringDamper"}), ("b", {"A": "Fixed"}), ("c", None)):
        cli("run", study(), "--out", name)
        tree = results.load(Path(name) / "results.nc")
        if components is not None:
            tree.attrs["parts"] = json.dumps({"bodies": ["rod", f"mass {name}"], "components": components})
        paths.append(str(results.save(tree, Path(f"{name}.nc"))))
    status, out, err = cli("compare", *paths[:2])
    assert status == 0, err
    rows = [line.split() for line in out.splitlines()]
    assert ["component", "k", "SpringDamper", "–"] in rows and ["component", "A", "Revolute", "Fixed"] in rows
    assert ["body", "mass", "b", "–", "yes"] in rows and not any(row[:2] == ["body", "rod"] for row in rows)
    assert "parts" not in out
    assert "component" not in cli("compare", paths[0], paths[2])[1]


def test_check_of_bodies_that_nothing_holds():
    """Counts by hand: a planar body has four coordinates, of which the half-angle pair has unit length."""
    made = uqmbd.Mechanism("parts", uqmbd.Planar())
    made.body("ball", mass=1, inertia=1)
    alone = uqmbd.check(made)
    assert (alone.equations, alone.unit_lengths, alone.apart) == (1, 1, (("ball",),))
    assert described_equations(alone).startswith("1 constraint equation, independent; it is the unit length")
    one, two, held = (made.body(name, mass=1, inertia=1) for name in ("one", "two", "held"))
    made.add(Revolute("pin", one, two, (0, 0), (0, 0)))
    made.add(SpringDamper("spring", made.ground, held, (1, 0), (0, 0), 10))
    found = uqmbd.check(made)
    assert found.apart == (("ball",), ("one", "two"))
    assert described_equations(found) == (
        "6 constraint equations, 6 of them independent; 4 are the unit lengths of the bodies' half-angle pairs, "
        "not of joints"
    )
    made.output("x", held.position[0])
    ball, pair, *more = uqmbd.findings(uqmbd.Study("parts", made, [0, 1]))
    assert "body 'ball' is not connected" in ball.message and not more
    assert "bodies 'one', 'two' are connected with each other, but not with the ground" in pair.message
    assert ball.severity is pair.severity is uqmbd.extend.Severity.NOTE


def test_check_of_bodies_that_are_drawn_in_degrees():
    """60 rad are 9.55 turns; a variable has no number to look at, and one turn may be meant."""
    made = uqmbd.Mechanism("parts", uqmbd.Planar())
    tilt = uqmbd.RandomVariable("tilt", chaospy.Normal(50, 1), units="rad")
    for name, angle in (("degrees", 60), ("radians", 1.05), ("turned", -6.2), ("random", tilt)):
        made.body(name, mass=1, inertia=1, angle=angle)
    made.output("x", made.bodies["degrees"].position[0])
    (found,) = (x for x in uqmbd.findings(uqmbd.Study("parts", made, [0, 1])) if "has the angle" in x.message)
    assert str(found) == (
        "Warning: body 'degrees' has the angle 60 rad, 9.55 turns. Write degrees as math.radians(60)."
    )
    space = uqmbd.Mechanism("space", uqmbd.Spatial())
    cube = space.body("cube", mass=1, inertia=(1, 1, 1))
    space.output("x", cube.position[0])
    assert uqmbd.findings(uqmbd.Study("space", space, [0, 1])) == []


def test_check(cli, study, monkeypatch):
    found = types.SimpleNamespace(
        bodies=("crank", "rod"),
        components=(("A", "Revolute", 2), ("B", "Revolute", 2)),
        coordinates=8,
        equations=6,
        rank=5,
        redundant=("B.point[1]",),
        mobility=1,
        not_unique=("B.reaction_force[1]",),
        inputs=(("length", "Normal(mu=1, sigma=0.02)", "m"), ("mass", "Uniform(1, 2)", "kg")),
        unused_inputs=("mass",),
        moved=(),
    )
    monkeypatch.setattr(uqmbd, "check", lambda mechanism: found, raising=False)
    status, out, _ = cli("check", study())
    assert status == 0
    for part in (
        "bodies      2: crank, rod",
        "6 constraint equations, 5 of them independent",
        "1 degree of freedom",
        "B.point[1] (follow from the others",
        "Normal(mu=1, sigma=0.02)",
        "FakeMonteCarlo",
    ):
        assert part in out


def test_plugins_as_json_and_table(cli, monkeypatch):
    info = plugins.PluginInfo("magnets", "uqmbd-magnets", "0.1", components=("Magnet",), hooks=("uqmbd_components",))
    broken = plugins.PluginInfo(
        "bad", "uqmbd-bad", "0.2", status="failed", errors=("it cannot be loaded: ValueError: no",)
    )
    registry = plugins.Registry((info, broken), plugins.load([]).classes)
    monkeypatch.setattr(plugins.registry, "registered", lambda: registry)
    status, out, _ = cli("plugins", "--json")
    assert status == 0
    assert json.loads(out)[0]["components"] == ["Magnet"] and json.loads(out)[1]["status"] == "failed"
    status, out, _ = cli("plugins")
    assert status == 0
    assert "Magnet" in out and "bad: it cannot be loaded: ValueError: no" in out


def test_no_plugins_at_all(cli):
    assert "No plugins are installed" in cli("plugins")[1]


def test_version(cli):
    assert cli("--version") == (0, f"uqmbd {uqmbd.__version__}\n", "")


def test_help_imports_nothing_heavy():
    code = """
import sys
from uqmbd.cli import main
try:
    main(["--help"])
except SystemExit:
    pass
print(sorted({"numpy", "sympy", "xarray", "rich", "matplotlib"} & set(sys.modules)))
print(len(sys.modules))
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "compare" in run.stdout
    heavy, modules = run.stdout.splitlines()[-2:]
    assert heavy == "[]"
    assert int(modules) < 350  # by which the time is known: 258 take 0.25 s of processor time


@pytest.mark.thorough
@pytest.mark.parametrize("words", [("run",), ("check",), ("animate",)])
def test_a_study_that_is_not_there_is_reported_before_anything_heavy_is_imported(words):
    code = (
        "import sys\nfrom uqmbd.cli import main\n"
        f"try:\n    main([{words[0]!r}, 'no_such_study.py'])\n"
        "except SystemExit as left:\n    assert left.code == 2\n"
        "heavy = {'sympy', 'numpy', 'xarray', 'chaospy', 'scipy'} & set(sys.modules)\nassert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    assert "The file no_such_study.py does not exist" in done.stderr


def test_interrupt_from_the_keyboard(tmp_path):
    """A real signal, while a script is being loaded."""
    import signal

    script = tmp_path / "slow.py"
    script.write_text("import time\nprint('here', flush=True)\ntime.sleep(60)\n")
    with subprocess.Popen(
        [sys.executable, "-m", "uqmbd", "check", str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # a test run in the background of a shell ignores the signal, and so would its children
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        assert process.stdout.readline() == "here\n"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err == "Interrupted.\n"


def test_settings_leave_the_study_as_it_was():
    before = (FakeMonteCarlo(seed=1), FakeMonteCarlo(label="other"))
    after = apply_settings(["other.seed=none", "monte-carlo.seed=7", "monte-carlo.seed=8"], before)
    assert after == (FakeMonteCarlo(seed=8), FakeMonteCarlo(label="other"))
    assert before[0].seed == 1


@pytest.mark.parametrize(
    ("text", "annotation"), [("1.5", int), ("x", float), ("maybe", bool), ("x", int | None), ("c", Literal["a", "b"])]
)
def test_values_of_another_type_are_refused(text, annotation):
    with pytest.raises(ValueError):
        parse_value(text, annotation)


@pytest.mark.parametrize(
    ("kind", "expected"), [("xterm", "monte-carlo +━+ +3 "), ("dumb", "monte-carlo: done after [0-9.]+ m?s\n")]
)
def test_bar_on_a_terminal(monkeypatch, kind, expected):
    """One that cannot change what it shows gets lines; a finished bar has the realisations that were computed."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("TERM", kind)
    screen = Terminal()
    with progress.shown_progress(screen) as shown:
        shown.start("monte-carlo", 4)
        shown.advance("monte-carlo", 3)
        shown.finish("monte-carlo")
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.getvalue())
    assert re.search(expected, plain)


def test_without_a_report_none_is_written(cli, study, tmp_path):
    """The results are there, what would be wrong with a report is not looked at, and it is said how to get one."""
    status, out, err = cli("run", study(), "--out", "r", "--no-report")
    assert status == 0 and "writing the report" not in err
    assert {path.name for path in (tmp_path / "r").iterdir()} == {"results.nc", ".uqmbd-manifest.json"}
    assert "to write it: uqmbd report r" in out


@pytest.mark.parametrize("option", ["--open", "--figures"])
def test_options_of_the_report_need_it(cli, study, option):
    status, _, err = cli("run", study(), "--no-report", option)
    assert status == 2 and option in err and "--no-report" in err


@pytest.mark.thorough
def test_the_report_is_opened_when_it_is_written_and_figures_when_asked_for(cli, study, tmp_path, monkeypatch):
    opened = []

    def browse(address):
        opened.append((address, (tmp_path / "r" / "report.html").exists()))
        return len(opened) < 2

    monkeypatch.setattr("webbrowser.open", browse)
    status, _, err = cli("run", study(), "--out", "r", "--open")
    assert status == 0 and opened == [((tmp_path / "r" / "report.html").as_uri(), True)] and "browser" not in err
    assert not (tmp_path / "r" / "figures").exists()
    status, _, err = cli("report", "r", "--figures", "--open")
    assert status == 0 and any((tmp_path / "r" / "figures").glob("*.svg"))
    assert "no browser was found" in err and len(opened) == 2
    status, _, err = cli("report", "r")
    assert status == 0 and "belong to an earlier report; --figures" in err and len(opened) == 2


@pytest.mark.parametrize(
    ("mean", "std", "text"),
    [
        (0.0, 0.0123, "0.000 ± 0.012"),
        (9.999, 0.0999, "9.999 ± 0.100"),
        (1e8, 2e5, "1.0000e+08 ± 2.0e+05"),
        (3.0, 1e-12, "3.000000000000e+00 ± 1.0e-12"),
    ],
)
def test_digits_follow_the_spread(mean, std, text):
    assert tables.with_spread(mean, std) == text


@pytest.mark.thorough
def test_example_of_the_readme_runs(tmp_path, monkeypatch, command):
    """The first Python fence of the README is a study script, and the command line does what it says of it."""
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    (tmp_path / "pendulum.py").write_text(readme.split("```python\n")[1].split("```")[0])
    monkeypatch.chdir(tmp_path)
    run = command("run", "pendulum.py", "--set", "monte-carlo.samples=8")
    sys.modules.pop("pendulum", None)
    assert run.returncode == 0, run.stderr
    assert "tip_height" in run.stdout and "0 of 8" in run.stdout
    statistics = results.load(tmp_path / "results" / "results.nc")["monte-carlo/statistics"].to_dataset()
    assert statistics["mean"].dims == ("output", "time") and statistics.sizes["time"] == 201
    assert float(statistics["std"].max()) > 0
