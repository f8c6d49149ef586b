"""The ADAMS joint suite on all eight channels: closed forms that agree with the published numbers, along 5 s.

Channels: position, velocity, acceleration, quaternion, angular velocity and acceleration of the body, force and moment
on the ground.  Published numbers: cases.md, A4, A5 and section C.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

import uqmbd
from uqmbd_drivers import LinearSpeedDriver, PositionDriver, RotationDriver
from uqmbd_joints import Parallel1, Prismatic, Revolute, Spherical, Universal
from uqmbd_springs import SpringDamper

G = 9.80665
RTOL = 1e-9
TIMES = np.linspace(0, 5, 51)
WEIGHT = np.array([0, 0, -G])
CHANNELS = ("pos", "vel", "acc", "quat", "w", "alpha", "Rf", "Rt")


def product(a, b):
    """Quaternion of the rotation b, then a."""
    u, v = np.asarray(a[1:]), np.asarray(b[1:])
    return np.array([a[0] * b[0] - u @ v, *(a[0] * v + b[0] * u + np.cross(u, v))])


@pytest.fixture
def channels(observe, series):
    """Record and run: the eight channels of a body and of each part between it and the ground, arrays (time, entry)."""

    def run(mechanism, body, times, *parts):
        observe(
            mechanism, pos=body.position, vel=body.velocity, acc=body.acceleration, quat=body.quaternion,
            w=body.angular_velocity, alpha=body.angular_acceleration,
        )  # fmt: skip
        for k, part in enumerate(parts):
            ending = str(k) if k else ""
            observe(mechanism, **{f"Rf{ending}": [-f for f in part.reaction_force]})
            observe(mechanism, **{f"Rt{ending}": [-m for m in part.reaction_moment]})
        data = uqmbd.simulate(mechanism, times, rtol=RTOL)
        names = dict.fromkeys(v.split("[")[0] for v in data.data_vars)
        return SimpleNamespace(**{name: series(data, name) for name in names})

    return run


def heavy_body(name, **pose):
    mechanism = uqmbd.Mechanism(name, uqmbd.Spatial(gravity=tuple(WEIGHT)))
    return mechanism, mechanism.body("body", mass=1, inertia=(0.04, 0.1, 0.1), **pose)


def agree(found, exact, same_rotation, close, scales, relative=1e-6):
    """Compare all channels with closed forms."""
    same_rotation(found.quat, exact.quat, atol=relative)
    for name in CHANNELS:
        if name != "quat":
            expected = np.broadcast_to(getattr(exact, name), getattr(found, name).shape)
            close(getattr(found, name), expected, relative=relative, scale=scales.get(name, 1.0), what=name)


# -- pendulums ----------------------------------------------------------------------------------------------------------
def pendulum(loc, axis, q0, turn, times):
    """Body, centre of mass 2 m from a hinge, from rest with its x axis level: elliptic functions."""
    x, e = np.array([1.0, 0, 0]), np.cross(axis, (1.0, 0, 0))  # along the body, and where it falls
    rate = np.sqrt(-G * e[2] * 2 / 4.1)
    u = ellipk(0.5) - rate * times
    sn, cn, _, _ = ellipj(u, 0.5)
    # angle from the lowest pose 2 asin(k sn), its rate -2 k rate cn with k^2 = 1/2
    angle, speed = np.pi / 2 - 2 * np.arcsin(np.sqrt(0.5) * sn), 2 * np.sqrt(0.5) * rate * cn
    growth = rate**2 * np.cos(angle)
    out = np.outer(np.cos(angle), x) + np.outer(np.sin(angle), e)
    way = np.outer(-np.sin(angle), x) + np.outer(np.cos(angle), e)
    acc = 2 * (growth[:, None] * way - speed[:, None] ** 2 * out)
    return SimpleNamespace(
        pos=loc + 2 * out,
        vel=2 * speed[:, None] * way,
        acc=acc,
        quat=np.array([product(turn(axis, a), q0) for a in angle]),
        w=np.outer(speed, axis),
        alpha=np.outer(growth, axis),
        Rf=WEIGHT - acc,
        Rt=np.cross(2 * out, WEIGHT) - 4.1 * np.outer(growth, axis),
    )


PENDULUMS = {
    "Revolute_Case01": (Revolute, (0, 0, 0), -np.pi / 2, (0, 1, 0)),
    "FullAssembly": (Revolute, (1, 2, 3), -np.pi / 4, (0, np.sqrt(0.5), np.sqrt(0.5))),
    "Spherical_Case01": (Spherical, (0, 0, 0), -np.pi / 2, (0, 1, 0)),
    "Spherical_Case02": (Spherical, (1, 2, 3), -np.pi / 4, (0, 1, 0)),
}


@pytest.mark.thorough
@pytest.mark.parametrize("case", PENDULUMS)
def test_pendulums(case, channels, same_rotation, close, turn):
    kind, loc, tilt, axis = PENDULUMS[case]
    q0 = turn((1, 0, 0), tilt)
    mechanism, body = heavy_body(case, position=np.add(loc, (2, 0, 0)), quaternion=q0)
    joint = kind("joint", mechanism.ground, body, at=loc, **({"axis": axis} if kind is Revolute else {}))
    found = channels(mechanism, body, TIMES, mechanism.add(joint))
    exact = pendulum(loc, np.array(axis), q0, turn, TIMES)
    scales = {"pos": 2, "vel": 6, "acc": 20, "w": 3, "alpha": 5, "Rf": 30, "Rt": 20}
    agree(found, exact, same_rotation, close, scales, relative=2e-6)


def test_the_closed_form_of_the_pendulum_is_that_of_the_tables(close, same_rotation, turn):
    """ADAMS Revolute_Case01 at 1, 2.5 and 5 s, and Chrono's FullAssembly at the start, each in all its channels."""
    adams = pendulum((0, 0, 0), np.array([0, 1, 0]), turn((1, 0, 0), -np.pi / 2), turn, np.array([1, 2.5, 5]))
    close(adams.pos[0], (-0.89238148553, 0, -1.7898757734), relative=1e-5)
    close(adams.pos[2], (-1.9996838689, 0, -0.035558747545), relative=1e-5)
    close(adams.vel[1], (6.1043145787, 0, -0.81760360368), relative=1e-5)
    close(adams.w[:, 1], (2.9261383237, -3.0794127739, 0.41243606547), relative=1e-5)
    close(adams.Rf[0], (-11.46123757, 0, -23.22732763), relative=1e-5)
    close(adams.Rf[1], (-3.776608472, 0, -28.43574302), relative=1e-5)
    close(adams.Rt, 0, scale=1, relative=1e-12)
    same_rotation(adams.quat[0], (0.372091809, -0.372091809, 0.6012883549, 0.6012883549), atol=1e-5)
    half = np.sqrt(0.5)
    start = pendulum((1, 2, 3), np.array([0, half, half]), turn((1, 0, 0), -np.pi / 4), turn, np.array([0.0]))
    close(start.pos[0], (3, 2, 3), relative=1e-12)
    close(start.acc[0], (0, 4.783730, -4.783730), relative=1e-6)
    close(start.alpha[0], (0, 2.391865, 2.391865), relative=1e-6)
    close(start.Rf[0], (0, -4.783730, -5.022920), relative=1e-6)
    close(start.Rt[0], (0, 9.806650, -9.806650), relative=1e-6)
    same_rotation(start.quat, (0.9238795, -0.3826834, 0, 0), atol=1e-7)


