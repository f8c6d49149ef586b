"""Assembly: cases.md, "Behaviour", and initial velocities."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics import Ensemble, build
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Fixed, Prismatic, Revolute, Spherical

pytestmark = pytest.mark.filterwarnings("ignore:.*assembly moved:uqmbd.StudyWarning")  # by much: that is what is tried

OFF = [120, 150, 175]
ORIGIN = (0, 0, 0)


def assembled(mechanism):
    """Drawn and assembled coordinates at the means, each (coordinate,)."""
    model = build(mechanism)
    ensemble = Ensemble(model, mechanism.inputs.means[None, :])
    start = ensemble.start
    assert not start.messages[0]
    return ensemble.parameters[0, model.drawn], start


# -- do no harm ---------------------------------------------------------------------------------------------------------
def slider_crank():
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar(gravity=(0, -9.81)))
    angle, l1, l2 = 0.7, 0.15, 0.35
    below = -np.arcsin(l1 * np.sin(angle) / l2)
    pin = l1 * np.array([np.cos(angle), np.sin(angle)])
    end = pin[0] + l2 * np.cos(below)
    crank = mechanism.body("crank", mass=1, inertia=0.1, position=pin / 2, angle=angle)
    rod = mechanism.body("rod", mass=1, inertia=0.1, position=((pin[0] + end) / 2, pin[1] / 2), angle=below)
    slider = mechanism.body("slider", mass=1, inertia=0.1, position=(end, 0))
    mechanism.add(Revolute("A", mechanism.ground, crank, (0, 0), (-l1 / 2, 0)))
    mechanism.add(Revolute("B", crank, rod, (l1 / 2, 0), (-l2 / 2, 0)))
    mechanism.add(Revolute("C", rod, slider, (l2 / 2, 0), (0, 0)))
    mechanism.add(Prismatic("D", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.output("x", slider.position[0])
    return mechanism


def spatial_arm(turn, matrix):
    """Bodies in general poses, joined by every joint: all closed as drawn."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    rng = np.random.default_rng(5)
    before, base, drawn = mechanism.ground, np.zeros(3), np.eye(3)
    for k, kind in enumerate((Revolute, Prismatic, Fixed, Spherical, Distance)):
        q = turn(rng.normal(size=3), rng.uniform(0.5, 3))
        position, rotation = rng.normal(size=3), matrix(q)
        body = mechanism.body(f"b{k}", mass=1, inertia=(0.1, 0.2, 0.25), position=position, quaternion=q)
        point = rng.normal(size=3)  # of the joint, in the world
        axis = rng.normal(size=3)
        points = {"point_i": drawn.T @ (point - base), "point_j": rotation.T @ (point - position)}
        axes = {"axis_i": drawn.T @ axis, "axis_j": rotation.T @ axis}
        if kind in (Revolute, Prismatic):
            mechanism.add(kind(f"j{k}", before, body, **points, **axes))
        elif kind is Distance:
            end = points["point_j"] + np.array([0.3, 0.4, 1.2])
            mechanism.add(Distance(f"j{k}", before, body, points["point_i"], end, length=1.3))
        else:
            mechanism.add(kind(f"j{k}", before, body, **points))
        before, base, drawn = body, position, rotation
    mechanism.output("x", body.position[0])
    return mechanism


def test_consistent_planar_state_is_not_moved():
    drawn, start = assembled(slider_crank())
    assert np.abs(start.q[0] - drawn).max() < 1e-12


@pytest.mark.thorough
def test_consistent_spatial_state_is_not_moved(turn, matrix):
    drawn, start = assembled(spatial_arm(turn, matrix))
    assert np.abs(start.q[0] - drawn).max() < 1e-12


def test_state_that_is_slightly_off_moves_slightly():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=1, position=(1.001, 0.002), angle=0.003)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-1, 0)))
    mechanism.output("x", rod.position[0])
    drawn, start = assembled(mechanism)
    assert 1e-5 < np.abs(start.q[0] - drawn).max() < 3e-3


