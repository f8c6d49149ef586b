"""Every function that expressions may contain is computed: against mpmath, and for NaN, infinities and signed zeros."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
import scipy.special
import symengine as se
import sympy
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.compiled import compile_kernel
from uqmbd.dynamics.equations import plain
from uqmbd.mechanism.expressions.computable import FUNCTIONS
from uqmbd_springs import PointForce

X, Y = sympy.symbols("x y", real=True)
ONE = [f for f in FUNCTIONS if f not in (sympy.atan2, sympy.Max, sympy.Min, sympy.Piecewise)]
POINTS = np.array(
    [[0.37, 1.9, -0.61, 2.7, 0.055, -3.3, 12.5, -0.93], [1.3, -0.42, 0.77, -2.2, 0.0625, 3.3, 0.6, -7.1]]
).T


class Outside(Exception):
    """A number leaves the range of double precision on the way."""


def compiled(expressions: list[sympy.Expr], points: np.ndarray) -> np.ndarray:
    return compile_kernel(se.symbols("x y"), [se.sympify(plain(e)) for e in expressions])(points)


def exact(e: sympy.Basic, point: dict[sympy.Symbol, float], blur: Callable[[], float]) -> mpmath.mpf | bool | None:
    """Evaluate by mpmath with 40 digits, each operation blurred; what is not real is NaN, as everything made of it.

    Truth values are those of Kleene's logic: None where what is not real decides.
    """
    if isinstance(e, sympy.Symbol):
        return mpmath.mpf(point[e])
    if isinstance(e, sympy.Number | sympy.NumberSymbol):
        return mpmath.mpf(sympy.N(e, 40)._to_mpmath(160)) if e.is_finite else mpmath.mpf(str(e))
    if e in (sympy.true, sympy.false):
        return bool(e)
    if isinstance(e, sympy.Piecewise):
        for v, c in e.args:
            if (truth := exact(c, point, blur)) is not False:
                return mpmath.nan if truth is None else exact(v, point, blur)
        return mpmath.nan
    values = [exact(a, point, blur) for a in e.args]
    if isinstance(e, sympy.logic.boolalg.BooleanFunction):
        return joined(e, values)
    if any(mpmath.isnan(v) for v in values):
        return None if isinstance(e, sympy.core.relational.Relational) else mpmath.nan
    if isinstance(e, sympy.core.relational.Relational):
        return bool(e.func(*[sympy.Float(v, 40) for v in values]))
    found = _APPLIED[e.func](*values)
    if isinstance(found, mpmath.mpc):
        if found.imag != 0:
            return mpmath.nan
        found = found.real
    if mpmath.isinf(found) or (found != 0 and not 1e-290 < abs(found) < 1e290):
        raise Outside
    return found * (1 + blur())


def joined(e: sympy.Basic, values: list[bool | None]) -> bool | None:
    """Join truth values."""
    if isinstance(e, sympy.And | sympy.Or):
        settles = isinstance(e, sympy.Or)
        return settles if settles in values else None if None in values else not settles
    return None if None in values else bool(e.func(*values))


def _by_name(function: type[sympy.Basic]) -> Callable[..., mpmath.mpf]:
    names = {"Abs": "fabs", "ceiling": "ceil", "loggamma": "loggamma"}
    called = getattr(mpmath, names.get(function.__name__, function.__name__), None)

    def apply(*values: mpmath.mpf) -> mpmath.mpf:
        try:
            return called(*values)
        except (ValueError, ZeroDivisionError):  # a pole
            raise Outside from None

    return apply


def _power(base: mpmath.mpf, exponent: mpmath.mpf) -> mpmath.mpf:
    if base == 0 and exponent < 0:
        raise Outside
    return mpmath.power(base, exponent)


_APPLIED: dict[object, Callable[..., mpmath.mpf]] = {f: _by_name(f) for f in FUNCTIONS}
_APPLIED |= {
    sympy.Add: lambda *v: mpmath.fsum(v),
    sympy.Mul: lambda *v: mpmath.fprod(v),
    sympy.Pow: _power,
    sympy.Max: lambda *v: max(v),
    sympy.Min: lambda *v: min(v),
    sympy.Heaviside: lambda x, *_: mpmath.mpf(x > 0),
    # the C library's logarithm of gamma is that of its magnitude
    sympy.loggamma: lambda x: mpmath.log(abs(_by_name(sympy.gamma)(x))),
}


def numbers() -> st.SearchStrategy[sympy.Expr]:
    return st.one_of(
        st.integers(-4, 4).map(sympy.Integer),
        st.fractions(-3, 3, max_denominator=7).map(sympy.Rational),
        st.just(sympy.pi),
    )


def compare(relation: Callable[..., sympy.Basic], a: sympy.Expr, b: sympy.Expr) -> sympy.Basic:
    """Compare; true, where SymPy knows that nothing real is compared."""
    try:
        return relation(a, b)
    except TypeError:
        return sympy.true


def conditions(e: st.SearchStrategy[sympy.Expr]) -> st.SearchStrategy[sympy.Basic]:
    real = e.filter(lambda a: a.is_real is not False)
    compared = st.builds(compare, st.sampled_from([sympy.Lt, sympy.Le, sympy.Gt, sympy.Ge]), real, real)
    joined = st.builds(lambda f, a, b: f(a, b), st.sampled_from([sympy.And, sympy.Or, sympy.Xor]), compared, compared)
    return st.one_of(compared, joined, joined.map(sympy.Not))


def made(function: Callable[..., sympy.Expr], *parts: sympy.Expr) -> sympy.Expr:
    """Apply a function; the first part, where SymPy knows that nothing real comes of it."""
    try:
        return function(*parts)
    except (ValueError, TypeError, ZeroDivisionError):
        return parts[0]


def larger(e: st.SearchStrategy[sympy.Expr]) -> st.SearchStrategy[sympy.Expr]:
    return st.one_of(
        st.builds(made, st.sampled_from(ONE), e),
        st.builds(made, st.sampled_from([sympy.atan2, sympy.Max, sympy.Min]), e, e),
        st.builds(made, st.just(lambda a, b: a + b), e, e),
        st.builds(made, st.just(lambda a, b: a - 2 * b), e, e),
        st.builds(made, st.just(lambda a, b: a * b), e, e),
        st.builds(made, st.just(lambda a, b: a / b), e, e),
        st.builds(made, st.just(lambda a, n: a**n), e, st.fractions(-3, 5, max_denominator=3).map(sympy.Rational)),
        st.builds(made, st.just(lambda a, b: sympy.Abs(a) ** b), e, e),
        st.builds(made, st.just(lambda a, b, c: sympy.Piecewise((a, c), (b, True))), e, e, conditions(e)),
    )


EXPRESSIONS = st.recursive(st.one_of(st.sampled_from([X, Y]), numbers()), larger, max_leaves=6)
REAL = EXPRESSIONS.filter(
    lambda e: (
        isinstance(e, sympy.Expr) and e.is_real is not False and not e.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo)
    )
)


@pytest.mark.thorough
# what fails is told with the point and the value; to shrink it takes SymPy minutes
@settings(
    deadline=None,
    max_examples=40,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
)
@given(st.lists(REAL, min_size=4, max_size=4))
def test_random_expressions_are_what_mpmath_says(expressions: list[sympy.Expr]) -> None:
    """Within what the result moves when each operation is wrong by 1e-14, which it may be by a few 1e-16."""
    found = compiled(expressions, POINTS)
    rng = random.Random(0)
    for row, values in zip(POINTS, found, strict=True):
        point = dict(zip((X, Y), row, strict=True))
        for e, value in zip(expressions, values, strict=True):
            try:
                with mpmath.workdps(40):
                    expected = exact(e, point, lambda: 0.0)
                    around = [exact(e, point, lambda: rng.choice([-1e-14, 1e-14])) for _ in range(8)]
            except Outside:
                continue
            if mpmath.isnan(expected):
                assert math.isnan(value) or not all(map(mpmath.isnan, around)), (e, row, value)
            elif not any(map(mpmath.isnan, around)):
                spread = max(abs(x - expected) for x in around)
                assert abs(value - expected) <= 3 * spread + 1e-14 * abs(expected) + 1e-290, (e, row, value, expected)


def truths(depth: int) -> st.SearchStrategy[sympy.Basic]:
    """Conditions of which some are compared with no real numbers: roots and logarithms of negative ones."""
    sides = st.sampled_from([X, Y, sympy.sqrt(X), sympy.log(Y), sympy.acos(X), X ** sympy.Rational(1, 3) + Y])
    compared = st.builds(
        lambda relation, a, b: relation(a, sympy.Rational(b, 7)),
        st.sampled_from([sympy.Lt, sympy.Le, sympy.Gt, sympy.Ge, sympy.Ne]),
        sides,
        st.integers(-9, 9),
    )
    if not depth:
        return compared
    part = truths(depth - 1)
    joins = st.builds(lambda f, a, b: f(a, b), st.sampled_from([sympy.And, sympy.Or, sympy.Xor]), part, part)
    return st.one_of(part, joins, part.map(sympy.Not))


@settings(deadline=None, max_examples=4, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(st.lists(truths(2), min_size=12, max_size=12))
def test_what_depends_on_a_comparison_of_no_real_numbers_is_none(conditions: list[sympy.Basic]) -> None:
    """It is NaN unless other parts of the condition decide, whichever branch would be taken."""
    pieces = [
        sympy.Piecewise((1, c), (sympy.Piecewise((2, d), (3, True)), True)) for c, d in itertools.pairwise(conditions)
    ]
    pieces += [sympy.sign(sympy.log(X)), sympy.Max(Y, sympy.sqrt(X)), sympy.Heaviside(sympy.acos(Y)) + X]
    found = compiled(pieces, POINTS)
    for row, values in zip(POINTS, found, strict=True):
        point = dict(zip((X, Y), row, strict=True))
        expected = [float(exact(piece, point, lambda: 0.0)) for piece in pieces]
        np.testing.assert_allclose(values, expected, rtol=1e-14, err_msg=str((row, pieces)))


def test_powers_of_negative_numbers_are_real_for_whole_exponents_only() -> None:
    """A comparison of one that is not real decides nothing; those of zero and positive numbers do."""
    bases = [sympy.Integer(-2), sympy.Rational(-1, 3), sympy.Float(-0.5), -sympy.pi, sympy.Integer(3), sympy.Float(0.5)]
    pieces = [sympy.Piecewise((1, b**X > sympy.Rational(1, 2)), (2, True)) for b in bases]
    points = np.array([[x, 0.0] for x in (-3.0, -1.5, 0.0, 0.3, 0.5, 2.0, 2.5, 5.0)])
    for (x, _), values in zip(points, compiled(pieces, points), strict=True):
        for b, value in zip(bases, values, strict=True):
            real = b > 0 or x.is_integer()
            expected = (1 if float(b) ** x > 0.5 else 2) if real else math.nan
            np.testing.assert_equal(value, expected, err_msg=str((b, x)))


SPECIAL = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 1.0, -1.0, 0.5])
NUMPY = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh,
    "exp": np.exp, "log": np.log, "erf": scipy.special.erf, "erfc": scipy.special.erfc, "floor": np.floor,
    "ceiling": np.ceil, "sqrt": np.sqrt, "Abs": np.abs, "sign": np.sign,
    "cot": lambda x: 1 / np.tan(x), "sec": lambda x: 1 / np.cos(x), "csc": lambda x: 1 / np.sin(x),
    "coth": lambda x: 1 / np.tanh(x), "sech": lambda x: 1 / np.cosh(x), "csch": lambda x: 1 / np.sinh(x),
    "acot": lambda x: np.arctan(1 / x), "asec": lambda x: np.arccos(1 / x), "acsc": lambda x: np.arcsin(1 / x),
    "acoth": lambda x: np.arctanh(1 / x),
}  # fmt: skip


@pytest.mark.parametrize("name", NUMPY)
def test_special_values_are_those_of_numpy(name: str) -> None:
    """NaN, infinities and the sign of zero."""
    kernel = compile_kernel([se.Symbol("x")], [se.sympify(getattr(sympy, name)(X))])
    found = kernel(SPECIAL[:, None])[:, 0]
    with np.errstate(all="ignore"):
        expected = NUMPY[name](SPECIAL)
    np.testing.assert_allclose(found, expected, rtol=1e-15)
    if name != "sign":  # there zero keeps its sign, which NumPy drops
        zero = expected == 0
        np.testing.assert_array_equal(np.signbit(found[zero]), np.signbit(expected[zero]))


def test_special_values_of_two_arguments() -> None:
    pairs = np.array([(a, b) for a in SPECIAL for b in SPECIAL])
    x, y = se.symbols("x y")
    chosen = [se.sympify(e) for e in (sympy.atan2(X, Y), sympy.Max(X, Y), sympy.Min(X, Y))]
    found = compile_kernel([x, y], [*chosen, x**y, x + y, x * y, x - y])(pairs).T
    a, b = pairs.T
    with np.errstate(all="ignore"):
        expected = [np.arctan2(a, b), np.maximum(a, b), np.minimum(a, b), a**b, a + b, a * b, a - b]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-15)


@pytest.mark.parametrize(
    ("force", "named"), [(sympy.besselj, "besselj"), (sympy.Function("f"), r"function f is not defined")]
)
def test_check_refuses_what_cannot_be_computed_by_name(force: type[sympy.Function], named: str) -> None:
    mechanism = uqmbd.Mechanism("one", uqmbd.Translational())
    body = mechanism.body("body", mass=1)
    args = (0, body.position[0]) if force is sympy.besselj else (body.position[0],)
    with pytest.raises(uqmbd.StudyError, match=named):
        mechanism.add(PointForce("force", body, (0, 0), (force(*args), 0)))
        uqmbd.check(mechanism)
