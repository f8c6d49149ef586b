"""Mechanisms of the benchmark of stiff integrators, as pairs of a mechanism and its end time in s."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

import numpy as np
import sympy
from flexible_slider_crank import build as build_slider_crank

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_flexible import Beam
from uqmbd_joints import Distance, Prismatic, Revolute
from uqmbd_springs import Bushing, SpringDamper, Torque

__all__ = ["MECHANISMS", "double_pendulum"]

GRAVITY = (0, -9.81)


def andrews() -> tuple[uqmbd.Mechanism, float]:
    """Return Andrews' squeezer mechanism (Test Set for IVP Solvers)."""
    beta, gamma, phi, delta = -0.0617138900142764, 0.45527981916307, 0.222668390165886, 0.487364979543843
    omega, epsilon = -0.222668390165886, 1.23054744454982
    xa, ya, xb, yb, xc, yc = -0.06934, -0.00227, -0.03635, 0.03273, 0.014, 0.072
    d, da, e, ea, rr, ra, sa, sb, sc, sd = (
        *(28e-3, 115e-4, 2e-2, 1421e-5, 7e-3, 92e-5, 1874e-5, 1043e-5, 18e-3, 2e-2),
    )
    ta, tb, u, ua, ub, zf, zt, fa = 2308e-5, 916e-5, 4e-2, 1228e-5, 449e-5, 2e-2, 4e-2, 1421e-5
    a, b = np.array([xa, ya]), np.array([xb, yb])

    def along(angle: float) -> Any:
        return np.array([np.cos(angle), np.sin(angle)])

    def across(angle: float) -> Any:
        return np.array([np.sin(angle), -np.cos(angle)])

    masses = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
    inertias = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
    places = (
        ra * along(beta),
        (rr - da) * along(beta),
        b + sa * across(gamma) + sb * along(gamma),
        a + zt * along(delta) + (e - ea) * across(phi + delta),
        a + ta * along(delta) - tb * across(delta),
        a + u * across(epsilon) + (zf - fa) * along(omega + epsilon),
        a + ua * across(epsilon) - ub * along(epsilon),
    )
    mechanism = uqmbd.Mechanism("andrews", uqmbd.Planar())
    bodies = [
        mechanism.body(f"K{k + 1}", mass=mass, inertia=inertia, position=tuple(place.tolist()))
        for k, (mass, inertia, place) in enumerate(zip(masses, inertias, places, strict=True))
    ]
    k1, k2, k3, k4, k5, k6, k7 = bodies
    point = (rr - d) * along(beta)
    pins = (
        ("O", mechanism.ground, k1, np.zeros(2)),
        ("crank", k1, k2, rr * along(beta)),
        ("B", mechanism.ground, k3, b),
        ("A5", mechanism.ground, k5, a),
        ("A7", mechanism.ground, k7, a),
        ("P3", k2, k3, point),
        ("P4", k2, k4, point),
        ("P6", k2, k6, point),
        ("E", k4, k5, a + zt * along(delta)),
        ("H", k6, k7, a + u * across(epsilon)),
    )
    for name, body_i, body_j, at in pins:
        mechanism.add(Revolute(name, body_i, body_j, at=tuple(at.tolist())))
    end = b + sc * across(gamma) + sd * along(gamma) - places[2]
    spring: dict[str, Any] = {"stiffness": 4530.0, "free_length": 0.07785}
    mechanism.add(SpringDamper("spring", mechanism.ground, k3, (xc, yc), tuple(end.tolist()), **spring))
    mechanism.add(Torque("motor", k1, 0.033))
    return mechanism, 0.03


