"""Mechanisms of the peers, written by hand for CasADi (IDAS) and Exudyn, and reference solutions for the errors.

Both need the extra ``bench``: ``pip install ".[bench]"``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

__all__ = [
    "PEERS",
    "CasadiModel",
    "CasadiPeer",
    "casadi_chunk",
    "casadi_five_bar",
    "casadi_peer",
    "casadi_slider_crank",
    "exudyn_slider_crank",
    "five_bar_pose",
    "five_bar_reference",
    "slider_crank_pose",
    "slider_crank_reference",
]

Array = NDArray[np.float64]

MASSES = (0.36, 0.15, 0.10)
TORQUE, DAMPING, GRAVITY, SLIDER_INERTIA = 0.1, 0.005, 9.81, 1e-4


@dataclass(frozen=True)
class CasadiModel:
    """Lagrange's equations with constraints, assembled by CasADi's symbolic differentiation.

    Parameters
    ----------
    q, v, p, t : casadi.SX
        Coordinates, velocities, parameters, time.
    kinetic, potential : casadi.SX
        Energies.
    work : casadi.SX
        Generalised forces without a potential.
    constraints : casadi.SX
        Independent holonomic constraints without time.
    outputs : callable
        Outputs as functions of ``(q, multipliers)``.
    reactions : bool
        Whether the outputs contain multipliers, which then are computed at the output times.
    """

    q: ca.SX
    v: ca.SX
    p: ca.SX
    t: ca.SX
    kinetic: ca.SX
    potential: ca.SX
    work: ca.SX
    constraints: ca.SX
    outputs: Callable[[ca.SX, ca.SX], ca.SX]
    reactions: bool

    @cached_property
    def pieces(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Return mass matrix, applied minus inertial forces, constraint Jacobian, right side of accelerations."""
        momentum = ca.jacobian(self.kinetic, self.v).T
        mass = ca.jacobian(momentum, self.v)
        force = (
            self.work
            - ca.jacobian(self.potential, self.q).T
            + ca.jacobian(self.kinetic, self.q).T
            - ca.jtimes(momentum, self.q, self.v)
        )
        gradient = ca.jacobian(self.constraints, self.q)
        gamma = -ca.jtimes(ca.mtimes(gradient, self.v), self.q, self.v)
        return mass, force, gradient, gamma

    @cached_property
    def system(self) -> ca.Function:
        """Return matrix and right side of the index-1 system as a function of ``(q, v, p, t)``."""
        mass, force, gradient, gamma = self.pieces
        m = self.constraints.numel()
        matrix = ca.vertcat(ca.horzcat(mass, gradient.T), ca.horzcat(gradient, ca.SX(m, m)))
        return ca.Function("system", [self.q, self.v, self.p, self.t], [matrix, ca.vertcat(force, gamma)])

    def accelerations(self, q: Array, v: Array, p: Array, t: float) -> Array:
        """Return accelerations and multipliers."""
        matrix, right = self.system(q, v, p, t)
        return np.linalg.solve(matrix.full(), right.full())[:, 0]


