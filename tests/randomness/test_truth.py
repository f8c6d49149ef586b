"""A quantity is no number: conditions, comparisons with NaN and conversions of Python report it and its replacement."""

from __future__ import annotations

import math
import operator
import subprocess
import sys

import chaospy
import numpy as np
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


QUANTITIES = [LENGTH, 2 * LENGTH, BODY.position[0], LENGTH + BODY.velocity[0], sympy.sin(uqmbd.t)]
UNREAL = [math.nan, np.float64("nan"), sympy.nan, sympy.zoo, 1j, sympy.sqrt(-2)]


@pytest.mark.parametrize("value", UNREAL, ids=repr)
@pytest.mark.parametrize("compare", [operator.lt, operator.le, operator.gt, operator.ge], ids=lambda x: x.__name__)
def test_a_comparison_with_a_value_that_is_not_real_names_both(compare, value):
    for quantity in QUANTITIES:
        for use in (
            lambda x: compare(x, value),
            lambda x: compare(value, x),
            lambda x: sympy.Piecewise((1, compare(x, value)), (0, True)),
            lambda x: uqmbd.first_time(compare(x, value)),
            lambda x: sympy.Max(x, value),
            lambda x: sympy.Min(1, value, x),
        ):
            with pytest.raises(
                uqmbd.StudyError, match=r"because .* is not (a number|real)\. Compare with a real"
            ) as caught:
                use(quantity)
            given = {str(value), str(sympy.sympify(value))}
            assert str(quantity) in str(caught.value) and any(x in str(caught.value) for x in given)


CONVERSIONS = {
    "float": float, "int": int, "complex": complex, "round": round, "trunc": math.trunc, "floor": math.floor,
    "sin": math.sin, "two places": lambda x: round(x, 2), "format": lambda x: f"{x:.3f}", "percent": lambda x: f"{x:%}",
    "array": lambda x: np.array([x, 1], dtype=float), "fill": lambda x: np.zeros(2).__setitem__(0, x),
}  # fmt: skip


@pytest.mark.parametrize("convert", CONVERSIONS.values(), ids=CONVERSIONS)
def test_a_conversion_to_a_number_names_the_quantity_and_the_replacement(convert):
    for quantity in QUANTITIES:
        with pytest.raises(uqmbd.StudyError, match="needs a number") as caught:
            convert(quantity)
        message = str(caught.value)
        assert message.startswith(f"{quantity} differs") and isinstance(caught.value, TypeError)
        assert (f"uqmbd.nominal({quantity})" in message) == (quantity.free_symbols == {LENGTH})


def test_numbers_and_symbols_of_others_convert_and_compare_as_before():
    x = sympy.Symbol("x")
    for use in (float, int, complex, round, math.trunc, lambda y: y > sympy.nan, lambda y: sympy.Max(y, sympy.nan)):
        with pytest.raises((TypeError, ValueError)) as caught:
            use(x)
        assert not isinstance(caught.value, uqmbd.StudyError)
    assert float(LENGTH - LENGTH + sympy.pi) == math.pi and int(sympy.pi) == 3 and f"{sympy.pi:.2f}" == "3.14"
    assert (
        f"{LENGTH}" == "length" and (LENGTH < sympy.oo) is not None and sympy.Max(LENGTH, 1, 2) == sympy.Max(LENGTH, 2)
    )


@pytest.mark.thorough
def test_python_alone_says_it(tmp_path):
    script = tmp_path / "study.py"
    script.write_text(
        "import chaospy, uqmbd\nlength = uqmbd.RandomVariable('length', chaospy.Normal(1, 0.1))\nif length > 1:\n    pass\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert "line 3" in done.stderr and "length > 1 has no truth value" in done.stderr
    assert "sympy.Piecewise" in done.stderr


def test_a_comparison_with_two_limits_is_two_requirements():
    with pytest.raises(uqmbd.StudyError, match=r"such as 1 <= x <= 2, as two requirements: 1 <= x, and x <= 2\."):
        1 <= BODY.position[0] <= 2  # noqa: B015 - the comparison raises


@pytest.mark.parametrize("compare", [operator.lt, operator.le, operator.gt, operator.ge], ids=lambda x: x.__name__)
def test_a_vector_is_not_compared_as_a_whole(compare):
    vector = sympy.Matrix([LENGTH, 2 * LENGTH])
    for sides in ((vector, 2), (2, vector), (LENGTH, vector), (vector, vector), (abs(vector), 1.5)):
        with pytest.raises(uqmbd.StudyError, match=r"is a vector \(2 entries\): .*expected a scalar") as caught:
            compare(*sides)
        assert isinstance(caught.value, TypeError) and "vector.norm()" in str(caught.value)
    with pytest.raises(uqmbd.StudyError, match=r"left side of <= is a vector \(2 entries\): length, 2\*length"):
        sympy.Le(vector, 2)
    plain = sympy.Matrix(sympy.symbols("a b"))
    with pytest.raises(TypeError) as caught:
        compare(plain, 2)
    assert not isinstance(caught.value, uqmbd.StudyError)


@pytest.mark.parametrize("several", [[LENGTH <= 1, LENGTH >= 0], sympy.Matrix([LENGTH, 1])], ids=["list", "vector"])
def test_a_requirement_has_one_relation(several):
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    with pytest.raises(uqmbd.StudyError, match="(?s)requirement 'both': the argument is a sequence, .*for each entry"):
        mechanism.require("both", several)
