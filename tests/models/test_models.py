"""Small models in both formats against closed forms, mechanisms written by hand, and MuJoCo's own numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_models import MJCF, URDF

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
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

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


@pytest.mark.thorough
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


def test_rotors_and_damping_of_actuators_act_through_their_gears(mjcf):
    """(J + 0.1 + 9 * 0.5 + 0.2) q'' = -(0.3 + 9 * 2) q': in the joint, on a gear of 3, and from the parent."""
    read = mjcf(
        '<option gravity="0 0 0"/><worldbody><body><joint name="q" armature="0.1" '
        'damping="0.3"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 0.7"/></body></worldbody>'
        '<tendon><fixed name="t"><joint joint="q" coef="1"/></fixed></tendon>'
        '<actuator><motor joint="q" armature="0.5" damping="2" gear="3"/><motor jointinparent="q" armature="0.2"/>'
        '<motor name="rope" tendon="t" armature="0.2" damping="5" gear="2"/>'
        '<position name="servo" joint="q" kp="10" kv="3"/><position joint="q" kp="4" dampratio="1"/>'
        '<general joint="q" biastype="affine" biasprm="1 0 0"/></actuator>'
        '<keyframe><key qvel="2"/></keyframe>',
        keyframe=0,
    )
    times = np.linspace(0, 0.5, 6)
    rate = (0.3 + 9 * 2) / (0.7 + 0.1 + 9 * 0.5 + 0.2)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    np.testing.assert_allclose(found["q"], 2 / rate * (1 - np.exp(-rate * times)), rtol=0, atol=1e-7)
    told = {row.what: row.names for row in read.not_taken}
    assert told["rotors and damping of actuators"] == ("rope (armature 0.2, damping 5, gear 2)",)
    assert told["forces of actuators without control"] == (
        "servo (kp 10, kv 3)",
        "no. 5 (kp 4, dampratio 1)",
        "no. 6 (force 1)",
    )


