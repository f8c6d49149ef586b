"""Dimensions of expressions: what does not fit is found, and what fits is left alone."""

import warnings
from fractions import Fraction

import chaospy
import pytest
import sympy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.mechanism import find_unit_problems
from uqmbd.mechanism.expressions import mismatches
from uqmbd.units import in_words, read_units
from uqmbd_joints import Revolute
from uqmbd_springs import PointForce, SpringDamper

from .written import COHERENT, FACTORS, UNITS, Measured, expressions, symbol_of


@settings(max_examples=40, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.data())
def test_what_is_of_one_dimension_is_left_alone(data):
    whole_expressions(data)


@pytest.mark.slow
@settings(max_examples=5000, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.data())
def test_thousands_of_one_dimension_are_left_alone(data):
    whole_expressions(data)


def whole_expressions(data):
    dimension = data.draw(st.sampled_from(list(COHERENT)))
    whole = data.draw(expressions(dimension, data.draw(st.integers(0, 3))))
    assert mismatches("it", whole, COHERENT[dimension]) == []
    converted = data.draw(st.sampled_from([u for u in FACTORS if read_units(u).dimension == dimension] or ["s"]))
    if read_units(converted).dimension == dimension:
        assert mismatches("it", whole / FACTORS[converted], converted) == []
    factor = data.draw(st.sampled_from([sympy.Float(9.81), sympy.Integer(2), sympy.Rational(-1, 3), sympy.pi]))
    for units in UNITS:  # a number may have any dimension
        assert mismatches("it", factor * symbol_of(dimension), units) == []


@settings(max_examples=40, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.data())
def test_one_term_of_another_dimension_is_found(data):
    broken_expressions(data)


@pytest.mark.slow
@settings(max_examples=5000, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.data())
def test_one_term_of_another_dimension_is_found_in_thousands(data):
    broken_expressions(data)


def broken_expressions(data):
    dimension, broken = data.draw(st.sampled_from(list(COHERENT))), []
    whole = data.draw(expressions(dimension, data.draw(st.integers(1, 3)), broken))
    if broken:
        found = mismatches("it", whole)
        assert found and not any(one.certain for one in found)
    other = data.draw(st.sampled_from([d for d in COHERENT if d != dimension]))
    simple = symbol_of(dimension) * symbol_of(other) / symbol_of(other)
    (one,) = mismatches("it", simple, COHERENT[other])
    assert in_words(dimension) in one.text or COHERENT[dimension] in one.text


@pytest.fixture
def mechanism():
    found = uqmbd.Mechanism("crank", uqmbd.Planar(gravity=(0, -9.81)))
    crank = found.body("crank", mass=2, inertia=0.5)
    found.body("rod", mass=3, inertia=0.5, position=(0.4, 0))
    found.add(Revolute("pin", found.ground, crank, (0, 0), (0, 0)))
    return found


def variable(units):
    return uqmbd.RandomVariable(f"v in {units}".replace("/", " per "), chaospy.Uniform(1, 2), units=units)


def dimensions(call):
    with pytest.warns(uqmbd.UnitsWarning) as told:
        call()
    assert len(told) == 1
    assert told[0].filename == __file__  # the line that states them
    return str(told[0].message)


def test_outputs_of_another_dimension_are_reported(mechanism):
    crank, pin = mechanism.bodies["crank"], mechanism.components["pin"]
    text = dimensions(lambda: mechanism.output("x", crank.position[0] + pin.reaction_force[0], units="m"))
    assert "in N" in text and "in m" in text and "output 'x'" in text
    text = dimensions(lambda: mechanism.output("slider_x", crank.position[0], units="N"))
    assert "crank.x is in m" in text and "N" in text
    text = dimensions(lambda: mechanism.output("sine", sympy.sin(crank.position[0])))
    assert "sin" in text and "crank.x is in m" in text
    assert "units is 'meter'; write 'm'" in dimensions(lambda: mechanism.output("y", crank.position[1], units="meter"))
    assert list(mechanism.outputs) == ["x", "slider_x", "sine", "y"]  # a warning, and the output is there


