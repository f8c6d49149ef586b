"""Quantities of pint are taken where numbers are: what is computed is the same as with the SI's numbers."""

import subprocess
import sys

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.units import is_quantity, without_quantities
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper, TorsionSpringDamper

pint = pytest.importorskip("pint")
UNIT = pint.UnitRegistry()


class Plain:
    """Numbers of the SI in place of quantities of pint."""

    def __call__(self, value, units):
        return UNIT.Quantity(value, units).to_base_units().magnitude


def crank(q):
    mechanism = uqmbd.Mechanism("crank", uqmbd.Planar(gravity=q([0, -981], "cm/s^2")))
    body = mechanism.body(
        "crank", mass=q(500, "g"), inertia=q(20, "kg cm^2"), position=(q(10, "cm"), 0), angle=q(0, "deg"),
        com=q([1, 2], "mm"),
    )  # fmt: skip
    mass = mechanism.body(
        "mass", mass=q(2, "lb"), inertia=0.1, position=q([0.2, 0.3], "m"), velocity=q([36, 0], "km/h")
    )
    mechanism.add(Revolute("pin", mechanism.ground, body, at=q([5, 0], "cm")))
    mechanism.add(
        SpringDamper(
            "spring", body, mass, (0, 0), (0, q(1, "inch")), q(3, "N/mm"), damping=q(2, "N s/m"), free_length=0.2
        )
    )
    mechanism.add(TorsionSpringDamper("twist", mechanism.ground, body, stiffness=q(3, "N m/deg")))
    mechanism.add(PointForce("load", mass, body.position * 0, q([1, 0.5], "kN") / 1000))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("tip", body.point(q([30, 0], "mm"))[1], units="m")
    return mechanism


def test_a_mechanism_in_quantities_moves_as_that_in_numbers():
    times = np.linspace(0, 0.2, 5)
    exact = uqmbd.simulate(crank(Plain()), times)
    found = uqmbd.simulate(crank(UNIT.Quantity), UNIT.Quantity(times * 1000, "ms"))
    for name in ("x", "tip"):
        np.testing.assert_allclose(found[name], exact[name], rtol=1e-9)


def test_times_of_a_study_may_be_quantities():
    mechanism = crank(Plain())
    propagators = [MonteCarlo(samples=2, seed=1)]
    study = uqmbd.Study("crank", mechanism, times=np.linspace(0, 200, 5) * UNIT.ms, propagators=propagators)
    np.testing.assert_allclose(study.times, np.linspace(0, 0.2, 5))
    study = uqmbd.Study("crank", mechanism, times=[0 * UNIT.s, 1 * UNIT.min], propagators=propagators)
    assert study.times.tolist() == [0, 60]
    with pytest.raises(uqmbd.StudyError, match="times is the quantity .* expected a number or quantity in s"):
        uqmbd.Study("crank", mechanism, times=[0, 1] * UNIT.m, propagators=propagators)


def test_quantities_of_something_else_are_refused():
    mechanism = uqmbd.Mechanism("plane", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1)
    wrong = [
        (lambda: mechanism.body("b", mass=2 * UNIT.mm, inertia=1), "body 'b': mass is the quantity 2 millimeter"),
        (lambda: mechanism.body("b", mass=1, inertia=1, position=(2 * UNIT.kg, 0)), "position is the quantity"),
        (lambda: Revolute("p", mechanism.ground, body, UNIT.Quantity([1, 2], "N"), (0, 0)), "'p': point_i is the"),
        (lambda: SpringDamper("s", mechanism.ground, body, (0, 0), (0, 0), 5 * UNIT.N), "'s': stiffness is .* in N/m"),
        (lambda: uqmbd.Mechanism("g", uqmbd.Planar(gravity=(0, 9.81 * UNIT.m))), "gravity is the quantity"),
        (lambda: mechanism.output("x", 2 * UNIT.mm * body.position[0]), "output 'x'.*quantity.m_as"),
        (lambda: body.point((2 * UNIT.s, 0)), "local is the quantity"),
    ]
    for call, words in wrong:
        with pytest.raises(uqmbd.StudyError, match=words):
            made = call()
            mechanism.add(made)


def test_a_quantity_times_a_random_variable_is_converted():
    factor = uqmbd.RandomVariable("factor", chaospy.Uniform(1, 2), units="1")
    mechanism = uqmbd.Mechanism("plane", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1)
    pin = mechanism.add(Revolute("pin", mechanism.ground, body, (25 * UNIT.mm * factor, 0), (0, 0)))
    assert float(pin.point_i[0].subs(factor, 2)) == pytest.approx(0.05, rel=1e-15)


def test_values_at_the_start_may_be_quantities():
    mechanism = uqmbd.Mechanism("plane", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1)
    mechanism.start(body.angle, 30 * UNIT.deg)
    mechanism.start(body.position[0], 20 * UNIT.mm)
    residuals = [x.residual for x in mechanism.conditions.values()]
    assert float(residuals[0].subs(body.angle, 0)) == pytest.approx(-np.pi / 6)
    assert float(residuals[1].subs(body.position[0], 0)) == pytest.approx(-0.02)
    with pytest.raises(uqmbd.StudyError, match="the quantity"):
        mechanism.start(body.position[1], 20 * UNIT.deg)


def test_a_parameter_in_other_units_gets_numbers_in_those():
    assert without_quantities("it", 2 * UNIT.m, "mm") == pytest.approx(2000)
    assert without_quantities("it", 2 * UNIT.mm, "mm") == 2
    assert without_quantities("it", [1 * UNIT.m, 2], "m") == [1, 2]
    assert without_quantities("it", (np.array([1, 2]) * UNIT.cm,), "m") == ([0.01, 0.02],)
    assert without_quantities("it", sympy.pi, "m") == sympy.pi
    assert is_quantity(1 * UNIT.m) and not is_quantity(UNIT.m)


USE = """
import sys
import uqmbd
mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-9.81))
stone = mechanism.body("stone", mass=2)
mechanism.output("height", stone.position[0], units="m")
mechanism.output("speed", 3.6 * stone.velocity[0], units="km/h")
assert "pint" not in sys.modules
"""


def test_pint_is_not_imported_for_units_of_the_table():
    subprocess.run([sys.executable, "-c", USE], check=True)
