"""Reference cases A2, A4 and the ADAMS joint suite (cases.md, section C)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import uqmbd
from uqmbd_joints import Prismatic, Revolute, Spherical
from uqmbd_springs import SpringDamper

G = 9.80665
RTOL = 1e-9


# -- A2 -------------------------------------------------------------------------------------------------------------
def test_torque_free_top(observe, series, same_rotation, close):
    """Case A2: symmetric torque-free top, closed form."""
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial())
    top = mechanism.body("top", mass=1, inertia=(0.05, 0.05, 0.02), angular_velocity=(2, 0, 3))
    observe(mechanism, w=top.rotation.T * top.angular_velocity, q=top.quaternion, r=top.position)
    data = uqmbd.simulate(mechanism, [0, 1, 2.5, 5], rtol=RTOL).sel(time=[1, 5])
    omega = [[-0.4544041893861738, -1.9476952617563905, 3], [-1.8222605237693539, -0.8242369704835132, 3]]
    quaternion = [
        [-0.1257768565702, 0.4899883342411, -0.6174628258977, 0.6023547736122],
        [-0.4093755382974, 0.078985905866, -0.36628387313, -0.8318707950175],
    ]
    close(series(data, "w"), omega)
    same_rotation(series(data, "q"), quaternion)
    close(series(data, "r"), 0, scale=1, relative=1e-10)


def test_torque_free_top_in_the_world(observe, series, close, matrix, turn):
    """Case A2: q(t) = rot(L/|L|, |L| t/I) o rot(z, s t), at many times; angular velocity in world axes."""
    mechanism = uqmbd.Mechanism("top", uqmbd.Spatial())
    top = mechanism.body("top", mass=1, inertia=(0.05, 0.05, 0.02), angular_velocity=(2, 0, 3))
    observe(mechanism, w=top.angular_velocity, R=top.rotation)
    times = np.linspace(0, 5, 26)
    data = uqmbd.simulate(mechanism, times, rtol=RTOL)
    momentum = np.array([0.1, 0, 0.06])
    for k, t in enumerate(times):
        turned = matrix(turn(momentum, np.linalg.norm(momentum) * t / 0.05)) @ matrix(turn((0, 0, 1), 1.8 * t))
        close(series(data, "R")[k].reshape(3, 3), turned)
        body = np.array([2 * np.cos(1.8 * t), -2 * np.sin(1.8 * t), 3])
        close(series(data, "w")[k], turned @ body)


# -- one body on a joint ----------------------------------------------------------------------------------------------
def on_a_joint(kind, loc, tilt, length, turn, matrix, observe):
    """Body with J = diag(.04, .1, .1), COM = joint + A (length, 0, 0), frame turned by `tilt` about the world's x."""
    mechanism = uqmbd.Mechanism("pend", uqmbd.Spatial(gravity=(0, 0, -G)))
    q0 = turn((1, 0, 0), tilt)
    body = mechanism.body("pend", mass=1, inertia=(0.04, 0.1, 0.1), position=np.add(loc, (length, 0, 0)), quaternion=q0)
    axes = {} if kind is Spherical else {"axis_i": matrix(q0) @ (0, 0, 1), "axis_j": (0, 0, 1)}
    joint = mechanism.add(kind("joint", mechanism.ground, body, point_i=loc, point_j=(-length, 0, 0), **axes))
    observe(
        mechanism,
        pos=body.position,
        vel=body.velocity,
        acc=body.acceleration,
        quat=body.quaternion,
        w=body.angular_velocity,
        alpha=body.angular_acceleration,
        Rf=[-f for f in joint.reaction_force],
        Rt=[-m for m in joint.reaction_moment],
    )
    return mechanism


@pytest.fixture
def pend(turn, matrix, observe, series):
    """Run a body on a joint and return its outputs as arrays (time, entry)."""

    def run(kind, loc, tilt, times, length=2.0):
        mechanism = on_a_joint(kind, loc, tilt, length, turn, matrix, observe)
        data = uqmbd.simulate(mechanism, [0, *times], rtol=RTOL)
        names = ("pos", "vel", "acc", "quat", "w", "alpha", "Rf", "Rt")
        return SimpleNamespace(**{n: series(data, n) for n in names})

    return run