class CasadiPeer:
    """IDAS on a `CasadiModel`.

    A diagonal mass matrix is inverted on paper.  Otherwise the accelerations are also algebraic unknowns, which was
    faster than eliminating them (measured on the five-bar).

    Parameters
    ----------
    model : CasadiModel
        The equations.
    times : array, shape (T,)
        Output times, s.
    tolerance : float
        Relative and absolute tolerance.
    index : {2, 1}
        Stabilised index 2 (Gear, Gupta, Leimkuhler) or index 1 (accelerations; constraints drift).
    """

    def __init__(self, model: CasadiModel, times: Array, tolerance: float, index: int = 2) -> None:
        self.model, self.times = model, times
        mass, force, gradient, gamma = model.pieces
        n, m = model.q.numel(), model.constraints.numel()
        multipliers = ca.SX.sym("l", m)
        drift, unknowns, motion = [], [multipliers], []
        if mass.sparsity().is_diag():
            a = (force - ca.mtimes(gradient.T, multipliers)) / ca.diag(mass)
            self._skip = n
        else:
            a = ca.SX.sym("a", n)
            unknowns = [a, multipliers]
            motion = [ca.mtimes(mass, a) - force + ca.mtimes(gradient.T, multipliers)]
            self._skip = 0
        rate = model.v
        if index == 2:
            mu = ca.SX.sym("mu", m)
            unknowns.append(mu)
            rate = rate - ca.mtimes(gradient.T, mu)
            drift = [ca.mtimes(gradient, model.v), model.constraints]
        else:
            drift = [ca.mtimes(gradient, a) - gamma]
        dae = {
            "x": ca.vertcat(model.q, model.v),
            "z": ca.vertcat(*unknowns),
            "p": model.p,
            "t": model.t,
            "ode": ca.vertcat(rate, a),
            "alg": ca.vertcat(*motion, *drift),
        }
        self.unknowns = dae["x"].numel() + dae["z"].numel()
        self._zeros = np.zeros(m if index == 2 else 0)
        options = {
            "reltol": tolerance,
            "abstol": tolerance,
            "suppress_algebraic": index == 2,
            "calc_ic": False,
            "max_num_steps": 1_000_000,
        }
        self._integrator = ca.integrator("peer", "idas", dae, float(times[0]), times, options)
        self._observe = self._observer().map(len(times))

    def _observer(self) -> ca.Function:
        model = self.model
        n, m = model.q.numel(), model.constraints.numel()
        multipliers = ca.SX.sym("l", m)
        direct = ca.Function("outputs", [model.q, multipliers], [model.outputs(model.q, multipliers)])
        x, p, t = ca.MX.sym("x", 2 * n), ca.MX.sym("p", model.p.numel()), ca.MX.sym("t")
        found = ca.MX(m, 1)
        if model.reactions:
            matrix, right = model.system(x[:n], x[n:], p, t)
            found = ca.solve(matrix, right, "qr")[n:]
        return ca.Function("observe", [x, p, t], [direct(x[:n], found)])

    def start(self, q: Array, p: Array) -> tuple[Array, Array]:
        """Return consistent states and algebraic unknowns at rest."""
        v = np.zeros_like(q)
        found = self.model.accelerations(q, v, p, float(self.times[0]))
        return np.concatenate([q, v]), np.concatenate([found[self._skip :], self._zeros])

    def integrate(self, start: tuple[Array, Array], p: Array) -> ca.DM:
        """Integrate, and return states at the output times, shape (state, T)."""
        return self._integrator(x0=start[0], z0=start[1], p=p)["xf"]

    def outputs(self, states: ca.DM, p: Array) -> Array:
        """Return the outputs at the output times, shape (output, T)."""
        count = len(self.times)
        p_all = np.tile(np.asarray(p, dtype=float)[:, None], count)
        result: Array = self._observe(states, p_all, self.times[None, :]).full()
        return result

    def counters(self) -> tuple[int, int]:
        """Return residual calls and Jacobians of the last integration."""
        stats = self._integrator.stats()
        return int(stats["n_call_daeF"]), int(stats["n_call_jacF"])


def casadi_slider_crank() -> CasadiModel:
    """Return the planar slider-crank in angles, with crank and rod length as parameters: 34 unknowns."""
    q, v, p, t = ca.SX.sym("q", 9), ca.SX.sym("v", 9), ca.SX.sym("p", 2), ca.SX.sym("t")
    crank, rod = p[0], p[1]
    inertias: tuple[Any, ...] = (MASSES[0] * crank**2 / 12, MASSES[1] * rod**2 / 12, SLIDER_INERTIA)
    kinetic, potential = ca.SX(0), ca.SX(0)
    for k, (mass, inertia) in enumerate(zip(MASSES, inertias, strict=True)):
        kinetic += mass * (v[3 * k] ** 2 + v[3 * k + 1] ** 2) / 2 + inertia * v[3 * k + 2] ** 2 / 2
        potential += mass * GRAVITY * q[3 * k + 1]
    x1, y1, a1, x2, y2, a2, x3, y3, a3 = ca.vertsplit(q)
    c1, s1, c2, s2 = ca.cos(a1), ca.sin(a1), ca.cos(a2), ca.sin(a2)
    constraints = ca.vertcat(
        x1 - crank / 2 * c1,
        y1 - crank / 2 * s1,
        x2 - rod / 2 * c2 - x1 - crank / 2 * c1,
        y2 - rod / 2 * s2 - y1 - crank / 2 * s1,
        x3 - x2 - rod / 2 * c2,
        y3 - y2 - rod / 2 * s2,
        y3,
        a3,
    )
    work = ca.vertcat(0, 0, TORQUE - DAMPING * v[2], 0, 0, 0, 0, 0, 0)

    def outputs(q: ca.SX, multipliers: ca.SX) -> ca.SX:
        return ca.vertcat(q[6], q[2], -multipliers[4])

    return CasadiModel(q, v, p, t, kinetic, potential, work, constraints, outputs, reactions=True)


