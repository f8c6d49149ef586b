"""Wrong units of a coefficient are found, and right ones pass."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.testing.components.cases import component_cases
from uqmbd.testing.components.units import check_units
from uqmbd.units import read_units

UNITS = ["1", "rad", "m", "mm", "m^2", "kg", "s", "K", "N", "N/m", "N/m^2", "N/m^3", "J", "N m s", "N m s/rad", "N s/m", "N s^2/m^2", "kg m^2"]  # fmt: skip
PURE = [
    1,
    2,
    -3,
    sympy.Rational(1, 2),
    sympy.Rational(2, 7),
    sympy.pi,
    sympy.sqrt(2),
    0.5,
    0.25,
    4 / 3,
    2.0,
    0.5 * math.pi,
]


def made(units, terms_of, spaces_of=(uqmbd.Line,)):
    class Made(uqmbd.Component):
        """A component with one coefficient."""

        spaces = spaces_of
        c = uqmbd.Parameter(units, "coefficient")
        length = uqmbd.Parameter("m", "length")

        def terms(self, p):
            yield terms_of(p)

    return Made


def passes(component):
    (space,) = component.spaces
    case = next(iter(component_cases(component, space, {}, np.random.default_rng(0))))
    try:
        check_units("it", case.component, case.mechanism.space)
    except AssertionError:
        return False
    return True


def alike(one, other):
    return read_units(one) == read_units(other)


@settings(max_examples=40, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.data())
def test_wrong_units_of_a_coefficient_of_a_potential_are_found(data):
    power = data.draw(st.integers(1, 4))
    number = data.draw(st.sampled_from(PURE))
    shape = data.draw(
        st.sampled_from([lambda s: 1, sympy.cos, sympy.exp, lambda s: 1 + s**2, lambda s: 1 / (3 + s**2)])
    )
    units = data.draw(st.sampled_from(UNITS))
    offset = data.draw(st.integers(0, 1))  # 1: from the length

    def term(p):
        x = p.body_j.position[0] - p.body_i.position[0]
        return uqmbd.Potential(number * p.c * (x - p.length * offset) ** power * shape(x / p.length))

    right = f"J/m^{power}"
    assert passes(made(right, term))
    assert passes(made(units, term)) == alike(units, right)


@settings(max_examples=40, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.data())
def test_wrong_units_of_a_damper_are_found(data):
    space, right = data.draw(
        st.sampled_from([(uqmbd.Line, "N s/m"), (uqmbd.Planar, "N m s/rad"), (uqmbd.Spatial, "N m s")])
    )
    number = data.draw(st.sampled_from(PURE))
    units = data.draw(st.sampled_from(UNITS))

    def term(p):
        kind = "velocity" if space is uqmbd.Line else "angular_velocity"
        rate = getattr(p.body_j, kind) - getattr(p.body_i, kind)
        return uqmbd.VirtualWork(-number * p.c * rate, rate)

    assert passes(made(right, term, (space,)))
    assert passes(made(units, term, (space,))) == alike(units, right)


@pytest.mark.parametrize("number", [1.0, 9.81, 0.7])
def test_other_floats_may_have_units(number):
    def term(p):
        return uqmbd.Potential(number * p.c * (p.body_j.position[0] - p.body_i.position[0]))

    assert all(passes(made(units, term)) for units in ("N", "kg", "K"))


def test_a_term_without_a_coefficient_has_an_implicit_one():
    def term(p):
        return uqmbd.Potential((p.body_j.position[0] - p.body_i.position[0] - p.length) ** 2 / 2)

    class Bare(made("N", term)):
        """A spring of stiffness one."""

    assert passes(Bare)


def test_a_coefficient_may_be_a_corner_of_a_step():
    """The corners of the step are equal if the coefficient is zero, and infinite if its reciprocal is."""

    def force(p):
        x = p.body_j.position[0] - p.body_i.position[0]
        return uqmbd.VirtualWork(uqmbd.step(x, p.c / 2, 1, p.c, 0), p.body_j.velocity[0])

    assert passes(made("m", force))
