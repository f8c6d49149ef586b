"""What joints tell of their motion: angles over any number of turns, displacements and speeds, also in laws."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import uqmbd
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_joints import (
    Fixed,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque, TorsionSpringDamper

TILTED = (2 / 7, -3 / 7, 6 / 7)
O2, O3 = (0, 0), (0, 0, 0)
unit_vectors = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
turns = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda v: np.linalg.norm(v) > 0.1)
angles = st.floats(-3.1, 3.1)


def hinged(space, speed, load, axis=TILTED, inertia=0.2, angle=0.3):
    """A wheel on a hinge whose axis holds its centre: load(joint, body, axis keywords) adds what acts on it."""
    plane = space is uqmbd.Planar
    mechanism = uqmbd.Mechanism("hinged", space())
    if plane:
        pose, axes, at = {"angle": angle, "angular_velocity": speed}, {}, O2
    else:
        x, y, z, w = Rotation.from_rotvec(angle * np.array(axis)).as_quat()
        pose = {"quaternion": (w, x, y, z), "angular_velocity": tuple(speed * np.array(axis))}
        axes, at = {"axis_i": axis, "axis_j": axis}, O3
    wheel = mechanism.body("wheel", mass=1, inertia=inertia if plane else (inertia,) * 3, **pose)
    joint = mechanism.add(Revolute("hinge", mechanism.ground, wheel, at, at, **axes))
    load(mechanism, joint, wheel, axes)
    mechanism.output("angle", joint.angle, units="rad")
    mechanism.output("speed", joint.speed, units="rad/s")
    return mechanism


def torque_along(space, amount, axis=TILTED):
    return amount if space is uqmbd.Planar else tuple(amount * x for x in axis)


def scipy_quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return (w, x, y, z)


def value_of(expression, *bodies):
    """Value of an expression in coordinates, in the drawn pose, turning as stated."""
    swap = {}
    for body in bodies:
        q = [float(x) for x in body.pose.q]
        e, w = np.array(q[3:]), np.array([float(x) for x in body.pose.angular_velocity or (0, 0, 0)])
        rate = 0.5 * np.array([-e[1:] @ w, *(e[0] * w + np.cross(e[1:], w))])
        v = [*map(float, body.pose.velocity or O3), *rate]
        swap |= dict(zip((*body.q, *body.v), (*q, *v), strict=True))
    return float(sympy.sympify(expression).xreplace({k: sympy.Float(x) for k, x in swap.items()}))


def start_of(symbol, *bodies):
    angle = symbol.angle
    cosine, sine = (value_of(angle.whole(x), *bodies) for x in (angle.cosine, angle.sine))
    return float(angle.at_start(cosine, sine, angle.near)), cosine, sine


@pytest.mark.thorough
@settings(max_examples=30, deadline=None)
@given(unit_vectors, unit_vectors, turns, angles, st.integers(-6, 6), angles)
def test_angle_and_speed_in_any_pose(axis_i, axis_j, turn, angle, count, speed):
    """The angle is that of SciPy's rotation about the axis; zero where the joint frames coincide; whatever the turn."""
    i, j = (np.array(x) / np.linalg.norm(x) for x in (axis_i, axis_j))
    if np.linalg.norm(i + j) < 1e-3:
        return  # half a turn between the axes may be about anything perpendicular
    across, cosine = np.cross(i, j), i @ j
    size = np.linalg.norm(across)
    between = Rotation.from_rotvec(across / size * np.arctan2(size, cosine) if size > 1e-12 else np.zeros(3))
    first = Rotation.from_quat(turn)
    second = first * Rotation.from_rotvec(angle * i) * between.inv()
    mechanism = uqmbd.Mechanism("any", uqmbd.Spatial())
    spin = np.array([0.3, -0.2, 0.5])
    carried = second.inv().apply(first.apply(spin + speed * i))
    a = mechanism.body("a", 1, (1, 1, 1), quaternion=scipy_quaternion(first), angular_velocity=tuple(spin))
    b = mechanism.body("b", 1, (1, 1, 1), quaternion=scipy_quaternion(second), angular_velocity=tuple(carried))
    joint = mechanism.add(Revolute("joint", a, b, O3, O3, tuple(i), tuple(j)))
    start, c, s = start_of(joint.angle, a, b)
    assert start == pytest.approx(angle, abs=1e-9)
    assert value_of(joint.speed, a, b) == pytest.approx(speed, abs=1e-9)
    counted = angle + 2 * np.pi * count + 0.7
    shown = [float(f(counted, c, s)) for f in (joint.angle.angle.continued, joint.angle.angle.nearest)]
    assert shown == pytest.approx([angle + 2 * np.pi * count] * 2, abs=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_torque_in_the_angle_is_a_torsion_spring(space, close):
    """``J a'' = -k a`` from 0.3 rad and 300 rad/s: 13 turns forth and 13 back, as in closed form, and as the spring."""
    inertia, stiffness, speed = 0.2, 3.0, 300.0
    times = np.linspace(0, 1.6, 9)
    rate = np.sqrt(stiffness / inertia)
    expected = 0.3 * np.cos(rate * times) + speed / rate * np.sin(rate * times)

    def by_law(mechanism, joint, wheel, axes):
        mechanism.add(Torque("torque", wheel, torque_along(space, -stiffness * joint.angle)))

    def by_spring(mechanism, joint, wheel, axes):
        mechanism.add(TorsionSpringDamper("spring", mechanism.ground, wheel, stiffness, **axes))

    for load in (by_law, by_spring):
        data = uqmbd.simulate(hinged(space, speed, load), times, rtol=1e-10)
        close(data["angle"], expected, relative=1e-7)
    assert np.abs(expected).max() > 11 * 2 * np.pi


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_turns_are_counted_about_a_tilted_axis(integrator, close):
    """A driven hinge of which both bodies turn: the angle is what the driver prescribes, 15 turns of it."""
    mechanism = uqmbd.Mechanism("driven", uqmbd.Spatial())
    first = mechanism.body("first", 1, (1, 1, 1))
    mechanism.add(Revolute("base", mechanism.ground, first, O3, O3, (0, 1, 0), (0, 1, 0)))
    mechanism.add(RotationDriver("slow", mechanism.ground, first, 3 * uqmbd.t, (0, 1, 0), (0, 1, 0)))
    second = mechanism.body("second", 1, (0.1, 0.2, 0.25), position=(0, 0, 0))
    joint = mechanism.add(Revolute("joint", first, second, O3, O3, TILTED, TILTED))
    wanted = 2 * np.pi * (15 * uqmbd.t - 3 * uqmbd.t**2)
    mechanism.add(RotationDriver("fast", first, second, wanted, TILTED, TILTED))
    mechanism.output("angle", joint.angle, units="rad")
    mechanism.output("speed", joint.speed, units="rad/s")
    times = np.linspace(0, 1.25, 6)
    data = uqmbd.simulate(mechanism, times, integrator=integrator)
    close(data["angle"], 2 * np.pi * (15 * times - 3 * times**2), relative=1e-7)
    close(data["speed"], 2 * np.pi * (15 - 6 * times), relative=1e-5)


@pytest.mark.thorough
def test_angle_of_a_body_in_a_law(close):
    """In the plane ``body.angle`` may stand in a law: the oscillator again, with four turns drawn already."""
    mechanism = uqmbd.Mechanism("flywheel", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=0.5, position=O2, angle=8 * np.pi)
    mechanism.add(Torque("torque", wheel, -2 * wheel.angle))
    mechanism.output("angle", wheel.angle, units="rad")
    times = np.linspace(0, 3, 7)
    close(uqmbd.simulate(mechanism, times, rtol=1e-9)["angle"], 8 * np.pi * np.cos(2 * times), relative=1e-6)


@pytest.mark.thorough
def test_a_drawn_half_turn_is_one_angle_for_all_realisations():
    """A hinge that is drawn at about half a turn starts on one side of it whatever the realisation: no jump of 2 pi."""
    angle = uqmbd.RandomVariable("angle", chaospy.Normal(np.pi - 0.01, 0.1), units="rad")
    mechanism = uqmbd.Mechanism("folded", uqmbd.Spatial())
    pose = (sympy.cos(angle / 2), 0, 0, sympy.sin(angle / 2))
    wheel = mechanism.body("wheel", 1, (1, 1, 1), quaternion=pose, hold=True)
    joint = mechanism.add(Revolute("hinge", mechanism.ground, wheel, O3, O3, (0, 0, 1), (0, 0, 1)))
    mechanism.output("angle", joint.angle, units="rad")
    node = uqmbd.Study("folded", mechanism, [0, 0.1]).propagate(MonteCarlo(samples=60, seed=1))
    samples = node["samples"]
    expected = samples["inputs"].sel(input="angle").values
    np.testing.assert_allclose(samples["response"].sel(output="angle").values[:, 0], expected, atol=1e-9)
    assert (expected > np.pi).any()


def free(space, make, **pose):
    mechanism = uqmbd.Mechanism("any", space)
    body = mechanism.body("body", 1, 1 if space.dimension == 2 else (1, 1, 1), **pose)
    return mechanism.add(make(mechanism.ground, body))


def test_what_a_joint_does_not_have_is_told():
    plane, space = uqmbd.Planar(), uqmbd.Spatial()
    slide = free(plane, lambda g, b: Prismatic("slide", g, b, O2, O2, (1, 0), (1, 0)))
    with pytest.raises(AttributeError, match=r"Prismatic 'slide' has no .angle: it has .displacement \(m\) and .speed"):
        slide.angle  # noqa: B018
    weld = free(plane, lambda g, b: Fixed("weld", g, b, O2, O2))
    with pytest.raises(AttributeError, match=r"Fixed 'weld' has no .speed: it tells no motion"):
        weld.speed  # noqa: B018
    ball = free(space, lambda g, b: Spherical("ball", g, b, O3, O3))
    with pytest.raises(AttributeError, match=r"has no .angle"):
        ball.angle  # noqa: B018
    cross = free(space, lambda g, b: Universal("cross", g, b, O3, O3, (1, 0, 0), (0, 1, 0)))
    with pytest.raises(AttributeError, match=r"has no .angle: it has .angle_i \(rad\), .speed_i \(rad/s\), .angle_j"):
        cross.angle  # noqa: B018
    with pytest.raises(AttributeError, match="'Universal' object has no attribute 'angel'"):
        cross.angel  # noqa: B018
    massless = uqmbd.Mechanism("points", uqmbd.Translational())
    point = massless.body("point", 1)
    pin = massless.add(Revolute("pin", massless.ground, point, O2, O2))
    with pytest.raises(AttributeError, match="Revolute 'pin' has no .angle: it tells no motion"):
        pin.angle  # noqa: B018


def test_a_joint_tells_its_motion_once_it_is_added():
    mechanism = uqmbd.Mechanism("any", uqmbd.Planar())
    body = mechanism.body("body", 1, 1)
    joint = Revolute("joint", mechanism.ground, body, O2, O2)
    with pytest.raises(uqmbd.StudyError, match=r".angle is asked for before it was added to a mechanism"):
        joint.angle  # noqa: B018
    mechanism.add(joint)
    other = uqmbd.Mechanism("other", uqmbd.Planar())
    stranger = other.body("stranger", 1, 1)
    with pytest.raises(uqmbd.StudyError, match=r"it contains joint.angle, but 'joint' was not added to mechanism"):
        other.add(Torque("torque", stranger, joint.angle))
    with pytest.raises(uqmbd.StudyError, match=r"body 'odd': mass: it contains joint.angle, which changes while"):
        mechanism.body("odd", 1 + joint.angle**2, 1)
    with pytest.raises(uqmbd.StudyError, match="enters the constraint 'displacement'; there a number may depend on"):
        mechanism.add(PositionDriver("drive", mechanism.ground, body, O2, O2, (1, 0), joint.speed))