@pytest.mark.parametrize(
    ("expression", "units"),
    [
        (lambda c, p: c.position[0] - 0.3, "m"),
        (lambda c, p: c.position.norm(), "m"),
        (lambda c, p: c.point((1, 0))[0], "m"),
        (lambda c, p: c.point_velocity((1, 0.5))[0], "m/s"),
        (lambda c, p: c.mass * c.acceleration[0], "N"),
        (lambda c, p: 1000 * c.position[0], "mm"),
        (lambda c, p: c.angle * 180 / sympy.pi, "deg"),
        (lambda c, p: c.angular_velocity * 30 / sympy.pi, "rpm"),
        (lambda c, p: c.angular_velocity * p.reaction_moment, "W"),
        (lambda c, p: sympy.atan2(c.position[1], c.position[0]), "rad"),
        (lambda c, p: sympy.sqrt(p.reaction_force.dot(p.reaction_force)) / 1000, "kN"),
        (lambda c, p: c.position[0] * sympy.cos(c.angle), "m"),
        (lambda c, p: 9.81 * c.position[1], "J"),
        (lambda c, p: sympy.sin(2 * uqmbd.t) + c.position[0], "m"),
        (lambda c, p: uqmbd.integral(c.position[0]), "m s"),
        (lambda c, p: uqmbd.maximum(p.reaction_force[0]) - 3, "N"),
        (lambda c, p: uqmbd.time_of_maximum(c.position[0]), "s"),
        (lambda c, p: uqmbd.eigenfrequency(1) * 2 * sympy.pi, "rad/s"),
        (lambda c, p: c.position[0] + variable("mm") / 1000, "m"),
        (lambda c, p: c.position[0] * 1000 + variable("mm"), "mm"),
        (lambda c, p: c.position[0] * variable(""), "N"),
        (lambda c, p: c.position[0] * variable("N/m"), "N"),
        (lambda c, p: sympy.Piecewise((c.position[0], c.position[0] > 0.1), (0, True)), "m"),
        (lambda c, p: uqmbd.step(uqmbd.t, 0, 0, 1, 1) * c.position[0], "m"),
        (lambda c, p: uqmbd.step(uqmbd.t, 0, 0, 1, 2) * c.position[0], "N"),
        (lambda c, p: c.mass * c.velocity[0] ** 2 / 2, "J"),  # a mass of 2 kg, of which the half is 1
        (lambda c, p: 1000 * (0.02 * c.position[0]), "mm"),
        (lambda c, p: 0.01 * c.position[0] + variable("mm") / 1000, "m"),
        (lambda c, p: sympy.Rational(1, 3) * c.velocity[0] * 3.6, "km/h"),
        (lambda c, p: 1000 * (1 + sympy.sin(c.angle) / 50) * c.position[0], "mm"),
        (lambda c, p: uqmbd.step(uqmbd.t, 0, 0, 1, 1000) * c.position[0], "mm"),
        (lambda c, p: sympy.Piecewise((1000, uqmbd.t < 1), (0, True)) * c.position[0], "mm"),
        (lambda c, p: variable("N/m^1.33") * sympy.Max(c.position[0], 0) ** 1.33, "N"),
        (lambda c, p: variable("N/m^n") * sympy.Max(c.position[0], 0) ** 1.7, "N"),
        (lambda c, p: p.angle * 180 / sympy.pi - variable("deg"), "deg"),
    ],
)
def test_outputs_that_fit_are_left_alone(mechanism, expression, units):
    crank, pin = mechanism.bodies["crank"], mechanism.components["pin"]
    mechanism.output("it", expression(crank, pin), units=units)


@pytest.mark.parametrize(
    ("expression", "units", "remedy"),
    [
        (lambda c, p: c.position[0], "mm", "1000*crank.x"),
        (lambda c, p: -2 * c.position[0], "mm", "1000*"),
        (lambda c, p: c.angle, "deg", "180/pi*crank.angle"),
        (lambda c, p: c.angular_velocity, "rpm", "30/pi*"),
        (lambda c, p: p.reaction_force[0], "kN", "pin.reaction_force[0]/1000"),
        (lambda c, p: c.position[0] / variable("m"), "%", "100*"),
        (lambda c, p: c.position[0] + variable("mm"), "m", "1000"),
        (lambda c, p: 9.81 * c.position[0] + c.position[1] + variable("mm"), "", "1000"),
        (lambda c, p: c.position[0] / 2, "mm", "1000*"),
        (lambda c, p: sympy.sin(variable("deg")), "1", "pi/180"),
        (lambda c, p: c.velocity.norm(), "km/h", "18/5*"),
    ],
)
def test_numbers_in_other_units_than_stated_are_refused(mechanism, expression, units, remedy):
    crank, pin = mechanism.bodies["crank"], mechanism.components["pin"]
    with pytest.raises(uqmbd.StudyError, match="output 'it'") as error:
        mechanism.output("it", expression(crank, pin), units=units)
    assert remedy in str(error.value)


def test_parameters_are_compared_with_what_they_are_declared_in(mechanism):
    crank, rod = mechanism.bodies["crank"], mechanism.bodies["rod"]
    assert "mass" in dimensions(lambda: mechanism.body("a", mass=variable("m"), inertia=1))
    assert "position" in dimensions(lambda: mechanism.body("b", mass=1, inertia=1, position=(variable("N"), 0)))
    assert "point_i" in dimensions(lambda: mechanism.add(Revolute("joint", crank, rod, (variable("kg"), 0), (0, 0))))
    assert "stiffness" in dimensions(
        lambda: mechanism.add(SpringDamper("spring", crank, rod, (0, 0), (0, 0), stiffness=variable("N")))
    )
    with pytest.raises(uqmbd.StudyError, match=r"point_i.*in mm.*Write .*/1000"):
        mechanism.add(Revolute("wrong", crank, rod, (variable("mm"), 0), (0, 0)))
    with pytest.raises(uqmbd.StudyError, match=r"angle.*in deg.*pi/180"):
        mechanism.body("c", mass=2, inertia=1, angle=variable("deg"))
    mechanism.add(Revolute("right", crank, rod, (variable("mm") / 1000, variable("m")), (variable(""), 0)))


