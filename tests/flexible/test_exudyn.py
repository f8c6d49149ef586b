"""A flexible body in space against Exudyn's ``ObjectFFRFreducedOrder`` with the same matrices (studies/records)."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

import uqmbd
import uqmbd_flexible
from uqmbd_joints import Spherical

FOLDER = Path(__file__).resolve().parents[2] / "studies" / "records"


@pytest.mark.slow
def test_a_flexible_pendulum_moves_as_in_exudyn():
    """Frequencies, places of a free node and forces of the joint, to 1e-4 of their sizes."""
    given = runpy.run_path(str(FOLDER / "make_flexible_pendulum.py"))
    expected = json.loads((FOLDER / "flexible_pendulum.json").read_text())
    nodes, masses, stiffness = given["lattice"]()
    held, seen = given["HELD"], given["SEEN"]
    model = uqmbd_flexible.craig_bampton(np.diag(masses), stiffness, nodes, range(len(nodes)), modes=0)
    frequencies = np.array(expected["frequencies, Hz"])[-model.modes :]
    np.testing.assert_allclose(model.frequencies, frequencies, rtol=1e-6)

    mechanism = uqmbd.Mechanism("flexible pendulum", uqmbd.Spatial(gravity=given["GRAVITY"]))
    body = uqmbd_flexible.flexible_body(mechanism, "body", model, position=(0, 0, 0))
    pin = mechanism.add(Spherical("pin", mechanism.ground, body.node(held), at=tuple(nodes[list(held)].mean(axis=0))))
    for k, axis in enumerate("xyz"):
        mechanism.output(axis, body.node_point(seen)[k], units="m")
        mechanism.output(f"f{axis}", pin.reaction_force[k], units="N")
    found = uqmbd.simulate(mechanism, given["TIMES"], rtol=1e-8)
    places, forces = (np.stack([found[a + x].values for x in "xyz"], axis=1) for a in ("", "f"))
    length = np.abs(np.array(expected["places, m"])).max()
    np.testing.assert_allclose(places, expected["places, m"], atol=1e-4 * length)
    # Exudyn states the force on the ground, uqmbd the force on the body
    size = np.abs(np.array(expected["forces, N"])).max()
    np.testing.assert_allclose(-forces, expected["forces, N"], atol=1e-4 * size)
