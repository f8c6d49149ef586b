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
from uqmbd_collocation import Collocation
from uqmbd_drivers import PositionDriver, RotationDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import (
    Cylindrical,
    Fixed,
    Gear,
    Prismatic,
    RackAndPinion,
    Revolute,
    RevoluteSpherical,
    Screw,
    Spherical,
    Universal,
)
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, Torque, TorsionSpringDamper

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
    """Value of an expression in coordinates, in the given pose, turning as stated."""
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


BETA = np.pi / 6


def shafts(speed):
    """Case A5: two shafts at 30 degrees with a Cardan joint between them, the first one driven."""
    mechanism = uqmbd.Mechanism("shafts", uqmbd.Spatial())
    turn = (np.cos(BETA / 2), 0, -np.sin(BETA / 2), 0)
    first = mechanism.body("first", 1, (1, 1, 1))
    second = mechanism.body("second", 1, (1, 1, 1), quaternion=turn)
    ground = mechanism.ground
    one = mechanism.add(Revolute("one", ground, first, O3, O3, (1, 0, 0), (1, 0, 0)))
    along = (np.cos(BETA), 0, np.sin(BETA))
    two = mechanism.add(Cylindrical("two", ground, second, O3, O3, along, (1, 0, 0)))
    # the cross arm of the first shaft starts in the plane of the shafts
    cross = mechanism.add(Universal("cross", first, second, O3, O3, (0, 0, 1), (0, 1, 0)))
    mechanism.add(RotationDriver("drive", ground, first, speed * uqmbd.t, (1, 0, 0), (1, 0, 0)))
    return mechanism, one, two, cross


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.RedundantConstraintWarning")
def test_output_angle_of_a_cardan_joint(close):
    """``tan(out) cos(beta) = tan(in)``, over 11 turns; the cross swings in both yokes as vectors turned by SciPy."""
    mechanism, one, two, cross = shafts(10.0)
    for name, value in {
        "in": one.angle, "out": two.angle, "speed": two.speed, "slides": two.displacement,
        "i": cross.angle_i, "j": cross.angle_j, "rate_i": cross.speed_i, "rate_j": cross.speed_j,
    }.items():  # fmt: skip
        mechanism.output(name, value)
    fine = np.linspace(0.2, 0.2004, 5)
    times = np.array([0, 0.05, 0.1, *fine, 0.3, 3.0, 7.0])
    data = uqmbd.simulate(mechanism, times, rtol=1e-10)
    turned = 10 * times
    out = np.arctan2(np.sin(turned), np.cos(BETA) * np.cos(turned))
    out += 2 * np.pi * np.round((turned - out) / (2 * np.pi))
    close(data["in"], turned, relative=1e-8)
    close(data["out"], out, relative=1e-8)
    published = [11.547005383792516, 10.725274708395798, 9.34205239320907, 9.052163353137358, 11.470858549144744]
    close(data["speed"][[0, 1, 2, 3, 8]], published, relative=1e-7)
    close(data["slides"], np.zeros(len(times)), relative=1e-9)
    first = Rotation.from_rotvec(np.outer(turned, [1, 0, 0]))
    tilt = Rotation.from_quat([0, -np.sin(BETA / 2), 0, np.cos(BETA / 2)])
    second = Rotation.from_rotvec(np.outer(out, tilt.apply([1, 0, 0]))) * tilt
    arm = first.inv().apply(second.apply([0, 1, 0]))
    swing = np.arctan2(np.cross([0, 1, 0], arm) @ [0, 0, 1], arm @ [0, 1, 0])
    close(data["i"], swing, relative=1e-7, scale=1)
    assert np.abs(data["i"]).max() > 0.3
    start, back = tilt.inv().apply([0, 0, 1]), second.inv().apply(first.apply([0, 0, 1]))
    close(data["j"], -np.arctan2(np.cross(start, back) @ [0, 1, 0], back @ start), relative=1e-7, scale=1)
    for angle, rate in (("i", "rate_i"), ("j", "rate_j")):
        values = data[angle].values[3:8]
        slope = (values[0] - 8 * values[1] + 8 * values[3] - values[4]) / (12 * (fine[1] - fine[0]))
        close(data[rate].values[5], slope, relative=1e-5, scale=10)


