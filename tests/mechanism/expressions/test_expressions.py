"""What stands in an expression is computed, or refused where it was written, with what to write instead."""

from __future__ import annotations

import math
import re
import warnings

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.mechanism.expressions.computable import FUNCTIONS, WITHOUT_DERIVATIVE
from uqmbd_springs import PointForce

variable = uqmbd.RandomVariable("stiffness of the spring", chaospy.Uniform(0.4, 0.6), "N/m")
undefined = sympy.Function("f")
x = sympy.Symbol("x")


class Spring(uqmbd.Component):
    """A spring to the origin, whose energy is stated in some way."""

    bodies = ("body",)
    k = uqmbd.Parameter("N/m", "stiffness")
    law = uqmbd.Parameter("", "anything", kind="option", default=None)
    state = staticmethod(lambda self, p, r: p.k * r.dot(r) / 2)

    def terms(self, p):
        yield uqmbd.Potential(type(self).state(self, p, p.body.position))


def falling():
    mechanism = uqmbd.Mechanism("falling", uqmbd.Translational(gravity=(0, -10)))
    mechanism.body("stone", mass=1, position=(0.5, 0.25))
    mechanism.output("x", mechanism.bodies["stone"].position[0], units="m")
    return mechanism, mechanism.bodies["stone"]


def spring_stated(how):
    return type("Stated", (Spring,), {"state": staticmethod(how)})


WRONG_TERMS = {
    "the time": (lambda self, p, r: uqmbd.t * r[0], ["uqmbd.t", "p.time"]),
    "a parameter of self": (lambda self, p, r: self.k * r.dot(r), ["self.k", "use p.k"]),
    "a random option": (lambda self, p, r: p.law * r.dot(r), ["stiffness of the spring", "option 'law'", "p.law"]),
    "a random variable": (lambda self, p, r: variable * uqmbd.t**0 * r.dot(r) + variable * r[0], ["stiffness of the spring", "uqmbd.Parameter"]),
    "a body": (lambda self, p, r: self.attached["body"].position[0] * p.k, ["stone.x", "p.body"]),
    "a foreign symbol": (lambda self, p, r: x * r[0], ["symbol x", "quantities of p"]),
    "an undefined function": (lambda self, p, r: undefined(r[0]), ["f(", "not defined"]),
    "an integral": (lambda self, p, r: sympy.Integral(sympy.exp(-(x**2)), (x, 0, r[0])), ["Integral", ".doit()"]),
    "a step without derivative": (lambda self, p, r: sympy.floor(r[0]), ["floor", "piecewise"]),
    "a number of NumPy's": (lambda self, p, r: np.sin(p.k * r[0]), ["raised TypeError", "test_expressions.py, line"]),
    "a text": (lambda self, p, r: "r", ["'r'", "not an expression"]),
    "nothing there": (lambda self, p, r: p.stiffness, ["raised AttributeError", "stiffness"]),
}  # fmt: skip


@pytest.mark.parametrize(("how", "words"), WRONG_TERMS.values(), ids=WRONG_TERMS)
def test_terms_that_mean_nothing_name_the_component_and_the_remedy(how, words):
    mechanism, stone = falling()
    mechanism.add(spring_stated(how)("holder", stone, 2.0, law=variable))
    with pytest.raises(uqmbd.StudyError) as caught:
        uqmbd.simulate(mechanism, [0, 0.1])
    assert "'holder'" in str(caught.value)
    for word in words:
        assert word in str(caught.value)


SLIPS = {
    "a misspelt parameter": (lambda self, p: p.stifness, "no attribute 'stifness'; did you mean 'stiffness'"),
    "the time": (lambda self, p: p.t, "the time is p.time"),
    "a choice of Python": (lambda self, p: min(p.stiffness, p.body.position[0]), r"line \d+\)\. Python's if, .* sympy.Piecewise"),
    "a function of math": (lambda self, p: math.sqrt(p.stiffness), "sympy.sqrt instead of math.sqrt"),
    "a function of NumPy": (lambda self, p: np.sqrt(p.stiffness * p.body.position[0]), "sympy.sqrt instead of numpy.sqrt"),
}  # fmt: skip


@pytest.mark.parametrize(("slip", "words"), SLIPS.values(), ids=SLIPS)
def test_a_slip_in_terms_is_reported_with_its_line_and_what_to_write(slip, words):
    class Slip(uqmbd.Component):
        bodies = ("body",)
        stiffness = uqmbd.Parameter("N/m", "spring rate")

        def terms(self, p):
            yield uqmbd.Potential(slip(self, p))

    mechanism, stone = falling()
    mechanism.add(Slip("slip", stone, 2.0))
    with pytest.raises(
        uqmbd.StudyError, match=r"Slip 'slip': terms\(\) raised .*\(test_expressions.py, line.*"
    ) as caught:
        uqmbd.simulate(mechanism, [0, 0.1])
    assert re.search(words, str(caught.value))


def test_a_component_without_terms_is_reported():
    class Silent(uqmbd.Component):
        bodies = ("body",)

        def terms(self, p):
            p.body.position.dot(p.body.position)

    mechanism, stone = falling()
    mechanism.add(Silent("silent", stone))
    with pytest.raises(
        uqmbd.StudyError, match=r"Silent 'silent': terms\(\) raised TypeError.*The method terms\(\) must yield terms"
    ):
        uqmbd.simulate(mechanism, [0, 0.1])


