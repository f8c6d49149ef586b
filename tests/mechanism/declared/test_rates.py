"""Time derivatives of expressions, against those of splines through what was simulated."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.interpolate import make_interp_spline

import uqmbd
from uqmbd_joints import Revolute


@pytest.mark.thorough
def test_rates_of_what_moves_are_those_of_its_course():
    """Positions, angles of bodies and joints, angular velocity and time, once and twice."""
    mechanism = uqmbd.Mechanism("double", uqmbd.Planar(gravity=(0, -9.81)))
    upper = mechanism.body("upper", mass=1, inertia=0.1, position=(0.5, 0), angle=0)
    lower = mechanism.body("lower", mass=1, inertia=0.1, position=(1.5, 0), angle=0, angular_velocity=3)
    mechanism.add(Revolute("pin", mechanism.ground, upper, (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("knee", upper, lower, (0.5, 0), (-0.5, 0)))
    knee = mechanism.components["knee"]
    courses = {
        "point": lower.point((0.5, 0.1))[1] * sympy.cos(uqmbd.t),
        "angle": upper.angle * uqmbd.t,
        "knee": knee.angle**2,
        "spin": sympy.sin(1.0 * lower.angular_velocity),
    }
    twice = ("point", "angle", "knee")
    for name, course in courses.items():
        mechanism.output(name, course)
        mechanism.output(f"{name}_rate", uqmbd.time_derivative(course))
        if name in twice:
            mechanism.output(f"{name}_second", uqmbd.time_derivative(uqmbd.time_derivative(course)))
    times = np.linspace(0, 1, 401)
    found = uqmbd.simulate(mechanism, times, rtol=1e-10)
    for name in courses:
        spline = make_interp_spline(times, found[name].values, 7)
        inside = slice(20, -20)
        rate = spline.derivative()(times)[inside]
        assert found[f"{name}_rate"].values[inside] == pytest.approx(rate, abs=1e-6 * np.abs(rate).max())
        if name in twice:
            second = spline.derivative(2)(times)[inside]
            assert found[f"{name}_second"].values[inside] == pytest.approx(second, abs=1e-4 * np.abs(second).max())


def test_what_has_no_rate_is_reported():
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=1)
    mechanism.add(Revolute("pin", mechanism.ground, rod, (0, 0), (0, 0)))
    for expression in (rod.acceleration[0], mechanism.components["pin"].reaction_force[0], rod.angular_acceleration):
        with pytest.raises(
            uqmbd.StudyError, match=r"time_derivative\(\): the expression is .* the rate of .* is unknown"
        ):
            uqmbd.time_derivative(expression)
    assert uqmbd.time_derivative(3) == 0