def test_laws_are_compared_as_well(mechanism):
    crank = mechanism.bodies["crank"]
    text = dimensions(
        lambda: mechanism.add(PointForce("drag", crank, (0, 0), (-crank.velocity[0] * variable("N/m"), 0)))
    )
    assert "force" in text
    mechanism.add(PointForce("right", crank, (0, 0), (-crank.velocity[0] * variable("N s/m"), 0)))
    mechanism.add(PointForce("number", crank, (0, 0), (-2.5 * crank.velocity[0], 0)))


def test_requirements_and_start_conditions_are_compared(mechanism):
    crank = mechanism.bodies["crank"]
    mechanism.require("right", crank.position[0] <= 0.47)
    mechanism.require("random", crank.position[0] <= variable("m"))
    assert "requirement 'wrong'" in dimensions(lambda: mechanism.require("wrong", crank.position[0] <= variable("N")))
    with pytest.raises(uqmbd.StudyError, match="in mm"):
        mechanism.require("small", crank.position[0] <= variable("mm"))
    assert "start" in dimensions(lambda: mechanism.start(crank.angle, variable("m")))


def test_a_number_one_of_the_mechanism_may_have_been_in_a_product():
    """A mass of 1 kg leaves no trace in mass * acceleration."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    stone = mechanism.body("stone", mass=1)
    mechanism.output("force", stone.mass * stone.acceleration[0], units="N")
    mechanism.output("energy", stone.mass * stone.velocity[0] ** 2 / 2, units="J")
    heavy = mechanism.body("heavy", mass=2)
    mechanism.output("its force", heavy.mass * heavy.acceleration[0], units="N")
    assert "position" not in dimensions(lambda: mechanism.output("x", stone.position[0], units="rad"))


def test_powers():
    x = Measured("m")
    assert mismatches("it", x ** sympy.Rational(3, 2), "m^1.5") == []
    assert mismatches("it", x**1.5 / Measured("m^(1/2)"), "m") == []
    assert mismatches("it", x**2, "m")
    assert mismatches("it", sympy.Pow(2, x))
    assert read_units("m^1.5").dimension[0] == Fraction(3, 2)


def test_all_findings_of_a_mechanism_are_reported_together():
    mechanism = uqmbd.Mechanism("spring", uqmbd.Line())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.UnitsWarning)
        stone = mechanism.body("stone", mass=variable("m"))
        mechanism.output("x", stone.position[0], units="N")
        mechanism.output("y", stone.position[0], units="meter")
        mechanism.require("near", stone.position[0] <= variable("kg"))
        mechanism.start(stone.velocity[0], variable("rad"))
    found = find_unit_problems(mechanism)
    assert len(found) == 5
    for words in ("body 'stone': mass", "output 'x'", "write 'm'", "requirement 'near'", "start condition"):
        assert sum(words in sentence for sentence in found) == 1
    assert all(sentence.endswith(".") for sentence in found)


def test_a_mechanism_that_fits_has_no_findings(mechanism):
    mechanism.output("x", mechanism.bodies["crank"].position[0], units="m")
    assert find_unit_problems(mechanism) == ()


FREQUENCY, DAMPING = uqmbd.eigenfrequency(1), uqmbd.damping_ratio(1)


@pytest.mark.parametrize(
    ("expression", "units", "words"),
    [
        (FREQUENCY, "m/s", "is in Hz, but its declared units are m/s"),
        (FREQUENCY, "m", "is in Hz, but its declared units are m;"),
        (DAMPING, "m", "is in 1, but its declared units are m;"),
        (FREQUENCY, "rad/s", r"wrong by a factor of 6.28319. Write 2\*pi\*eigenfrequency"),
        (FREQUENCY, "rpm", r"wrong by a factor of 60. Write 60\*eigenfrequency"),
        (FREQUENCY, "deg/s", r"wrong by a factor of 360. Write 360\*eigenfrequency"),
        (uqmbd.eigenfrequency(2) - FREQUENCY, "rad/s", "wrong by a factor of 6.28319"),
        *((FREQUENCY, units, "") for units in ("Hz", "1/s")),
        *((2 * sympy.pi * FREQUENCY, units, "") for units in ("rad/s", "1/s")),
        (60 * FREQUENCY, "rpm", ""),
        (360 * FREQUENCY, "deg/s", ""),
    ],
)
def test_units_of_natural_frequencies(expression, units, words) -> None:
    """Definitions: 1 Hz is 2 pi rad/s, 60 rpm, 360 deg/s. Masses and lengths of 1 are no invisible factors of a symbol."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mechanism.body("mass", mass=1, position=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if not words:
            mechanism.output("value", expression, units=units)
            return
        with pytest.raises((uqmbd.StudyError, uqmbd.UnitsWarning), match=words):
            mechanism.output("value", expression, units=units)
