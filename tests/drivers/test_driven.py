"""Reference case A5: driven joints and inverse dynamics; many turns."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute

t = uqmbd.t


def driven_rod(space, angle):
    """Uniform rod (m = 1, l = 1) on a pivot in the origin, driven about the horizontal z axis; gravity along -y."""
    if space == "planar":
        mechanism = uqmbd.Mechanism("rod", uqmbd.Planar(gravity=(0, -9.81)))
        rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0.5, 0))
        mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
        driver = mechanism.add(RotationDriver("motor", mechanism.ground, rod, angle))
        moment, rate = driver.reaction_moment, rod.angular_velocity
    else:
        mechanism = uqmbd.Mechanism("rod", uqmbd.Spatial(gravity=(0, -9.81, 0)))
        rod = mechanism.body("rod", mass=1, inertia=(1e-3, 1 / 12, 1 / 12), position=(0.5, 0, 0))
        axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
        mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0, 0), (-0.5, 0, 0), **axes))
        driver = mechanism.add(RotationDriver("motor", mechanism.ground, rod, angle, **axes))
        moment, rate = driver.reaction_moment[2], rod.angular_velocity[2]
    mechanism.output("torque", moment, units="N m")
    mechanism.output("rate", rate, units="rad/s")
    mechanism.output("x", 2 * rod.position[0])
    mechanism.output("y", 2 * rod.position[1])
    return mechanism, rod


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("angle", [3 * t, 1.2 * sympy.sin(4 * t)], ids=["constant rate", "sine"])
def test_torque_of_a_driven_rod(space, angle, close):
    """Case A5: tau = m l^2/3 theta'' + m g l/2 cos theta."""
    mechanism, _ = driven_rod(space, angle)
    times = np.linspace(0, 3, 31)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    theta, rate, second = (
        sympy.lambdify(t, e, "numpy")(times) * np.ones_like(times) for e in (angle, angle.diff(t), angle.diff(t, 2))
    )
    close(data.torque, second / 3 + 9.81 / 2 * np.cos(theta))
    close(data.rate, rate)
    close(data.x, np.cos(theta))
    close(data.y, np.sin(theta))


def test_angle_is_counted_over_many_turns_of_a_driver(close):
    """200 rad, more than 31 turns, in the plane."""
    mechanism, rod = driven_rod("planar", 20 * t)
    mechanism.output("angle", rod.angle)
    times = np.linspace(0, 10, 101)
    data = uqmbd.simulate(mechanism, times, rtol=1e-7)
    close(data.angle, 20 * times, relative=1e-6)
    close(data.torque, 9.81 / 2 * np.cos(20 * times), relative=1e-3)


def test_driver_makes_many_turns_in_space(close):
    """200 rad, more than 31 turns."""
    mechanism, _ = driven_rod("spatial", -20 * t)
    times = np.linspace(0, 10, 101)
    data = uqmbd.simulate(mechanism, times, rtol=1e-7)
    close(data.x, np.cos(20 * times))
    close(data.y, -np.sin(20 * times))
    close(data.rate, np.full(101, -20.0))


@pytest.mark.parametrize("rate", [50, -50])
def test_angle_is_counted_over_many_turns_of_a_free_body(rate, close):
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=2, angle=0.3, angular_velocity=rate)
    mechanism.output("angle", wheel.angle)
    times = np.array([0, 0.5, 3.9, 4])  # far apart: many turns between two outputs
    close(uqmbd.simulate(mechanism, times, rtol=1e-8).angle, 0.3 + rate * times, relative=1e-5)


@pytest.mark.thorough
def test_driver_between_two_moving_bodies_in_space(observe, series, close, turn, matrix):
    """A tilted axis: the second body turns by the angle relative to the first, which turns relative to the ground."""
    mechanism = uqmbd.Mechanism("two", uqmbd.Spatial())
    inertia = (0.1, 0.2, 0.3)
    axis = np.array([1.0, 2.0, 2.0]) / 3
    origin = (0, 0, 0)
    first = mechanism.body("first", mass=1, inertia=inertia)
    second = mechanism.body("second", mass=1, inertia=inertia)
    z, tilted = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}, {"axis_i": axis, "axis_j": axis}
    mechanism.add(Revolute("A", mechanism.ground, first, origin, origin, **z))
    mechanism.add(Revolute("B", first, second, origin, origin, **tilted))
    mechanism.add(RotationDriver("DA", mechanism.ground, first, 2 * t, **z))
    mechanism.add(RotationDriver("DB", first, second, 5 * t**2 / 2, **tilted))
    observe(mechanism, R=second.rotation, w=second.angular_velocity)
    times = np.linspace(0, 3, 16)
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    for k, time in enumerate(times):
        base = matrix(turn((0, 0, 1), 2 * time))
        close(series(data, "R")[k].reshape(3, 3), base @ matrix(turn(axis, 2.5 * time**2)))
        close(series(data, "w")[k], [0, 0, 2] + base @ (5 * time * axis), scale=17)


# t, phi2, phi2', x, x', x'', driver torque, T: cases.md A5 (Simeon's crank data, rigid limit), phi1 = 150 t
CRANK = np.array(
    [
        [0, 0, -75, 0.45, 0, -5062.5, 0, 43.43041659375],
        [0.01, -0.52215310825393, -6.1209188973657, 0.27063477991866, -23.359475085621, 1685.4864704215, -38.466810382413, 90.986493869835],
        [0.02, -0.070618685277925, 74.434963658024, 0.15075338652865, -1.5995607806436, 1708.5925766913, -4.1019273225547, 43.719379356277],
        [0.05, -0.48815817530699, -29.435804629154, 0.31695474925292, -25.246617086205, 216.88029659112, -0.4079267199136, 96.977465657401],
        [0.1, -0.33116391346484, 60.250322145937, 0.16974617650232, -8.7544686249774, 2166.9454029254, -25.014657779962, 51.480751272751],
    ]
)  # fmt: skip


def driven_slider_crank():
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar())
    ground = mechanism.ground
    l1, l2, m2, m3, j1, j2 = 0.15, 0.30, 0.151104, 0.075552, 0.002727, 0.0045339259
    crank = mechanism.body("crank", mass=1, inertia=j1)  # turns about its centre of mass: its mass does not matter
    rod = mechanism.body("rod", mass=m2, inertia=j2 - m2 * (l2 / 2) ** 2, com=(l2 / 2, 0), position=(l1, 0))
    slider = mechanism.body("slider", mass=m3, inertia=1e-4, position=(l1 + l2, 0))
    mechanism.add(Revolute("O", ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("pin", crank, rod, (l1, 0), (0, 0)))
    mechanism.add(Revolute("piston", rod, slider, (l2, 0), (0, 0)))
    mechanism.add(Prismatic("guide", ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    drive = mechanism.add(RotationDriver("drive", ground, crank, 150 * t))
    mechanism.output("phi2", rod.angle)
    mechanism.output("phi2'", rod.angular_velocity)
    mechanism.output("x", slider.position[0])
    mechanism.output("x'", slider.velocity[0])
    mechanism.output("x''", slider.acceleration[0])
    mechanism.output("torque", drive.reaction_moment)
    return mechanism


@pytest.mark.thorough
def test_driven_slider_crank(close, energy):
    """Case A5: positions, velocities, accelerations, driver torque and kinetic energy at 150 rad/s."""
    mechanism = driven_slider_crank()
    times = CRANK[:, 0]
    data = uqmbd.simulate(mechanism, times, rtol=1e-8)
    for column, name in enumerate(("phi2", "phi2'", "x", "x'", "x''", "torque"), start=1):
        close(data[name], CRANK[:, column], what=name)
    close(energy(mechanism, times)[0], CRANK[:, 7])


@pytest.mark.thorough
def test_driven_slider_crank_over_fifty_turns(close):
    """The closed form of case A5, 314 rad on."""
    mechanism = driven_slider_crank()
    times = np.linspace(0, 2.1, 64)
    data = uqmbd.simulate(mechanism, times, rtol=1e-7)
    phi1 = 150 * times
    phi2 = -np.arcsin(0.5 * np.sin(phi1))
    close(data.phi2, phi2, relative=1e-4)
    close(data.x, 0.15 * np.cos(phi1) + 0.3 * np.cos(phi2), relative=1e-4)