# -- slides -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("tilt", [-np.pi / 4, -np.pi / 2], ids=["Prismatic_Case02", "Prismatic_Case03"])
def test_slides(tilt, channels, same_rotation, close, turn):
    """Uniform acceleration along the axis; the guide carries what is across, with its moment about a point of the ground."""
    axis = np.array([0, -np.sin(tilt), np.cos(tilt)])
    loc, q0 = np.array([1.0, 2, 3]), turn((1, 0, 0), tilt)
    mechanism, body = heavy_body("slide", position=loc + (2, 0, 0), quaternion=q0)
    found = channels(
        mechanism, body, TIMES, mechanism.add(Prismatic("joint", mechanism.ground, body, at=loc, axis=axis))
    )
    acc = axis * (axis @ WEIGHT)
    pos = loc + (2, 0, 0) + np.outer(TIMES**2 / 2, acc)
    rest = {"quat": np.tile(q0, (51, 1)), "w": 0, "alpha": 0}
    exact = SimpleNamespace(
        pos=pos, vel=np.outer(TIMES, acc), acc=acc, Rf=WEIGHT - acc, Rt=np.cross(pos - loc, WEIGHT - acc), **rest
    )
    if tilt == -np.pi / 4:  # as published, at 1 and 5 s
        close(exact.pos[10], (3, -0.4516625, 0.5483375), relative=1e-8)
        close(exact.Rf, (0, 4.903325, -4.903325), relative=1e-8)
        close(exact.Rt[10], (24.042596056, 9.80665, 9.80665), relative=1e-8)
        close(exact.Rt[50], (601.064901, 9.80665, 9.80665), relative=1e-8)
    else:
        close(exact.Rt[50], (0, 19.6133, 0), relative=1e-8)
    agree(found, exact, same_rotation, close, {"pos": 60, "vel": 35, "acc": G, "Rf": G, "Rt": 600})