@pytest.mark.thorough
@pytest.mark.parametrize("integrator", ["dop853", "ida"])
@pytest.mark.parametrize("kind", ["Screw", "by law"])
def test_a_screw_by_law(kind, integrator, close):
    """A nut that falls along a tilted thread: ``a = g / (1 + J / (m h^2))``, many turns, as the screw and by a law."""
    pitch, inertia, mass, g = 0.1, 0.0005, 2.0, 9.81
    axis = np.array(TILTED)
    mechanism = uqmbd.Mechanism("nut", uqmbd.Spatial(gravity=tuple(g * axis)))
    nut = mechanism.body("nut", mass, (inertia,) * 3, velocity=O3, angular_velocity=O3)
    arguments = (mechanism.ground, nut, O3, O3, TILTED, TILTED)
    if kind == "Screw":
        thread = mechanism.add(Screw("thread", *arguments, pitch))
    else:
        thread = mechanism.add(Cylindrical("thread", *arguments))
        law = pitch * thread.angle / (2 * sympy.pi)
        mechanism.add(PositionDriver("law", mechanism.ground, nut, O3, O3, TILTED, law))
    for name in ("angle", "displacement", "speed", "sliding_speed"):
        mechanism.output(name, getattr(thread, name))
    times = np.linspace(0, 1.2, 4)
    data = uqmbd.simulate(mechanism, times, integrator=integrator, rtol=1e-9)
    h = pitch / (2 * np.pi)
    way = 0.5 * g / (1 + inertia / (mass * h**2)) * times**2
    close(data["displacement"], way, relative=1e-6)
    close(data["angle"], way / h, relative=1e-6)
    close(data["sliding_speed"], h * data["speed"], relative=1e-6)
    assert way[-1] / pitch > 10


@pytest.mark.thorough
def test_gears_and_pinions(close):
    """Gears turn in the ratio of their teeth, a pinion rolls its way, from the given pose on."""
    mechanism = uqmbd.Mechanism("gears", uqmbd.Planar())
    ground = mechanism.ground
    first = mechanism.body("first", 1, 1, angle=0.4)
    second = mechanism.body("second", 1, 1, position=(3, 0), angle=-1.3)
    for body, place in ((first, O2), (second, (3, 0))):
        mechanism.add(Revolute(f"axle_{body.name}", ground, body, place, O2))
    gear = mechanism.add(Gear("gear", first, second, 2))
    rack = mechanism.body("rack", 1, 1, position=(0, -1))
    mechanism.add(Prismatic("guide", ground, rack, (0, -1), O2, (1, 0), (1, 0)))
    pinion = mechanism.add(RackAndPinion("pinion", rack, first, O2, O2, (1, 0), radius=1))
    mechanism.add(RotationDriver("drive", ground, first, 0.4 + 20 * uqmbd.t))
    for name, value in {
        "i": gear.angle_i, "j": gear.angle_j, "rate": gear.speed_j, "turned": pinion.angle,
        "way": pinion.displacement, "sliding": pinion.sliding_speed,
    }.items():  # fmt: skip
        mechanism.output(name, value)
    times = np.linspace(0, 2, 5)
    data = uqmbd.simulate(mechanism, times)
    close(data["i"], 20 * times, relative=1e-7)
    close(data["j"], -10 * times, relative=1e-7)
    close(data["rate"], np.full(5, -10.0), relative=1e-6)
    close(data["turned"], 20 * times, relative=1e-7)
    close(data["way"], 20 * times, relative=1e-7)
    close(data["sliding"], np.full(5, 20.0), relative=1e-6)


