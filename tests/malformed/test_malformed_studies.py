"""A corpus of malformed studies: each is refused with its place, or computed; none fails in another way.

Every keyword of every call of four valid studies, and of every component that is installed, is given what it is not
made for (`mutations`).  They run in processes of their own, so that one that ends the process is seen.
"""

from __future__ import annotations

import sys
import warnings

import pytest

from uqmbd.cli.app import main

from .judged import complaint, run_isolated
from .mutations import cases
from .studies import BASES

CASES = cases()
COMPONENTS = [base for base in BASES if " in " in base]


def complaints(chosen):
    found = run_isolated(chosen)
    return [f"{case.name} => {wrong}" for case in chosen if (wrong := complaint(case, found[case.name]))]


def test_the_corpus_reaches_every_component_and_every_call():
    assert len(COMPONENTS) > 90
    assert {case.base for case in CASES} == set(BASES)
    assert len({case.key for case in CASES if " in " not in case.base}) > 20
    assert len({case.name for case in CASES}) == len(CASES) > 20_000


@pytest.mark.thorough
def test_what_cannot_be_used_is_refused_with_its_name():
    chosen = [case for case in CASES if case.fate == "refused"][::149]
    assert len(chosen) > 100
    assert not complaints(chosen)


@pytest.mark.slow
def test_what_may_be_meant_is_computed_or_refused():
    chosen = [case for case in CASES if case.fate == "either" and case.base in ("pendulum", "impact")][::61]
    assert len(chosen) > 3
    assert not complaints(chosen)


@pytest.mark.slow
@pytest.mark.parametrize("base", [base for base in BASES if base not in COMPONENTS])
def test_half_of_the_corpus_of_a_study(base):
    assert not complaints([case for case in CASES if case.base == base][::2])


@pytest.mark.slow
def test_a_part_of_the_corpus_of_every_component():
    assert not complaints([case for case in CASES if case.base in COMPONENTS][::29])


AT_A_TERMINAL = {
    "pendulum | planar body | names | misspelt": (2, "there is no argument 'names'; did you mean 'name'?"),
    "pendulum | planar body | mass | an undefined function": (2, "the function f is not defined"),
    "pendulum | planar body | position | with nan": (2, "body 'rod': position is"),
    "pendulum | MonteCarlo | label | two dots": (2, "label '..'"),
    "pendulum | MonteCarlo | max_failures | a text": (2, "MonteCarlo: max_failures is '0.1'"),
    "pendulum | Study | integrator | an array": (2, "integrator is "),
    "pendulum | output | expression | a derivative": (2, "For the rate of another expression"),
    "slider-crank | random_vector | names | a number": (2, "names is 2"),
    "slider-crank | step | x1 | nan": (2, "step: x1 is nan"),
    "pendulum | planar body | mass | 0": (0, ""),
}


@pytest.mark.parametrize("command", ["check", "run"])
@pytest.mark.parametrize(
    ("name", "status", "words"), [(n, *told) for n, told in AT_A_TERMINAL.items()], ids=AT_A_TERMINAL
)
def test_at_a_terminal_there_is_a_message_and_a_status(name, status, words, command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    if command == "run" and not status:
        pytest.skip("valid studies run elsewhere")
    (tmp_path / "malformed_script.py").write_text(
        f"from tests.malformed.mutations import named\nstudy = named({name!r}).study()\n"
    )
    with pytest.raises(SystemExit) as left, warnings.catch_warnings():
        warnings.simplefilter("default")
        main([command, "malformed_script.py"])
    heard = capsys.readouterr()
    assert left.value.code == status, heard.err
    assert words in heard.err.replace("\n", " ")
    assert "Traceback" not in heard.err and "mistake in uqmbd" not in heard.err


def test_a_computation_that_fails_has_another_status(tmp_path, monkeypatch, capsys):
    """A driver that is no number in the middle of the motion; a plugin's or a script's own exception is told with its place."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "failing_script.py").write_text(
        "import numpy as np, sympy, uqmbd, chaospy\n"
        "from uqmbd_montecarlo import MonteCarlo\n"
        "from uqmbd_springs import PointForce\n"
        "mechanism = uqmbd.Mechanism('m', uqmbd.Translational())\n"
        "k = uqmbd.RandomVariable('k', chaospy.Uniform(1, 2))\n"
        "body = mechanism.body('b', mass=k)\n"
        "mechanism.add(PointForce('push', body, (0, 0), (sympy.log(0.05 - uqmbd.t), 0)))\n"
        "mechanism.output('x', body.position[0])\n"
        "study = uqmbd.Study('s', mechanism, [0, 0.05, 0.1], [MonteCarlo(samples=4)])\n"
    )
    with pytest.raises(SystemExit) as left, warnings.catch_warnings():
        warnings.simplefilter("default")
        main(["run", "failing_script.py"])
    heard = capsys.readouterr()
    assert left.value.code == 1
    assert "4 of 4 samples failed" in heard.err and "Traceback" not in heard.err and "mistake in" not in heard.err