@pytest.mark.parametrize("driver", ["speed", "position"])
@pytest.mark.parametrize(("tilt", "speed"), [(0, 1.0), (np.pi / 4, 0.5)], ids=["Case01", "Case02"])
def test_linear_actuators(tilt, speed, driver, channels, same_rotation, close, turn):
    """A weight that an actuator moves along a slide at constant speed: what each of them carries."""
    axis, q0, zero = np.array([np.sin(tilt), 0, np.cos(tilt)]), turn((0, 1, 0), tilt), (0, 0, 0)
    mechanism, body = heavy_body("actuator", quaternion=q0)
    slide = mechanism.add(Prismatic("slide", mechanism.ground, body, at=zero, axis=axis))
    law = {"speed": speed} if driver == "speed" else {"displacement": speed * uqmbd.t}
    kind = LinearSpeedDriver if driver == "speed" else PositionDriver
    actuator = mechanism.add(kind("actuator", mechanism.ground, body, at=zero, axis=axis, **law))
    found = channels(mechanism, body, TIMES, slide, actuator)
    push = axis * (axis @ WEIGHT)  # on the ground, as everything here
    pos = np.outer(speed * TIMES, axis)
    rest = {"acc": 0, "quat": np.tile(q0, (51, 1)), "w": 0, "alpha": 0}
    guide = WEIGHT - push
    exact = SimpleNamespace(pos=pos, vel=speed * axis, Rf=guide, Rt=np.cross(pos, guide), **rest)
    close(np.linalg.norm(push), 9.80665 if tilt == 0 else 6.934349, relative=1e-6)
    close(np.linalg.norm(guide), 0 if tilt == 0 else 6.934349, relative=1e-6, scale=G)
    agree(found, exact, same_rotation, close, {"pos": 5, "Rf": G, "Rt": 20})
    close(found.Rf1, np.broadcast_to(push, (51, 3)), relative=1e-6)
    close(found.Rt1, 0, scale=20, relative=1e-6)


# -- springs ------------------------------------------------------------------------------------------------------------
SPRINGS = {"TranSpring_Case01": ((0, 0, 0), 10, 0.5, 0), "TranSpring_Case02": ((0, 2, 0), 100, 5, 2)}
PUBLISHED = {
    "TranSpring_Case01": [[0, 0, -1.7450165992240305], [0, 0, -0.9532062729149013], [0, 0, -1.2624228748116537]],
    "TranSpring_Case02": [[0, -0.59732743, -2.18906861], [0, -0.98055948, -1.99288723], [0, -1.94519785, -0.767401]],
}


