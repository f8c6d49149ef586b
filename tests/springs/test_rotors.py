"""Rotors and springs along an axis: what the kit asks of components, by every method, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd.testing import check_component
from uqmbd_joints import Prismatic, Revolute
from uqmbd_springs import RotorInertia, SlidingInertia, SlidingSpringDamper, Torque


@pytest.mark.slow
@pytest.mark.parametrize("component", [RotorInertia, SlidingInertia, SlidingSpringDamper])
def test_the_kit_accepts_it_by_every_method(component):
    check_component(component)


def test_a_motor_behind_a_gear_in_a_free_arm():
    """Two discs on one axis without a ground: (J1 + I) a1 - I a2 = -M and (J2 + I) a2 - I a1 = M."""
    mechanism = uqmbd.Mechanism("discs", uqmbd.Spatial())
    first = mechanism.body("first", 1, (1, 1, 2), velocity=(0, 0, 0), angular_velocity=(0, 0, 0))
    second = mechanism.body("second", 1, (1, 1, 0.5))
    axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
    mechanism.add(Revolute("bearing", first, second, (0, 0, 0), (0, 0, 0), **axes))
    mechanism.add(RotorInertia("rotor", first, second, 0.7, axis_i=(0, 0, 1)))
    mechanism.add(Torque("up", second, (0, 0, 3)))
    mechanism.add(Torque("down", first, (0, 0, -3)))
    for body in (first, second):
        mechanism.output(body.name, body.angular_velocity[2], units="rad/s")
    found = uqmbd.simulate(mechanism, [0, 1, 2], rtol=1e-9, check=False)
    expected = np.linalg.solve([[2.7, -0.7], [-0.7, 1.2]], [-3, 3])
    np.testing.assert_allclose(found["first"], expected[0] * np.arange(3), atol=1e-8)
    np.testing.assert_allclose(found["second"], expected[1] * np.arange(3), atol=1e-8)


def test_a_slider_passes_through_the_zero_of_its_spring():
    """(m + M) x'' = -k (x - x0) - c x', from one side of zero to the other."""
    mass, added, k, c, free = 1.5, 0.5, 50.0, 0.8, -0.05
    mechanism = uqmbd.Mechanism("slider", uqmbd.Planar())
    slider = mechanism.body("slider", mass, 0.1, position=(0.2, 0), velocity=(0, 0))
    ends = {"point_i": (0, 0), "point_j": (0, 0), "axis_i": (1, 0)}
    mechanism.add(Prismatic("rail", mechanism.ground, slider, **ends, axis_j=(1, 0)))
    spring = SlidingSpringDamper(
        "spring", mechanism.ground, slider, **ends, stiffness=k, damping=c, free_displacement=free
    )
    mechanism.add(spring)
    mechanism.add(SlidingInertia("spindle", mechanism.ground, slider, **ends, mass=added))
    mechanism.output("x", slider.position[0], units="m")
    times = np.linspace(0, 3, 31)
    whole = mass + added
    decay, speed = c / (2 * whole), np.sqrt(k / whole - (c / (2 * whole)) ** 2)
    wave = np.cos(speed * times) + decay / speed * np.sin(speed * times)
    found = uqmbd.simulate(mechanism, times, rtol=1e-9, check=False)
    np.testing.assert_allclose(found["x"], free + (0.2 - free) * np.exp(-decay * times) * wave, atol=1e-8)
    assert float(found["x"].min()) < -0.1
