"""Polynomials of a motion, which summaries of plugins receive."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.compiled import PLACES, SERIES
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper


def polynomials(functions, edges):
    """Interpolate functions of time on parts between edges."""
    begin, end = np.asarray(edges[:-1], dtype=float), np.asarray(edges[1:], dtype=float)
    times = begin[:, None] + (end - begin)[:, None] * PLACES
    return uqmbd.extend.MotionPolynomials(begin, end, np.stack([f(times) @ SERIES for f in functions]))


@uqmbd.extend.summary(polynomials=True, further=("rad",), power=1)
def integral_over_angle(motion, order):
    """Return an integral over an angle, or the reason why there is none."""
    times = np.linspace(motion.begin[0], motion.end[-1], 4001)
    x, angle = motion.at(times)
    if np.any(np.diff(angle) < 0):
        return "the angle decreases"
    return np.trapezoid(x * np.cos(order * angle), angle)


@uqmbd.extend.summary(polynomials=True, power=0)
def number_of_turns(motion):
    return float(len(motion.turning_points()))


def oscillator(amplitude=2.0):
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=amplitude)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=(2 * np.pi) ** 2))
    return mechanism, mass


def test_values_derivatives_parts_and_turning_points_are_those_of_the_functions():
    motion = polynomials([np.sin, lambda t: t**3], np.linspace(0, 10, 41))
    times = np.linspace(0, 10, 1001)
    np.testing.assert_allclose(motion.at(times), [np.sin(times), times**3], atol=1e-9)
    np.testing.assert_allclose(motion.at(times, derivative=1), [np.cos(times), 3 * times**2], atol=1e-7)
    np.testing.assert_allclose(motion.turning_points(), [0, 1, -1, 1, np.sin(10)], atol=1e-9)
    np.testing.assert_allclose(motion.turning_points(1), [0, 1000])
    some = motion.between(0.6, 7.13)
    assert some.begin[0] == 0.6 and some.end[-1] == 7.13 and (some.begin[1:] == some.end[:-1]).all()
    inside = np.linspace(0.6, 7.13, 301)
    np.testing.assert_allclose(some.at(inside), motion.at(inside), atol=1e-9)
    np.testing.assert_allclose(some.turning_points(), [np.sin(0.6), 1, -1, np.sin(7.13)], atol=1e-9)
    assert motion.between(-5, 50).begin[0] == 0 and motion.between(-5, 50).end[-1] == 10


def test_both_sides_of_a_jump_are_turning_points():
    begin, end = np.array([0.0, 1.0]), np.array([1.0, 2.0])
    motion = uqmbd.extend.MotionPolynomials(begin, end, np.eye(8)[None, [1, 1]])
    np.testing.assert_array_equal(motion.turning_points(), [-1, 1, -1, 1])
    np.testing.assert_array_equal(motion.at(np.array([1.0])), [[-1.0]])


def test_extremes_at_the_end_of_a_part_and_constants():
    motion = polynomials([lambda t: np.cos(np.pi * t)], [0.0, 0.5, 1.0, 1.5, 2.0, 3.0])
    np.testing.assert_allclose(motion.turning_points(), [1, -1, 1, -1], atol=1e-5)
    still = polynomials([lambda t: np.ones_like(t)], [0.0, 1.0])
    assert len(still.turning_points()) <= 2


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_function_receives_several_expressions_of_a_motion(integrator):
    """The integral of 2 cos(a) cos(a) over a whole turn is 2 pi; with the third order it is zero."""
    mechanism, mass = oscillator()
    for order in (1, 3):
        value = integral_over_angle(mass.position[0], 2 * np.pi * uqmbd.t, order)
        mechanism.output(f"order_{order}", value, units="m")
    mechanism.output("turns", number_of_turns(mass.position[0]), units="1")
    found = uqmbd.simulate(mechanism, [0, 1], integrator=integrator, rtol=1e-8)
    np.testing.assert_allclose(found["order_1"], 2 * np.pi, rtol=1e-5)
    np.testing.assert_allclose(found["order_3"], 0, atol=1e-5)
    assert float(found["turns"]) == 3


@pytest.mark.thorough
def test_every_method_propagates_it_and_requirements_contain_it():
    amplitude = uqmbd.RandomVariable("a", chaospy.Uniform(1, 2), units="m")
    mechanism, mass = oscillator(amplitude)
    mechanism.output("first", integral_over_angle(mass.position[0], 2 * np.pi * uqmbd.t, 1), units="m")
    mechanism.require("small", integral_over_angle(mass.position[0], 2 * np.pi * uqmbd.t, 1) <= 1.5 * np.pi)
    methods = [MonteCarlo(samples=64, sampling="sobol", seed=1), Collocation(order=2)]
    tree = uqmbd.Study("oscillator", mechanism, [0, 1], methods).run()
    for label in ("monte-carlo", "collocation"):
        data = tree[label]["scalars/statistics"].dataset
        np.testing.assert_allclose(data["mean"], [1.5 * np.pi], rtol=1e-3)
        lower, upper = tree[label]["requirements"].dataset["interval"].values[0]
        assert lower <= 0.5 <= upper


def test_a_realisation_is_refused_with_the_reason_of_the_function():
    """Angles that decrease in some realisations."""
    speed = uqmbd.RandomVariable("w", chaospy.Uniform(-0.3, 1), units="rad/s")
    mechanism, mass = oscillator()
    mechanism.output("first", integral_over_angle(mass.position[0], speed * uqmbd.t, 1), units="m")
    with pytest.warns(UserWarning, match=r"'first' has no value: .*integral_over_angle\(mass.x.*: the angle decreases"):
        node = uqmbd.Study("o", mechanism, [0, 1]).propagate(MonteCarlo(samples=32, seed=1))
    samples = node["scalars/samples"].dataset
    np.testing.assert_array_equal(samples["status"].values != 0, samples["inputs"].values[:, 0] < 0)


def test_a_further_expression_that_is_not_finite_fails():
    mechanism, mass = oscillator()
    mechanism.output("first", integral_over_angle(mass.position[0], 1 / (uqmbd.t - 0.5), 1))
    with pytest.raises(uqmbd.UqmbdError, match="'first' is not finite"):
        uqmbd.simulate(mechanism, [0, 1])


def test_jumps_of_an_impact_are_turning_points():
    mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-10))
    ball = mechanism.body("ball", mass=1, position=0.05)
    mechanism.add(PlaneImpact("floor", mechanism.ground, ball, 0, 0, 1, restitution=0.5))
    mechanism.output("turns", number_of_turns(ball.velocity[0]), units="1")
    # from 0 down to -1, up to 0.5, down to -0.4
    assert float(uqmbd.simulate(mechanism, [0, 0.19])["turns"]) == 4


def test_units_are_compared():
    mechanism, mass = oscillator()
    with pytest.warns(uqmbd.UnitsWarning, match=r"is in m, but its declared units are N"):
        mechanism.output("wrong", integral_over_angle(mass.position[0], 2 * np.pi * uqmbd.t, 1), units="N")
    with pytest.warns(uqmbd.UnitsWarning, match="mass.x is in m, but its declared units are rad"):
        mechanism.output("angle", integral_over_angle(mass.position[0], mass.position[0], 1), units="m")
    with pytest.raises(uqmbd.StudyError, match="wrong by a factor of 1000"):
        mechanism.output("scaled", integral_over_angle(mass.position[0], 2 * np.pi * uqmbd.t, 1), units="mm")


def _nothing(motion):
    return 1.0


def test_declarations_of_one_function_with_different_units_differ():
    x = oscillator()[1].position[0]
    one, same, other = (uqmbd.extend.summary(_nothing, polynomials=True, power=k)(x) for k in (1, 1, 2))
    assert one == same != other


@pytest.mark.parametrize(
    ("declare", "text"),
    [
        (lambda: uqmbd.extend.summary(_nothing, units="s"), "power is None; expected known units"),
        (lambda: uqmbd.extend.summary(_nothing, power=1, units="foo"), "units is 'foo'"),
        (lambda: uqmbd.extend.summary(_nothing, further=("rad",)), "and polynomials=True"),
        (lambda: uqmbd.extend.summary(_nothing, polynomials=True, further=("foo",)), r"further=\('foo',\)"),
        (lambda: uqmbd.extend.summary(_nothing, polynomials=True, further="rad"), "further is 'rad'"),
        (lambda: integral_over_angle(oscillator()[1].position[0]), "given 1 expressions; expected 2"),
        (lambda: integral_over_angle(oscillator()[1].position[0], 3.0), "which is equal in every pose"),
        (lambda: integral_over_angle(oscillator()[1].position[0], uqmbd.t, "1"), "finite numbers"),
    ],
)
def test_other_declarations_are_refused(declare, text):
    with pytest.raises(uqmbd.StudyError, match=text):
        declare()