# -- joints that start far off ------------------------------------------------------------------------------------------
def pose_of(mechanism, body):
    """Rotation matrix of the assembled body, or None where assembly is refused."""
    for i in range(3):
        for j in range(3):
            mechanism.output(f"R{i}{j}", body.rotation[i, j])
    try:
        data = uqmbd.simulate(mechanism, [0, 1e-3])
    except uqmbd.AssemblyError:
        return None
    return np.array([[data[f"R{i}{j}"].values[0] for j in range(3)] for i in range(3)])


@pytest.mark.parametrize("off", OFF)
@pytest.mark.parametrize("tilt", [(1, 0, 0), (0, 1, 0), (1, 2, 0), (2, -1, 0.5)])
def test_revolute_axis_never_points_the_other_way(off, tilt, turn):
    mechanism = uqmbd.Mechanism("flip", uqmbd.Spatial())
    body = mechanism.body("b", mass=1, inertia=(1, 1, 1), quaternion=turn(tilt, np.deg2rad(off)), position=(0.1, 0, 0))
    mechanism.add(Revolute("hinge", mechanism.ground, body, ORIGIN, (0.2, 0, 0), (0, 0, 1), (0, 0, 1)))
    rotation = pose_of(mechanism, body)
    if rotation is not None:
        np.testing.assert_allclose(rotation @ (0, 0, 1), (0, 0, 1), atol=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("off", OFF)
def test_revolute_between_two_free_bodies_never_points_the_other_way(off, turn):
    mechanism = uqmbd.Mechanism("flip", uqmbd.Spatial())
    first = mechanism.body("a", mass=1, inertia=(1, 1, 1))
    body = mechanism.body("b", mass=1, inertia=(1, 1, 1), quaternion=turn((1, 0, 0), np.deg2rad(off)))
    mechanism.add(Revolute("hinge", first, body, ORIGIN, (0.2, 0, 0), (0, 1, 0), (0, 1, 0)))
    mechanism.output(
        "cosine", (first.rotation * np.array([[0], [1], [0]])).dot(body.rotation * np.array([[0], [1], [0]]))
    )
    try:
        cosine = uqmbd.simulate(mechanism, [0, 1e-3]).cosine[0]
    except uqmbd.AssemblyError:
        return
    assert cosine == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("off", OFF)
@pytest.mark.parametrize("tilt", [(1, 0, 0), (1, 2, 0), (2, -1, 0.5)])
def test_prismatic_axis_never_points_the_other_way(off, tilt, turn):
    mechanism = uqmbd.Mechanism("flip", uqmbd.Spatial())
    body = mechanism.body("b", mass=1, inertia=(1, 1, 1), quaternion=turn(tilt, np.deg2rad(off)), position=(0.1, 0, 0))
    mechanism.add(Prismatic("slide", mechanism.ground, body, ORIGIN, ORIGIN, (0, 0, 1), (0, 0, 1)))
    rotation = pose_of(mechanism, body)
    if rotation is not None:
        np.testing.assert_allclose(rotation @ (0, 0, 1), (0, 0, 1), atol=1e-9)


@pytest.mark.parametrize("off", OFF)
def test_planar_prismatic_axis_never_points_the_other_way(off):
    mechanism = uqmbd.Mechanism("flip", uqmbd.Planar())
    body = mechanism.body("b", mass=1, inertia=1, angle=np.deg2rad(off))
    mechanism.add(Prismatic("slide", mechanism.ground, body, (0, 0), (0, 0), (0.6, 0.8), (0.6, 0.8)))
    mechanism.output("cosine", body.rotation[0, 0])
    try:
        cosine = uqmbd.simulate(mechanism, [0, 1e-3]).cosine[0]
    except uqmbd.AssemblyError:
        return
    assert cosine == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("off", OFF)
@pytest.mark.parametrize("tilt", [(1, 0, 0), (1, 2, 3)])
def test_fixed_joint_finds_the_stated_rotation(off, tilt, turn, matrix):
    mechanism = uqmbd.Mechanism("flip", uqmbd.Spatial())
    body = mechanism.body("b", mass=1, inertia=(1, 1, 1), quaternion=turn(tilt, np.deg2rad(off)), position=(0.1, 0, 0))
    wanted = turn((0, 1, 1), 0.4)
    mechanism.add(Fixed("weld", mechanism.ground, body, ORIGIN, (0.2, 0, 0), rotation=wanted))
    rotation = pose_of(mechanism, body)
    if rotation is not None:
        np.testing.assert_allclose(rotation, matrix(wanted), atol=1e-9)


@pytest.mark.parametrize("off", OFF)
def test_planar_fixed_joint_finds_the_stated_rotation(off):
    mechanism = uqmbd.Mechanism("flip", uqmbd.Planar())
    body = mechanism.body("b", mass=1, inertia=1, angle=np.deg2rad(off))
    mechanism.add(Fixed("weld", mechanism.ground, body, (0, 0), (1, 0), rotation=0.0))
    mechanism.output("cosine", body.rotation[0, 0])
    try:
        cosine = uqmbd.simulate(mechanism, [0, 1e-3]).cosine[0]
    except uqmbd.AssemblyError:
        return
    assert cosine == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("off", [*OFF, -150])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_rotation_driver_finds_its_angle(off, space, turn):
    spatial = space == "spatial"
    mechanism = uqmbd.Mechanism("flip", uqmbd.Spatial() if spatial else uqmbd.Planar())
    wanted, drawn = 0.3, 0.3 + np.deg2rad(off)
    pose = {"quaternion": turn((0, 0, 1), drawn), "inertia": (1, 1, 1)} if spatial else {"angle": drawn, "inertia": 1}
    axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)} if spatial else {}
    point, zero = ((1, 0, 0), ORIGIN) if spatial else ((1, 0), (0, 0))
    body = mechanism.body("b", mass=1, **pose)
    mechanism.add(Revolute("hinge", mechanism.ground, body, zero, point, **axes))
    mechanism.add(RotationDriver("motor", mechanism.ground, body, wanted + 0 * uqmbd.t, **axes))
    mechanism.output("cos", body.rotation[0, 0])
    mechanism.output("sin", body.rotation[1, 0])
    try:
        data = uqmbd.simulate(mechanism, [0, 1e-3])
    except uqmbd.AssemblyError:
        return
    assert data.cos[0] == pytest.approx(np.cos(wanted), abs=1e-9)
    assert data.sin[0] == pytest.approx(np.sin(wanted), abs=1e-9)


