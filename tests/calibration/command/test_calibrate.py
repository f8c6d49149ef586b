"""`uqmbd calibrate`: from files of records to a posterior, predictions and a report; every option is used."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.cli import commands
from uqmbd.testing import check_command
from uqmbd_calibration import Calibration, Record, Series
from uqmbd_calibration.command import Calibrate, running

STUDY = """
import chaospy, numpy as np, uqmbd
from uqmbd_collocation import Collocation
from uqmbd_springs import SpringDamper

mechanism = uqmbd.Mechanism("mass", uqmbd.Translational())
stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(100, 10), units="N/m")
damping = uqmbd.RandomVariable("damping", chaospy.Uniform(0.5, 1.5), units="N s/m")
mass = mechanism.body("mass", mass=1, position=(1, 0), velocity=(0.5, 0))
mechanism.add(
    SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=stiffness, damping=damping, free_length=1)
)
mechanism.output("way", mass.position[0], units="m")
mechanism.output("speed", mass.velocity[0], units="m/s")
study = uqmbd.Study("mass", mechanism, np.linspace(0, 3, 31), [Collocation(order=2), Collocation(order=3, label="third")])
"""

TRUTH = {"stiffness": 108.0, "damping": 0.9}
NOISE = 1e-3


def way(times):
    """The motion of a mass of 1 kg on a spring and a damper that both give way, in closed form."""
    decay = TRUTH["damping"] / 2
    frequency = np.sqrt(TRUTH["stiffness"] - decay**2)
    return 1 + 0.5 / frequency * np.exp(-decay * times) * np.sin(frequency * times)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a study and a record; the command is found without an installation."""
    point = importlib.metadata.EntryPoint("calibration", "uqmbd_calibration.command", "uqmbd.commands")
    found = plugins.load([point], group="uqmbd.commands")
    monkeypatch.setattr(plugins.registry, "registered_commands", lambda: found)
    commands.plugin_commands.cache_clear()
    monkeypatch.chdir(tmp_path)
    times = np.linspace(0, 2.9, 60)
    values = way(times) + NOISE * np.random.default_rng(3).standard_normal(60)
    lines = [f"{t!r},{x!r}" for t, x in zip(times.tolist(), values.tolist(), strict=True)]
    (tmp_path / "mass_study.py").write_text(STUDY)
    (tmp_path / "record.csv").write_text("\n".join(["time [s],way [m]", *lines, ""]))
    yield tmp_path
    commands.plugin_commands.cache_clear()


@pytest.mark.thorough
def test_a_record_leads_to_a_posterior_to_predictions_and_to_a_report(folder, command):
    done = command(
        "calibrate", "mass_study.py", "record.csv", "--noise", "way=0.001", "--out", "out", "--only", "third"
    )
    assert done.returncode == 0, done.stderr
    found = Calibration.load(folder / "out" / "calibration.nc")
    assert str(found) in done.stdout
    table = found.summary()
    for name, truth in TRUTH.items():
        one = table.sel(input=name)
        assert abs(float(one["mean"]) - truth) < 3.5 * float(one["sd"])
        assert float(one["reduction"]) > 0.9
    tree = uqmbd.results.load(folder / "out" / "results.nc")
    before, after = (tree[label]["statistics"].to_dataset() for label in ("third", "third, calibrated"))
    assert set(uqmbd.results.propagator_nodes(tree)) == {"third", "third, calibrated"}
    # what is known of the spring says where the mass will be
    late = {"time": -1, "output": 0}
    assert float(after["std"].isel(late)) < 0.1 * float(before["std"].isel(late))
    assert abs(float(after["mean"].isel(late)) - way(3.0)) < 5 * float(after["std"].isel(late))
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "third, calibrated" in page
    for name in ("calibration.nc", "results.nc", "report.html"):
        assert str(Path("out") / name) in done.stdout


@pytest.fixture
def asked(monkeypatch):
    """What `calibrate` is asked for, instead of doing it."""
    calls = []

    def calibrate(study, records, **options):
        calls.append((study, records, options))
        raise SystemExit(0)

    monkeypatch.setattr(running, "calibrate", calibrate)
    return calls


PLAIN = {"noise": "normal", "realisations": None, "seed": 0, "workers": 1, "progress": True}


