"""Reference case A1: IFToMM multi-body benchmark A01, the simple pendulum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import uqmbd
from uqmbd_joints import Distance, Revolute, Spherical

G = 9.81
# t, x, y, vx, vy, rod tension: cases.md A1 (Source: iftomm-multibody.org "Planar simple pendulum")
TABLE = np.array(
    [
        [0.5, -0.3910487915505464, -0.9203699487851922, 3.911048003955552, -1.661734607547415, 27.086487592748],
        [1, 0.9862917511318753, -0.1650108531255412, 0.2969055159163158, 1.774643641112656, 4.8562694074847],
        [2, -0.7935661953433217, -0.6084839304437915, -2.102437874436126, 2.741935393010509, 17.907682072961],
        [5, -0.9423054350437573, -0.3347543384140006, 0.8579042568859491, -2.414928654370489, 9.851820179524],
        [9.99, -0.3164364699130323, -0.9486137045757765, 4.092451991494021, -1.365151120240305, 27.917701325665],
        [10, -0.2750874625761169, -0.9614192050991251, 4.175598100951729, -1.194749054560475, 28.294567206067],
    ]
)
TIMES = np.union1d(np.linspace(0, 10, 201), TABLE[:, 0])


def planar_revolute():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    mass = mechanism.body("mass", mass=1, inertia=0, position=(-1, 0))
    rod = mechanism.add(Revolute("rod", mechanism.ground, mass, point_i=(0, 0), point_j=(1, 0)))
    return mechanism, mass, rod


def translational_distance():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Translational(gravity=(0, -G)))
    mass = mechanism.body("mass", mass=1, position=(-1, 0))
    rod = mechanism.add(Distance("rod", mechanism.ground, mass, point_i=(0, 0), point_j=(0, 0), length=1))
    return mechanism, mass, rod


def planar_distance():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -G)))
    mass = mechanism.body("mass", mass=1, inertia=1, position=(-1, 0))
    rod = mechanism.add(Distance("rod", mechanism.ground, mass, point_i=(0, 0), point_j=(0, 0), length=1))
    return mechanism, mass, rod


def spatial_spherical():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Spatial(gravity=(0, -G, 0)))
    mass = mechanism.body("mass", mass=1, inertia=(1e-12, 1e-12, 1e-12), position=(-1, 0, 0))
    rod = mechanism.add(Spherical("rod", mechanism.ground, mass, point_i=(0, 0, 0), point_j=(1, 0, 0)))
    return mechanism, mass, rod


MODELS = [planar_revolute, translational_distance, planar_distance, spatial_spherical]


@pytest.fixture(scope="module", params=MODELS, ids=lambda f: f.__name__)
def motion(request):
    """Position, velocity and rod tension over 10 s."""
    mechanism, mass, rod = request.param()
    for k, axis in enumerate("xy"):
        mechanism.output(axis, mass.position[k], units="m")
        mechanism.output(f"v{axis}", mass.velocity[k], units="m/s")
        mechanism.output(f"f{axis}", rod.reaction_force[k], units="N")
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-9)
    data["tension"] = -(data.fx * data.x + data.fy * data.y)
    data["across"] = data.fy * data.x - data.fx * data.y
    return data


def test_motion_agrees_with_the_published_table(motion, close):
    """Case A1."""
    at = motion.sel(time=TABLE[:, 0])
    for column, name in enumerate(("x", "y", "vx", "vy", "tension"), start=1):
        close(at[name], TABLE[:, column], relative=1e-5, what=name)


def test_motion_agrees_with_the_elliptic_functions(motion, close):
    """Case A1: th = 2 asin(k sn(K - w0 t)), k = sin(pi/4), w0 = sqrt(g/L)."""
    square = 0.5
    sn, *_ = ellipj(ellipk(square) - np.sqrt(G) * TIMES, square)
    th = 2 * np.arcsin(np.sqrt(square) * sn)
    close(motion.x, -np.sin(th), relative=1e-5)
    close(motion.y, -np.cos(th), relative=1e-5)
    close(motion.tension, 3 * G * np.cos(th), relative=1e-5)
    assert np.abs(motion.across).max() < 1e-5 * 3 * G


def test_energy_drift_is_within_the_acceptance_limit(motion):
    """Case A1, IFToMM acceptance: |energy drift| < 5e-5 J."""
    energy = (motion.vx**2 + motion.vy**2) / 2 + G * motion.y
    assert np.abs(energy - energy[0]).max() < 5e-5


def test_rod_length_and_its_rate_are_kept(motion):
    assert np.abs(np.hypot(motion.x, motion.y) - 1).max() < 1e-8
    assert np.abs(motion.x * motion.vx + motion.y * motion.vy).max() < 1e-7


def test_default_tolerance_gives_three_digits(close):
    """Case A1 with nothing set."""
    mechanism, mass, _ = planar_revolute()
    mechanism.output("x", mass.position[0])
    data = uqmbd.simulate(mechanism, TIMES)
    close(data.x.sel(time=TABLE[:, 0]), TABLE[:, 1], relative=5e-3)


def test_two_output_times_are_enough(close):
    """Case A1 at t = 10 s with a first and a last time only."""
    mechanism, mass, _ = planar_revolute()
    mechanism.output("x", mass.position[0])
    close(uqmbd.simulate(mechanism, [0, 10], rtol=1e-9).x[-1], TABLE[-1, 1], relative=1e-5, scale=1)
