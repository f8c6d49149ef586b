"""Stationary responses about steady motions, against equations of the relative motion written by hand."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import sympy

import uqmbd
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_processes import (
    PowerSpectralDensity,
    RandomProcess,
    crossing_rate,
    exponential_covariance,
    stationary_psd,
    stationary_std,
    white_noise,
)
from uqmbd_springs import PointForce, SpringDamper

SPEED, STIFFNESS, DAMPING, LENGTH = 3.0, 40.0, 0.8, 1.0
DEVIATION, TIME = 0.05, 0.4
RADIUS = LENGTH * STIFFNESS / (STIFFNESS - SPEED**2)
"""Radius of the bead in the steady motion, m."""


def rotating_arm():
    """Return a mechanism with an arm of constant angular velocity, the arm, its driver and a bead of 1 kg."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
    arm = mechanism.body("arm", mass=1, inertia=1, position=(0, 0), angle=0.0)
    bead = mechanism.body("bead", mass=1, inertia=0.1, position=(RADIUS * 0.98, 0), angle=0.0)
    mechanism.add(Revolute("axle", mechanism.ground, arm, (0, 0), (0, 0)))
    driver = mechanism.add(RotationDriver("drive", mechanism.ground, arm, angle=SPEED * uqmbd.t))
    mechanism.add(Prismatic("slide", arm, bead, (0, 0), (0, 0), (1, 0), (1, 0)))
    return mechanism, arm, driver, bead


def bead_on_a_random_spring():
    mechanism, arm, driver, bead = rotating_arm()
    process = RandomProcess("length", covariance=exponential_covariance(DEVIATION, TIME), units="m")
    spring = SpringDamper("spring", arm, bead, (0, 0), (0, 0), STIFFNESS, DAMPING, free_length=LENGTH + process())
    mechanism.add(spring)
    return mechanism, driver, bead


def norm(vector):
    return sympy.sqrt(vector[0] ** 2 + vector[1] ** 2)


@pytest.mark.thorough
def test_a_bead_on_a_rotating_arm():
    """The relative motion has the stiffness ``k - m W^2``; the driver bears the Coriolis force ``2 m W r'``."""
    mechanism, driver, bead = bead_on_a_random_spring()
    radius = norm(bead.position)
    mechanism.output("radius", stationary_std(radius, at="steady"))
    mechanism.output("moment", stationary_std(driver.reaction_moment, at="steady"))
    mechanism.output("crossings", crossing_rate(radius, RADIUS + 0.05, at="steady"))
    mechanism.output("density", stationary_psd(radius, 2.0, at="steady"))
    found = uqmbd.simulate(mechanism, [0, 1])
    system = np.array([[0, 1, 0], [SPEED**2 - STIFFNESS, -DAMPING, STIFFNESS], [0, 0, -1 / TIME]])
    p = scipy.linalg.solve_continuous_lyapunov(system, -np.diag([0, 0, 2 * DEVIATION**2 / TIME]))
    rate = np.sqrt(p[1, 1] / p[0, 0]) / (2 * np.pi) * np.exp(-(0.05**2) / (2 * p[0, 0]))
    omega = 4 * np.pi
    response = STIFFNESS / (STIFFNESS - SPEED**2 - omega**2 + 1j * omega * DAMPING)
    density = abs(response) ** 2 * 4 * DEVIATION**2 * TIME / (1 + (omega * TIME) ** 2)
    expected = [np.sqrt(p[0, 0]), 2 * SPEED * RADIUS * np.sqrt(p[1, 1]), rate, density]
    names = ("radius", "moment", "crossings", "density")
    assert [float(found[x]) for x in names] == pytest.approx(expected, rel=1e-8)


@pytest.mark.thorough
def test_a_quantity_that_turns_with_the_motion_is_refused_by_name():
    mechanism, _, bead = bead_on_a_random_spring()
    mechanism.output("x", stationary_std(bead.position[0], at="steady"))
    with pytest.raises(uqmbd.AssemblyError, match=r"the response of bead\.x changes during the steady motion"):
        uqmbd.simulate(mechanism, [0, 1])


