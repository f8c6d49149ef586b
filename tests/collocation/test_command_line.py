"""The command line: options, mistakes and warnings of a collocation as someone at a terminal sees them."""

from __future__ import annotations

import sys
import warnings

import pytest

from uqmbd.cli import main
from uqmbd.results import load, validate

STUDY = """
import chaospy, sympy
from uqmbd_collocation import Collocation

import uqmbd

a = uqmbd.RandomVariable("a", {distribution})
b = uqmbd.RandomVariable("b", chaospy.Uniform(0, 1))
mechanism = uqmbd.Mechanism("machine", uqmbd.Translational())
body = mechanism.body("body", mass=1, position=(0, 0))
mechanism.output("y", {function} + body.position[0], units="m")
study = uqmbd.Study("study", mechanism, [0, 1], [Collocation({options})])
"""


@pytest.fixture
def cli(tmp_path, monkeypatch, capsys):
    """Run the command line on a study script in an empty folder; return status, output and errors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    # what a report shows is tested with the reports
    monkeypatch.setattr("uqmbd.cli.run.run.write", lambda tree, path, **_: path)

    def run(command, *words, distribution="chaospy.Uniform(-1, 1)", function="a**2 + b", options="order=2"):
        text = STUDY.format(distribution=distribution, function=function, options=options)
        (tmp_path / "script.py").write_text(text)
        # in the tests warnings are errors; users see them as text
        with pytest.raises(SystemExit) as left, warnings.catch_warnings():
            warnings.simplefilter("default")
            main([command, "script.py", *words])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return left.value.code, captured.out, captured.err

    yield run
    sys.modules.pop("script", None)


@pytest.mark.thorough
def test_run_with_other_options(cli, tmp_path):
    status, out, err = cli("run", "--set", "collocation.order=4", "--set", "collocation.nodes=5,6")
    assert status == 0, err
    assert "collocation: 0 of 46" in err
    assert "collocation" in out
    tree = load(tmp_path / "results" / "results.nc")
    validate(tree)
    assert tree["collocation"].attrs["fit"] == "projection by Gauss tensor, 5 x 6 nodes"
    assert tree["collocation"].attrs["terms"] == 15


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"options": "order=-1"}, ["script.py, line", "order is -1"]),
        ({"options": "rule='gauss', samples=3"}, ["samples=3 cannot be combined with rule='gauss'"]),
        ({"distribution": "chaospy.Cauchy()"}, ["'a'", "Cauchy", "moments"]),
        ({"options": "method='regression', samples=5"}, ["10 terms", "5 samples"]),
        ({"options": "order=100"}, ["10201 nodes", "max_realisations = 5000"]),
    ],
    ids=str,
)
def test_mistakes_are_one_message(cli, change, words):
    status, out, err = cli("run", **change)
    # what cannot be written is unusable input; what the method cannot do with these inputs is a method that failed
    assert status == (2 if change.get("options") in ("order=-1", "rule='gauss', samples=3") else 1)
    assert out == ""
    assert err.count("Error: ") == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"distribution": "chaospy.Cauchy()"}, ["no: ", "'a'", "moments"]),
        ({"options": "method='regression', samples=5"}, ["no: ", "10 terms"]),
        ({"options": "order=2"}, ["yes", "order=2"]),
    ],
    ids=str,
)
def test_check_says_whether_it_fits(cli, change, words):
    status, out, err = cli("check", **change)
    assert (status, err) == (0, "")
    told = " ".join(out.split())
    for word in words:
        assert word in told


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("change", "lines"),
    [
        (
            {"function": "sympy.log(a + sympy.Rational(8, 10)) + b", "options": "order=3"},
            [
                "Warning: collocation: 4 of 16 nodes failed",
                "Warning: collocation: 5 of 18 verification realisations",
                "Warning: collocation: the stated error of the surrogate exceeds 10% of the standard deviation: 'y' ",
            ],
        ),
        (
            {"function": "sympy.Abs(a) + b", "options": "adaptive='order', max_realisations=58"},
            [
                "Warning: collocation: the tolerance 0.001 was not met with 55 realisations",
                "Warning: collocation: the stated error of the surrogate exceeds 10% of the standard deviation: 'y' ",
            ],
        ),
        (
            {"options": "rule='sobol', samples=512"},
            ["Warning: collocation: the rule (512 samples, sobol) integrates products of the 10 terms"],
        ),
    ],
    ids=["failures", "tolerance", "coarse"],
)
def test_warnings_are_one_line_each(cli, change, lines):
    status, _, err = cli("run", **change)
    assert status == 0
    told = ("uqmbd ", "loading ", "collocation: ", "writing the ")
    shown = [line for line in err.splitlines() if not line.startswith(told)]
    assert len(shown) == len(lines), err
    for line, expected in zip(shown, lines, strict=True):
        assert line.startswith(expected)
        assert ".py" not in line


@pytest.mark.thorough
def test_an_input_without_influence(cli):
    status, _, err = cli("run", function="a**2 + mechanism.body('other', mass=1 + b).mass * 0")
    assert status == 0
    (line,) = [line for line in err.splitlines() if line.startswith("Warning")]
    assert line.startswith("Warning: study 'study': no output depends on the random input 'b'")


def test_everything_failed(cli):
    status, out, err = cli("run", function="sympy.log(a - 2) + b")
    assert status == 1
    assert out == ""
    (line,) = [line for line in err.splitlines() if line.startswith("Error")]
    assert line.startswith("Error: collocation: 9 of 9 nodes failed")
    assert "an output is not finite" in line
