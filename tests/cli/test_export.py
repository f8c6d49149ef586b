"""`uqmbd export`: mistakes are one message each, before a method runs; stored results are used."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.cli.check import show_check
from uqmbd.cli.export import export_study
from uqmbd.results import save

STUDY = """
import chaospy
import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
stone = mechanism.body("stone", mass=1, velocity=speed)
mechanism.output("height", stone.position[0], units="m")
study = uqmbd.Study("throw", mechanism, [0, 1, 2], [MonteCarlo(samples=8), Collocation(order=1)])
"""


@dataclasses.dataclass(frozen=True)
class Means:
    """Writes means."""

    name = "means"
    suffix = ".means"
    exports = ("surrogate",)

    digits: int = 6
    loud: bool = False
    why: str = ""

    def refusal(self, what: str, study: Any) -> str:
        return self.why

    def export(self, source: Any, path: Path, study: Any) -> str:
        path.write_text(str(uqmbd.results.surrogate(source).mean.round(self.digits).tolist()))
        return f"{study.name} {self.loud}"


@pytest.fixture
def export(monkeypatch, tmp_path, capsys):
    """Export a study by the exporter `Means`."""
    monkeypatch.setattr(plugins, "exporters", lambda: {"means": Means})
    script = tmp_path / "throw.py"
    script.write_text(STUDY)

    def run(*words, to="a.means", what=None, method=None, results=None):
        export_study(script, to=tmp_path / to, what=what, method=method, results=results, words=words)
        return capsys.readouterr().out, (tmp_path / to).read_text()

    return run


def test_the_method_runs_and_options_are_set(export):
    assert export("--digits", "2", "--loud", method="collocation") == ("throw True\n", "[[0.0, 3.0, 6.0]]")
    assert export("--digits=1", "--loud=no", method="collocation")[0] == "throw False\n"


@pytest.mark.thorough
def test_stored_results_are_used(export, tmp_path):
    study = uqmbd.load_study(tmp_path / "throw.py")
    tree = study.run()
    save(tree, tmp_path / "results.nc")
    assert export(results=tmp_path)[1] == "[[0.0, 3.0, 6.0]]"  # Monte Carlo has no surrogate
    with pytest.raises(uqmbd.StudyError, match="contains no surrogate"):
        export(results=tmp_path, method="monte-carlo")
    with pytest.raises(uqmbd.StudyError, match="no such method.*did you mean 'collocation'"):
        export(results=tmp_path, method="collocatoin")
    (tmp_path / "throw.py").write_text(STUDY.replace('Study("throw"', 'Study("fall"'))
    with pytest.raises(uqmbd.StudyError, match="belong to study 'throw', not 'fall'"):
        export(results=tmp_path)


MISTAKES = {
    "ending": ((), {"to": "a.txt"}, r"no exporter writes files with this ending.*\.means \(means\)"),
    "no name": ((), {"to": ".means"}, "no exporter writes"),
    "folder": ((), {"to": "no/a.means"}, "does not exist; create it"),
    "object": ((), {"what": "mechanism"}, "exports surrogate only"),
    "several methods": ((), {}, "2 methods; select.*--method LABEL.*monte-carlo, collocation"),
    "method": ((), {"method": "galerkin"}, "no such method"),
    "results": ((), {"results": Path("/nowhere")}, "expected the folder of a run"),
    "option": (("--digit", "2"), {}, "no such option; did you mean 'digits'.*--digits: int"),
    "word": (("digits",), {}, "no such option"),
    "value": (("--digits", "two"), {}, "--digits two: expected int"),
    "missing value": (("--digits",), {}, "--digits has no value; expected int"),
    "refusal": (("--why", "it is empty."), {"method": "collocation"}, r"cannot be exported to \.means: it is empty"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_a_message(mistake, export):
    words, options, text = MISTAKES[mistake]
    with pytest.raises(uqmbd.StudyError, match=text):
        export(*words, **options)


def test_classes_that_are_no_exporters_are_refused():
    problem = plugins.KINDS["exporters"].problem
    assert problem(Means) == ""
    for name, value, text in (
        ("suffix", "fmu", "ending of its files"),
        ("exports", ("movie",), "some of"),
        ("exports", (), "some of"),
        ("__dataclass_fields__", None, "not a dataclass"),
    ):
        wrong = {k: v for k, v in vars(Means).items() if k in ("name", "suffix", "exports", "export", name)} | {
            name: value
        }
        if value is None:
            del wrong[name]
        assert text in problem(type("Wrong", (), wrong)), name


@pytest.mark.parametrize(
    ("methods", "expected"),
    [
        ("MonteCarlo(samples=8)", "no: no method of the study computes a surrogate; add one that does, such as "),
        ("Collocation(order=1)", "yes: uqmbd export --to FILE.means --what surrogate\n"),
        ("MonteCarlo(samples=8), Collocation(order=1)", "FILE.means --what surrogate --method collocation\n"),
    ],
)
def test_the_check_says_which_methods_have_a_surrogate(methods, expected, export, tmp_path, capsys):
    script = tmp_path / "throw.py"
    script.write_text(STUDY.replace("MonteCarlo(samples=8), Collocation(order=1)", methods))
    show_check(script)
    assert expected in capsys.readouterr().out