@pytest.mark.thorough
def test_a_driver_moves_the_foot_of_a_spring_on_a_rotating_arm():
    mechanism, arm, _, bead = rotating_arm()
    foot = mechanism.body("foot", mass=0.5, inertia=0.1, position=(0.2, 0), angle=0.0)
    mechanism.add(Prismatic("foot slide", arm, foot, (0, 0), (0, 0), (1, 0), (1, 0)))

    def density(frequency):
        return 1e-4 * np.exp(-(((frequency - 1) / 0.4) ** 2))

    process = RandomProcess("base", psd=PowerSpectralDensity(density, "one", "Hz", (0.05, 4.0)), units="m")
    mechanism.add(PositionDriver("move", arm, foot, (0.2, 0), (0, 0), displacement=process(), axis_i=(1, 0)))
    mechanism.add(SpringDamper("spring", foot, bead, (0, 0), (0, 0), STIFFNESS, DAMPING, free_length=LENGTH))
    mechanism.output("radius", stationary_std(norm(bead.position), at="steady"))
    mechanism.output("acceleration", stationary_std(norm(bead.acceleration), at="steady"))
    found = uqmbd.simulate(mechanism, [0, 1])

    def deviation(factor):
        def power(frequency):
            s = 2j * np.pi * frequency
            h = (STIFFNESS + s * DAMPING) / (STIFFNESS - SPEED**2 + s * DAMPING + s**2)
            return density(frequency) * abs(h * factor(s)) ** 2

        return np.sqrt(scipy.integrate.quad(power, 0.05, 4.0, limit=300, epsabs=1e-14)[0])

    assert float(found["radius"]) == pytest.approx(deviation(lambda s: 1), rel=1e-8)
    # to first order, the norm of the acceleration is its radial part
    assert float(found["acceleration"]) == pytest.approx(deviation(lambda s: s**2 - SPEED**2), rel=1e-8)


@pytest.mark.thorough
def test_a_spinning_disc_and_a_travelling_mass_have_the_response_in_the_world():
    """Both move steadily in axes at rest: an oscillator in white noise has the variance ``pi S / (c k)``."""
    mechanism = uqmbd.Mechanism("steady", uqmbd.Planar())
    disc = mechanism.body("disc", mass=2, inertia=0.3, position=(0, 0), angle=0.0, angular_velocity=20.0)
    cart = mechanism.body("cart", mass=2, inertia=0.3, position=(0, 3), angle=0.0, velocity=(5, 0), angular_velocity=0)
    noise = RandomProcess("force", psd=white_noise(0.1, sided="two", per="rad/s"), units="N")
    for name, body in (("disc", disc), ("cart", cart)):
        away, rate = (body.position[1] - (3 if body is cart else 0)), body.velocity[1]
        mechanism.add(PointForce(f"load of {name}", body, (0, 0), (0, -50 * away - 1.5 * rate + noise())))
        mechanism.output(name, stationary_std(body.position[1], at="steady"))
    mechanism.output("resting", stationary_std(disc.position[0], at="steady"))
    mechanism.output("x", stationary_std(cart.position[0], at="steady"))
    found = uqmbd.simulate(mechanism, [0, 1])
    expected = np.sqrt(np.pi * 0.1 / (1.5 * 50))
    assert [float(found[x]) for x in ("disc", "cart")] == pytest.approx([expected] * 2, rel=1e-8)
    assert float(found["resting"]) == float(found["x"]) == 0


@pytest.mark.thorough
def test_a_level_of_a_quantity_that_travels_is_refused():
    mechanism = uqmbd.Mechanism("cart", uqmbd.Translational())
    cart = mechanism.body("cart", mass=2, position=(0, 0), velocity=(5, 0))
    noise = RandomProcess("force", covariance=exponential_covariance(1.0, 0.5), units="N")
    spring = -50 * (cart.position[0] - 5 * uqmbd.t) - 1.5 * (cart.velocity[0] - 5)
    mechanism.add(PointForce("load", cart, (0, 0), (spring + noise(), 0)))
    mechanism.output("deviation", stationary_std(cart.position[0], at="steady"))
    system = np.array([[0, 1, 0], [-25, -0.75, 0.5], [0, 0, -2]])
    p = scipy.linalg.solve_continuous_lyapunov(system, -np.diag([0, 0, 4.0]))
    assert float(uqmbd.simulate(mechanism, [0, 1])["deviation"]) == pytest.approx(np.sqrt(p[0, 0]), rel=1e-8)
    mechanism.output("crossings", crossing_rate(cart.position[0], 1.0, at="steady"))
    with pytest.raises(uqmbd.AssemblyError, match=r"the mean of cart\.x changes during the steady motion"):
        uqmbd.simulate(mechanism, [0, 1])
