"""Motion of a flexible body in space by Exudyn, as a reference for `uqmbd_flexible`: makes flexible_pendulum.json.

The body consists of twelve masses at the nodes of a lattice with springs.  A spherical joint holds the mean of
four nodes, and gravity deforms the body.  Exudyn uses ``ObjectFFRFreducedOrder`` with all elastic modes of the free
body, and the generalised-alpha method with two step sizes.  The file states the error that their difference shows.

Run ``python make_flexible_pendulum.py`` after ``pip install exudyn scipy``.  The README of this folder states the
version of Exudyn.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np

SIZES = (3, 2, 2)  # nodes for each axis
SPACING = (0.2, 0.1, 0.1)  # m
MASS = 0.1  # kg, of a node
STIFFNESS = 2e4  # N/m, of a spring between nodes that are next to one another, also across diagonals
GRAVITY = (0.0, 2.0, -9.81)  # m/s^2
TIMES = np.arange(31) / 100  # s
HELD, SEEN = (0, 1, 2, 3), 11  # nodes whose mean the joint holds, and node of the displacement


def lattice() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places of nodes (node, 3), m, masses of degrees of freedom, kg, and the stiffness matrix, N/m."""
    grid = np.array(list(itertools.product(*map(range, SIZES))))
    nodes = grid * np.array(SPACING)
    stiffness = np.zeros((3 * len(nodes), 3 * len(nodes)))
    for i, j in itertools.combinations(range(len(nodes)), 2):
        if np.abs(grid[i] - grid[j]).max() > 1:
            continue
        along = (nodes[j] - nodes[i]) / np.linalg.norm(nodes[j] - nodes[i])
        block = STIFFNESS * np.outer(along, along)
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            stiffness[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += sign * block
    return nodes, np.full(3 * len(nodes), MASS), stiffness


def swing(steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies, Hz, and a table (T, 6): place of a node, m, and force of the joint on the ground, N."""
    import exudyn
    import scipy.sparse
    from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
    from exudyn.itemInterface import (
        MarkerBodyPosition,
        MarkerSuperElementPosition,
        ObjectJointSpherical,
        SensorObject,
        SensorSuperElement,
    )

    nodes, masses, stiffness = lattice()
    model = FEMinterface()
    model.nodes = {"Position": nodes}
    model.massMatrix = scipy.sparse.csr_matrix(np.diag(masses))
    model.stiffnessMatrix = scipy.sparse.csr_matrix(stiffness)
    model.ComputeEigenmodes(nModes=len(masses) - 6, excludeRigidBodyModes=6, useSparseSolver=False)
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    about = ObjectFFRFreducedOrderInterface(model).AddObjectFFRFreducedOrder(system, gravity=list(GRAVITY))
    body = about["oFFRFreducedOrder"]
    ground = system.AddObject({"objectType": "Ground", "referencePosition": nodes[list(HELD)].mean(axis=0).tolist()})
    markers = [
        system.AddMarker(MarkerBodyPosition(bodyNumber=ground, localPosition=[0, 0, 0])),
        system.AddMarker(
            MarkerSuperElementPosition(
                bodyNumber=body, meshNodeNumbers=list(HELD), weightingFactors=[1 / len(HELD)] * len(HELD)
            )
        ),
    ]
    joint = system.AddObject(ObjectJointSpherical(markerNumbers=markers, constrainedAxes=[1, 1, 1]))
    kinds = exudyn.OutputVariableType
    sensors = [
        system.AddSensor(
            SensorSuperElement(
                bodyNumber=body, meshNodeNumber=SEEN, outputVariableType=kinds.Position, storeInternal=True
            )
        ),
        system.AddSensor(SensorObject(objectNumber=joint, outputVariableType=kinds.Force, storeInternal=True)),
    ]
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = float(TIMES[-1])
    settings.timeIntegration.numberOfSteps = (len(TIMES) - 1) * steps
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.99
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.useModifiedNewton = False
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = float(TIMES[1])
    settings.timeIntegration.verboseMode = 0
    if not system.SolveDynamic(settings):
        raise RuntimeError("Exudyn did not reach the end")
    stored = [np.asarray(system.GetSensorStoredData(sensor)) for sensor in sensors]
    for data in stored:
        np.testing.assert_allclose(data[:, 0], TIMES, atol=1e-9)
    return np.asarray(model.GetEigenFrequenciesHz()), np.hstack([data[:, 1:4] for data in stored])


def main() -> None:
    """Write the reference next to this script."""
    import exudyn

    frequencies, coarse = swing(400)
    _, fine = swing(800)
    table = fine + (fine - coarse) / 3  # of second order
    found = {
        "made by": f"Exudyn {exudyn.__version__}, make_flexible_pendulum.py",
        "error": {
            "place, m": float(np.abs(fine - coarse)[:, :3].max()) / 3,
            "force, N": float(np.abs(fine - coarse)[1:, 3:].max()) / 3,
        },
        "frequencies, Hz": frequencies.round(8).tolist(),
        "places, m": table[:, :3].round(9).tolist(),
        "forces, N": table[:, 3:].round(6).tolist(),
    }
    text = json.dumps(found, indent=1)
    (Path(__file__).parent / "flexible_pendulum.json").write_text(text + "\n")
    print(found["error"])


if __name__ == "__main__":
    main()
