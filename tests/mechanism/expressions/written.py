"""Expressions of known dimension, as people write them, for tests of units."""

from __future__ import annotations

import itertools
from fractions import Fraction

import chaospy
import sympy
from hypothesis import strategies as st

import uqmbd
from uqmbd.units import PURE, read_units
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import SpringDamper

__all__ = ["COHERENT", "FACTORS", "UNITS", "Measured", "conversion", "expressions", "symbol_of"]


class Measured(sympy.Symbol):
    """A symbol with units, each its own: nothing cancels."""

    count = itertools.count()

    def __new__(cls, units):
        self = sympy.Symbol.__xnew__(cls, f"x{next(cls.count)}", real=True)
        self.units = units
        return self

    def _hashable_content(self):
        return (*super()._hashable_content(), self.units)


UNITS = ["m", "kg", "s", "N", "N m", "m/s", "rad/s", "N/m", "1", "kg m^2"]
COHERENT = {read_units(text).dimension: text for text in UNITS}
FACTORS = {
    "mm": sympy.Rational(1, 1000), "g": sympy.Rational(1, 1000), "ms": sympy.Rational(1, 1000), "kN": sympy.Integer(1000),
    "kN m": sympy.Integer(1000), "km/h": sympy.Rational(5, 18), "rpm": sympy.pi / 30, "N/mm": sympy.Integer(1000),
    "%": sympy.Rational(1, 100), "deg": sympy.pi / 180, "g mm^2": sympy.Rational(1, 10**9),
}  # fmt: skip
"""Units, and what their numbers are multiplied by to be in the SI's: written down here, not computed by what is tested."""


def conversion(draw, units):
    """The factor between units, as it is written: exactly, or as a decimal number."""
    exact = FACTORS[units]
    return draw(st.sampled_from([exact, sympy.Float(float(exact)), sympy.Float(f"{float(exact):.4g}")]))


def variable(name, units):
    return uqmbd.RandomVariable(name, chaospy.Uniform(1, 2), units=units)


def machine():
    """Symbols of a mechanism, by what they are measured in."""
    mechanism = uqmbd.Mechanism("crank", uqmbd.Planar(gravity=(0, -9.81)))
    mass, stiffness = variable("mass", "kg"), variable("stiffness", "N/m")
    crank = mechanism.body("crank", mass=mass, inertia=variable("inertia", "kg m^2"))
    slider = mechanism.body("slider", mass=3.5, inertia=0.3, position=(0.4, 0))
    pin = mechanism.add(Revolute("pin", mechanism.ground, crank, (0, 0), (-variable("length", "mm") / 1000, 0)))
    slide = mechanism.add(Prismatic("slide", mechanism.ground, slider, (0, 0), (0, 0), axis=(1, 0)))
    spring = mechanism.add(
        SpringDamper("spring", crank, slider, (0, 0), (0, 0), stiffness, damping=2.5, free_length=0.2)
    )
    driver = mechanism.add(RotationDriver("motor", mechanism.ground, crank, 3.5 * uqmbd.t))
    points = crank.point((0.1, 0.02)), slider.point((0.3, 0))
    return {
        "m": [crank.position[0], slider.position[1], points[0][0], (points[0] - points[1]).norm(), slide.displacement],
        "kg": [crank.mass, mass],
        "s": [variable("time constant", "s"), uqmbd.time_of_maximum(crank.position[0])],
        "N": [pin.reaction_force[0], slider.mass * slider.acceleration[0], crank.mass * crank.acceleration[1]],
        "N m": [driver.reaction_moment, uqmbd.maximum(driver.reaction_moment)],
        "m/s": [crank.velocity[0], slider.point_velocity((0.1, 0.02))[0]],
        "rad/s": [crank.angular_velocity],
        "N/m": [spring.stiffness, stiffness],
        "1": [crank.angle, pin.angle, sympy.atan2(crank.position[1], crank.position[0]), variable("friction", "1")],
        "kg m^2": [crank.inertia],
    }


SYMBOLS = []


def symbol_of(dimension):
    text = COHERENT.get(dimension)
    return Measured(text or f"1 {' '.join(f'{u}^({p})' for u, p in zip(['m', 'kg', 's'], dimension, strict=False))}")


def less(one, other):
    return tuple(a - b for a, b in zip(one, other, strict=True))


def times(dimension, factor):
    return tuple(factor * d for d in dimension)


@st.composite
def leaves(draw, dimension):
    """A symbol, one in other units times the factor between them, or an expression of a mechanism."""
    text = COHERENT.get(dimension)
    kind = draw(st.sampled_from(["symbol", "converted", "machine"]))
    if kind == "machine" and text:
        if not SYMBOLS:
            SYMBOLS.append(machine())
        return draw(st.sampled_from(SYMBOLS[0][text]))
    scaled = [units for units in FACTORS if read_units(units).dimension == dimension]
    if kind == "converted" and scaled:
        units = draw(st.sampled_from(scaled))
        return Measured(units) * conversion(draw, units)
    return symbol_of(dimension)


