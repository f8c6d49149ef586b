"""A relation between quantities has no truth value: the error says so, wherever it is used as a condition."""

from __future__ import annotations

import subprocess
import sys

import chaospy
import pytest
import sympy

import uqmbd

LENGTH = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.1), units="m")
BODY = uqmbd.Mechanism("m", uqmbd.Line()).body("b", mass=1)

RELATIONS = [
    LENGTH > 1, LENGTH <= 1.5, 2 * LENGTH < 3, LENGTH**2 >= LENGTH, sympy.sin(LENGTH) > uqmbd.t, uqmbd.t >= 1,
    BODY.position[0] > 0, BODY.velocity[0] <= LENGTH,
]  # fmt: skip


@pytest.mark.parametrize("relation", RELATIONS, ids=str)
def test_a_relation_is_no_condition(relation):
    for use in (bool, lambda x: 1 if x else 2, lambda x: not x, lambda x: x and True, lambda x: [1 for _ in "a" if x]):
        with pytest.raises(uqmbd.StudyError, match="has no truth value.*sympy.Piecewise.*uqmbd.nominal") as caught:
            use(relation)
        assert str(caught.value).startswith(str(relation)) and isinstance(caught.value, TypeError)


@pytest.mark.parametrize(
    "use", [lambda x: max(x, 1), lambda x: min(2, x), lambda x: 0 < x < 2, lambda x: sorted([x, 1])]
)
def test_neither_in_functions_of_python(use):
    for value in (LENGTH, 2 * LENGTH, BODY.position[0]):
        with pytest.raises(uqmbd.StudyError, match="no truth value"):
            use(value)


def test_relations_of_others_and_decided_ones_are_as_before():
    x = sympy.Symbol("x")
    with pytest.raises(TypeError, match="cannot determine truth value") as caught:
        bool(x > 1)
    assert not isinstance(caught.value, uqmbd.StudyError)
    assert sympy.Integer(2) > 1 and LENGTH == LENGTH and (LENGTH - LENGTH >= 0)
    # SymPy expects a TypeError of itself, and goes on
    assert sympy.Max(LENGTH, 1).has(LENGTH) and sympy.Piecewise((1, LENGTH > 1), (0, True)).has(LENGTH)


@pytest.mark.thorough
def test_python_alone_says_it(tmp_path):
    script = tmp_path / "study.py"
    script.write_text(
        "import chaospy, uqmbd\nlength = uqmbd.RandomVariable('length', chaospy.Normal(1, 0.1))\nif length > 1:\n    pass\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert "line 3" in done.stderr and "length > 1 has no truth value" in done.stderr
    assert "sympy.Piecewise" in done.stderr
