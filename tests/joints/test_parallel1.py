"""Parallel axes: closed forms, and a hinge made of a ball and parallel axes."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd_joints import Parallel1, Revolute, Spherical
from uqmbd_springs import Torque

G = 9.81
TIMES = np.linspace(0, 1, 11)
ORIGIN = (0, 0, 0)
INERTIA = (0.30, 0.25, 0.20, 0.03, -0.02, 0.04)


def test_spinning_body_falls_and_is_kept_upright(observe, series):
    """Along z theta'' = M / J_zz and free fall; across it Euler's equations, for an axis that is no principal one."""
    mechanism = uqmbd.Mechanism("spin", uqmbd.Spatial(gravity=(0, 0, -G)))
    body = mechanism.body("body", mass=2, inertia=INERTIA, angular_velocity=(0, 0, 3))
    joint = mechanism.add(Parallel1("upright", mechanism.ground, body, (0, 0, 1), (0, 0, 1)))
    mechanism.add(Torque("drive", body, torque=(0, 0, 0.5)))
    observe(mechanism, r=body.position, R=body.rotation, F=joint.reaction_force, M=joint.reaction_moment)
    data = uqmbd.simulate(mechanism, TIMES, rtol=1e-9)
    alpha = 0.5 / 0.20
    theta, speed = 3 * TIMES + alpha * TIMES**2 / 2, 3 + alpha * TIMES
    np.testing.assert_allclose(series(data, "r")[:, 2], -G * TIMES**2 / 2, atol=1e-7)
    np.testing.assert_allclose(series(data, "F"), 0, atol=1e-9)
    rotation = series(data, "R").reshape(-1, 3, 3)
    np.testing.assert_allclose(rotation[:, 0, 0], np.cos(theta), atol=1e-6)
    np.testing.assert_allclose(rotation[:, :, 2], np.tile([0, 0, 1], (11, 1)), atol=1e-8)
    *_, xz, yz = INERTIA
    local = np.array([xz * alpha - yz * speed**2, yz * alpha + xz * speed**2, 0 * speed]).T
    expected = np.einsum("tij,tj->ti", rotation, local)
    np.testing.assert_allclose(series(data, "M"), expected, atol=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "swap",
    [pytest.param(False, id="upper first"), pytest.param(True, id="lower first", marks=pytest.mark.thorough)],
)
def test_ball_and_parallel_axes_are_a_hinge(swap, observe, series):
    """Motion and reaction moment are those of `Revolute`, between two moving bodies, about a tilted axis."""
    found = []
    for whole in (True, False):
        mechanism = uqmbd.Mechanism("two", uqmbd.Spatial(gravity=(0, 0, -G)))
        upper = mechanism.body("upper", mass=1.5, inertia=INERTIA, com=(0.4, 0.1, -0.2))
        lower = mechanism.body("lower", mass=0.8, inertia=INERTIA, com=(0.1, -0.3, 0.2), position=(0.9, 0, -0.2))
        mechanism.add(Spherical("top", mechanism.ground, upper, ORIGIN, ORIGIN))
        ends = ((upper, (0.8, 0, 0)), (lower, (-0.1, 0, 0.2)))
        (i, at_i), (j, at_j) = ends[::-1] if swap else ends
        axis = (1, 2, -1)
        if whole:
            parts = [Revolute("hinge", i, j, at_i, at_j, axis, axis)]
        else:
            parts = [Spherical("ball", i, j, at_i, at_j), Parallel1("axes", i, j, axis, axis)]
        for part in parts:
            mechanism.add(part)
        observe(mechanism, r=lower.position, R=lower.rotation, F=parts[0].reaction_force, M=parts[-1].reaction_moment)
        found.append(uqmbd.simulate(mechanism, TIMES, rtol=1e-9))
    for name, scale in (("r", 1), ("R", 1), ("F", 10), ("M", 1)):
        np.testing.assert_allclose(series(found[1], name), series(found[0], name), atol=1e-6 * scale)
    assert np.ptp(series(found[0], "r"), axis=0).max() > 0.3


@pytest.mark.filterwarnings("ignore:mechanism 'flip'. assembly moved:uqmbd.StudyWarning")
@pytest.mark.parametrize("degrees", [60, 120, 170])
def test_never_assembled_the_wrong_way_round(degrees, turn, observe, series):
    mechanism = uqmbd.Mechanism("flip", uqmbd.Spatial())
    body = mechanism.body("body", mass=1, inertia=(1, 1, 1), quaternion=turn((1, 0, 0), np.radians(degrees)))
    mechanism.add(Parallel1("axes", mechanism.ground, body, (0, 0, 1), (0, 0, 1)))
    observe(mechanism, axis=body.rotation[:, 2])
    np.testing.assert_allclose(series(uqmbd.simulate(mechanism, [0, 1]), "axis")[0], [0, 0, 1], atol=1e-9)


def test_makes_no_sense_in_the_plane():
    mechanism = uqmbd.Mechanism("flat", uqmbd.Planar())
    bodies = [mechanism.body(name, mass=1, inertia=1) for name in "ab"]
    with pytest.raises(
        uqmbd.StudyError, match=r"Parallel1 'axes': the component does not support Planar space.*Spatial"
    ):
        mechanism.add(Parallel1("axes", *bodies, (1, 0), (1, 0)))
