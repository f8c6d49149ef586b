"""Eigenvalues of what rolls without slipping, straight on: a disc in closed form, and the benchmark bicycle."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd_joints import Revolute, RollingWheel

G = 9.81
SIDE, UP = (0, 1, 0), (0, 0, 1)


def eigenvalues(mechanism):
    found = uqmbd.eigenfrequencies(mechanism, at="steady")
    return found["eigenvalue_real"].values + 1j * found["eigenvalue_imaginary"].values


@pytest.mark.parametrize("spin", [4.0, 9.0])
def test_a_disc_that_rolls_upright(spin):
    """(Id + m R^2) p'' + ((Ia + m R^2) Ia W^2 / Id - m g R) p = 0: it falls below a speed, and wobbles above it."""
    mass, radius, across, axial = 2.0, 0.5, 0.125, 0.25
    mechanism = uqmbd.Mechanism("disc", uqmbd.Spatial(gravity=(0, 0, -G)))
    disc = mechanism.body(
        "disc", mass=mass, inertia=(across, axial, across), position=(0, 0, radius), quaternion=(1, 0, 0, 0),
        angular_velocity=(0, spin, 0),
    )  # fmt: skip
    mechanism.add(
        RollingWheel("rim", mechanism.ground, disc, (0, 0, 0), (0, 0, 0), normal_i=UP, axis_j=SIDE, radius=radius)
    )
    stiffness = (axial + mass * radius**2) * axial * spin**2 / across - mass * G * radius
    rate = np.sqrt(complex(-stiffness / (across + mass * radius**2)))
    found = eigenvalues(mechanism)
    moving = found[np.abs(found) > 0]
    expected = [rate, -rate] if stiffness < 0 else [1j * abs(rate)]
    np.testing.assert_allclose(np.sort_complex(moving), np.sort_complex(np.array(expected)), atol=1e-7)


def bicycle(speed):
    """The benchmark bicycle: its 25 parameters (Meijaard, Papadopoulos, Ruina, Schwab 2007, table 1), z upwards."""
    mechanism = uqmbd.Mechanism("bicycle", uqmbd.Spatial(gravity=(0, 0, -G)))
    wheelbase, trail, tilt, rear_radius, front_radius = 1.02, 0.08, np.pi / 10, 0.3, 0.35

    def body(name, mass, place, inertia, **stated):
        return mechanism.body(name, mass=mass, inertia=inertia, position=place, quaternion=(1, 0, 0, 0), **stated)

    frame = body(
        "frame", 85, (0.3, 0, 0.9), (9.2, 11, 2.8, 0, -2.4, 0), velocity=(speed, 0, 0), angular_velocity=(0, 0, 0)
    )
    fork = body("fork", 4, (0.9, 0, 0.7), (0.05892, 0.06, 0.00708, 0, 0.00756, 0))
    rear = body("rear", 2, (0, 0, rear_radius), (0.0603, 0.12, 0.0603))
    front = body("front", 3, (wheelbase, 0, front_radius), (0.1405, 0.28, 0.1405))
    head, axis = (wheelbase + trail, 0, 0), (-np.sin(tilt), 0, np.cos(tilt))
    mechanism.add(Revolute("head", frame, fork, at=head, axis=axis))
    for name, holder, wheel, place, radius in (
        ("rear", frame, rear, (0, 0, rear_radius), rear_radius),
        ("front", fork, front, (wheelbase, 0, front_radius), front_radius),
    ):
        mechanism.add(Revolute(f"{name}_hub", holder, wheel, at=place, axis=SIDE))
        mechanism.add(
            RollingWheel(
                f"{name}_tyre", mechanism.ground, wheel, (0, 0, 0), (0, 0, 0), normal_i=UP, axis_j=SIDE, radius=radius
            )
        )
    return mechanism


def published(speed):
    """Eigenvalues of ``M q'' + v C1 q' + (g K0 + v^2 K2) q = 0``, the canonical matrices of section 5 there."""
    mass = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
    k0 = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
    k2 = np.array([[0, 76.59734589573222], [0, 2.65431523794604]])
    c1 = np.array([[0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])
    top = np.hstack([np.zeros((2, 2)), np.eye(2)])
    below = -np.linalg.solve(mass, np.hstack([G * k0 + speed**2 * k2, speed * c1]))
    return np.linalg.eigvals(np.vstack([top, below]))


@pytest.mark.thorough
@pytest.mark.parametrize("speed", [0.0, 3.0, 5.0, 7.0])
def test_the_benchmark_bicycle(speed):
    """Weave, capsize and castering (table 2 there: -0.775 +- 4.465 i, -0.323 and -14.078 at 5 m/s)."""
    found = eigenvalues(bicycle(speed))
    wanted = published(speed)
    wanted = wanted[wanted.imag >= 0]
    moving = found[np.abs(found) > 0]
    np.testing.assert_allclose(np.sort_complex(moving), np.sort_complex(wanted), rtol=1e-6, atol=1e-6)
    if speed == 5:
        weave = moving[moving.imag > 0]
        np.testing.assert_allclose(weave, [-0.775341882195845 + 4.464867713788230j], rtol=1e-6)