# -- what cannot be closed ----------------------------------------------------------------------------------------------
def ends_of_a_rod(how):
    mechanism = uqmbd.Mechanism("rod", uqmbd.Planar())
    ground = mechanism.ground
    if how == "fixed":
        body = mechanism.body("block", mass=1, inertia=1, position=(1, 0))
        mechanism.add(Fixed("weld", ground, body, (1, 0), (0, 0)))
        mechanism.add(Distance("strut", ground, body, (0, 0), (0, 0), length=0.1))
    elif how == "held":
        body = mechanism.body("block", mass=1, inertia=1, position=(1, 0), hold=True)
        mechanism.add(Distance("strut", ground, body, (0, 0), (0, 0), length=0.1))
    else:  # two pivoted levers whose tips cannot come closer than 0.6 m
        body = mechanism.body("left", mass=1, inertia=1, position=(0, 0))
        other = mechanism.body("right", mass=1, inertia=1, position=(1, 0))
        mechanism.add(Revolute("A", ground, body, (0, 0), (0, 0)))
        mechanism.add(Revolute("B", ground, other, (1, 0), (0, 0)))
        mechanism.add(Distance("strut", body, other, (0.2, 0), (0.2, 0), length=0.1))
    mechanism.output("x", body.position[0])
    return mechanism


@pytest.mark.parametrize("how", ["fixed", "held", "pivoted"])
def test_rod_that_is_too_short_names_the_joint_and_the_residual(how):
    """A rod of length 0.1 between points 1 m apart."""
    for attempt in (lambda m: uqmbd.simulate(m, [0, 1]), uqmbd.check):
        with pytest.raises(uqmbd.AssemblyError, match=r"strut.*residual of -?\d") as caught:
            attempt(ends_of_a_rod(how))
        assert "rod" in str(caught.value) or "strut" in str(caught.value)


