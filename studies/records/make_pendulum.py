"""Generate the records of a double pendulum in this folder with the engine Exudyn, which shares no code with uqmbd.

Two rods hang below each other and start from rest.  Dampers act in both pivots; in one record dry friction also acts in
the upper pivot.  The records contain the angle of the upper rod against the vertical and the angle between the rods.
The sampling rate is 20 times a second for 10 s, with independent normal errors.  Exudyn integrates redundant
coordinates with Lagrange multipliers by the generalised-alpha method with steps of 0.1 ms.  The script requires that
halving the steps changes no angle by more than 1e-5 rad.

Run ``python make_pendulum.py`` after ``pip install exudyn``.  The README of this folder states the version that
generated the records.
"""

from __future__ import annotations

from pathlib import Path

import exudyn
import numpy as np
from exudyn.itemInterface import (
    MarkerBodyMass,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    NodePointGround,
    NodeRigidBody2D,
    ObjectConnectorCoordinateSpringDamperExt,
    ObjectJointRevolute2D,
    ObjectRigidBody2D,
    SensorNode,
)

GRAVITY = 9.81
LENGTHS, MASSES, INERTIAS = (0.4, 0.3), (0.8, 0.55), (0.0107, 0.0042)  # m, kg, kg m^2 about the centre of each rod
DAMPINGS = (0.015, 0.005)  # N m s, of the upper and the lower pivot
ANGLES = (0.9, 0.5)  # rad against the vertical, at release
FRICTION = 0.04  # N m, dry, in the upper pivot, in the second record
SLOW = 0.01  # rad/s, below which dry friction is proportional to the speed
TIMES = np.arange(201) / 20
NOISE = 0.01  # rad
RECORDS = {"double_pendulum": (0.0, 19), "double_pendulum_with_friction": (FRICTION, 20)}  # friction, seed of the noise


def swing(friction: float, steps: int) -> np.ndarray:
    """Return angles of both rods against the vertical, shape (T, 2), with a number of steps per output time."""
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    ground = system.AddNode(NodePointGround())
    fixed = system.AddMarker(MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    anchor = system.AddObject({"objectType": "Ground", "referencePosition": [0, 0, 0]})
    hinge = system.AddMarker(MarkerBodyRigid(bodyNumber=anchor, localPosition=[0, 0, 0]))
    x, y, before, sensors = 0.0, 0.0, fixed, []
    for k, (length, mass, inertia, angle) in enumerate(zip(LENGTHS, MASSES, INERTIAS, ANGLES, strict=True)):
        half = np.array([np.sin(angle), -np.cos(angle)]) * length / 2
        middle = [x + half[0], y + half[1], angle]
        node = system.AddNode(NodeRigidBody2D(referenceCoordinates=middle))
        rod = system.AddObject(ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node))
        weight = system.AddMarker(MarkerBodyMass(bodyNumber=rod))
        system.AddLoad({"loadType": "MassProportional", "markerNumber": weight, "loadVector": [0, -GRAVITY, 0]})
        top = system.AddMarker(MarkerBodyRigid(bodyNumber=rod, localPosition=[0, length / 2, 0]))
        system.AddObject(ObjectJointRevolute2D(markerNumbers=[hinge, top]))
        turn = system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=2))
        system.AddObject(
            ObjectConnectorCoordinateSpringDamperExt(
                markerNumbers=[before, turn],
                damping=DAMPINGS[k],
                dynamicFrictionForce=friction if k == 0 else 0.0,
                frictionProportionalZone=SLOW if k == 0 and friction else 0.0,
            )
        )
        sensors.append(
            system.AddSensor(
                SensorNode(
                    nodeNumber=node, outputVariableType=exudyn.OutputVariableType.Coordinates, storeInternal=True
                )
            )
        )
        hinge = system.AddMarker(MarkerBodyRigid(bodyNumber=rod, localPosition=[0, -length / 2, 0]))
        before, x, y = turn, x + 2 * half[0], y + 2 * half[1]
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = float(TIMES[-1])
    settings.timeIntegration.numberOfSteps = (len(TIMES) - 1) * steps
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.95
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.useModifiedNewton = False
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = float(TIMES[1])
    settings.timeIntegration.verboseMode = 0
    if not system.SolveDynamic(settings):
        raise RuntimeError("Exudyn did not reach the end")
    stored = [system.GetSensorStoredData(sensor) for sensor in sensors]
    for data in stored:
        np.testing.assert_allclose(data[:, 0], TIMES, atol=1e-9)
    return np.stack([data[:, 3] for data in stored], axis=1) + np.array(ANGLES)


def main() -> None:
    """Write the records to the folder of this script."""
    folder = Path(__file__).parent
    for name, (friction, seed) in RECORDS.items():
        exact, finer = swing(friction, 500), swing(friction, 1000)
        change = np.abs(finer - exact).max()
        print(f"{name}: halving the steps changes angles by {change:.1e} rad at most")
        if change > 1e-5:
            raise RuntimeError(f"the steps are too long: {change:.1e} rad")
        angles = np.stack([finer[:, 0], finer[:, 1] - finer[:, 0]], axis=1)
        measured = angles + NOISE * np.random.default_rng(seed).standard_normal(angles.shape)
        lines = [
            f"# double pendulum by Exudyn {exudyn.__version__}, see README.md; noise {NOISE} rad, seed {seed}",
            "time [s],upper angle [rad],joint angle [rad]",
            *(f"{t:.2f},{a:.5f},{b:.5f}" for t, (a, b) in zip(TIMES, measured, strict=True)),
        ]
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