def car_axis() -> tuple[uqmbd.Mechanism, float]:
    """Return the car axis (Test Set for IVP Solvers): two light masses on springs above an oscillating axis."""
    mass = 0.01**2 * 10 / 2
    mechanism = uqmbd.Mechanism("car axis", uqmbd.Planar(gravity=(0, -1.0)))
    axis = mechanism.body("axis", mass=1.0, inertia=1.0)
    left = mechanism.body("left", mass=mass, inertia=mass, position=(0, 0.5), velocity=(-0.5, 0), angular_velocity=1.0)
    right = mechanism.body("right", mass=mass, inertia=mass, position=(1, 0.5), velocity=(-0.5, 0))
    mechanism.add(Revolute("wheel", mechanism.ground, axis, at=(0, 0)))
    mechanism.add(RotationDriver("road", mechanism.ground, axis, angle=sympy.asin(0.1 * sympy.sin(10 * uqmbd.t))))
    mechanism.add(Prismatic("guide", axis, left, (0, 0), (0, 0), (0, 1), (0, 1)))
    mechanism.add(Distance("chassis", left, right, (0, 0), (0, 0), 1.0))
    spring: dict[str, Any] = {"stiffness": 1.0, "free_length": 0.5}
    mechanism.add(SpringDamper("left spring", axis, left, (0, 0), (0, 0), **spring))
    mechanism.add(SpringDamper("right spring", axis, right, (1, 0), (0, 0), **spring))
    return mechanism, 3.0


def governor() -> tuple[uqmbd.Mechanism, float]:
    """Return a flyball governor whose sleeve hangs on springs of 8e5 N/m with dampers of 4e4 N s/m."""
    mechanism = uqmbd.Mechanism("governor", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    spin = (0, 0, 6.0)
    shaft = mechanism.body("shaft", mass=5.0, inertia=(0.5, 0.5, 0.2), angular_velocity=spin)
    mechanism.add(Revolute("axle", mechanism.ground, shaft, at=(0, 0, 0), axis=(0, 0, 1)))
    sleeve = mechanism.body(
        "sleeve", mass=3.0, inertia=(0.01, 0.01, 0.01), position=(0, 0, -0.5), angular_velocity=spin
    )
    mechanism.add(Prismatic("guide", shaft, sleeve, (0, 0, 0), (0, 0, 0), (0, 0, 1), (0, 0, 1)))
    for side in (1, -1):
        place = (side * 0.5, 0, -0.5 * np.sqrt(3))
        speed = (0, 6.0 * place[0], 0)
        arm = mechanism.body(f"arm {side}", mass=5.0, inertia=(0.02, 0.02, 0.02), position=place, velocity=speed,
                             angular_velocity=spin)  # fmt: skip
        mechanism.add(Revolute(f"hinge {side}", shaft, arm, at=(0, 0, 0), axis=(0, 1, 0)))
        middle = tuple(-0.5 * np.array(place))
        length = float(np.hypot(place[0] / 2, place[2] / 2 + 0.5))
        spring: dict[str, Any] = {"stiffness": 8e5, "damping": 4e4, "free_length": length}
        mechanism.add(SpringDamper(f"rod {side}", sleeve, arm, (0, 0, 0), middle, **spring))
    return mechanism, 2.0


def double_pendulum(stiffness: Any = 0) -> uqmbd.Mechanism:
    """Return two rods of 1 m, horizontal at the start, on bushings of a stiffness; of stiffness 0: on pins."""
    mechanism = uqmbd.Mechanism("double pendulum", uqmbd.Planar(gravity=GRAVITY))
    upper, lower = (mechanism.body(f"rod {k}", mass=1, inertia=0.1, position=(k + 0.5, 0)) for k in range(2))
    joints = (("A", mechanism.ground, upper, (0, 0)), ("B", upper, lower, (1, 0)))
    for name, body_i, body_j, at in joints:
        if stiffness:
            both = (stiffness, stiffness, 0), (stiffness / 1000, stiffness / 1000, 0)
            mechanism.add(Bushing(name, body_i, body_j, at=at, stiffness=both[0], damping=both[1]))
        else:
            mechanism.add(Revolute(name, body_i, body_j, at=at))
    mechanism.output("x", lower.position[0], units="m")
    return mechanism


def bushings() -> tuple[uqmbd.Mechanism, float]:
    """Return the double pendulum on bushings of 1e6 N/m."""
    return double_pendulum(1e6), 2.0


def flexible_slider_crank() -> tuple[uqmbd.Mechanism, float]:
    """Return the slider-crank with a rod of nine modes from 0.5 to 31 kHz, damped by 1 %."""
    width = 0.008
    beam = Beam(0.3, width**2, width**4 / 12, 0.2e12, 7870.0, modes=6).damped(0.01)
    return build_slider_crank(beam, (0.45, -75.0, (0,) * beam.modes, (0,) * beam.modes)), 0.02


MECHANISMS = (andrews, car_axis, governor, bushings, flexible_slider_crank)