def test_objects_of_one_type_with_other_values_do_not_share_numbers():
    """Terms are asked for once for all objects of a type, so that a number taken from `self` would be that of the first."""
    mechanism, stone = falling()
    heavy = mechanism.body("heavy", mass=1, position=(0.5, 0))
    mechanism.output("heavy x", heavy.position[0], units="m")
    for name, body, k in (("a", stone, 4.0), ("b", heavy, 9.0)):
        mechanism.add(Spring(name, body, k))
    found = uqmbd.simulate(mechanism, np.linspace(0, 0.5, 3), rtol=1e-9)
    np.testing.assert_allclose(found["x"], 0.5 * np.cos(2 * found["time"]), atol=1e-7)
    np.testing.assert_allclose(found["heavy x"], 0.5 * np.cos(3 * found["time"]), atol=1e-7)


BY_NUMPY = {
    "the time": (lambda: np.sin(uqmbd.t), "sympy.sin"),
    "a random variable": (lambda: np.exp(variable), "sympy.exp"),
    "a position": (lambda: np.sqrt(falling()[1].position[0]), "sympy.sqrt"),
    "an array": (lambda: np.arctan(np.array([uqmbd.t, variable])), "sympy.atan"),
    "two": (lambda: np.arctan2(uqmbd.t, 2), "sympy.atan2"),
    "a frequency": (lambda: np.log10(uqmbd.eigenfrequency(1)), "log(x, 10)"),
}


@pytest.mark.parametrize(("make", "word"), BY_NUMPY.values(), ids=BY_NUMPY)
def test_functions_of_numpy_name_those_of_sympy(make, word):
    with pytest.raises(uqmbd.StudyError, match="numpy") as caught:
        make()
    assert word in str(caught.value)


@pytest.mark.parametrize("text", ["np.sin(2 * uqmbd.t)", "math.sin(uqmbd.t)"])
def test_a_script_that_gives_an_expression_to_a_function_of_numbers_is_referred_to_sympy(tmp_path, text):
    from uqmbd.propagation.studies.script import load_study

    script = tmp_path / "expression_study.py"
    script.write_text(f"import math\nimport numpy as np, uqmbd\nstudy = {text}\n")
    with pytest.raises(uqmbd.StudyError, match=r"line 3:\n.*(?s:.)*sympy\.sin"):
        load_study(script)


def every_function():
    """Functions of SymPy with the number of arguments that each takes."""
    found = {}
    for name in sorted(vars(sympy.functions)):
        function = getattr(sympy, name, None)
        if isinstance(function, type) and issubclass(function, sympy.Function):
            for count in (1, 2, 3):
                if count in (function.nargs or ()):
                    found[name] = (function, count)
                    break
    return found


@pytest.mark.filterwarnings("ignore::uqmbd.UnitsWarning")  # a place is taken for a number
@pytest.mark.parametrize(("function", "count"), every_function().values(), ids=every_function())
def test_every_function_of_sympy_is_computed_or_refused_by_name(function, count):
    """The oracle is SymPy itself, at the same number."""
    mechanism, stone = falling()
    try:
        value = function(stone.position[0], *[sympy.Rational(1, 3)] * (count - 1))
        function(sympy.Rational(1, 2), *[sympy.Rational(1, 3)] * (count - 1))
    except (AttributeError, TypeError, ValueError):
        return  # of whole numbers only
    if not isinstance(value, sympy.Expr) or not value.free_symbols:
        return
    try:
        mechanism.output("y", value)
    except uqmbd.StudyError as error:
        assert function not in FUNCTIONS
        assert str(error).startswith("output 'y'")  # noqa: PT017 - other examples of the property raise nothing
        return
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "simulate 'falling': an output is not finite: 'y' is nan at t = 0 s")
        found = float(uqmbd.simulate(mechanism, [0, 0.1])["y"][0])
    exact = complex(value.subs(stone.position[0], sympy.Rational(1, 2)).evalf())
    if exact.imag:
        assert np.isnan(found)
    else:
        assert found == pytest.approx(exact.real, rel=1e-12)


def test_what_has_no_derivative_may_depend_on_time_in_a_force():
    mechanism, stone = falling()
    mechanism.add(PointForce("push", stone, (0, 0), (sympy.floor(10 * uqmbd.t + 1), 0)))
    assert sympy.floor in WITHOUT_DERIVATIVE
    assert np.isfinite(uqmbd.simulate(mechanism, [0, 0.01, 0.02])["x"]).all()


CONSTANTS = {
    "an integral": (sympy.Integral(sympy.exp(-(x**2)), (x, 0, sympy.oo)), np.sqrt(np.pi) / 2),
    "a sum": (sympy.Sum(1 / x**2, (x, 1, sympy.oo)), np.pi**2 / 6),
    "a special function": (sympy.besselj(0, sympy.Rational(1, 2)), 0.938469807240813),
}


@pytest.mark.parametrize(("given", "value"), CONSTANTS.values(), ids=CONSTANTS)
def test_a_constant_is_its_value_however_it_is_written(given, value):
    mechanism = uqmbd.Mechanism("falling", uqmbd.Translational(gravity=(0, given)))
    stone = mechanism.body("stone", mass=given, position=(given, 0))
    mechanism.output("x", stone.position[0])
    mechanism.output("y", stone.acceleration[1])
    found = uqmbd.simulate(mechanism, [0, 0.1])
    assert float(found["x"][0]) == pytest.approx(value, rel=1e-12)
    assert float(found["y"][0]) == pytest.approx(value, rel=1e-12)