def slider_crank_pose(crank: float, rod: float) -> Array:
    """Return the pose in angles with the crank at 45 degrees."""
    a = np.pi / 4
    x, y = crank * np.cos(a), crank * np.sin(a)
    b = -np.arcsin(y / rod)
    return np.array([x / 2, y / 2, a, x + rod / 2 * np.cos(b), y / 2, b, x + rod * np.cos(b), 0, 0])


def slider_crank_reference(lengths: Array, times: Array, steps: int = 8) -> Array:
    """Return slider position and crank angle by the equation of the crank angle, for many slider-cranks at once.

    Parameters
    ----------
    lengths : array, shape (K, 2)
        Lengths of crank and rod, m.
    times : array, shape (T,)
        Output times, s.
    steps : int
        Runge-Kutta steps (order 4) between output times.

    Returns
    -------
    array, shape (K, 2, T)
    """
    r, length = lengths.T
    inertia = MASSES[1] * length**2 / 12

    def acceleration(angle: Array, speed: Array) -> Array:
        c, s = np.cos(angle), np.sin(angle)
        sb = -r * s / length
        cb = np.sqrt(1 - sb**2)
        # derivatives by the crank angle: rod angle, x and y of the rod's centre, x of the slider
        k = -r * c / (length * cb)
        k1 = r * s / (length * cb) - r * c * sb / (length * cb**2) * k
        x2, y2, x3 = -r * s - length / 2 * sb * k, r * c / 2, -r * s - length * sb * k
        bend = cb * k**2 + sb * k1
        dx2, dy2, dx3 = -r * c - length / 2 * bend, -r * s / 2, -r * c - length * bend
        total = MASSES[0] * r**2 / 3 + MASSES[1] * (x2**2 + y2**2) + inertia * k**2 + MASSES[2] * x3**2
        slope = MASSES[1] * (x2 * dx2 + y2 * dy2) + inertia * k * k1 + MASSES[2] * x3 * dx3
        torque = TORQUE - DAMPING * speed - GRAVITY * (MASSES[0] + MASSES[1]) * r / 2 * c
        result: Array = (torque - slope * speed**2) / total
        return result

    result = np.empty((len(lengths), 2, len(times)))
    angle, speed = np.full(len(lengths), np.pi / 4), np.zeros(len(lengths))
    for i in range(len(times)):
        result[:, 0, i] = r * np.cos(angle) + length * np.sqrt(1 - (r * np.sin(angle) / length) ** 2)
        result[:, 1, i] = angle
        if i + 1 == len(times):
            break
        h = (times[i + 1] - times[i]) / steps
        for _ in range(steps):
            a1 = acceleration(angle, speed)
            a2 = acceleration(angle + h / 2 * speed, speed + h / 2 * a1)
            a3 = acceleration(angle + h / 2 * (speed + h / 2 * a1), speed + h / 2 * a2)
            a4 = acceleration(angle + h * (speed + h / 2 * a2), speed + h * a3)
            angle = angle + h * speed + h**2 / 6 * (a1 + a2 + a3)
            speed = speed + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return result


def _rotation(e: ca.SX) -> ca.SX:
    a, b, c, d = ca.vertsplit(e)
    rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def _angular_velocity(e: ca.SX, rate: ca.SX) -> ca.SX:
    a, b, c, d = ca.vertsplit(e)
    matrix = [[-b, a, d, -c], [-c, -d, a, b], [-d, c, -b, a]]
    return 2 * ca.mtimes(ca.vertcat(*(ca.horzcat(*row) for row in matrix)), rate)


