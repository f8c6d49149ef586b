"""Summaries and requirements of expressions that are not real or not finite somewhere, against closed forms and mpmath.

Each family is monotone where it is real, and so its extremes are at the ends.  The same functions are those of the time,
of a position, and of an acceleration.
"""

from __future__ import annotations

import re
from importlib import resources

import chaospy
import mpmath
import numpy as np
import pytest
import scipy.integrate
import sympy

import uqmbd
from uqmbd.dynamics import Ensemble, integrate, margins_of, scalars_of
from uqmbd.dynamics.summaries import resolved
from uqmbd.dynamics.summaries.domain import DEEPEST, exponential_types
from uqmbd.dynamics.summaries.motion import SteppedMotion
from uqmbd.dynamics.summaries.resolved import ROUGH
from uqmbd.mechanism import domain_of
from uqmbd.propagation.observed_model import build_observed_model
from uqmbd.status import Status
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce

END = 0.5
"""The last time, s; the first is 0."""

CLEAR = 1e-4
"""Inputs are at least so far from those at which the domain is left at the last time."""

FAMILIES = {
    "root": (lambda x, a: sympy.sqrt(a - x), (0.1, 1.0), lambda a: a),
    "hidden root": (lambda x, a: sympy.sqrt(a - x) * (1 + x**2), (0.1, 1.0), lambda a: a),
    "cube root": (lambda x, a: (a - x) ** sympy.Rational(1, 3), (0.1, 1.0), lambda a: a),
    "pole": (lambda x, a: 100 - 1 / (x - a), (0.1, 1.0), lambda a: a),
    "double pole": (lambda x, a: 0.01 / (x - a) ** 2, (0.1, 1.0), lambda a: a),
    "pole of a root": (lambda x, a: 1 / sympy.sqrt(a - x), (0.1, 1.0), lambda a: a),
    "logarithm": (lambda x, a: 3 - sympy.log(a - x), (0.1, 1.0), lambda a: a),
    "tangent": (lambda x, a: sympy.tan(x / a), (0.1, 0.6), lambda a: a * np.pi / 2),
    "arccosine": (lambda x, a: -sympy.acos(x / a), (0.1, 1.0), lambda a: a),
    "atanh": (lambda x, a: sympy.atanh(x / a), (0.1, 1.0), lambda a: a),
    "gamma": (lambda x, a: -1 / sympy.gamma(a - x) + sympy.gamma(a - x), (0.1, 0.9), lambda a: a),
}
"""Expression of what moves evenly and of an input, range of the input, and when the domain is left."""


def mechanism_of(family, variant, *functions):
    """A mechanism with summaries of a family, of the time, or of a position or acceleration that is the same number."""
    function, (low, high), _ = FAMILIES[family]
    a = uqmbd.RandomVariable("a", chaospy.Uniform(low, high))
    mechanism = uqmbd.Mechanism("moving", uqmbd.Translational())
    body = mechanism.body("body", mass=1, velocity=(1, 0) if variant == "position" else (0, 0))
    if variant == "acceleration":
        mechanism.add(PointForce("pull", body, (0, 0), (uqmbd.t, 0)))
    x = {"time": uqmbd.t, "position": body.position[0], "acceleration": body.acceleration[0]}[variant] * sympy.Float(1)
    expression = function(x, a)
    for k, summary in enumerate(functions):
        mechanism.output(f"o{k}", summary(expression))
    return mechanism, expression


def computed(mechanism, inputs, evaluate=scalars_of, rtol=1e-7):
    times = np.array([0, END])
    ensemble = Ensemble(build_observed_model(mechanism, 0.0), inputs[:, None])
    trajectories = integrate(ensemble, times, rtol, "auto", between=True)
    return evaluate(ensemble, trajectories) if evaluate is scalars_of else margins_of(ensemble, times, trajectories)


def drawn(family, count):
    """Inputs, and when each leaves the domain, s; those that nearly do at the end are left out."""
    _, (low, high), left = FAMILIES[family]
    inputs = np.random.default_rng(list(FAMILIES).index(family)).uniform(low, high, count)
    when = np.array([left(a) for a in inputs])
    clear = np.abs(when - END) > CLEAR
    return inputs[clear], when[clear]


def exactly(family, a):
    x = sympy.Symbol("x", real=True)
    return sympy.lambdify(x, FAMILIES[family][0](x, sympy.Float(a, 30)), "mpmath")


