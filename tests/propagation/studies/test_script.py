"""Study scripts: what a user gets wrong in one is told in the script's own lines."""

from __future__ import annotations

import pickle
import subprocess
import sys
import textwrap

import pytest

import uqmbd
from uqmbd.propagation.studies.script import load_study


class FakeStudy:
    """Stands for a study; scripts make one without a mechanism."""

    def __init__(self, name="fake", function=None):
        self.name = name
        self.function = function


@pytest.fixture(autouse=True)
def fake_study(monkeypatch):
    """Take any `FakeStudy` for a study, and forget modules and folders of scripts after the test."""
    monkeypatch.setattr(uqmbd, "Study", FakeStudy, raising=False)
    monkeypatch.setattr("uqmbd.propagation.studies.script.Study", FakeStudy)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)
    yield
    for name in set(sys.modules) - before:
        if getattr(sys.modules[name], "__file__", None) and "pytest-of" in str(sys.modules[name].__file__):
            del sys.modules[name]


@pytest.fixture
def script(tmp_path):
    """Write a script of this text and return its path."""

    def write(text, name="my_script.py"):
        path = tmp_path / name
        path.write_text(textwrap.dedent(text).lstrip())
        return path

    return write


def message(path):
    with pytest.raises(uqmbd.StudyError) as caught:
        load_study(path)
    return str(caught.value)


def test_study_is_returned(script):
    path = script("import uqmbd\nstudy = uqmbd.Study('a')\n")
    assert load_study(path).name == "a"


def test_functions_of_the_script_can_be_pickled(script):
    path = script("""
        import uqmbd

        def double(x):
            return 2 * x

        study = uqmbd.Study(function=double)
        """)
    function = load_study(path).function
    assert pickle.loads(pickle.dumps(function)) is function


def test_functions_of_the_script_reach_a_process_that_was_not_forked(script):
    """Such a process has the path of its parent, and imports the module by its name."""
    source = "def double(x):\n    return 2 * x\n"
    path = script(source + "import uqmbd\nstudy = uqmbd.Study(function=double)\n")
    pickled = pickle.dumps(load_study(path).function).hex()
    path.write_text(source)  # the fake study is unknown in the other process
    code = "import pickle, sys; sys.path[:] = eval(sys.argv[1]); print(pickle.loads(bytes.fromhex(sys.argv[2]))(21))"
    command = [sys.executable, "-c", code, repr(sys.path), pickled]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.stdout.strip() == "42", run.stderr


def test_neighbouring_modules_can_be_imported(script):
    script("VALUE = 'from the neighbour'\n", name="script_neighbour.py")
    path = script("import uqmbd, script_neighbour\nstudy = uqmbd.Study(script_neighbour.VALUE)\n")
    assert load_study(path).name == "from the neighbour"


def test_script_named_like_a_library_does_not_replace_it(script):
    import json

    path = script("import uqmbd\nstudy = uqmbd.Study(__name__)\n", name="json.py")
    assert load_study(path).name.startswith("uqmbd_study_json_")
    assert sys.modules["json"] is json


def test_script_is_read_again_when_it_changed(script):
    load_study(script("import uqmbd\nstudy = uqmbd.Study('first')\n"))
    assert load_study(script("import uqmbd\nstudy = uqmbd.Study('second')\n")).name == "second"


def test_missing_file_lists_its_neighbours(script, tmp_path):
    script("", name="crank.py")
    text = message(tmp_path / "krank.py")
    assert "does not exist" in text and "krank.py" in text and "crank.py" in text.split("Python files in")[1]


def test_folder_and_other_files(tmp_path):
    assert "is a folder" in message(tmp_path)
    other = tmp_path / "study.txt"
    other.write_text("")
    assert "is not a Python file" in message(other)


def test_no_study(script):
    assert "has no module-level `study`" in message(script("x = 1\n"))
    hinted = message(script("import uqmbd\nproblem = uqmbd.Study()\n"))
    assert "It contains the study 'problem'; rename this variable to study." in hinted


