"""The peers: the same mechanisms written by hand for CasADi (IDAS, stabilised index 2) and Exudyn.

Both need the extra ``bench``: ``pip install ".[bench]"``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CasadiModel:
    """Lagrange's equations with constraints, assembled by CasADi's symbolic differentiation.

    Parameters
    ----------
    q, v, p : casadi.SX
        Coordinates, velocities, parameters.
    kinetic, potential : casadi.SX
        Energies.
    work : casadi.SX
        Generalised forces that derive from no potential.
    constraints : casadi.SX
        Independent holonomic constraints without time.
    t : casadi.SX
        Time.
    """

    q: ca.SX
    v: ca.SX
    p: ca.SX
    t: ca.SX
    kinetic: ca.SX
    potential: ca.SX
    work: ca.SX
    constraints: ca.SX

    def pieces(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Mass matrix, applied minus inertial forces, constraint Jacobian, right side of the accelerations."""
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

    def integrator(self, times: Array, tolerance: float) -> tuple[ca.Function, ca.Function]:
        """IDAS on the stabilised index-2 form, and the accelerations with multipliers.

        CasADi wants semi-explicit equations, so the accelerations are algebraic unknowns beside both multipliers.
        """
        mass, force, gradient, gamma = self.pieces()
        n, m = self.q.numel(), self.constraints.numel()
        a, multipliers, mu = ca.SX.sym("a", n), ca.SX.sym("l", m), ca.SX.sym("mu", m)
        dae = {
            "x": ca.vertcat(self.q, self.v),
            "z": ca.vertcat(a, multipliers, mu),
            "p": self.p,
            "t": self.t,
            "ode": ca.vertcat(self.v - ca.mtimes(gradient.T, mu), a),
            "alg": ca.vertcat(
                ca.mtimes(mass, a) - force + ca.mtimes(gradient.T, multipliers),
                ca.mtimes(gradient, self.v),
                self.constraints,
            ),
        }
        options = {
            "reltol": tolerance,
            "abstol": tolerance,
            "suppress_algebraic": True,
            "calc_ic": False,
            "max_num_steps": 1_000_000,
        }
        system = ca.vertcat(ca.horzcat(mass, gradient.T), ca.horzcat(gradient, ca.SX.zeros(m, m)))
        solution = ca.solve(system, ca.vertcat(force, gamma), "symbolicqr")
        start = ca.Function("start", [self.q, self.v, self.p, self.t], [solution])
        return ca.integrator("peer", "idas", dae, float(times[0]), times, options), start


def casadi_slider_crank() -> CasadiModel:
    """Planar slider-crank in angles, with crank and rod length as parameters: 34 unknowns."""
    q, v, p, t = ca.SX.sym("q", 9), ca.SX.sym("v", 9), ca.SX.sym("p", 2), ca.SX.sym("t")
    crank, rod = p[0], p[1]
    masses = (0.36, 0.15, 0.10)
    inertias = (0.36 * crank**2 / 12, 0.15 * rod**2 / 12, 1e-4)
    kinetic, potential = 0, 0
    for k, (mass, inertia) in enumerate(zip(masses, inertias, strict=True)):
        kinetic += mass * (v[3 * k] ** 2 + v[3 * k + 1] ** 2) / 2 + inertia * v[3 * k + 2] ** 2 / 2
        potential += mass * 9.81 * q[3 * k + 1]
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
    work = ca.vertcat(0, 0, 0.1 - 0.005 * v[2], 0, 0, 0, 0, 0, 0)
    return CasadiModel(q, v, p, t, kinetic, potential, work, constraints)


def slider_crank_pose(crank: float, rod: float) -> Array:
    """Pose in angles with the crank at 45 degrees."""
    a = np.pi / 4
    x, y = crank * np.cos(a), crank * np.sin(a)
    b = -np.arcsin(y / rod)
    return np.array([x / 2, y / 2, a, x + rod / 2 * np.cos(b), y / 2, b, x + rod * np.cos(b), 0, 0])


def _rotation(e: ca.SX) -> ca.SX:
    a, b, c, d = ca.vertsplit(e)
    rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def _rates(e: ca.SX, rate: ca.SX) -> ca.SX:
    a, b, c, d = ca.vertsplit(e)
    matrix = [[-b, a, d, -c], [-c, -d, a, b], [-d, c, -b, a]]
    return 2 * ca.mtimes(ca.vertcat(*(ca.horzcat(*row) for row in matrix)), rate)