@pytest.mark.parametrize(
    "variant",
    [
        "time",
        pytest.param("position", marks=pytest.mark.thorough),
        pytest.param("acceleration", marks=pytest.mark.thorough),
    ],
)
@pytest.mark.parametrize("family", ["root", *(pytest.param(x, marks=pytest.mark.thorough) for x in list(FAMILIES)[1:])])
def test_summaries_are_right_or_fail(family, variant):
    """They fail where the expression leaves its domain, and say when; all others are those of mpmath."""
    names = "maximum", "minimum", "time_of_maximum", "time_of_minimum", "integral", "root_mean_square"
    mechanism, _ = mechanism_of(family, variant, *(getattr(uqmbd, name) for name in names))
    inputs, when = drawn(family, 16)
    found = computed(mechanism, inputs)
    for a, left, values, status, message in zip(inputs, when, found.values, found.status, found.messages, strict=True):
        if left < END:
            assert status == Status.NOT_FINITE, (a, values)
            assert float(message.partition("at t = ")[2].partition(" s")[0]) == pytest.approx(left, abs=2e-3)
            continue
        assert status == Status.OK, message
        with mpmath.workdps(20):
            f = exactly(family, a)
            ends = float(f(0)), float(f(END))
            area, square = mpmath.quad(f, [0, END / 2, END]), mpmath.quad(lambda x, f=f: f(x) ** 2, [0, END / 2, END])
        rising = ends[1] > ends[0]
        expected = [max(ends), min(ends), END * rising, END * (not rising), float(area), float(mpmath.sqrt(2 * square))]
        size = np.abs(ends).max()
        np.testing.assert_allclose(values, expected, rtol=2e-6, atol=2e-6 * size, err_msg=str(a))