def test_every_option_is_used(folder, command, asked):
    Record("tap", [Series("speed", [0.0, 1.0], [0.5, 0.1], "m/s", 0.2)], {}, "rig 2").write("tap.nc")
    Path("plain.csv").write_text("time,way\n0,1\n")
    assert command("calibrate", "mass_study.py", "record.csv").returncode == 0
    words = ["--noise", "way=0.001", "--units", "way=m", "--known", "damping=0.8", "--robust", "--realisations", "90"]
    words += ["--seed", "7", "--workers", "2", "--out", "elsewhere"]
    assert command("calibrate", "mass_study.py", "plain.csv", "tap.nc", *words).returncode == 0
    (study, records, options), (_, others, changed) = asked
    assert study.name == "mass" and options == PLAIN
    assert records == [Record.read("record.csv")]
    assert changed == {"noise": "student", "realisations": 90, "seed": 7, "workers": 2, "progress": True}
    assert others == [
        Record("plain", [Series("way", [0], [1], "m", 0.001)], {"damping": 0.8}),
        Record("tap", [Series("speed", [0.0, 1.0], [0.5, 0.1], "m/s", 0.2)], {"damping": 0.8}, "rig 2"),
    ]
    assert Path("elsewhere").is_dir() and Path("calibration").is_dir()


def test_methods_are_those_of_the_study_or_those_that_are_chosen(folder):
    study = uqmbd.load_study("mass_study.py")
    assert running.chosen_methods(study, ()) == list(study.propagators)
    assert running.chosen_methods(study, ("third",)) == [study.propagators[1]]
    (default,) = running.chosen_methods(study.with_propagators([]), ())
    assert default.node_name == "collocation"


UNUSABLE = {
    "The record none.csv does not exist": ["none.csv"],
    "The study script none.py does not exist": ["record.csv"],
    "is given twice": ["record.csv", "--noise", "way=1", "--noise", "way=2"],
    "expected NAME=VALUE": ["record.csv", "--noise", "way"],
    "'one' is not a finite number": ["record.csv", "--noise", "way=one"],
    "--noise contains 'wya', which is not a recorded output; did you mean 'way'?": ["record.csv", "--noise", "wya=1"],
    "--units contains 'force', which is not a recorded output": ["record.csv", "--units", "force=N"],
    "the units of 'way' are 'm' in the file and 'mm' in units=": ["record.csv", "--units", "way=mm"],
    "its noise is -1": ["record.csv", "--noise", "way=-1"],
    "--only fourth: the study has no method with this label": ["record.csv", "--only", "fourth"],
    "did you mean 'damping'?": ["record.csv", "--known", "dampnig=1"],
    "the units are 'mm' in the record and 'm' in the study": ["long.csv"],
    "two records have the name 'record'": ["record.csv", "record.csv"],
    "results.nc exists, but uqmbd": ["record.csv", "--out", "used"],
    "record.csv": ["record.csv", "--out", "record.csv"],
}


@pytest.mark.parametrize("message", UNUSABLE)
def test_what_cannot_be_used_is_reported_and_the_status_is_two(folder, command, message):
    Path("long.csv").write_text("time,way [mm]\n0,1\n")
    Path("used").mkdir()
    Path("used/results.nc").touch()
    script = "none.py" if "none.py" in message else "mass_study.py"
    done = command("calibrate", script, *UNUSABLE[message])
    assert done.returncode == 2 and done.stderr.startswith("Error: ")
    assert message in done.stderr and "Traceback" not in done.stderr


def test_a_command_line_that_is_incomplete_is_refused(folder, command):
    for words in ((), ("mass_study.py",), ("mass_study.py", "record.csv", "--seed", "x")):
        assert command("calibrate", *words).returncode == 2


@pytest.mark.thorough
def test_the_command_is_one():
    check_command(Calibrate, "uqmbd_calibration.command")


BROKEN = """
import dataclasses


@dataclasses.dataclass(frozen=True, kw_only=True)
class Broken(uqmbd.extend.Propagator):
    name = "broken"

    def propagate(self, problem):
        raise uqmbd.IntegrationError("it stopped")


study = study.with_propagators([Collocation(order=2), Broken()])
"""


@pytest.mark.thorough
def test_where_a_method_fails_the_others_are_reported_and_the_status_is_one(folder, command):
    Path("mass_study.py").write_text(STUDY + BROKEN)
    done = command("calibrate", "mass_study.py", "record.csv", "--noise", "way=0.001", "--out", "out")
    assert done.returncode == 1
    for label in ("broken", "broken, calibrated"):
        assert f"Error: the method {label} failed: it stopped" in done.stderr
    tree = uqmbd.results.load(folder / "out" / "results.nc")
    assert set(uqmbd.results.propagator_nodes(tree)) == {"collocation", "collocation, calibrated"}
    assert (folder / "out" / "report.html").exists() and (folder / "out" / "calibration.nc").exists()