@pytest.mark.thorough
def test_the_hinge_of_a_link(close):
    """A massless link whose ball goes round three times: its angle about the hinge, from where it is drawn."""
    mechanism = uqmbd.Mechanism("link", uqmbd.Spatial())
    mass = mechanism.body("mass", 1, (1, 1, 1), position=(0.6, 0.8, 0), angular_velocity=O3, velocity=(-8, 6, 0))
    link = mechanism.add(RevoluteSpherical("link", mechanism.ground, mass, O3, O3, (0, 0, 1), 1.0))
    mechanism.output("angle", link.angle, units="rad")
    mechanism.output("speed", link.speed, units="rad/s")
    data = uqmbd.simulate(mechanism, [0, 1, 2], rtol=1e-9)
    close(data["angle"], [0, 10, 20], relative=1e-7)
    close(data["speed"], [10, 10, 10], relative=1e-7)


@pytest.mark.thorough
@pytest.mark.parametrize("space", [uqmbd.Planar, uqmbd.Spatial])
def test_every_method_and_equilibrium_and_modes(space):
    """A random spring by a law about a tilted axis: closed form, its moments by quadrature; at rest; frequency."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(2.0, 4.0), units="N m/rad")
    inertia, speed, decay = 0.2, 60.0, 0.05

    def load(mechanism, joint, wheel, axes):
        mechanism.add(Torque("torque", wheel, torque_along(space, 1.5 - stiffness * joint.angle - 0.02 * joint.speed)))
        mechanism.output("rest", uqmbd.at_equilibrium(joint.angle), units="rad")
        mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")

    def exact(k, times):
        rate, offset = np.sqrt(k / inertia - decay**2), 0.3 - 1.5 / k
        swing = offset * np.cos(rate * times) + (speed + decay * offset) / rate * np.sin(rate * times)
        return 1.5 / k + np.exp(-decay * times) * swing

    mechanism = hinged(space, speed, load, inertia=inertia)
    times = np.linspace(0, 0.6, 4)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    k, weights = 3 + nodes[:, None], weights[:, None] / 2
    values = exact(k, times)
    assert np.abs(values).max() > 2 * np.pi
    mean = (weights * values).sum(0)
    std = np.sqrt((weights * (values - mean) ** 2).sum(0))
    methods = [Collocation(order=6), Galerkin(order=6), MonteCarlo(samples=20, seed=3)]
    tree = uqmbd.Study("springs", mechanism, times, propagators=methods, rtol=1e-8).run()
    for label in ("collocation", "galerkin"):
        found = tree[f"{label}/statistics"].to_dataset().sel(output="angle")
        np.testing.assert_allclose(found["mean"], mean, rtol=0, atol=2e-4 * std.max())
        np.testing.assert_allclose(found["std"], std, rtol=0, atol=2e-4 * std.max())
        alone = tree[f"{label}/scalars/statistics"].to_dataset()["mean"]
        np.testing.assert_allclose(alone.sel(output="rest"), (weights * 1.5 / k).sum(), rtol=1e-4)
        hertz = (weights * np.sqrt(k / inertia)).sum() / (2 * np.pi)
        np.testing.assert_allclose(alone.sel(output="frequency"), hertz, rtol=1e-4)
    samples = tree["monte-carlo/samples"]
    expected = exact(samples["inputs"].values[:, :1], times)
    np.testing.assert_allclose(samples["response"].sel(output="angle"), expected, rtol=0, atol=1e-5)


@pytest.mark.thorough
def test_random_axes(close):
    """A hinge whose axis is random: the angle by a law and as an output is that about each realisation's own axis."""
    tilt = uqmbd.RandomVariable("tilt", chaospy.Uniform(-0.4, 0.6), units="rad")
    axis = (sympy.sin(tilt), 0, sympy.cos(tilt))
    mechanism = uqmbd.Mechanism("tilted", uqmbd.Spatial())
    spin = tuple(40 * x for x in axis)
    wheel = mechanism.body("wheel", 1, (0.2, 0.2, 0.2), angular_velocity=spin)
    joint = mechanism.add(Revolute("hinge", mechanism.ground, wheel, O3, O3, axis, axis))
    mechanism.add(Torque("torque", wheel, tuple(-3 * joint.angle * x for x in axis)))
    mechanism.output("angle", joint.angle, units="rad")
    mechanism.output("lean", wheel.rotation[0, 1])
    times = np.linspace(0, 1, 3)
    methods = [MonteCarlo(samples=8, seed=1), Collocation(order=2), Galerkin(order=4)]
    tree = uqmbd.Study("tilted", mechanism, times, propagators=methods, rtol=1e-9).run()
    rate = np.sqrt(3 / 0.2)
    expected = 40 / rate * np.sin(rate * times)
    close(tree["monte-carlo/samples"]["response"].values[:, 0], np.tile(expected, (8, 1)), relative=1e-6)
    for label in ("collocation", "galerkin"):
        close(tree[f"{label}/statistics"]["mean"].values[0], expected, relative=1e-4)


