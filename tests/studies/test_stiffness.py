"""The spectra of `studies/stiffness.py` against a closed form, and its table."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import chaospy
import numpy as np
import pytest
from rich.console import Console

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_springs import TorsionSpringDamper

FOLDER = Path(__file__).parents[2] / "studies"
DAMPING = 0.3


@pytest.fixture(scope="module")
def script():
    sys.path.insert(0, str(FOLDER))
    yield runpy.run_path(str(FOLDER / "stiffness.py"))
    sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def pendulum():
    """A damped pendulum of random length that hangs at rest."""
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.8, 1.2), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    body = mechanism.body("body", mass=2, inertia=0.1, position=(0, -length))
    mechanism.add(Revolute("pivot", mechanism.ground, body, (0, 0), (0, length)))
    mechanism.add(TorsionSpringDamper("friction", mechanism.ground, body, stiffness=0, damping=DAMPING))
    mechanism.output("y", body.position[1], units="m")
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 1, 3))


def roots(length):
    """Of J s^2 + d s + m g l = 0."""
    return np.roots([2 * length**2 + 0.1, DAMPING, 2 * 9.81 * length])


@pytest.mark.parametrize("order", [0, 1, 3])
def test_pendulum_at_rest(script, pendulum, order):
    """Realisations: closed form; their projection with as many terms as nodes has all of their eigenvalues."""
    whole, alone = script["projection"](pendulum, order)
    expected = [np.sort_complex(roots(float(one.ensemble.values[0, 0]))) for one in alone]
    for one, pair in zip(alone, expected, strict=True):
        found = np.sort_complex(script["spectrum"](one, one.start.state, 0.0))
        np.testing.assert_allclose(found, pair, rtol=1e-7)
    found = script["spectrum"](whole, whole.start.state, 0.0)
    np.testing.assert_allclose(np.sort(found.imag), np.sort(np.concatenate(expected).imag), rtol=1e-7)
    np.testing.assert_allclose(np.sort(found.real), np.sort(np.concatenate(expected).real), rtol=1e-7)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:galerkin")
def test_table(script, pendulum):
    console = Console(width=200, record=True)
    console.print(script["table"](pendulum, 1))
    text = console.export_text()
    assert "pendulum, 1 s" in text and len(script["row"](pendulum, 0)) == len(script["COLUMNS"])


def test_study(script):
    study = script["study"]
    assert [p.node_name for p in study.propagators] == [f"galerkin-{p}" for p in range(7)]