def casadi_five_bar(bodies: list[tuple[float, tuple[float, ...], tuple[float, ...]]], torque: float) -> CasadiModel:
    """Spherical five-bar of four bodies in quaternions (28 coordinates, 26 independent equations): see `five_bar`."""
    q, v, p, t = ca.SX.sym("q", 28), ca.SX.sym("v", 28), ca.SX.sym("p", 0), ca.SX.sym("t")
    x = [q[7 * k : 7 * k + 3] for k in range(4)]
    e = [q[7 * k + 3 : 7 * k + 7] for k in range(4)]
    turn = [_rotation(k) for k in e]
    kinetic, constraints = 0, []
    for k, (mass, com, inertia) in enumerate(bodies):
        rate = v[7 * k + 3 : 7 * k + 7]
        speed = v[7 * k : 7 * k + 3] + ca.jtimes(ca.mtimes(turn[k], ca.DM(com)), e[k], rate)
        omega = _rates(e[k], rate)
        xx, yy, zz, xy, xz, yz = (*inertia, 0.0, 0.0, 0.0)[:6]
        tensor = ca.DM([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        kinetic += mass * ca.dot(speed, speed) / 2 + ca.dot(omega, ca.mtimes(tensor, omega)) / 2
        constraints.append(ca.dot(e[k], e[k]) - 1)
    ex, ey, ez = (ca.DM(np.eye(3)[k]) for k in range(3))
    # bodies 1 to 4 are 0 to 3; the bearings of bodies 2 and 3, then 2-1 and 1-4, then the closing 4-3
    constraints += [x[1], ca.dot(ey, turn[1] @ ex), ca.dot(ez, turn[1] @ ex)]
    constraints += [x[2], ca.dot(ex, turn[2] @ ey), ca.dot(ez, turn[2] @ ey)]
    constraints += [x[0] - x[1], ca.dot(turn[1] @ ex, turn[0] @ ey), ca.dot(turn[1] @ ez, turn[0] @ ey)]
    constraints += [x[3] - x[0], ca.dot(turn[0] @ ey, turn[3] @ ex), ca.dot(turn[0] @ ez, turn[3] @ ex)]
    constraints += [ca.dot(turn[3] @ ex, turn[2] @ ez), ca.dot(turn[3] @ ey, turn[2] @ ez)]
    # constant torques about the axes of the two bearings
    work = ca.jtimes(_rates(e[1], v[10:14])[0], v, ca.SX.eye(28)).T * torque
    work += ca.jtimes(_rates(e[2], v[17:21])[1], v, ca.SX.eye(28)).T * 1.5 * torque
    return CasadiModel(q, v, p, t, kinetic, ca.SX(0), work, ca.vertcat(*constraints))


def exudyn_slider_crank(crank: float, rod: float, end: float, steps: int) -> Callable[[], Array]:
    """Return a function that integrates the slider-crank with Exudyn's implicit trapezoidal rule and gives slider_x."""
    import exudyn as exu
    import exudyn.itemInterface as items

    pose = slider_crank_pose(crank, rod).reshape(3, 3)
    masses = (0.36, 0.15, 0.10)
    inertias = (0.36 * crank**2 / 12, 0.15 * rod**2 / 12, 1e-4)

    def run() -> Array:
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        ground = mbs.AddObject(items.ObjectGround(referencePosition=[0, 0, 0]))
        nodes, bodies = [], []
        for (x, y, a), mass, inertia in zip(pose, masses, inertias, strict=True):
            nodes.append(mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=[x, y, a])))
            bodies.append(
                mbs.AddObject(items.ObjectRigidBody2D(physicsMass=mass, physicsInertia=inertia, nodeNumber=nodes[-1]))
            )
            marker = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[-1]))
            mbs.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=[0, -9.81, 0]))

        def joint(first: int, at: float, second: int, there: float) -> None:
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
        mbs.AddObject(items.ObjectConnectorCoordinateSpringDamper(markerNumbers=[fixed, angle], damping=0.005))
        mbs.AddLoad(items.LoadCoordinate(markerNumber=angle, load=0.1))
        mbs.Assemble()
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = end
        settings.timeIntegration.verboseMode = 0
        settings.solutionSettings.writeSolutionToFile = False
        settings.timeIntegration.newton.useModifiedNewton = True
        mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
        position: Array = np.array(mbs.GetNodeOutput(nodes[2], exu.OutputVariableType.Position))
        return position[:1]

    return run
