"""Mechanisms to which the tests of descriptions add what is wrong, or right."""

from __future__ import annotations

import pytest

import uqmbd


@pytest.fixture
def plane():
    """A plane with one rod."""
    mechanism = uqmbd.Mechanism("machine", uqmbd.Planar(gravity=(0, -9.81)))
    mechanism.body("rod", mass=1, inertia=0.1)
    return mechanism


@pytest.fixture
def space():
    """A space with one block."""
    mechanism = uqmbd.Mechanism("machine", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    mechanism.body("block", mass=1, inertia=(1, 1, 1))
    return mechanism