# -- initial velocities ---------------------------------------------------------------------------------------------------
@pytest.mark.thorough
def test_stated_velocities_are_held(observe, series, turn, matrix):
    """Velocity of the body frame's origin in world axes, angular velocity in the body frame."""
    mechanism = uqmbd.Mechanism("free", uqmbd.Spatial())
    q, v, w = turn((1, 2, -1), 0.9), (1.0, -2.0, 0.5), (0.3, 0.7, -1.1)
    body = mechanism.body(
        "b", mass=2, inertia=(1, 2, 2.5), com=(0.1, 0.2, -0.3), quaternion=q, velocity=v, angular_velocity=w
    )
    observe(mechanism, v=body.velocity, w=body.angular_velocity)
    data = uqmbd.simulate(mechanism, [0, 0.1])
    np.testing.assert_allclose(series(data, "v")[0], v, atol=1e-12)
    np.testing.assert_allclose(series(data, "w")[0], matrix(q) @ w, atol=1e-12)


def test_velocity_left_out_follows_from_the_stated_ones():
    """Two particles on a rod: along it they move alike, across it the free one rests (the smallest norm)."""
    mechanism = uqmbd.Mechanism("dumbbell", uqmbd.Translational())
    a = mechanism.body("a", mass=1, velocity=(2, 3))
    b = mechanism.body("b", mass=1, position=(1, 0))
    mechanism.add(Distance("rod", a, b, (0, 0), (0, 0), length=1))
    for k, axis in enumerate("xy"):
        mechanism.output(f"a{axis}", a.velocity[k])
        mechanism.output(f"b{axis}", b.velocity[k])
    data = uqmbd.simulate(mechanism, [0, 0.1]).isel(time=0)
    assert [float(data[n]) for n in ("ax", "ay", "bx", "by")] == pytest.approx([2, 3, 2, 0], abs=1e-12)


def test_nothing_stated_means_the_smallest_velocities():
    """One driver in a loop-free arm: what it does not drive stays at rest."""
    mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
    arm = mechanism.body("arm", mass=1, inertia=1)
    other = mechanism.body("other", mass=1, inertia=1, position=(5, 0))
    mechanism.add(Revolute("A", mechanism.ground, arm, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, arm, 3 * uqmbd.t))
    mechanism.output("rate", arm.angular_velocity)
    mechanism.output("vx", other.velocity[0])
    data = uqmbd.simulate(mechanism, [0, 0.1]).isel(time=0)
    assert float(data.rate) == pytest.approx(3, abs=1e-12)
    assert float(data.vx) == 0


def test_angular_velocity_alone_carries_the_origin_along():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar())
    rod = mechanism.body("rod", mass=1, inertia=1, position=(2, 0), angular_velocity=1.5)
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-2, 0)))
    mechanism.output("vy", rod.velocity[1])
    mechanism.output("rate", rod.angular_velocity)
    data = uqmbd.simulate(mechanism, [0, 0.1]).isel(time=0)
    assert float(data.vy) == pytest.approx(3, abs=1e-12)
    assert float(data.rate) == pytest.approx(1.5, abs=1e-12)


def test_velocity_that_breaks_a_joint_is_an_error_that_names_both():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar())
    rod = mechanism.body("lever", mass=1, inertia=1, position=(2, 0), velocity=(1, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-2, 0)))
    mechanism.output("vy", rod.velocity[1])
    with pytest.raises(uqmbd.AssemblyError, match=r"velocity.*lever.*contradict.*pivot"):
        uqmbd.simulate(mechanism, [0, 0.1])


def test_statements_that_contradict_each_other_are_an_error_that_names_them():
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Spatial())
    axes = {"axis_i": (0, 0, 1), "axis_j": (0, 0, 1)}
    rod = mechanism.body(
        "lever", mass=1, inertia=(1, 1, 1), position=(2, 0, 0), velocity=(0, 1, 0), angular_velocity=(0, 0, 2)
    )
    mechanism.add(Revolute("pivot", mechanism.ground, rod, ORIGIN, (-2, 0, 0), **axes))
    mechanism.output("vy", rod.velocity[1])
    with pytest.raises(uqmbd.AssemblyError) as caught:
        uqmbd.simulate(mechanism, [0, 0.1])
    assert "velocity of body lever" in str(caught.value)
    assert "angular_velocity of body lever" in str(caught.value)