def test_initial_accelerations_and_reactions(pend, close, same_rotation):
    """Case A4: Chrono FullAssembly, accelerations and reactions at t = 0."""
    found = pend(Revolute, (1, 2, 3), -np.pi / 4, [0.1])
    close(found.pos[0], (3, 2, 3), relative=1e-12)
    same_rotation(found.quat[0], (0.9238795, -0.3826834, 0, 0), atol=1e-7)
    close(found.acc[0], (0, 4.783730, -4.783730), relative=1e-6)
    close(found.alpha[0], (0, 2.391865, 2.391865), relative=1e-6)
    close(found.Rf[0], (0, -4.783730, -5.022920), relative=1e-6)
    close(found.Rt[0], (0, 9.806650, -9.806650), relative=1e-6)


REVOLUTE = {  # ADAMS Revolute_Case01: pos, v, w_y, Rf at t = 1, 2.5, 5
    "pos": [
        [-0.89238148553, 0, -1.7898757734],
        [-0.26550633634, 0, -1.9822982584],
        [-1.9996838689, 0, -0.035558747545],
    ],
    "vel": [[-5.2374240953, 0, 2.6112316642], [6.1043145787, 0, -0.81760360368], [-0.014665709931, 0, 0.82474174708]],
    "w": [[0, 2.9261383237, 0], [0, -3.0794127739, 0], [0, 0.41243606547, 0]],
    "Rf": [[-11.46123757, 0, -23.22732763], [-3.776608472, 0, -28.43574302], [-0.5102298618, 0, -0.2482595869]],
}


@pytest.mark.parametrize(
    ("kind", "loc", "tilt"), [(Revolute, (0, 0, 0), -np.pi / 2), (Spherical, (1, 2, 3), -np.pi / 4)]
)
def test_pendulum_of_the_joint_suite(kind, loc, tilt, pend, close, same_rotation):
    """ADAMS Revolute_Case01 and Spherical_Case02 (the same motion about another point)."""
    found = pend(kind, loc, tilt, [1, 2.5, 5])
    close(found.pos[1:] - loc, REVOLUTE["pos"])
    close(found.vel[1:], REVOLUTE["vel"])
    close(found.w[1:], REVOLUTE["w"])
    close(found.Rf[1:], REVOLUTE["Rf"])
    close(found.Rt, 0, scale=2 * G)
    # Newton: the reaction is what gravity leaves of m a
    close(found.acc[1:], -np.array(REVOLUTE["Rf"]) + [0, 0, -G])
    # I alpha = moment of the weight about the pivot
    close(found.alpha[1:, 1], G * np.array(REVOLUTE["pos"])[:, 0] / 4.1)
    if kind is Revolute:
        same_rotation(found.quat[1], (0.372091809, -0.372091809, 0.6012883549, 0.6012883549))
    else:  # the positions published for Spherical_Case02 itself
        published = [[0.1076185145, 2, 1.2101242266], [0.7344936637, 2, 1.0177017416], [-0.9996838689, 2, 2.9644412525]]
        close(found.pos[1:], published)


def test_slide_along_a_tilted_axis(pend, close):
    """ADAMS Prismatic_Case02: a = g sin 45 degrees along the axis; the moment grows with the way."""
    found = pend(Prismatic, (1, 2, 3), -np.pi / 4, [1, 2.5, 5])
    close(found.pos[[1, 3]], [[3, -0.4516625, 0.5483375], [3, -59.2915625, -58.2915625]], relative=1e-6)
    close(found.vel[1], (0, -4.903325, -4.903325), relative=1e-6)
    close(found.acc, np.tile((0, -4.903325, -4.903325), (4, 1)), relative=1e-6)
    close(found.w, 0, scale=1, relative=1e-8)
    close(found.Rf[1:], np.tile((0, 4.903325, -4.903325), (3, 1)), relative=1e-6)
    close(found.Rt[1], (24.042596056, 9.80665, 9.80665), relative=1e-6)
    close(found.Rt[3], (601.064901, 9.80665, 9.80665), relative=1e-6)