def test_study_of_another_type(script):
    text = message(script("study = 3\n"))
    assert "`study` is 3 (of type int); expected a uqmbd.Study" in text


def test_script_that_raises_shows_its_own_line(script):
    path = script("""
        def ratio(a, b):
            return a / b

        study = ratio(1, 0)
        """)
    text = message(path)
    assert text == f"{path}, line 2, in ratio:\n    return a / b\nZeroDivisionError: division by zero"


def test_script_that_raises_inside_a_library_shows_the_line_that_called_it(script):
    path = script("import json\nstudy = json.loads('{')\n")
    text = message(path)
    assert text.startswith(f"{path}, line 2:\n    study = json.loads('{{')\n") and "JSONDecodeError" in text
    assert "decoder.py" not in text


def test_message_of_a_study_error_is_not_decorated(script):
    path = script("import uqmbd\nraise uqmbd.StudyError('the mass is negative')\n")
    assert message(path).endswith("\nthe mass is negative")


def test_statement_over_several_lines_is_shown_whole(script):
    path = script("study = dict(\n    [1],\n)\n")
    assert "    study = dict(\n        [1],\n    )\nTypeError" in message(path)


def test_syntax_error(script):
    path = script("x = 1\nstudy = (1,\n")
    text = message(path)
    assert text.startswith(f"{path}, line 2:\n    study = (1,") and "SyntaxError: '(' was never closed" in text


def test_missing_module(script):
    path = script("import no_such_module_at_all\n")
    text = message(path)
    assert "line 1:" in text and "No module named 'no_such_module_at_all'" in text


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("from uqmbd import Mechansim", "'Mechanism'"),
        ("from uqmbd.laws import lenght", "'length'"),
        ("import uqmbd_sprngs", "'uqmbd_springs'"),
        ("import nmupy", "'numpy'"),
        ("import uqmbd.lwas", "'laws'"),
        ("from math import cso", "'cos'"),
    ],
)
def test_a_misspelt_import_comes_with_what_it_may_mean(script, line, meant):
    told = message(script(line))
    assert f"did you mean {meant}?" in told and told.lower().count("did you mean") == 1, told


@pytest.mark.parametrize(
    ("line", "relation"),
    [
        ("value = 1 if length > 1 else 2", "length > 1"),
        ("value = max(length, 1)", "length < 1"),
        ("assert 0 < length < 2", "length > 0"),
        ("while uqmbd.t <= length: pass", "t <= length"),
    ],
)
def test_a_comparison_of_random_variables_says_what_to_write(script, line, relation):
    text = f"import chaospy\nimport uqmbd\nlength = uqmbd.RandomVariable('length', chaospy.Normal(1, 0.1))\n{line}\n"
    told = message(script(text))
    assert "line 4:" in told and f"\n{relation} has no truth value" in told, told
    assert "sympy.Piecewise" in told and "uqmbd.nominal(" in told


def test_script_that_exits(script):
    assert "exited (SystemExit: 3)" in message(script("import sys\nsys.exit(3)\n"))


def test_failure_leaves_nothing_behind(script):
    path_before = list(sys.path)
    message(script("raise ValueError('no')\n", name="script_that_fails.py"))
    assert "script_that_fails" not in sys.modules
    assert sys.path == path_before


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("rocker.angel", "'Body' object has no attribute 'angel'; did you mean 'angle'?"),
        ("rockr.angle", "name 'rockr' is not defined; did you mean 'rocker'?"),
        ("ragne(3)", "name 'ragne' is not defined; did you mean 'range'?"),
        ("numpy.linspce(0, 1)", "did you mean 'linspace'?"),
    ],
)
def test_a_misspelt_name_comes_with_what_it_may_mean(script, line, meant):
    text = script(f"""
        import numpy
        import uqmbd
        rocker = uqmbd.Mechanism("m", uqmbd.Planar()).body("rocker", mass=1, inertia=1)
        value = {line}
        study = uqmbd.Study("a")
    """)
    assert meant in (told := message(text)) and told.lower().count("did you mean") == 1