@pytest.mark.thorough
def test_start_condition_of_a_joint(close):
    """Angle and displacement between bodies in space are given at the start, more than a turn; so are their rates."""
    mechanism = uqmbd.Mechanism("two", uqmbd.Spatial())
    body = mechanism.body("body", 1, (1, 1, 1))
    joint = mechanism.add(Cylindrical("joint", mechanism.ground, body, O3, O3, TILTED, TILTED))
    for name in ("angle", "displacement", "speed", "sliding_speed"):
        mechanism.output(name, getattr(joint, name))
    mechanism.start(joint.angle, 7.5)
    mechanism.start(joint.displacement, 0.3)
    mechanism.start(joint.speed, 2.0)
    mechanism.start(joint.sliding_speed, -0.4)
    data = uqmbd.simulate(mechanism, [0, 1])
    close(data["angle"], [7.5, 9.5], relative=1e-6)
    close(data["displacement"], [0.3, -0.1], relative=1e-6)


@pytest.mark.thorough
def test_a_force_by_a_displacement(close):
    """``m x'' = -k x - c x'`` by the displacement and speed of a slide on a turned line, in three spaces."""
    for space, along in ((uqmbd.Translational(), (0.6, 0.8)), (uqmbd.Planar(), (0.6, 0.8)), (uqmbd.Spatial(), TILTED)):
        mechanism = uqmbd.Mechanism("slide", space)
        heavy = {"mass": 2.0} | ({} if not space.turns else {"inertia": 1 if space.dimension == 2 else (1, 1, 1)})
        start = tuple(0.1 * x for x in along)
        cart = mechanism.body("cart", position=start, **heavy)
        zero = (0,) * space.dimension
        slide = mechanism.add(Prismatic("slide", mechanism.ground, cart, zero, zero, along, along))
        push = -50 * slide.displacement - 4 * slide.speed
        mechanism.add(PointForce("push", cart, zero, tuple(push * x for x in along)))
        mechanism.output("x", slide.displacement, units="m")
        times = np.linspace(0, 1, 4)
        decay, rate = 1.0, np.sqrt(25 - 1)
        expected = 0.1 * np.exp(-decay * times) * (np.cos(rate * times) + decay / rate * np.sin(rate * times))
        close(uqmbd.simulate(mechanism, times, rtol=1e-9)["x"], expected, relative=1e-6)


def free(space, make, **pose):
    mechanism = uqmbd.Mechanism("any", space)
    body = mechanism.body("body", 1, 1 if space.dimension == 2 else (1, 1, 1), **pose)
    return mechanism.add(make(mechanism.ground, body))


