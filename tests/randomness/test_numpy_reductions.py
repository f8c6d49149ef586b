"""NumPy reduces arrays: a statistic of one expression is refused, and arithmetic of arrays and expressions is not."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd

X = uqmbd.RandomVariable("X", chaospy.Normal(1, 0.1), units="m")
BODY = uqmbd.Mechanism("m", uqmbd.Translational(gravity=(0, -9.81))).body("b", mass=1, velocity=(1, 0))
PLACE = BODY.position[0]
EXPRESSIONS = {
    "symbol": PLACE,
    "sum": PLACE + 2,
    "product": 2 * PLACE,
    "function": sympy.sin(PLACE),
    "mixed": X * PLACE,
}
WRITTEN = {
    "max": "uqmbd.maximum(",
    "amax": "uqmbd.maximum(",
    "nanmax": "uqmbd.maximum(",
    "min": "uqmbd.minimum(",
    "nanmin": "uqmbd.minimum(",
    "ptp": "uqmbd.maximum(",
    "argmax": "uqmbd.time_of_maximum(",
    "argmin": "uqmbd.time_of_minimum(",
    "mean": "uqmbd.integral(",
    "average": "uqmbd.integral(",
    "nanmean": "uqmbd.integral(",
    "sum": "uqmbd.integral(",
    "trapezoid": "uqmbd.integral(",
    "std": "uqmbd.root_mean_square(",
    "var": "uqmbd.root_mean_square(",
    "median": "declare it with uqmbd.extend.summary",
    "cumsum": "a summary of the motion",
    "prod": "a summary of the motion",
    "gradient": "a summary of the motion",
    "diff": "a summary of the motion",
    "sort": "a summary of the motion",
    "unique": "a summary of the motion",
    "any": "a summary of the motion",
    "all": "a summary of the motion",
    "count_nonzero": "a summary of the motion",
    "nan_to_num": "a summary of the motion",
    "clip": "sympy.Min(",
    "round": "a summary of the motion",
}


@pytest.mark.parametrize("name", WRITTEN)
def test_a_statistic_of_one_expression_is_refused(name):
    for expression in EXPRESSIONS.values():
        with pytest.raises(uqmbd.StudyError) as caught:
            getattr(np, name)(expression)
        assert WRITTEN[name] in str(caught.value) and f"numpy.{name}" in str(caught.value)


@pytest.mark.parametrize("function", [np.percentile, np.quantile, np.nanpercentile, np.nanquantile])
def test_percentiles_name_the_function_that_declares_them(function):
    for expression in EXPRESSIONS.values():
        with pytest.raises(uqmbd.StudyError, match="uqmbd.extend.summary"):
            function(expression, 0.5)


@pytest.mark.parametrize("function", [np.add, np.multiply, np.maximum, np.minimum, np.hypot, np.logical_or])
@pytest.mark.parametrize("method", ["reduce", "accumulate"])
def test_reductions_by_ufuncs_are_refused(function, method):
    for expression in EXPRESSIONS.values():
        with pytest.raises(uqmbd.StudyError, match=f"numpy.{function.__name__}: the argument is"):
            getattr(function, method)(expression)


def test_norms_and_transforms_are_refused():
    for function in (np.linalg.norm, np.fft.fft, np.fft.rfft):
        with pytest.raises(uqmbd.StudyError, match="instead of an array of values over time"):
            function(2 * PLACE)


def test_statistics_of_random_expressions_name_the_study():
    for expression in (X, 2 * X, sympy.exp(X)):
        for function in (np.mean, np.std, np.max, np.median):
            with pytest.raises(uqmbd.StudyError, match="declare the expression as an output"):
                function(expression)


def test_elementary_functions_of_expressions_name_sympy():
    for function in (np.sin, np.sqrt, np.exp):
        with pytest.raises(uqmbd.StudyError, match=f"Write sympy.{function.__name__}"):
            function(2 * PLACE)


def test_arithmetic_and_arrays_are_as_before():
    """Arrays times expressions, sums over arrays of expressions, and shapes give what SymPy gives entry by entry."""
    times = np.array([0.0, 0.5, 2.0])
    for e in EXPRESSIONS.values():
        assert (times * e).tolist() == [x * e for x in times.tolist()] == (e * times).tolist()
        assert (times + e).tolist() == [x + e for x in times.tolist()]
        assert (e - times).tolist() == [e - x for x in times.tolist()]
        assert (times**2 / e).tolist() == [x**2 / e for x in times.tolist()]
        assert np.float64(2) * e == 2.0 * e and np.float64(1) / e == 1.0 / e and np.float64(2) ** e == 2.0**e
        assert isinstance(np.float64(2) * e, sympy.Expr)
        assert np.array([e, e]).sum() == 2 * e and np.sum([e, PLACE]) == e + PLACE and np.mean([e, -e]) == 0
        assert np.dot([1, 2], np.array([e, e])) == 3 * e and np.stack([e, e]).tolist() == [e, e]
        assert np.shape(e) == () and np.ndim(e) == 0 and np.where([True, False], e, 0).tolist() == [e, 0]
        assert np.abs(e) == abs(e) and np.full(2, e).tolist() == [e, e]


def test_expressions_of_others_are_as_before():
    y = sympy.Symbol("y")
    assert np.max(y) is y and np.mean(2 * y) == 2 * y and np.add.reduce(y) == y
    assert np.max(sympy.Float(2.5)) == 2.5 and np.sum(sympy.Integer(3)) == 3