def test_two_bodies_whose_velocities_contradict_through_a_rod_are_named():
    mechanism = uqmbd.Mechanism("dumbbell", uqmbd.Translational())
    a = mechanism.body("a", mass=1, velocity=(1, 0))
    b = mechanism.body("b", mass=1, position=(1, 0), velocity=(0, 0))
    mechanism.add(Distance("rod", a, b, (0, 0), (0, 0), length=1))
    mechanism.output("x", b.position[0])
    with pytest.raises(uqmbd.AssemblyError) as caught:
        uqmbd.simulate(mechanism, [0, 0.1])
    text = str(caught.value)
    assert "velocity of body a" in text and "velocity of body b" in text and "rod" in text


def test_stated_velocity_may_be_random():
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.5), units="m/s")
    mechanism = uqmbd.Mechanism("throw", uqmbd.Planar())
    stone = mechanism.body("stone", mass=1, inertia=1, velocity=(speed, 2 * speed), angular_velocity=speed / 2)
    mechanism.output("x", stone.position[0])
    mechanism.output("y", stone.position[1])
    mechanism.output("angle", stone.angle)
    for value in (3.0, 1.7):
        last = uqmbd.simulate(mechanism, [0, 2], values={"speed": value}, rtol=1e-8).isel(time=-1)
        assert [float(last[n]) for n in ("x", "y", "angle")] == pytest.approx([2 * value, 4 * value, value], rel=1e-6)


def test_held_body_keeps_its_drawn_pose_while_the_other_moves():
    mechanism = uqmbd.Mechanism("pair", uqmbd.Planar())
    first = mechanism.body("first", mass=1, inertia=1, position=(0.1, -0.2), angle=0.3, hold=True)
    second = mechanism.body("second", mass=1, inertia=1, position=(1.4, 0.5))
    mechanism.add(Revolute("hinge", first, second, (1, 0), (0, 0)))
    mechanism.output("x", first.position[0])
    drawn, start = assembled(mechanism)
    np.testing.assert_array_equal(start.q[0, :4], drawn[:4])
    np.testing.assert_allclose(start.q[0, 4:6], [0.1 + np.cos(0.3), -0.2 + np.sin(0.3)], atol=1e-11)


def test_mechanism_in_which_nothing_can_move_keeps_its_pose():
    mechanism = uqmbd.Mechanism("wall", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    body = mechanism.body("block", mass=2, inertia=(1, 1, 1), position=(1, 0, 0))
    weld = mechanism.add(Fixed("weld", mechanism.ground, body, ORIGIN, (-1, 0, 0)))
    mechanism.output("x", body.position[0])
    mechanism.output("force", weld.reaction_force[2])
    mechanism.output("moment", weld.reaction_moment[1])
    data = uqmbd.simulate(mechanism, [0, 1, 2])
    np.testing.assert_allclose(data.x, 1, atol=1e-12)
    np.testing.assert_allclose(data.force, 19.62, atol=1e-9)
    np.testing.assert_allclose(data.moment, -19.62, atol=1e-9)


def test_mechanism_without_mobility_carries_its_load():
    """A lever that a strut holds: 1 m out, the strut pulls at right angles."""
    mechanism = uqmbd.Mechanism("bracket", uqmbd.Planar(gravity=(0, -9.81)))
    lever = mechanism.body("lever", mass=3, inertia=1, com=(0.5, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, lever, (0, 0), (0, 0)))
    strut = mechanism.add(Distance("strut", mechanism.ground, lever, (1, 1), (1, 0), 1))
    mechanism.output("force", strut.reaction_force[1])
    np.testing.assert_allclose(uqmbd.simulate(mechanism, [0, 1, 2]).force, 3 * 9.81 / 2, atol=1e-9)


def test_numpy_scalars_are_numbers_like_any_other():
    mechanism = uqmbd.Mechanism("numpy", uqmbd.Planar())
    body = mechanism.body(
        "b", mass=np.float64(1), inertia=np.int64(2), position=(np.cos(0.3), 0), angle=np.float64(0.1)
    )
    mechanism.add(Revolute("A", mechanism.ground, body, (np.float64(0.5), 0), (0, np.float32(0.25))))
    mechanism.output("x", body.position[0])
    assert np.isfinite(uqmbd.simulate(mechanism, [0, 1]).x).all()