@pytest.mark.parametrize("variant", ["position", pytest.param("time", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("family", ["root", *(pytest.param(x, marks=pytest.mark.thorough) for x in list(FAMILIES)[1:])])
def test_first_times_before_the_end_of_a_domain_stand(family, variant):
    """Later ones fail, and so does a last value outside; an expression that stays inside is censored or found."""
    mechanism, expression = mechanism_of(family, variant)
    inputs, when = drawn(family, 16)
    with mpmath.workdps(20):
        start = [float(exactly(family, a)(0)) for a in inputs]
        rising = float(exactly(family, inputs[0])(0.01)) > start[0]
    level = float(np.median(start)) + (0.3 if rising else -0.3)
    relation = expression >= level if rising else expression <= level
    mechanism.output("first", uqmbd.first_time(relation), units="s")
    found = computed(mechanism, inputs)
    for k, (a, left) in enumerate(zip(inputs, when, strict=True)):
        f, low, high = exactly(family, a), 0.0, min(left, END) * (1 - 1e-9)

        def holds(x, f=f):
            y = float(mpmath.re(f(x)))
            return y >= level if rising else y <= level

        if holds(0.0):
            assert found.values[k, 0] == 0
        elif holds(high):
            for _ in range(40):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if holds(middle) else (middle, high)
            assert found.values[k, 0] == pytest.approx(high, abs=2e-6), (a, found.messages[k])
        elif left > END:
            assert found.censored[k, 0] or found.values[k, 0] == pytest.approx(END)
        else:  # it may be reached right before the domain is left
            assert found.status[k] == Status.NOT_FINITE or found.values[k, 0] == pytest.approx(left, abs=2e-6)


@pytest.mark.parametrize("family", ["root", *(pytest.param(x, marks=pytest.mark.thorough) for x in list(FAMILIES)[1:])])
def test_last_values_and_margins_are_right_or_fail(family):
    mechanism, expression = mechanism_of(family, "position", uqmbd.final)
    mechanism.require("small", expression <= 1)
    inputs, when = drawn(family, 16)
    last, margins = computed(mechanism, inputs), computed(mechanism, inputs, margins_of)
    for k, (a, left) in enumerate(zip(inputs, when, strict=True)):
        with mpmath.workdps(20):
            f = exactly(family, a)
            end, ends = mpmath.mpmathify(f(END)), (float(mpmath.re(f(0))), float(mpmath.re(f(END))))
        outside = abs(mpmath.im(end)) > 1e-12
        assert (last.status[k] == Status.NOT_FINITE) == outside, a
        if not outside:
            assert last.values[k, 0] == pytest.approx(float(mpmath.re(end)), rel=1e-5)
        assert (margins.status[k] == Status.NOT_FINITE) == (left < END), a
        if left < END:
            assert "the margin of requirement 'small' is not a finite real number at t = " in margins.messages[k]
            assert np.isnan(margins.running[k]).all()
        else:
            size = max(map(abs, ends))
            assert margins.values[k, 0] == pytest.approx(1 - max(ends), rel=2e-6, abs=2e-6 * size)


def test_constants_that_the_driver_has_too_are_the_same():
    source = resources.files("uqmbd.compiled").joinpath("source/parts.c").read_text()
    stated = dict(re.findall(r"\b(DEEPEST|ROUGH) = (\d+)", source))
    assert {name: int(number) for name, number in stated.items()} == {"DEEPEST": DEEPEST, "ROUGH": ROUGH}


POWERS = {
    "power": lambda x, p: x**p,
    "power of a square": lambda x, p: (x**2) ** p,
    "root of a power": lambda x, p: sympy.sqrt(x**p + 1e-4),
    "logarithm of a power": lambda x, p: sympy.log(1 + x**p),
    "product": lambda x, p: x**p * (1 + x) ** p,
    "ratio": lambda x, p: (1 + x) / (2 + x**p),
}
"""Of what moves from -0.3 to 0.2, and an exponent."""


@pytest.mark.parametrize("power", POWERS)
def test_floats_and_rational_numbers_give_the_same_domain(power):
    x = sympy.Symbol("x", real=True)
    for p in map(sympy.Rational, ("1", "2", "3", "4", "1/2", "3/2", "-1", "-2", "-3/2")):
        inside = []
        for exponent in (p, sympy.Float(p), sympy.Float(p, 30)):
            conditions = domain_of(POWERS[power](x, exponent))
            inside.append([all(holds_at(one, x, y) for one in conditions) for y in (-0.3, -0.01, 0.0, 0.2)])
        assert inside[0] == inside[1] == inside[2], (p, inside)


def holds_at(condition, x, y):
    value = condition.part.subs(x, y)
    return bool(value.is_real) and bool(sympy.Ne(value, 0) if condition.nonzero else value >= 0)


@pytest.mark.slow
@pytest.mark.parametrize("power", POWERS)
def test_floats_and_rational_numbers_are_the_same_exponents(power):
    """Powers with an exponent of each type have the same summaries and margins, or none, also if it is random."""
    k = uqmbd.RandomVariable("k", chaospy.Uniform(0, 5))
    exponents = [sympy.Integer(1), sympy.Integer(2), sympy.Integer(3), sympy.Integer(4), sympy.Rational(1, 2)]
    exponents += [sympy.Rational(3, 2), sympy.Rational(5, 2), sympy.Integer(-1), sympy.Integer(-2)]
    mechanism, x = moving(position=-0.3)
    inputs = np.array([[float(p)] for p in exponents])
    function = POWERS[power]
    mechanism.output("m", uqmbd.maximum(function(x, k)))
    mechanism.output("q", uqmbd.root_mean_square(function(x, k)))
    mechanism.require("below", function(x, k) <= 0.05)
    of_inputs = verdicts(mechanism, inputs)
    places = np.linspace(-0.3, 0.2, 2001)
    for p, *random in zip(exponents, *of_inputs, strict=True):
        for exponent in dict.fromkeys([p, sympy.Float(p), sympy.Float(p, 30)]):
            mechanism, x = moving(position=-0.3)
            mechanism.output("m", uqmbd.maximum(function(x, exponent)))
            mechanism.output("q", uqmbd.root_mean_square(function(x, exponent)))
            mechanism.require("below", function(x, exponent) <= 0.05)
            found = [each[0] for each in verdicts(mechanism, np.zeros((1, 0)))]
            np.testing.assert_allclose(
                np.hstack(found), np.hstack(random), rtol=1e-9, atol=1e-12, err_msg=str(exponent)
            )
        with np.errstate(all="ignore"):
            values = np.array([complex(function(sympy.Float(y), p)) for y in places[::200] if abs(y) > 1e-9])
        if (np.abs(values.imag) > 1e-12).any():
            assert np.isnan(np.hstack(random)).all(), p
        elif p > 0:
            with np.errstate(all="ignore"):
                curve = sympy.lambdify(s := sympy.Symbol("s", real=True), function(s, p))(places) + 0 * places
            expected = [curve.max(), np.sqrt(scipy.integrate.simpson(curve**2, places) / 0.5), 0.05 - curve.max()]
            np.testing.assert_allclose(np.hstack(random), expected, rtol=1e-5, atol=1e-7, err_msg=str(p))


def verdicts(mechanism, inputs):
    """Summaries and margins of a motion over 0.5 s, NaN where there is none."""
    times = np.array([0, END])
    ensemble = Ensemble(build_observed_model(mechanism, 0.0), inputs)
    trajectories = integrate(ensemble, times, 1e-9, "auto", between=True)
    return scalars_of(ensemble, trajectories).values, margins_of(ensemble, times, trajectories).values


def test_powers_of_negative_numbers_with_random_exponents_have_values():
    k = uqmbd.RandomVariable("k", chaospy.DiscreteUniform(1, 3))
    mechanism, x = moving(position=-0.3)
    mechanism.output("low", uqmbd.minimum(x**k))
    mechanism.output("root", uqmbd.root_mean_square(x**k))
    whole = computed(mechanism, np.array([1.0, 2.0, 3.0])).values
    np.testing.assert_allclose(whole[:, 0], [-0.3, 0.0, -0.027], atol=1e-9)
    squares = [(0.2 ** (2 * n + 1) + 0.3 ** (2 * n + 1)) / (2 * n + 1) / END for n in (1, 2, 3)]
    np.testing.assert_allclose(whole[:, 1], np.sqrt(squares), rtol=1e-6)
    assert np.isnan(computed(mechanism, np.array([0.5, 1.5])).values).all()  # though squares of the values are real


def moving(*, position=0.0, velocity=1.0):
    mechanism = uqmbd.Mechanism("moving", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=position, velocity=velocity)
    return mechanism, sympy.Float(1) * body.position[0]


@pytest.mark.parametrize(
    "expression",
    [
        lambda x: sympy.sqrt((x - 0.3) ** 2 - 1e-8),
        lambda x: 1000 * sympy.cos(3 * x) + 1e-3 / (x - 0.3),
        lambda x: 1000 * sympy.cos(3 * x) + 1e-3 * sympy.log(sympy.Abs(x - 0.3)),
        lambda x: 1 / sympy.sqrt(x),
        lambda x: sympy.log(x),
        lambda x: sympy.Max(sympy.sqrt(0.3 - x), -1),
        lambda x: sympy.sign(sympy.log(0.3 - x)),
        lambda x: sympy.Heaviside(sympy.sqrt(0.3 - x) - 0.1),
        lambda x: sympy.Piecewise((1, sympy.sqrt(0.3 - x) > 0.1), (0, True)),
        lambda x: sympy.exp(2000 * x),
    ],
    ids=["gap", "weak pole", "weak logarithm", "pole at the start", "logarithm at the start", "greater one", "sign",
         "step", "condition", "overflow"],
)  # fmt: skip
@pytest.mark.parametrize("summary", ["maximum", pytest.param("integral", marks=pytest.mark.thorough)])
def test_what_is_not_seen_at_the_places_of_parts_fails_too(expression, summary):
    """Narrow gaps, poles far below the largest value, singularities at the start, and comparisons of no real numbers."""
    mechanism, x = moving()
    mechanism.output("o", getattr(uqmbd, summary)(expression(x)))
    with pytest.raises(uqmbd.UqmbdError, match="'o' is not finite: the expression of .* is not a finite real number"):
        uqmbd.simulate(mechanism, [0, END], rtol=1e-9)


def test_what_is_real_and_finite_is_no_failure():
    """Removable singularities, roots that touch zero, functions of one branch, and resonances that are none."""
    mechanism, x = moving()
    y = x - 0.3
    mechanism.output("touching", uqmbd.minimum(sympy.sqrt(y**2)))
    mechanism.output("branch", uqmbd.integral(sympy.Piecewise((sympy.sqrt(0.3 - x), x < 0.3), (0, True))))
    mechanism.output("peak", uqmbd.maximum(1 / (y**2 + sympy.Float("1e-6"))))
    mechanism.output("area", uqmbd.integral(1 / (y**2 + sympy.Float("1e-6"))))
    alone, x = moving()
    y = x - 0.3  # no part is divided right where they are 0 / 0
    alone.output("sinc", uqmbd.minimum(sympy.sin(y) / y))
    alone.output("small", uqmbd.maximum(y * sympy.log(sympy.Abs(y))))
    found = {**uqmbd.simulate(mechanism, [0, END]), **uqmbd.simulate(alone, [0, END])}
    expected = {
        "sinc": np.sin(0.3) / 0.3,
        "small": 0.3 * np.log(1 / 0.3),
        "touching": 0.0,
        "branch": 2 / 3 * 0.3**1.5,
        "peak": 1e6,
        "area": 1e3 * (np.arctan(200) + np.arctan(300)),
    }
    for name, value in expected.items():
        assert float(found[name]) == pytest.approx(value, rel=3e-6, abs=1e-6), name


@pytest.mark.parametrize("p", [0.1, *(pytest.param(p, marks=pytest.mark.thorough) for p in (0.02, 0.05, 0.15, 0.3, 1))])
def test_slow_limits_are_finite(p):
    """Powers with small exponents, alone and of a damper, whose divisor is zero on the way: against closed forms."""
    for function, sign in ((lambda y: sympy.Abs(y) ** p, 1), (lambda y: y * sympy.Abs(y) ** (p - 1), -1)):
        mechanism, x = moving(position=-0.3)
        mechanism.output("most", uqmbd.maximum(function(x)))
        mechanism.output("area", uqmbd.integral(function(x)))
        found = uqmbd.simulate(mechanism, [0, END])
        assert float(found["most"]) == pytest.approx(max(sign * 0.3**p, 0.2**p), rel=1e-6)
        assert float(found["area"]) == pytest.approx((0.2 ** (p + 1) + sign * 0.3 ** (p + 1)) / (p + 1), rel=1e-6)


@pytest.mark.thorough
def test_a_limit_that_is_as_slow_as_a_logarithm_is_finite():
    mechanism, x = moving()
    mechanism.output("most", uqmbd.maximum(1 / (1 - sympy.log(sympy.Abs(x - 0.3)))))
    assert float(uqmbd.simulate(mechanism, [0, END])["most"]) == pytest.approx(1 / (1 - np.log(0.3)), rel=1e-6)


@pytest.mark.parametrize(
    "place",
    [0.01234, pytest.param(0.2543, marks=pytest.mark.thorough), pytest.param(0.4711, marks=pytest.mark.thorough)],
)
def test_narrow_features_of_time_are_found(place):
    """Peaks of a ten-thousandth of the time, and pulses, which no state follows."""
    t = uqmbd.t
    mechanism, _ = moving()
    mechanism.output("top", uqmbd.maximum(sympy.exp(-sympy.Float("1e9") * (t - place) ** 2)))
    mechanism.output("area", uqmbd.integral(sympy.exp(-sympy.Float("1e9") * (t - place) ** 2)))
    mechanism.output("pulse", uqmbd.integral(sympy.Heaviside(t - place) - sympy.Heaviside(t - place - 1e-4)))
    mechanism.output("high", uqmbd.maximum(sympy.Heaviside(t - place) - sympy.Heaviside(t - place - 1e-4)))
    found = uqmbd.simulate(mechanism, [0, END])
    assert float(found["top"]) == pytest.approx(1, rel=1e-6)
    assert float(found["area"]) == pytest.approx(np.sqrt(np.pi / 1e9), rel=1e-5)
    assert float(found["pulse"]) == pytest.approx(1e-4, rel=1e-5)
    assert float(found["high"]) == 1


W = uqmbd.RandomVariable("w", chaospy.Uniform(1, 5000))

PERIODIC = {
    "sine": lambda f, t: f.sin(W * t),
    "product": lambda f, t: f.sin(W * t) * f.cos(3 * t + W) * (t + 1) ** 2,
    "cube": lambda f, t: (f.cos(W * t / 3) + t / 2) ** 3,
    "decay": lambda f, t: f.exp(-W * t) + f.sin(2 * t),
}


@pytest.mark.thorough
@pytest.mark.parametrize("kind", PERIODIC)
def test_slow_outputs_of_time_are_not_looked_at(kind, monkeypatch):
    """Their summaries are the same to the bit as if they were, and those of mpmath; a look is at some at once."""
    looked, most = [], [0]
    observed = SteppedMotion.observed

    def counted(motion, outputs, steps, *args):
        most[0] = max(most[0], len(steps))
        parts = np.bincount(motion.course.owner[steps])
        looked.extend(np.flatnonzero(parts >= 1 / resolved.FINEST).tolist())  # a look is at that many parts
        return observed(motion, outputs, steps, *args)

    monkeypatch.setattr(SteppedMotion, "observed", counted)
    mechanism, _ = moving()
    expression = PERIODIC[kind](sympy, uqmbd.t)
    mechanism.output("top", uqmbd.maximum(expression))
    mechanism.output("area", uqmbd.integral(expression))
    rates = np.array([1.0, 3, 10, 30, 100, 130, 200, 300, 505, 520, 700, 1000, 1500, *np.linspace(2, 400, 51)])
    found = computed(mechanism, rates)
    assert 1 not in looked
    assert 12 in looked
    assert most[0] < 40_000
    monkeypatch.setattr(resolved, "SLOW", -1.0)
    everywhere = computed(mechanism, rates)
    assert set(looked) == set(range(len(rates)))
    np.testing.assert_array_equal(found.values, everywhere.values)
    for rate, values in zip(rates, found.values, strict=True):
        curve = sympy.lambdify(uqmbd.t, expression.subs(W, rate), "numpy")
        times = np.linspace(0, END, 40_001)
        assert values[0] == pytest.approx(curve(times).max(), abs=2e-4)
        assert values[1] == pytest.approx(scipy.integrate.simpson(curve(times), times), abs=1e-6)


def test_types_of_functions_of_time_that_are_not_known():
    t, s = uqmbd.t, sympy
    narrow = [s.exp(-(t**2)), s.Heaviside(t - 1), s.floor(t), 1 / (1 + t**2), (t - t**2) ** 4000, s.sin(t**2)]
    narrow += [s.Abs(t - 1), s.sqrt(t + 1), s.exp(s.sin(t)), t**17, s.Piecewise((1, t < 1), (2, True))]
    assert [exponential_types(e * W + s.sin(t)) for e in narrow] == [None] * len(narrow)


@pytest.mark.parametrize("summary", ["maximum", pytest.param("root_mean_square", marks=pytest.mark.thorough)])
def test_what_is_too_fast_is_not_resolved(summary):
    """A sine of a million radians in a second is a failure, and right where steps are bounded."""
    mechanism, x = moving()
    mechanism.output("o", getattr(uqmbd, summary)(sympy.sin(1_000_000 * x)))
    with pytest.raises(uqmbd.UqmbdError, match="'o' is not resolved: .* too fast .* a smaller max_step"):
        uqmbd.simulate(mechanism, [0, END])
    found = uqmbd.simulate(mechanism, [0, 1e-3], max_step=1e-5)
    expected = {"maximum": 1.0, "root_mean_square": np.sqrt(0.5 - np.sin(2000) / 4000)}
    assert float(found["o"]) == pytest.approx(expected[summary], rel=1e-6)


@pytest.mark.thorough
def test_realisations_that_meet_a_pole_fail_and_the_others_stand():
    """A ratio whose divisor passes zero where the input is between 0 and 1: those are counted, and no mean is NaN."""
    a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1.5), units="m")
    mechanism, x = moving(position=1, velocity=-1)
    mechanism.output("peak", uqmbd.maximum(1 / (x - a)), units="1/m")
    mechanism.require("low", 1 / (x - a) <= 3)
    study = uqmbd.Study("ratio", mechanism, [0, 1], [MonteCarlo(samples=100, seed=3)])
    with pytest.warns(UserWarning, match="of 100 realisations failed.*at t = "):
        node = study.run()["monte-carlo"]
    samples = node["scalars/samples"]
    inputs, response = samples["inputs"].values[:, 0], samples["response"].values[:, 0]
    met = (inputs > 0) & (inputs < 1)
    assert ((samples["status"].values == Status.NOT_FINITE) == met).all()
    assert np.isnan(response[met]).all()
    np.testing.assert_allclose(response[~met], -1 / inputs[~met], rtol=1e-6)
    assert float(node["scalars/statistics/mean"][0]) == pytest.approx(response[~met].mean())
    assert node["requirements"].attrs["failed"] == met.sum()
    assert int(node["requirements/violations"][0]) == (response[~met] > 3).sum()