NUMBERS = [sympy.Float(0.3), sympy.Integer(7), -sympy.pi, sympy.Integer(0)]
OF_TIME = [
    lambda w: sympy.sin(w * uqmbd.t),
    lambda w: 1 + sympy.Rational(1, 5) * sympy.cos(w * uqmbd.t),
    lambda w: 1000 * (1 + sympy.sin(3 * uqmbd.t) / 10) / 1000,
    lambda w: 1 - sympy.exp(-w * uqmbd.t),
    lambda w: uqmbd.step(uqmbd.t, 0, 0, 1, 1),
    lambda w: uqmbd.step(uqmbd.t, 0.1, 0, 0.4, 2.5),
    lambda w: uqmbd.spline([0, 1, 2, 3], [0, 0.3, 0.2, 0]),
]


@st.composite
def expressions(draw, dimension, depth, broken=None):
    """An expression of a dimension; `broken` is a list that gets one entry where a term of another one is put in."""
    kinds = [
        "sum", "sum", "product", "power", "root", "function", "greatest", "pieces", "course", "tabulated", "angle",
        "ratio", "one", "norm", "sign", "share",
    ]  # fmt: skip
    if broken is not None:  # in these nothing is known of what is within
        kinds = [kind for kind in kinds if kind not in ("course", "tabulated", "share")]
    kind = draw(st.sampled_from(kinds)) if depth else "leaf"

    def inner(d, spoilt=None):
        return draw(expressions(d, depth - 1, spoilt))

    if kind == "leaf":
        return draw(leaves(dimension))
    if kind == "sum":
        terms = [inner(dimension) for _ in range(draw(st.integers(1, 2)))] + [inner(dimension, broken)]
        if broken is not None and not broken:
            others = [d for d in COHERENT if d not in (dimension, PURE)]
            broken.append(draw(st.sampled_from(others)))
            terms = [symbol_of(dimension), *terms, symbol_of(broken[0])]
        if draw(st.booleans()):
            terms.append(draw(st.sampled_from(NUMBERS)))
        signs = [draw(st.sampled_from([1, -1])) for _ in terms]
        return sympy.Add(*(sign * term for sign, term in zip(signs, terms, strict=True)))
    if kind == "product":
        other = draw(st.sampled_from(list(COHERENT)))
        return inner(less(dimension, other), broken) * inner(other)
    if kind == "power":
        power = draw(st.sampled_from([sympy.Integer(-1), sympy.Float(1.5), sympy.Rational(1, 3), sympy.Float(1.33)]))
        return inner(times(dimension, 1 / Fraction(str(power))), broken) ** power
    if kind == "root":
        return sympy.sqrt(inner(times(dimension, 2), broken))
    if kind == "norm":
        return sympy.sqrt(inner(dimension, broken) ** 2 + inner(dimension) ** 2)
    if kind == "function":
        function = draw(st.sampled_from([sympy.sin, sympy.exp, sympy.tanh, sympy.atan, sympy.tan]))
        return function(inner(PURE, broken)) * inner(dimension)
    if kind == "angle":
        two = draw(st.sampled_from(list(COHERENT)))
        return sympy.atan2(inner(two, broken), inner(two)) * inner(dimension)
    if kind == "ratio":
        two = draw(st.sampled_from(list(COHERENT)))
        return inner(dimension, broken) * symbol_of(two) / symbol_of(two)
    if kind == "one":
        ones = [-1, 2, sympy.Rational(1, 3)] + [sympy.Float(1.0)] * (broken is None)  # 1.0 says that it has units
        return draw(st.sampled_from(ones)) * inner(dimension, broken)
    if kind == "sign":
        function = draw(st.sampled_from([sympy.sign, sympy.Heaviside]))
        return function(inner(draw(st.sampled_from(list(COHERENT))), broken)) * inner(dimension)
    if kind == "pieces":
        two = draw(st.sampled_from(list(COHERENT)))
        limit = draw(st.sampled_from([sympy.Float(0.3), symbol_of(two)]))
        conditions = [symbol_of(two) > limit, sympy.And(symbol_of(two) > limit, uqmbd.t < 1), uqmbd.t > 0.5]
        last = draw(st.sampled_from([sympy.Integer(0), symbol_of(dimension)]))
        return sympy.Piecewise((inner(dimension, broken), draw(st.sampled_from(conditions))), (last, True))
    if kind == "course":
        rate = draw(
            st.sampled_from([sympy.Integer(3), 2 * sympy.pi * Measured("Hz"), symbol_of(read_units("1/s").dimension)])
        )
        return inner(dimension) * draw(st.sampled_from(OF_TIME))(rate)
    if kind == "tabulated":
        table = uqmbd.spline([0, 0.1, 0.2, 0.3], [0, 1, 1.5, 2])
        return table(inner(draw(st.sampled_from(list(COHERENT)))))
    if kind == "share":  # a pure number, in front of what is in the SI's units
        return draw(st.sampled_from([sympy.Float(0.3), sympy.Rational(3, 7), 1 + Measured("%") / 100])) * inner(
            dimension
        )
    function = draw(st.sampled_from([sympy.Max, sympy.Min]))
    return function(inner(dimension, broken), inner(dimension))
