"""Small models in both formats against closed forms, mechanisms written by hand, and MuJoCo's own numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_models import MJCF, URDF

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

G = 9.81


@pytest.fixture
def urdf(tmp_path):
    """Read a URDF that is given as the inside of its robot element."""

    def read(inside, **options):
        path = tmp_path / "robot.urdf"
        path.write_text(f'<robot name="robot">{inside}</robot>', encoding="utf-8")
        return URDF().read(str(path), **options)

    return read


@pytest.fixture
def mjcf(tmp_path):
    """Read an MJCF file that is given as the inside of its mujoco element."""

    def read(inside, **options):
        path = tmp_path / "model.xml"
        path.write_text(f'<mujoco model="model">{inside}</mujoco>', encoding="utf-8")
        return MJCF().read(str(path), **options)

    return read


def link(name, mass=1.0, com="0 0 0", inertia=(0.01, 0.01, 0.01), rpy="0 0 0"):
    """A link of a URDF with shapes whose meshes are nowhere."""
    xx, yy, zz = inertia
    mesh = f'<geometry><mesh filename="package://nowhere/{name}.stl"/></geometry>'
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}" rpy="{rpy}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"<visual>{mesh}</visual><collision>{mesh}</collision></link>"
    )


def joint(name, parent, child, kind="continuous", xyz="0 0 0", axis="0 1 0", rpy="0 0 0", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{more}</joint>'
    )


TWO = (
    '<link name="base"/>'
    + link("upper", 1.2, "0 0 -0.3", (0.03, 0.04, 0.02))
    + link("lower", 0.7, "0 0.02 -0.25", (0.02, 0.03, 0.01))
    + joint("shoulder", "base", "upper", xyz="0 0 1", rpy="0 0.4 0")
    + joint("elbow", "upper", "lower", xyz="0 0 -0.6", rpy="0 -0.9 0")
)


def by_hand():
    """The double pendulum of `TWO`, written with uqmbd."""
    mechanism = uqmbd.Mechanism("hand", uqmbd.Spatial(gravity=(0, 0, -G)))

    def about_y(angle):
        return (np.cos(angle / 2), 0, np.sin(angle / 2), 0)

    elbow = (-0.6 * np.sin(0.4), 0, 1 - 0.6 * np.cos(0.4))
    upper = mechanism.body(
        "upper", 1.2, (0.03, 0.04, 0.02), com=(0, 0, -0.3), position=(0, 0, 1), quaternion=about_y(0.4)
    )
    lower = mechanism.body(
        "lower", 0.7, (0.02, 0.03, 0.01), com=(0, 0.02, -0.25), position=elbow, quaternion=about_y(-0.5)
    )
    axes = {"axis_i": (0, 1, 0), "axis_j": (0, 1, 0)}
    mechanism.add(Revolute("shoulder", mechanism.ground, upper, (0, 0, 1), (0, 0, 0), **axes))
    mechanism.add(Revolute("elbow", upper, lower, (0, 0, -0.6), (0, 0, 0), **axes))
    mechanism.output("x", lower.point((0, 0, -0.5))[0], units="m")
    return mechanism


def test_a_double_pendulum_is_the_one_written_by_hand(urdf):
    read = urdf(TWO)
    assert list(read.bodies) == ["upper", "lower"] and list(read.joints) == ["shoulder", "elbow"]
    read.output("x", read.bodies["lower"].point((0, 0, -0.5))[0], units="m")
    times = np.linspace(0, 1, 21)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    expected = uqmbd.simulate(by_hand(), times, rtol=1e-9, check=False)
    np.testing.assert_allclose(found["x"], expected["x"], rtol=0, atol=1e-8)
    assert float(found["shoulder"][0]) == pytest.approx(0, abs=1e-12)
    assert np.ptp(found["elbow"].values) > 0.5


def test_a_pendulum_with_a_rotor_spring_and_damper(mjcf):
    """(m l^2 + J + I) q'' = -k (q - q0) - c q' - m g l sin q, with a joint reference and a start away from it."""
    mass, length, inertia, rotor, k, c, rest, ref = 1.5, 0.4, 0.02, 0.3, 7.0, 0.25, 0.6, 0.3
    read = mjcf(
        f'<compiler angle="radian"/><worldbody><body name="bob" pos="0 0 2" euler="0 {ref} 0">'
        f'<joint name="pin" axis="0 1 0" ref="{ref}" springref="{rest}" stiffness="{k}" damping="{c}" armature="{rotor}"/>'
        f'<inertial pos="0 0 {-length}" mass="{mass}" diaginertia="0.03 {inertia} 0.025"/></body></worldbody>'
        '<keyframe><key name="up" qpos="1.1" qvel="-2"/></keyframe>',
        keyframe="up",
    )
    times = np.linspace(0, 2, 41)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    whole = mass * length**2 + inertia + rotor

    def rate(t, y):
        moment = -k * (y[0] - rest) - c * y[1] - mass * G * length * np.sin(y[0])
        return y[1], moment / whole

    exact = solve_ivp(rate, (0, 2), (1.1, -2.0), t_eval=times, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(found["pin"], exact.y[0], rtol=0, atol=1e-7)
