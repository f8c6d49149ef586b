"""Tables as motions, forces and laws: cams in closed form, SciPy, and moments that are linear in random values."""

import chaospy
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import uqmbd
from uqmbd.laws import length
from uqmbd_collocation import Collocation
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import PointOnLine, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import NonlinearSpringDamper, PointForce, Torque

ORIGIN = (0, 0)
RADIUS, ECCENTRICITY = 0.05, 0.012


def eccentric(theta):
    """Lift of a roller on an eccentric circle, in closed form: the centres keep their distance."""
    return ECCENTRICITY * np.cos(theta) + np.sqrt(RADIUS**2 - (ECCENTRICITY * np.sin(theta)) ** 2)


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_cam_by_points_lifts_as_the_eccentric_that_they_are_of(integrator):
    """Three turns, in the angle of the cam's own joint; the spline through 121 points is within 1e-7 m of the circle."""
    knots = np.linspace(0, 2 * np.pi, 121)
    profile = uqmbd.spline(knots, eccentric(knots), periodic=True)
    mechanism = uqmbd.Mechanism("cam", uqmbd.Planar(gravity=(0, 0)))
    ground = mechanism.ground
    cam = mechanism.body("cam", mass=1, inertia=0.01, angle=0.0)
    hinge = mechanism.add(Revolute("hinge", ground, cam, ORIGIN, ORIGIN))
    mechanism.add(RotationDriver("motor", ground, cam, angle=10 * uqmbd.t))
    follower = mechanism.body("follower", mass=0.2, inertia=0.01, position=(0, float(eccentric(0))), angle=0.0)
    mechanism.add(PointOnLine("guide", ground, follower, ORIGIN, ORIGIN, axis_i=(0, 1)))
    mechanism.add(
        PositionDriver("contact", ground, follower, ORIGIN, ORIGIN, axis_i=(0, 1), displacement=profile(hinge.angle))
    )
    mechanism.output("lift", follower.position[1], units="m")
    mechanism.output("speed", follower.velocity[1], units="m/s")
    times = np.linspace(0, 1.9, 39)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8, integrator=integrator, check=False)
    plain = CubicSpline(knots, np.r_[eccentric(knots[:-1]), eccentric(0.0)], bc_type="periodic")
    np.testing.assert_allclose(data["lift"], plain(10 * times), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(data["lift"], eccentric(10 * times), rtol=0, atol=1e-7)
    np.testing.assert_allclose(data["speed"], 10 * plain(10 * times, 1), rtol=0, atol=1e-6)


def pulled(force, law):
    mechanism = uqmbd.Mechanism("pulled", uqmbd.Translational(gravity=(0, 0)))
    body = mechanism.body("body", mass=2.0, position=(1, 0))
    mechanism.add(PointOnLine("guide", mechanism.ground, body, ORIGIN, ORIGIN, axis_i=(1, 0)))
    mechanism.add(NonlinearSpringDamper("spring", mechanism.ground, body, ORIGIN, ORIGIN, law=law))
    mechanism.add(PointForce("force", body, ORIGIN, (force, 0)))
    mechanism.output("x", body.position[0], units="m")
    return mechanism


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_random_values_give_moments_that_are_linear_in_them(integrator):
    """A linear oscillator, with a force whose values are random: its mean and deviation in closed form, by all methods."""
    gain = uqmbd.RandomVariable("gain", chaospy.Normal(1, 0.2))
    knots, values = np.linspace(0, 2, 9), np.array([0, 1, 3, -2, 0, 4, 1, -1, 0.0])
    force = uqmbd.spline(knots, [gain * v for v in values])
    plain, times = CubicSpline(knots, values), np.linspace(0, 2, 9)
    # the law of a linear spring, by a table
    law = uqmbd.spline([0, 0.5, 1, 1.5, 2], [-40, -20, 0, 20, 40])(length)
    solved = solve_ivp(
        lambda t, z: [z[1], (plain(t) - 40 * z[0]) / 2],
        (0, 2), [0, 0], t_eval=times, rtol=1e-11, atol=1e-13, max_step=0.02,
    )  # fmt: skip
    methods = [Collocation(order=1), Galerkin(order=1), MonteCarlo(samples=20, seed=1)]
    study = uqmbd.Study("pulled", pulled(force, law), times, methods, rtol=1e-8, integrator=integrator)
    tree = study.run()
    for method in ("collocation", "galerkin"):
        found = tree[f"{method}/statistics"]
        np.testing.assert_allclose(found["mean"].values[0], 1 + solved.y[0], rtol=0, atol=1e-7)
        np.testing.assert_allclose(found["std"].values[0], 0.2 * np.abs(solved.y[0]), rtol=0, atol=1e-7)
    samples = tree["monte-carlo/samples"]
    gains = samples["inputs"].values[:, 0]
    expected = 1 + gains[:, None] * solved.y[0]
    np.testing.assert_allclose(samples["response"].values[:, 0], expected, rtol=0, atol=1e-7)


@pytest.mark.thorough
def test_a_torque_over_speed_against_scipy():
    """A motor's curve over `joint.speed`, beyond its last point constant."""
    speeds, torques = [0, 5, 10, 20], [2.0, 2.2, 1.5, 0.0]
    curve = uqmbd.spline(speeds, torques)
    mechanism = uqmbd.Mechanism("motor", uqmbd.Planar(gravity=(0, 0)))
    rotor = mechanism.body("rotor", mass=1, inertia=0.1, angle=0.0, angular_velocity=0.5)
    hinge = mechanism.add(Revolute("hinge", mechanism.ground, rotor, ORIGIN, ORIGIN))
    mechanism.add(Torque("torque", rotor, curve(hinge.speed)))
    mechanism.output("speed", hinge.speed, units="rad/s")
    times = np.linspace(0, 2, 9)
    plain = CubicSpline(speeds, torques)
    solved = solve_ivp(lambda t, w: plain(w) / 0.1, (0, 2), [0.5], t_eval=times, rtol=1e-11, atol=1e-12)
    found = uqmbd.simulate(mechanism, times, rtol=1e-9, check=False)["speed"]
    np.testing.assert_allclose(found, solved.y[0], rtol=1e-7)
