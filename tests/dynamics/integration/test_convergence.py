"""The error falls when the tolerance falls: order of convergence in the tolerance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Prismatic, Revolute
from uqmbd_springs import SpringDamper, TorsionSpringDamper

TOLERANCES = 10.0 ** np.arange(-4, -10, -1)
TIMES = np.linspace(0, 3, 31)


def pendulum_position(length=1.0, g=9.81):
    """Case A1, x and y."""
    sn, *_ = ellipj(ellipk(0.5) - np.sqrt(g / length) * TIMES, 0.5)
    th = 2 * np.arcsin(np.sqrt(0.5) * sn)
    return np.stack([-np.sin(th), -np.cos(th)])


def planar_pendulum():
    """Case A1."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    mass = mechanism.body("mass", mass=1, inertia=0, position=(-1, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, mass, (0, 0), (1, 0)))
    return mechanism, mass.position, pendulum_position()


def particle_on_a_rod():
    """Case A1."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Translational(gravity=(0, -9.81)))
    mass = mechanism.body("mass", mass=1, position=(-1, 0))
    mechanism.add(Distance("rod", mechanism.ground, mass, (0, 0), (0, 0), 1))
    return mechanism, mass.position, pendulum_position()


def spatial_pendulum():
    """Case A1 about a tilted axis, without rotary inertia about it."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Spatial(gravity=(0, -9.81, 0)))
    mass = mechanism.body("mass", mass=1, inertia=(0.1, 0.1, 0), position=(-1, 0, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, mass, (0, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, 1)))
    return mechanism, list(mass.position)[:2], pendulum_position()


def torque_free_top():
    """Case A2."""
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial())
    top = mechanism.body("top", mass=1, inertia=(0.05, 0.05, 0.02), angular_velocity=(2, 0, 3))
    w = top.rotation.T * top.angular_velocity
    exact = np.stack([2 * np.cos(1.8 * TIMES), -2 * np.sin(1.8 * TIMES), 3 + 0 * TIMES])
    return mechanism, w, exact


def slider_crank():
    """Case A5's geometry at 15 rad/s."""
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar())
    crank = mechanism.body("crank", mass=1, inertia=0.002727)
    rod = mechanism.body("rod", mass=0.15, inertia=0.001, position=(0.15, 0))
    slider = mechanism.body("slider", mass=0.07, inertia=1e-4, position=(0.45, 0))
    mechanism.add(Revolute("O", mechanism.ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("pin", crank, rod, (0.15, 0), (0, 0)))
    mechanism.add(Revolute("piston", rod, slider, (0.3, 0), (0, 0)))
    mechanism.add(Prismatic("guide", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(RotationDriver("drive", mechanism.ground, crank, 15 * uqmbd.t))
    phi1 = 15 * TIMES
    phi2 = -np.arcsin(0.5 * np.sin(phi1))
    rate = -7.5 * np.cos(phi1) / np.cos(phi2)
    exact = -0.15 * 15 * np.sin(phi1) - 0.3 * rate * np.sin(phi2)
    return mechanism, [slider.velocity[0]], exact[None]


def spring():
    """Case A8's oscillator at k = 100."""
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), 100))
    return mechanism, [mass.position[0]], np.cos(10 * TIMES)[None]


def torsion_spring():
    mechanism = uqmbd.Mechanism("coil", uqmbd.Planar())
    body = mechanism.body("body", mass=1, inertia=1, angular_velocity=20)
    mechanism.add(TorsionSpringDamper("coil", mechanism.ground, body, 4))
    return mechanism, [body.angular_velocity], 20 * np.cos(2 * TIMES)[None]


MODELS = [
    planar_pendulum, particle_on_a_rod, spatial_pendulum, torque_free_top, slider_crank, spring, torsion_spring,
]  # fmt: skip


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
@pytest.mark.parametrize("model", MODELS, ids=lambda f: f.__name__)
def test_error_falls_with_the_tolerance(model, integrator):
    """Slope of log error over log tolerance: not monotone from one tolerance to the next, so it is fitted."""
    mechanism, outputs, exact = model()
    names = [f"y{k}" for k in range(len(exact))]
    for k, name in enumerate(names):
        mechanism.output(name, outputs[k])
    errors = []
    for rtol in TOLERANCES:
        data = uqmbd.simulate(mechanism, TIMES, rtol=float(rtol), integrator=integrator)
        errors.append(max(float(np.abs(data[n] - e).max()) for n, e in zip(names, exact, strict=True)))
    relative = np.array(errors) / np.abs(exact).max()
    slope = np.polyfit(np.log10(TOLERANCES), np.log10(relative), 1)[0]
    table = ", ".join(f"{r:.0e}: {e:.1e}" for r, e in zip(TOLERANCES, relative, strict=True))
    assert slope > 0.65, table
    assert relative[-1] < 2e-6, table
    assert (relative < 1000 * TOLERANCES).all(), table