def casadi_five_bar() -> CasadiModel:
    """Return the spherical five-bar of `mechanisms` in quaternions: 28 coordinates, 26 independent equations.

    The parameters are the centre of mass of body 1 along x and y.
    """
    from mechanisms import BODIES, TORQUES

    q, v, p, t = ca.SX.sym("q", 28), ca.SX.sym("v", 28), ca.SX.sym("p", 2), ca.SX.sym("t")
    x = [q[7 * k : 7 * k + 3] for k in range(4)]
    e = [q[7 * k + 3 : 7 * k + 7] for k in range(4)]
    rates = [v[7 * k + 3 : 7 * k + 7] for k in range(4)]
    turn = [_rotation(k) for k in e]
    omega = [_angular_velocity(e[k], rates[k]) for k in range(4)]
    kinetic, constraints = ca.SX(0), []
    for k, (mass, com, inertia) in enumerate(BODIES.values()):
        centre = ca.DM(com) if k else ca.vertcat(p, com[2])
        speed = v[7 * k : 7 * k + 3] + ca.jtimes(ca.mtimes(turn[k], centre), e[k], rates[k])
        xx, yy, zz, xy, xz, yz = (*inertia, 0.0, 0.0, 0.0)[:6]
        tensor = ca.DM([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        kinetic += mass * ca.dot(speed, speed) / 2 + ca.dot(omega[k], ca.mtimes(tensor, omega[k])) / 2
        constraints.append(ca.dot(e[k], e[k]) - 1)
    ex, ey, ez = (ca.DM(np.eye(3)[k]) for k in range(3))
    # bodies 1 to 4 have indices 0 to 3: bearings of bodies 2 and 3, then 2-1 and 1-4, then the parallel axes of 4 and 3
    constraints += [x[1], ca.dot(ey, turn[1] @ ex), ca.dot(ez, turn[1] @ ex)]
    constraints += [x[2], ca.dot(ex, turn[2] @ ey), ca.dot(ez, turn[2] @ ey)]
    constraints += [x[0] - x[1], ca.dot(turn[1] @ ex, turn[0] @ ey), ca.dot(turn[1] @ ez, turn[0] @ ey)]
    constraints += [x[3] - x[0], ca.dot(turn[0] @ ey, turn[3] @ ex), ca.dot(turn[0] @ ez, turn[3] @ ex)]
    constraints += [ca.dot(turn[3] @ ex, turn[2] @ ez), ca.dot(turn[3] @ ey, turn[2] @ ez)]
    # the bearings fix the torque axes, so that world and body components are equal
    work = TORQUES[0] * ca.jacobian(omega[1][0], v).T + TORQUES[1] * ca.jacobian(omega[2][1], v).T

    def outputs(q: ca.SX, multipliers: ca.SX) -> ca.SX:
        return _rotation(q[3:7])[:, 2]

    return CasadiModel(q, v, p, t, kinetic, ca.SX(0), work, ca.vertcat(*constraints), outputs, reactions=False)


def five_bar_pose(*_: float) -> Array:
    """Return the home pose: all frames coincide with the world frame, for every centre of mass."""
    return np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 4)


def five_bar_reference(centre: Array, times: Array) -> Array:
    """Return the direction of the camera, shape (3, T), by an explicit Runge-Kutta method of order 8.

    `centre`: the centre of mass of body 1 along x and y.
    """
    model, q = casadi_five_bar(), five_bar_pose()
    n = len(q)

    def rate(t: float, y: Array) -> Array:
        return np.concatenate([y[n:], model.accelerations(y[:n], y[n:], centre, t)[:n]])

    start = np.concatenate([q, np.zeros(n)])
    span = (float(times[0]), float(times[-1]))
    found = solve_ivp(rate, span, start, method="DOP853", rtol=1e-11, atol=1e-13, t_eval=times)
    a, b, c, d = found.y[3:7]
    return np.array([2 * (b * d + a * c), 2 * (c * d - a * b), a * a - b * b - c * c + d * d])


PEERS: dict[str, tuple[Callable[[], CasadiModel], Callable[..., Array]]] = {
    "slider_crank": (casadi_slider_crank, slider_crank_pose),
    "five_bar": (casadi_five_bar, five_bar_pose),
}
"""Factory of a mechanism for CasADi, and its pose for given parameters."""


@lru_cache
def _peer(name: str, times: bytes, tolerance: float) -> CasadiPeer:
    return CasadiPeer(PEERS[name][0](), np.frombuffer(times), tolerance)


def casadi_peer(name: str, times: Array, tolerance: float) -> CasadiPeer:
    """Return a mechanism, a key of `PEERS`, for IDAS, created once in a process."""
    return _peer(name, np.asarray(times, dtype=float).tobytes(), tolerance)


def casadi_chunk(name: str, values: Array, times: Array, tolerance: float) -> Array:
    """Compute some realisations one after another, also in a worker process.

    Returns
    -------
    array, shape (K, output, T)
    """
    peer, pose = casadi_peer(name, times, tolerance), PEERS[name][1]
    return np.array([peer.outputs(peer.integrate(peer.start(pose(*p), p), p), p) for p in values])


@dataclass(frozen=True)
class ExudynRun:
    """Outputs ``slider_x, crank_angle`` at the output times, shape (2, T), and seconds of the solver alone."""

    outputs: Array
    seconds: float
    newton: int
    jacobians: int


def exudyn_slider_crank(crank: float, rod: float, times: Array, steps: int) -> ExudynRun:
    """Integrate the slider-crank by Exudyn's implicit trapezoidal rule (index 2).

    Parameters
    ----------
    crank, rod : float
        Lengths, m.
    times : array, shape (T,)
        Output times, s, evenly spaced from 0.
    steps : int
        Steps of the whole motion, a multiple of T - 1.
    """
    import exudyn as exu
    import exudyn.itemInterface as items

    pose = slider_crank_pose(crank, rod).reshape(3, 3)
    inertias: tuple[Any, ...] = (MASSES[0] * crank**2 / 12, MASSES[1] * rod**2 / 12, SLIDER_INERTIA)
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.AddObject(items.ObjectGround(referencePosition=[0, 0, 0]))
    nodes, bodies = [], []
    for (x, y, a), mass, inertia in zip(pose, MASSES, inertias, strict=True):
        nodes.append(mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=[x, y, a])))
        body = items.ObjectRigidBody2D(physicsMass=mass, physicsInertia=inertia, nodeNumber=nodes[-1])
        bodies.append(mbs.AddObject(body))
        marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[-1]))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=[0, -GRAVITY, 0]))

    def joint(first: Any, at: float, second: Any, there: float) -> None:
        markers = [
            mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=b, localPosition=[p, 0, 0]))
            for b, p in ((first, at), (second, there))
        ]
        mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))

    joint(ground, 0, bodies[0], -crank / 2)
    joint(bodies[0], crank / 2, bodies[1], -rod / 2)
    joint(bodies[1], rod / 2, bodies[2], 0)
    point = mbs.AddNode(items.NodePointGround())
    fixed = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=point, coordinate=0))
    for coordinate in (1, 2):
        marker = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[2], coordinate=coordinate))
        mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[fixed, marker]))
    angle = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=2))
    mbs.AddObject(items.ObjectConnectorCoordinateSpringDamper(markerNumbers=[fixed, angle], damping=DAMPING))
    mbs.AddLoad(items.LoadCoordinate(markerNumber=angle, load=TORQUE))
    kind = exu.OutputVariableType.Coordinates
    sensors = [
        mbs.AddSensor(items.SensorNode(nodeNumber=nodes[k], storeInternal=True, outputVariableType=kind))
        for k in (2, 0)
    ]
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = float(times[-1])
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = float(times[1] - times[0])
    begin = time.process_time()
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    seconds = time.process_time() - begin
    slider, turned = (mbs.GetSensorStoredData(s) for s in sensors)
    found = np.array([pose[2, 0] + slider[:, 1], pose[0, 2] + turned[:, 3]])
    solver = mbs.sys["dynamicSolver"] if "dynamicSolver" in mbs.sys else None
    newton = int(solver.it.newtonStepsCount) if solver is not None else 0
    jacobians = int(solver.it.newtonJacobiCount) if solver is not None else 0
    return ExudynRun(found, seconds, newton, jacobians)