def test_slide_on_a_horizontal_axis_rests(pend, close):
    """ADAMS Prismatic_Case03: static, the whole weight on the guide."""
    found = pend(Prismatic, (1, 2, 3), -np.pi / 2, [1, 5])
    close(found.pos, np.tile((3, 2, 3), (3, 1)), relative=1e-9)
    close(found.Rf, np.tile((0, 0, -9.80665), (3, 1)), relative=1e-8)
    close(found.Rt, np.tile((0, 19.6133, 0), (3, 1)), relative=1e-8)


# -- translational springs ---------------------------------------------------------------------------------------------
def spring(position, stiffness, damping, free_length, observe):
    mechanism = uqmbd.Mechanism("spring", uqmbd.Spatial(gravity=(0, 0, -G)))
    body = mechanism.body("ball", mass=1, inertia=(0.04, 0.1, 0.1), position=position)
    origin = (0, 0, 0)
    part = mechanism.add(
        SpringDamper("spring", mechanism.ground, body, origin, origin, stiffness, damping, free_length)
    )
    observe(
        mechanism,
        pos=body.position,
        vel=body.velocity,
        acc=body.acceleration,
        force=part.reaction_force,
        moment=part.reaction_moment,
    )
    return mechanism


def test_spring_that_starts_at_zero_length(observe, series, close):
    """ADAMS TranSpring_Case01: m z'' = -g - k z - c z', closed form; free length 0, and zero initial length."""
    mechanism = spring((0, 0, 0), 10, 0.5, 0, observe)
    times = np.linspace(0, 5, 51)
    data = uqmbd.simulate(mechanism, times, rtol=RTOL)
    z = [-1.7450165992240305, -0.9532062729149013, -1.2624228748116537]
    close(series(data.sel(time=[1, 2.5, 5]), "pos")[:, 2], z, relative=1e-6)
    decay, rate = 0.25, np.sqrt(10 - 0.25**2)
    cos, sin, fade = np.cos(rate * times), np.sin(rate * times), np.exp(-decay * times)
    position = -G / 10 * (1 - fade * (cos + decay / rate * sin))
    velocity = -G / rate * fade * sin
    close(series(data, "pos")[:, 2], position, relative=1e-6)
    close(series(data, "vel")[:, 2], velocity, relative=1e-6)
    close(series(data, "force")[1:, 2], (-10 * position - 0.5 * velocity)[1:], relative=1e-5)
    close(series(data, "acc")[1:, 2], (-G - 10 * position - 0.5 * velocity)[1:], relative=1e-5)
    close(series(data, "pos")[:, :2], 0, scale=1, relative=1e-9)


def test_spring_with_a_free_length_swings_in_space(observe, series, close):
    """ADAMS TranSpring_Case02 (ADAMS itself differs by 5e-7)."""
    data = uqmbd.simulate(spring((0, 2, 0), 100, 5, 2, observe), [0, 1, 2.5, 5], rtol=RTOL)
    position = [[0, -0.59732743, -2.18906861], [0, -0.98055948, -1.99288723], [0, -1.94519785, -0.767401]]
    close(series(data, "pos")[1:], position, relative=1e-6)
    velocity = series(data, "vel")
    close(velocity[1], (0, -5.64161103, 1.64701346), relative=1e-6)
    for r, v, force in zip(series(data, "pos")[1:], velocity[1:], series(data, "force")[1:], strict=True):
        length = np.linalg.norm(r)
        close(force, -(100 * (length - 2) + 5 * (r @ v) / length) * r / length, relative=1e-9)
    close(series(data, "moment"), 0, scale=100, relative=1e-9)