def test_what_a_joint_does_not_have_is_reported():
    plane, space = uqmbd.Planar(), uqmbd.Spatial()
    slide = free(plane, lambda g, b: Prismatic("slide", g, b, O2, O2, (1, 0), (1, 0)))
    with pytest.raises(
        AttributeError,
        match=r"Prismatic 'slide' has no .angle: its motion quantities are .displacement \(m\) and .speed",
    ):
        slide.angle  # noqa: B018 - asking is what raises
    weld = free(plane, lambda g, b: Fixed("weld", g, b, O2, O2))
    with pytest.raises(AttributeError, match=r"Fixed 'weld' has no .speed: the component defines no motion quantities"):
        weld.speed  # noqa: B018 - asking is what raises
    ball = free(space, lambda g, b: Spherical("ball", g, b, O3, O3))
    with pytest.raises(AttributeError, match=r"has no .angle"):
        ball.angle  # noqa: B018 - asking is what raises
    cross = free(space, lambda g, b: Universal("cross", g, b, O3, O3, (1, 0, 0), (0, 1, 0)))
    with pytest.raises(
        AttributeError, match=r"has no .angle: its motion quantities are .angle_i \(rad\), .speed_i \(rad/s\), .angle_j"
    ):
        cross.angle  # noqa: B018 - asking is what raises
    with pytest.raises(AttributeError, match="'Universal' object has no attribute 'angel'; did you mean 'angle_"):
        cross.angel  # noqa: B018 - asking is what raises
    massless = uqmbd.Mechanism("points", uqmbd.Translational())
    point = massless.body("point", 1)
    pin = massless.add(Revolute("pin", massless.ground, point, O2, O2))
    with pytest.raises(
        AttributeError, match="Revolute 'pin' has no .angle: the component defines no motion quantities"
    ):
        pin.angle  # noqa: B018 - asking is what raises


def test_a_joint_tells_its_motion_once_it_is_added():
    mechanism = uqmbd.Mechanism("any", uqmbd.Planar())
    body = mechanism.body("body", 1, 1)
    joint = Revolute("joint", mechanism.ground, body, O2, O2)
    with pytest.raises(uqmbd.StudyError, match=r".angle is used before the joint was added to a mechanism"):
        joint.angle  # noqa: B018 - asking is what raises
    mechanism.add(joint)
    other = uqmbd.Mechanism("other", uqmbd.Planar())
    stranger = other.body("stranger", 1, 1)
    with pytest.raises(
        uqmbd.StudyError, match=r"the expression contains joint.angle, but 'joint' was not added to mechanism"
    ):
        other.add(Torque("torque", stranger, 1.0 * joint.angle))
    other.add(Revolute("joint", other.ground, stranger, O2, O2))
    with pytest.raises(
        uqmbd.StudyError,
        match="this Revolute 'joint' belongs to another mechanism than 'other', which has a different object",
    ):
        other.add(Torque("torque", stranger, 1.0 * joint.angle))
    namesake = other.body("body", 1, 1)
    with pytest.raises(
        uqmbd.StudyError,
        match="this body 'body' belongs to another mechanism than 'other', which has a different object",
    ):
        other.add(Torque("torque", namesake, 1.0 * body.angular_velocity))
    with pytest.raises(uqmbd.StudyError, match=r"give a non-zero vector, e\.g\. \(0, 1\)"):
        other.add(PositionDriver("drive", other.ground, stranger, O2, O2, (0, 0), 1))
    with pytest.raises(
        uqmbd.StudyError, match=r"body 'odd': mass: the expression contains joint.angle, which changes during"
    ):
        mechanism.body("odd", 1 + joint.angle**2, 1)
    with pytest.raises(uqmbd.StudyError, match="the constraint 'displacement' depends on .* but it may depend only on"):
        mechanism.add(PositionDriver("drive", mechanism.ground, body, O2, O2, (1, 0), joint.speed))