@pytest.mark.parametrize("case", SPRINGS)
def test_translational_springs(case, channels, same_rotation, close):
    """The point mass by SciPy at 1e-12; it passes through the published positions."""
    place, stiffness, damping, free = SPRINGS[case]

    def pull(r, v):
        length = max(np.linalg.norm(r), 1e-12)
        return -(stiffness * (length - free) + damping * (r @ v) / length) * r / length

    if free == 0:  # at zero length the damper of a point acts along its velocity, which stays on one line

        def pull(r, v):
            return -stiffness * r - damping * v

    mechanism, body = heavy_body("spring", position=place)
    spring = SpringDamper("spring", mechanism.ground, body, (0, 0, 0), (0, 0, 0), stiffness, damping, free)
    found = channels(mechanism, body, TIMES, mechanism.add(spring))
    start = [*map(float, place), 0, 0, 0]
    flow = solve_ivp(
        lambda t, y: [*y[3:], *(WEIGHT + pull(y[:3], y[3:]))], (0, 5), start, "DOP853", TIMES, rtol=1e-12, atol=1e-12
    )
    pos, vel = flow.y[:3].T, flow.y[3:].T
    close(pos[[10, 25, 50]], PUBLISHED[case], relative=1e-6)
    force = np.array([pull(r, v) for r, v in zip(pos, vel, strict=True)])
    rest = {"quat": np.tile((1.0, 0, 0, 0), (51, 1)), "w": 0, "alpha": 0, "Rt": 0}
    exact = SimpleNamespace(pos=pos, vel=vel, acc=WEIGHT + force, Rf=-force, **rest)
    agree(found, exact, same_rotation, close, {"pos": 2, "vel": 6, "acc": 40, "Rf": 40})


# -- Cardan joint -------------------------------------------------------------------------------------------------------
CARDAN = {  # time: w2, alpha2, th2
    0.0: (11.547005383792516, 0.0, 0.0),
    0.05: (10.725274708395798, -27.94250721487342, 0.5627705215653485),
    0.1: (9.34205239320907, -22.908673168533777, 1.0633059278066088),
    0.2: (9.052163353137358, 17.901799856252843, 1.9481462066807331),
    0.3: (11.470858549144744, 10.613331197714006, 2.978456850640348),
}


@pytest.mark.thorough
def test_cardan_joint_on_all_channels(channels, same_rotation, close, turn, matrix):
    """Case A5 with a `Universal`: shafts at 30 degrees, 10 rad/s; its moment is along the normal of its cross."""
    beta, inertia, origin = np.pi / 6, 0.02, (0, 0, 0)
    second = np.array([np.cos(beta), np.sin(beta), 0])
    mechanism = uqmbd.Mechanism("cardan", uqmbd.Spatial())
    ground = mechanism.ground
    one, two = (mechanism.body(name, mass=1, inertia=(inertia,) * 3) for name in ("one", "two"))
    mechanism.add(Revolute("bearing one", ground, one, at=origin, axis=(1, 0, 0)))
    cross = mechanism.add(Universal("cross", one, two, at=origin, axis_i=(0, 1, 0), axis_j=(0, 0, 1)))
    mechanism.add(Parallel1("bearing two", ground, two, axis=second))
    drive = mechanism.add(RotationDriver("drive", ground, one, 10 * uqmbd.t, axis=(1, 0, 0)))
    times = np.array(list(CARDAN))
    found = channels(mechanism, two, times, cross, drive)
    w, a, angle = np.array(list(CARDAN.values())).T
    moments = []
    for time, growth, th2 in zip(times, a, angle, strict=True):
        arms = (0, np.cos(10 * time), np.sin(10 * time)), matrix(turn(second, th2)) @ (0, 0, 1)
        normal = np.cross(*arms)
        moments.append(-inertia * growth * normal / (normal @ second))  # on the first shaft
    exact = SimpleNamespace(
        pos=0, vel=0, acc=0, quat=np.array([turn(second, th2) for th2 in angle]), w=np.outer(w, second),
        alpha=np.outer(a, second), Rf=0, Rt=np.array(moments),
    )  # fmt: skip
    agree(found, exact, same_rotation, close, {"w": 10, "alpha": 30, "Rt": 1}, relative=1e-5)
    close(-found.Rt1[:, 0], inertia * a * w / 10, relative=1e-5)