def test_what_actuators_add_is_that_of_mujoco(mjcf, tmp_path):
    """Mass matrix and damping force of MuJoCo, of a hinge, a slide and a ball joint with geared motors."""
    mujoco = pytest.importorskip("mujoco")
    inertial = '<inertial pos="0 0 0" mass="2" diaginertia="0.3 0.4 0.5"/>'
    read = mjcf(
        f'<worldbody><body><joint name="a" armature="0.1"/>{inertial}</body><body pos="1 0 0"><joint name="b" type="slide"/>'
        f'{inertial}</body><body pos="2 0 0"><joint name="c" type="ball" damping="0.2"/>{inertial}</body></worldbody><actuator>'
        '<motor joint="a" armature="0.2" damping="0.7" gear="-4"/><motor joint="b" armature="0.3" gear="2 9"/>'
        '<motor joint="c" armature="0.4" damping="0.6" gear="3 1 2"/></actuator>'
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    if not hasattr(model, "actuator_armature"):
        pytest.skip("an earlier MuJoCo, whose actuators have none")
    data = mujoco.MjData(model)
    data.qvel[:] = 1
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    added = np.diag(mass) - (0.5, 2, 0.3, 0.4, 0.5)
    values = {name: component.values for name, component in read.components.items()}
    inertia = [float(values[x]["inertia" if "b" not in x else "mass"]) for x in ("a_rotor", "b_rotor", "c_rotor_x")]
    np.testing.assert_allclose(inertia, added[:3], rtol=1e-12)
    damping = [float(values[x]["damping"]) for x in ("a_friction", "c_friction_x")]
    np.testing.assert_allclose(damping, -data.qfrc_damper[[0, 2]], rtol=1e-12)
    assert np.all(added > 0.1) and min(damping) > 1


def test_a_four_bar_with_a_loop(mjcf):
    """A parallelogram: (J1 + J3 + m1 r^2 + m3 r^2 + m2 l^2) q'' = g ((m1 + m3) r + m2 l) cos q."""
    inertial = '<inertial pos="{}" mass="{}" diaginertia="{} {} {}"/>'
    read = mjcf(
        '<worldbody><body name="crank"><joint name="motor" axis="0 1 0"/>'
        + inertial.format("0.2 0 0", 1, 0.01, 0.02, 0.015)
        + '<body name="coupler" pos="0.4 0 0"><joint axis="0 1 0"/>'
        + inertial.format("0 0 0.3", 2, 0.05, 0.06, 0.02)
        + '<body name="rocker" pos="0 0 0.6"><joint axis="0 1 0"/>'
        + inertial.format("-0.2 0 0", 1.5, 0.01, 0.03, 0.02)
        + '</body></body></body></worldbody><equality><connect body1="rocker" anchor="-0.4 0 0"/></equality>'
    )
    times = np.linspace(0, 0.8, 17)
    with pytest.warns(uqmbd.RedundantConstraintWarning):
        found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    whole = 0.02 + 1 * 0.2**2 + 0.03 + 1.5 * 0.2**2 + 2 * 0.4**2
    arm = (1 + 1.5) * 0.2 + 2 * 0.4
    exact = solve_ivp(
        lambda t, y: (y[1], G * arm * np.cos(y[0]) / whole), (0, 0.8), (0, 0), t_eval=times, rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose(found["motor"], exact.y[0], rtol=0, atol=1e-7)
    assert "connect_1" in read.components and [row.what for row in read.not_taken] == ["softness of constraints"]


def test_joints_that_follow_another_one(urdf):
    """A finger that slides half as far as a wheel turns: (J + m r^2) q'' = -m g r, and starts at the offset."""
    read = urdf(
        '<link name="base"/>'
        + link("wheel", 1, inertia=(0.1, 0.2, 0.1))
        + link("finger", 2)
        + joint("turn", "base", "wheel")
        + joint("slide", "base", "finger", "prismatic", axis="0 0 1", more='<mimic joint="turn" multiplier="0.5"/>')
    )
    times = np.linspace(0, 2, 21)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    rate = -2 * G * 0.5 / (0.2 + 2 * 0.25)
    assert abs(rate) * 2 > 2 * np.pi  # more than two turns
    np.testing.assert_allclose(found["turn"], rate * times**2 / 2, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found["slide"], rate * times**2 / 4, rtol=0, atol=1e-6)


NEAR_HALF_TURN = ("0 3.14159 0", "3.1416 0 0", "3.14159 3.1416 0", "3.141592653 0.2 0", "0 -3.14159265 1e-7")


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["continuous", "prismatic"])
def test_frames_that_are_nearly_half_a_turn_apart_keep_their_digits(urdf, kind):
    """Five decimals of half a turn, as files have them: each link keeps the rotation that the file states."""
    parts = [joint(f"j{k}", "base", f"l{k}", kind, axis="1 2 -3", rpy=x) for k, x in enumerate(NEAR_HALF_TURN)]
    read = urdf('<link name="base"/>' + "".join(link(f"l{k}") for k in range(len(parts))) + "".join(parts))
    for k in range(len(parts)):
        for i in range(9):
            read.output(f"r{k}{i}", read.bodies[f"l{k}"].rotation[i], units="1")
    found = uqmbd.simulate(read, [0, 1e-6], check=False).isel(time=0)
    for k, rpy in enumerate(NEAR_HALF_TURN):
        expected = Rotation.from_euler("xyz", [float(x) for x in rpy.split()]).as_matrix()
        rotation = np.reshape([float(found[f"r{k}{i}"]) for i in range(9)], (3, 3))
        np.testing.assert_allclose(rotation, expected, rtol=0, atol=1e-14)


def follower(name, child, follows="", kind="revolute"):
    """A joint about y of a link on the base; what it follows is its first half, q = -0.5 q_other + 0.1, say."""
    mimic = f'<mimic joint="{follows}" multiplier="-0.5" offset="0.1"/>' if follows else ""
    return joint(name, "base", child, kind, more=f'<limit lower="-9" upper="9" effort="1" velocity="1"/>{mimic}')


FOLLOWING = {
    "driver first": ("a", "ba", "c"),
    "follower first": ("ba", "a", "c"),
    "chain": ("a", "ba", "cb"),
    "chain, last one first": ("cb", "ba", "a"),
    "two followers": ("ba", "ca", "a"),
}


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:.*assembly moved")
@pytest.mark.parametrize("joints", FOLLOWING.values(), ids=FOLLOWING)
@pytest.mark.parametrize("kinds", ["aaa", "asa", "saa", "ssa"])
def test_hinges_and_slides_that_follow_others_in_any_order(urdf, joints, kinds):
    """Hinges (a) and slides (s) a, b, c, of which b or c follow the one whose letter stands behind theirs."""
    of = {name: {"a": "revolute", "s": "prismatic"}[kind] for name, kind in zip("abc", kinds, strict=True)}
    parts = [follower(f"j{x[0]}", f"l{x[0]}", f"j{x[1]}" if x[1:] else "", of[x[0]]) for x in joints]
    read = urdf('<link name="base"/>' + "".join(link(f"l{x}", com="0.05 0 0") for x in "abc") + "".join(parts))
    assert uqmbd.check(read).mobility == 3 - sum(len(x) - 1 for x in joints)
    found = uqmbd.simulate(read, [0, 0.1, 0.2], check=False)
    for x in joints:
        if x[1:]:
            np.testing.assert_allclose(found[f"j{x[0]}"], -0.5 * found[f"j{x[1]}"] + 0.1, rtol=0, atol=1e-12)


@pytest.mark.thorough
def test_coupled_hinges_of_mujoco(mjcf):
    """A hinge that follows another by a polynomial: equal rods, (1 + p'^2) q'' + p' p'' q'^2 = their weights."""
    rod = '<inertial pos="0.3 0 0" mass="1" diaginertia="0.01 0.03 0.03"/>'
    read = mjcf(
        f'<worldbody><body name="a"><joint name="first" axis="0 1 0"/>{rod}</body><body name="b" pos="0 1 0">'
        f'<joint name="second" axis="0 1 0"/>{rod}</body></worldbody>'
        '<equality><joint joint1="second" joint2="first" polycoef="0 0.5 0.2 -0.1"/></equality>'
    )
    times = np.linspace(0, 0.6, 13)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    moment, inertia = G * 0.3, 0.03 + 0.09

    def rate(t, s):
        q = s[0]
        p, slope, bend = 0.5 * q + 0.2 * q**2 - 0.1 * q**3, 0.5 + 0.4 * q - 0.3 * q**2, 0.4 - 0.6 * q
        torque = moment * (np.cos(q) + slope * np.cos(p)) - inertia * slope * bend * s[1] ** 2
        return s[1], torque / (inertia * (1 + slope**2))

    first = solve_ivp(rate, (0, 0.6), (0, 0), t_eval=times, rtol=1e-11, atol=1e-12).y[0]
    np.testing.assert_allclose(found["first"], first, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found["second"], 0.5 * first + 0.2 * first**2 - 0.1 * first**3, rtol=0, atol=1e-6)


def test_a_polynomial_between_joints(mjcf):
    """A slide whose displacement is a polynomial in that of another: energy is kept, and so is the polynomial."""
    read = mjcf(
        '<worldbody><body name="a"><joint name="first" type="slide" axis="0 0 1" ref="0.2"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body><body name="b" pos="1 0 0">'
        '<joint name="second" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body>'
        '</worldbody><equality><joint joint1="second" joint2="first" polycoef="0 0.5 -0.3 0.2"/></equality>'
    )
    times = np.linspace(0, 0.4, 9)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    x, y = found["first"].values - 0.2, found["second"].values
    np.testing.assert_allclose(y, 0.5 * x - 0.3 * x**2 + 0.2 * x**3, rtol=0, atol=1e-8)

    def rate(t, s):
        slope, bend = 0.5 - 0.6 * s[0] + 0.6 * s[0] ** 2, -0.6 + 1.2 * s[0]
        return s[1], (-G - 3 * slope * bend * s[1] ** 2) / (1 + 3 * slope**2)

    exact = solve_ivp(rate, (0, 0.4), (0, 0), t_eval=times, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(x, exact.y[0], rtol=0, atol=1e-7)


def test_several_joints_of_one_body(mjcf):
    """Slide, slide, hinge of one body in a plane are free motion there: a parabola, and a constant spin."""
    read = mjcf(
        '<worldbody><body name="disc" euler="0 20 0"><joint name="x" type="slide" axis="1 0 0"/>'
        '<joint name="z" type="slide" axis="0 0 1"/><joint name="turn" axis="0 1 0" pos="0 0 0"/>'
        '<inertial pos="0 0 0" mass="2" diaginertia="1 2 1"/></body></worldbody>'
        '<keyframe><key qpos="0.1 0.2 0.3" qvel="1 2 9"/></keyframe>',
        keyframe=0,
    )
    assert list(read.bodies) == ["disc_after_x", "disc_after_z", "disc"]
    for k, axis in enumerate("xyz"):
        read.output(f"p{axis}", read.bodies["disc"].position[k], units="m")
    times = np.linspace(0, 1, 11)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    tilt = np.deg2rad(20)
    x, z = 0.1 + times, 0.2 + 2 * times
    # gravity along the tilted axes
    x, z = x + G * np.sin(tilt) * times**2 / 2, z - G * np.cos(tilt) * times**2 / 2
    np.testing.assert_allclose(found["x"], x, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found["z"], z, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found["turn"], 0.3 + 9 * times, rtol=0, atol=1e-7)
    np.testing.assert_allclose(found["px"], x * np.cos(tilt) + z * np.sin(tilt), rtol=0, atol=1e-8)


def test_ball_and_free_joints(mjcf):
    """A symmetric top on a free body and one on a ball joint turn steadily about an axis of inertia, damped."""
    inertial = '<inertial pos="0 0 0" mass="2" diaginertia="0.3 0.3 0.5"/>'
    read = mjcf(
        '<option gravity="0 0 0"/><worldbody><body name="ball" pos="1 0 0">'
        f'<joint name="socket" type="ball" damping="0.2" armature="0.1"/>{inertial}</body>'
        f'<body name="free" pos="0 1 0"><freejoint name="base"/>{inertial}</body></worldbody>'
        '<keyframe><key name="spin" qpos="1 0 0 0 0 1 0 1 0 0 0" qvel="0 0 4 0.5 0 0 0 0 3"/></keyframe>',
        keyframe="spin",
    )
    assert {joint.kind for joint in read.joints.values()} == {"ball", "free"}
    for name in ("ball", "free"):
        read.output(f"{name}_speed", read.bodies[name].angular_velocity[2], units="rad/s")
    times = np.linspace(0, 2, 11)
    found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
    np.testing.assert_allclose(found["ball_speed"], 4 * np.exp(-0.2 / (0.5 + 0.1) * times), rtol=0, atol=1e-7)
    np.testing.assert_allclose(found["free_speed"], 3, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found["base.x"], 0.5 * times, rtol=0, atol=1e-8)


def test_a_rolled_up_spring_starts_in_the_turn_of_the_file(mjcf):
    """A hinge drawn at half a turn and at three turns: k (q - rest) acts, not what is left of it after whole turns."""
    for start in (np.pi, 6 * np.pi + 0.4):
        read = mjcf(
            '<option gravity="0 0 0"/><compiler angle="radian"/><worldbody><body><joint name="q" stiffness="2"/>'
            '<inertial pos="0 0 0" mass="1" diaginertia="0.5 0.5 0.5"/></body></worldbody>'
            f'<keyframe><key qpos="{start}"/></keyframe>',
            keyframe=0,
        )
        times = np.linspace(0, 3, 13)
        found = uqmbd.simulate(read, times, rtol=1e-9, check=False)
        np.testing.assert_allclose(found["q"], start * np.cos(2 * times), rtol=0, atol=1e-6)


def test_limits_are_margins_and_what_is_left_out_is_reported(urdf):
    limit = '<limit lower="-1" upper="0.5" effort="10" velocity="3"/><dynamics damping="0.1" friction="0.2"/>'
    read = urdf(
        link("base")
        + link("arm", com="0.3 0 0")
        + '<link name="tool"/>'
        + joint("pin", "base", "arm", "revolute", more=limit)
        + joint("flange", "arm", "tool", "fixed", xyz="0.6 0 0")
        + '<transmission name="drive"/>'
    )
    told = {row.what: row.names for row in read.not_taken}
    assert told["transmissions"] == ("drive",) and told["limits of joints"] == told["dry friction"] == ("pin",)
    assert told["limits of effort and speed"] == ("pin",)
    assert told["links fixed to the ground"] == ("base",) and told["links without a joint"] == ("tool",)
    read.output("tool", read.frames["tool"].velocity[2], units="m/s")
    read.output("down", read.frames["tool"].acceleration[2], units="m/s^2")
    found = uqmbd.simulate(read, np.linspace(0, 0.2, 11), check=False)
    q = found["pin"].values
    np.testing.assert_allclose(found["pin.margin"], np.minimum(q + 1, 0.5 - q), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.gradient(found["tool"].values, 0.02)[2:-2], found["down"][2:-2], rtol=0.02)


def test_merged_links_move_as_those_that_are_held(urdf):
    """fuse=False keeps fixed links as bodies; the motion is the same, also of a link that is turned in its frame."""
    inside = (
        '<link name="base"/>'
        + link("arm", com="0.3 0 0", rpy="0.3 0.2 0.1", inertia=(0.01, 0.03, 0.025))
        + link("hand", 0.5, "0.1 0.02 0", (0.002, 0.004, 0.003), rpy="1 0 0.5")
        + joint("pin", "base", "arm", axis="0.6 0.8 0")
        + joint("wrist", "arm", "hand", "fixed", xyz="0.6 0 0.1", rpy="0.4 0.5 0.6")
    )
    times = np.linspace(0, 1, 11)
    one, two = urdf(inside), urdf(inside, fuse=False)
    assert (list(one.bodies), list(two.bodies)) == (["arm"], ["arm", "hand"])
    found = [uqmbd.simulate(x, times, rtol=1e-9, check=False)["pin"] for x in (one, two)]
    np.testing.assert_allclose(*found, rtol=0, atol=1e-8)


def test_a_floating_base_falls(urdf):
    read = urdf(TWO.replace('<link name="base"/>', link("base")), floating=True)
    assert list(read.bodies) == ["base", "upper", "lower"] and read.joints["base_free"].kind == "free"
    found = uqmbd.simulate(read, np.linspace(0, 0.5, 6), check=False)
    mass = [float(body.mass) for body in read.bodies.values()]
    assert sum(mass) == pytest.approx(2.9)
    assert float(found["base_free.z"][-1]) < -0.5


def test_names_are_valid_and_each_once(mjcf):
    body = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    read = mjcf(
        f'<worldbody><body name="arm/time"><joint name="time"/>{body}<body name="same"><joint name="same"/>{body}'
        f"<body><joint/>{body}</body></body></body></worldbody>"
    )
    assert list(read.bodies) == ["arm_time", "same", "body_3"]
    assert list(read.joints) == ["time_joint", "same_joint", "body_3_joint"]


def test_names_that_change_are_reported_and_joints_found_by_both(urdf, mjcf):
    """A joint called like a link; the joint that has the longer name already keeps it."""
    inside = link("base") + link("arm") + link("hand") + joint("arm", "base", "arm") + joint("arm_joint", "arm", "hand")
    body = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    model = (
        f'<worldbody><body name="arm"><joint name="arm"/>{body}<body name="hand"><joint name="arm_joint"/>{body}</body>'
        "</body></worldbody>"
    )
    for read in (urdf(inside), mjcf(model)):
        told = {row.what: row.names for row in read.not_taken}
        assert told["names that changed"] == ("joint 'arm': 'arm_joint_2'",)
        assert read.joints["arm"] is read.joints["arm_joint_2"] and read.joints["arm"].child == "arm"
        assert read.joints["arm_joint"].child == "hand" and list(read.joints) == ["arm_joint_2", "arm_joint"]
        with pytest.raises(KeyError, match="the model has no joint 'am'"):
            read.joints["am"]
    assert not [row for row in urdf(TWO).not_taken if row.what == "names that changed"]


def gaps_of(read):
    """What does not hold at the start, by the names of constraints."""
    rows = [row for row in read.not_taken if row.what == "constraints violated in the start configuration"]
    return [name for row in rows for name in row.names]


def test_constraints_that_do_not_hold_at_the_start_are_reported(urdf, mjcf):
    follows = '<mimic joint="shoulder" multiplier="-2" offset="{}"/>'
    for offset, expected in ((0.2, ["elbow_mimic by 0.2 rad"]), (0, [])):
        read = urdf(TWO.replace("</joint>", "{}</joint>").format("", follows.format(offset)))
        assert gaps_of(read) == expected
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    model = (
        f'<compiler angle="radian"/><worldbody><body name="a"><joint name="q" axis="0 1 0"/>{inertial}</body>'
        f'<body name="b" pos="1 0 0"><joint name="s" type="slide" axis="1 0 0" ref="0.5"/>{inertial}</body></worldbody>'
        '<equality><connect name="pin" body1="a" body2="b" anchor="0.3 0 0.4"/><weld name="glue" body1="a" body2="b"/>'
        '<joint name="locked" joint1="s" polycoef="0.25"/></equality>'
        '<keyframe><key qpos="0 0.5"/><key qpos="0.6 0.75"/></keyframe>'
    )
    assert gaps_of(mjcf(model, keyframe=0)) == ["locked by 0.25 m"]
    # the point (0.3, 0, 0.4) turned about y by 0.6, and carried along x by 0.25
    gap = np.hypot(0.3 * np.cos(0.6) + 0.4 * np.sin(0.6) - 0.55, -0.3 * np.sin(0.6) + 0.4 * np.cos(0.6) - 0.4)
    glued = np.hypot(np.cos(0.6) - 1.25, np.sin(0.6))
    assert gaps_of(mjcf(model, keyframe=1)) == [f"pin by {gap:.3g} m", f"glue by {glued:.3g} m", "glue by 0.6 rad"]


def test_check_and_notebooks_tell_what_was_left_out(mjcf, tmp_path, capsys):
    from uqmbd.cli.check import show_check
    from uqmbd.report.notebook import mechanism_html

    read = mjcf(
        '<worldbody><body name="a"><joint name="q" axis="1 0 0" range="-10 10"/><geom name="shell" size="0.1"/></body>'
        '</worldbody><actuator><motor name="drive" joint="q"/></actuator>'
    )
    assert "drive" in mechanism_html(read) and "uqmbd does not enforce them" in mechanism_html(read)
    script = tmp_path / "robot.py"
    script.write_text(
        "import uqmbd\nfrom uqmbd_models import MJCF\n"
        f"study = uqmbd.Study('robot', MJCF().read({str(tmp_path / 'model.xml')!r}), times=[0, 0.1])\n"
    )
    show_check(script)
    printed = " ".join(capsys.readouterr().out.split())
    for part in ("actuators 1 drive", "shapes that collide 1 shell", "limits of joints 1 q", "by MuJoCo"):
        assert part in printed, part


def test_the_public_functions_find_the_readers(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="robot">{TWO}</robot>', encoding="utf-8")
    read = uqmbd.from_urdf(path)
    assert (
        isinstance(read, uqmbd.extend.ImportedMechanism)
        and read.source == str(path)
        and read.read_by == f"uqmbd {uqmbd.__version__}"
    )
    variables = read.randomise("*.mass", relative=0.02)
    assert sorted(map(str, variables)) == ["lower.mass", "upper.mass"]
