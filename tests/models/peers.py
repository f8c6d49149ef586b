"""Motion of a model as MuJoCo or Pinocchio has it: their accelerations, with rigid couplings, integrated by SciPy."""

from __future__ import annotations

import functools
import importlib
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

FREE, BALL = 0, 1
"""Kinds of joints of MuJoCo."""

PUSH = (2.0, 3.0, 1.0)
"""Acceleration, m/s^2, that acts on all masses next to gravity: models in equilibrium move, too."""

POINT = (0.1, 0.2, 0.3)
"""Point that is followed on each body, m, in its frame: it depends on the position and the rotation."""


@functools.cache
def benchmark():
    """Benchmark of robots, which has the peers' equations; it needs MuJoCo."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "studies" / "benchmarks"))
    try:
        return importlib.import_module("robots")
    finally:
        sys.path.pop(0)


def turning(quaternion, rate):
    """Rate of a quaternion, scalar first, from the angular velocity in axes of the body."""
    w, x, y, z = quaternion
    p, q, r = rate
    return 0.5 * np.array([-x * p - y * q - z * r, w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p])


def motion_of_mujoco(path, times, names):
    """Return where points (time, body, 3) of bodies are, of an MJCF file, from the state that it begins in.

    Bodies between several joints of one, which MuJoCo does not have, are NaN.
    """
    robots = benchmark()
    peer = robots.MuJoCo(str(path))
    m, d = peer.model, peer.data
    gravity_off = m.opt.disableflags & int(robots.mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    m.opt.gravity[:] = np.array(PUSH) + (0 if gravity_off else m.opt.gravity)
    m.opt.disableflags &= ~int(robots.mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    kinds = [(int(k), int(a), int(b)) for k, a, b in zip(m.jnt_type, m.jnt_qposadr, m.jnt_dofadr, strict=True)]

    def rates(_, state):
        q, v = state[: m.nq].copy(), state[m.nq :]
        dq = np.zeros(m.nq)
        for kind, a, b in kinds:
            if kind == FREE:
                dq[a : a + 3] = v[b : b + 3]
            if kind in (FREE, BALL):
                k, i = (a + 3, b + 3) if kind == FREE else (a, b)
                q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
                dq[k : k + 4] = turning(q[k : k + 4], v[i : i + 3])
            else:
                dq[a] = v[b]
        return np.concatenate([dq, peer.solve(q, v)[1]])

    found = solve_ivp(
        rates, (times[0], times[-1]), np.concatenate([m.qpos0, np.zeros(m.nv)]), "LSODA", times, rtol=1e-9, atol=1e-11
    )
    assert found.success, found.message
    ids = [robots.mujoco.mj_name2id(m, robots.mujoco.mjtObj.mjOBJ_BODY, name) for name in names]
    places = np.full((len(times), len(names), 3), np.nan)
    for k, state in enumerate(found.y.T):
        d.qpos[:] = state[: m.nq]
        robots.mujoco.mj_kinematics(m, d)
        for n, body in enumerate(ids):
            if body >= 0:
                places[k, n] = d.xpos[body] + d.xmat[body].reshape(3, 3) @ POINT
    return places


def motion_of_pinocchio(path, times, names):
    """Return where points (time, link, 3) of links are, of a URDF file, from its zero pose, followers where they belong."""
    robots = benchmark()
    tree = robots.read_urdf(str(path))
    peer = robots.Pinocchio(str(path), False)
    pin, model = peer.pin, peer.model
    model.gravity.linear = model.gravity.linear + np.array(PUSH)
    start, index = np.zeros(model.nv), {}
    for joint in tree.joints:
        index[joint.name] = model.joints[model.getJointId(joint.name)].idx_v
        start[index[joint.name]] = joint.start[0]

    def place(x):
        return pin.integrate(model, pin.neutral(model), x)

    def rates(_, state):
        x, v = np.split(state, 2)
        return np.concatenate([v, peer.solve(tree, place(x), v)[1]])

    first = np.concatenate([start, np.zeros(model.nv)])
    found = solve_ivp(rates, (times[0], times[-1]), first, "LSODA", times, rtol=1e-9, atol=1e-11)
    assert found.success, found.message
    places = []
    for state in found.y.T:
        pin.framesForwardKinematics(model, peer.data, place(state[: model.nv]))
        frames = [model.getFrameId(name, pin.FrameType.BODY) for name in names]
        places.append([peer.data.oMf[k].act(np.array(POINT)) for k in frames])
    return np.array(places)


def ours(mechanism, times):
    """Return the names of the bodies, and where points of them are (time, body, 3) by `uqmbd.simulate`."""
    import uqmbd
    from uqmbd_springs import Gravity

    names = list(mechanism.bodies)
    for name in names:
        if mechanism.bodies[name].mass:
            mechanism.add(Gravity(f"push on {name}", mechanism.bodies[name], PUSH))
    for name in names:
        for axis, part in zip("xyz", mechanism.bodies[name].point(POINT), strict=True):
            mechanism.output(f"place of {name} along {axis}", part, units="m")
    found = uqmbd.simulate(mechanism, times, rtol=1e-8, check=False)
    parts = [[found[f"place of {name} along {axis}"].values for axis in "xyz"] for name in names]
    return names, np.moveaxis(np.array(parts), 2, 0)
