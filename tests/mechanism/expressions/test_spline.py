"""Splines as expressions, against SciPy's `CubicSpline`."""

import pickle

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

import uqmbd
from uqmbd import t

X = sympy.Symbol("x", real=True)
F = uqmbd.RandomVariable("F", chaospy.Normal(2, 0.1))
G = uqmbd.RandomVariable("G", chaospy.Uniform(1, 2))

ENDS = {"not-a-knot": "not-a-knot", "natural": "natural", "flat": "clamped", "periodic": "periodic"}


@st.composite
def tables(draw):
    """Knots of uneven distance, values, and the condition at the ends."""
    ends = draw(st.sampled_from(list(ENDS)))
    count = draw(st.integers(3 if ends == "periodic" else 2, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    knots = rng.normal() * 10 ** rng.uniform(-3, 3) + np.cumsum(10 ** rng.uniform(-1.5, 1, count))
    values = rng.normal(size=count) * 10 ** rng.uniform(-6, 6)
    if ends == "periodic":
        values[-1] = values[0]
    return knots, values, ends


def made(knots, values, ends, **options):
    return (
        uqmbd.spline(knots, values, True) if ends == "periodic" else uqmbd.spline(knots, values, ends=ends, **options)
    )


@pytest.mark.thorough
@settings(max_examples=80, deadline=None)
@given(tables(), st.lists(st.floats(0, 1), min_size=1, max_size=8), st.integers(0, 3))
def test_it_is_scipys_spline(table, places, order):
    """Value and every derivative at any place of the table: inserted, and by lambdify."""
    knots, values, ends = table
    expected = CubicSpline(knots, values, bc_type=ENDS[ends])
    at = knots[0] + np.array(places) * (knots[-1] - knots[0])
    # the third derivative jumps at the knots, of which the last one has two neighbours in a period
    at = at[np.abs(at[:, None] - knots).min(axis=1) > 1e-9 * (knots[-1] - knots[0])] if order == 3 else at
    found = made(*table)
    for _ in range(order):
        found = found.diff(t)
    if len(at):
        wanted = expected(at, order)
        scale = np.abs(expected(np.linspace(knots[0], knots[-1], 400), order)).max() + np.abs(wanted).max()
        inserted = [float(found.subs(t, x)) for x in at]
        np.testing.assert_allclose(inserted, wanted, rtol=1e-9, atol=1e-9 * scale)
        np.testing.assert_array_equal(sympy.lambdify(t, found)(at), inserted)


@settings(max_examples=30, deadline=None)
@given(tables(), st.floats(0, 1), st.integers(-3, 3))
def test_beyond_the_table(table, place, turns):
    """A period goes on; other tables keep their last value, or go straight on."""
    knots, values, ends = table
    length = knots[-1] - knots[0]
    expected = CubicSpline(knots, values, bc_type=ENDS[ends])
    scale = 1e-9 * np.abs(expected(np.linspace(knots[0], knots[-1], 400))).max()
    if ends == "periodic":
        x = knots[0] + place * length
        assert abs(float(made(*table).subs(t, x + turns * length)) - expected(x)) <= scale + 1e-9 * abs(
            expected(x, 1) * length
        )
        return
    for end, far in ((0, -place * length), (-1, place * length)):
        x = knots[end] + far
        assert abs(float(made(*table).subs(t, x)) - values[end]) <= scale
        if ends != "flat":
            straight = made(*table, beyond="linear").subs(t, x)
            line = values[end] + expected(knots[end], 1) * far
            assert abs(float(straight) - line) <= scale + 1e-9 * abs(line)


def test_at_its_ends_it_has_the_slopes_of_the_table():
    """The ends belong to the table: the speed at the last time of a motion is that of the motion."""
    found = uqmbd.spline([0, 1, 2, 3], [0, 1, 8, 27]).diff(t)
    assert [float(found.subs(t, x)) for x in (0, 3, -0.1, 3.1)] == pytest.approx([0, 27, 0, 0])


def test_random_values_are_terms():
    """Value by value the same as with numbers in their place; the derivative by a random variable, too."""
    knots, values = [0, 1, 2.5, 3], [F, 1 + 2 * F - 3 * F * G, 4.0, G / 3]
    found = uqmbd.spline(knots, values)
    assert found.free_symbols == {t, F, G}
    numbers = {F: 1.7, G: 1.2}
    plain = CubicSpline(knots, [float(sympy.sympify(v).subs(numbers)) for v in values])
    at = np.linspace(0, 3, 13)
    assert [float(found.subs({**numbers, t: x})) for x in at] == pytest.approx(plain(at).tolist())
    assert sympy.lambdify((t, F, G), found)(at, 1.7, 1.2) == pytest.approx(plain(at))
    slope = CubicSpline(knots, [1, 2 - 3 * 1.2, 0, 0])
    assert float(found.diff(F).subs({**numbers, t: 0.7})) == pytest.approx(float(slope(0.7)))


def test_it_is_a_function_of_anything():
    """A call puts in another argument; derivatives follow the chain rule."""
    profile = uqmbd.spline([0, 1, 2], [0, 1, 0])
    plain = CubicSpline([0, 1, 2], [0, 1, 0])
    inner = profile(X**2)
    assert inner == profile.subs(t, X**2) and str(inner) == "spline(x**2)"
    assert float(inner.diff(X).subs(X, 1.2)) == pytest.approx(2.4 * float(plain(1.44, 1)))
    assert float(profile(profile(X)).subs(X, 0.3)) == pytest.approx(float(plain(plain(0.3))))
    assert float(profile(sympy.pi / 4)) == pytest.approx(float(plain(np.pi / 4)))
    assert profile.diff(t, 4) == 0


def test_it_survives_pickling_and_is_known_by_its_numbers():
    """The same numbers are the same expression, with the same text for the cache of kernels; other numbers are not."""
    one, two = (uqmbd.spline([0, 1, 2], [0, 1, F]) for _ in range(2))
    again, symbol = pickle.loads(pickle.dumps((one, F)))  # a random variable is equal to itself only
    assert one == two and hash(one) == hash(two) and sympy.srepr(one) == sympy.srepr(again)
    assert again == uqmbd.spline([0, 1, 2], [0, 1, symbol])
    other = uqmbd.spline([0, 1, 2], [0, 1 + 1e-15, F])
    assert one != other and sympy.srepr(one) != sympy.srepr(other)
    assert uqmbd.spline([0, 1, 2], [0, 1, F], ends="natural") != one
    assert str(one) == "spline(t)" and len(sympy.srepr(one)) < 1000


@pytest.mark.thorough
def test_a_long_table_is_made_at_once():
    """A thousand random values are one term: they are differentiated without a look at each."""
    rng = np.random.default_rng(0)
    values = [a * F + b * G for a, b in rng.normal(size=(1000, 2))]
    found = uqmbd.spline(np.arange(1000), values).diff(t)
    assert len(found.args) == 5  # the argument, the table, the order, and two terms


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0], [1]), "1 knot is given; expected at least 2"),
        (([0, 1], [0, 0], True), "2 knots are given; expected at least 3 of a period"),
        (([0, 1, 1], [0, 0, 0]), "the knots do not increase: knot 2 is 1, and knot 3 is 1"),
        (([0, 1, 2], [0, 1]), "3 knots and 2 values are given; expected one value for each knot"),
        (([0, 1], [0, np.nan]), "value number 2 is nan; expected finite numbers"),
        (([0, np.inf], [0, 1]), "knot number 2 is inf"),
        (
            ([0, F], [0, 1]),
            "the knot F contains the random variable F; .*divide the argument of the spline by the factor",
        ),
        (([0, 1], [0, 3 * t]), r"the value 3\*t depends on time; expected numbers, or expressions in random variables"),
        (([0, 1], [0, X]), "the value x depends on the symbol x"),
        (([0, 1, 2], [0, 1, 2], True), "the first value of the period is 0 and the last 2; expected the same"),
        (([0, 1, 2], [F, 1, 2 * F], True), r"the first value of the period is F and the last 2\*F"),
        (([[0, 1]], [[0, 1]]), r"the knots are \[\[0, 1\]\], which is nested; expected a list of numbers"),
        (([0, 1], ["a", 1]), "which contains the text 'a'"),
        (("ab", [0, 1]), "the knots are the text 'ab'; expected a list of numbers"),
        (([0, 1], 3), "the values are 3; expected a list of numbers or expressions"),
        (([0, 1], [0, 1e200]), "values reach 1e.200"),
        (([0, 1, 2], [0, 1, 0], "yes"), "periodic is the text 'yes'; expected True or False"),
    ],
)
def test_what_is_no_table(arguments, message):
    with pytest.raises(uqmbd.StudyError, match=f"^spline: .*{message}"):
        uqmbd.spline(*arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ends": "clamped"}, "ends is the text 'clamped'; expected one of 'not-a-knot', 'natural', 'flat'"),
        ({"periodic": True, "ends": "flat"}, "a periodic spline has no ends; leave ends out"),
        ({"periodic": True, "beyond": "linear"}, "a periodic spline has no ends; leave beyond out"),
        ({"ends": "flat", "beyond": "linear"}, "has zero slope at the ends"),
    ],
)
def test_options_that_mean_nothing(options, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        uqmbd.spline([0, 1, 2], [0, 1, 0], **options)


def test_an_argument_that_is_none():
    with pytest.raises(uqmbd.StudyError, match="spline: its argument is the text 'angle'; expected a number"):
        uqmbd.spline([0, 1], [0, 1])("angle")


MANY = 20_000


@pytest.mark.parametrize(
    "of",
    [
        np.asarray,
        list,
        pytest.param(lambda x: np.array(x, dtype=object), marks=pytest.mark.thorough),
        pytest.param(lambda x: [*x[:-1], sympy.Float(x[-1])], marks=pytest.mark.thorough),
    ],
)
def test_tables_of_many_knots(of):
    """Tables of a logger: they are no expressions, of which there may be 10,000 terms."""
    knots = np.arange(MANY) / 100
    values = np.round(np.sin(knots), 6)
    found, exact = uqmbd.spline(of(knots), of(values)), CubicSpline(knots, values)
    for x in (0.005, 57.3, 199.98):
        assert float(found.subs(t, x)) == pytest.approx(float(exact(x)), abs=1e-12)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.arange(MANY), "the first value of the period is 0 and the last 19999"),
        (np.array(["a"] * MANY), "the text 'a'"),
        (np.ones(MANY, dtype=bool), "which contains True"),
        (np.ones((MANY, 1)), "which is nested"),
        (np.array([None] * MANY), "None"),
        (np.ones(MANY + 1), "20000 knots and 20001 values are given"),
    ],
)
def test_mistakes_in_tables_of_many_knots_are_named_as_in_small_ones(values, words):
    with pytest.raises(uqmbd.StudyError, match=f"(?s)spline: .*{words}"):
        uqmbd.spline(np.arange(MANY), values, periodic=True)
