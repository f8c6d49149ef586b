"""Every model moves: public model files are read, simulated for 0.1 s, and compared with MuJoCo or Pinocchio.

The files come from packages of the extra ``corpus``; none is part of this repository.
"""

from __future__ import annotations

import importlib.util
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import uqmbd

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

TIMES = [0.0, 0.05, 0.1]

REFUSED = {
    "example-robot-data/hector_description/robots/quadrotor_base.urdf": "the model cannot move",
    "example-robot-data/iris_description/robots/iris_simple.urdf": "the model cannot move",
    "example-robot-data/ur_description/urdf/ur3.urdf": "the robot has no <link>",
    "example-robot-data/icub_description/robots/icub.urdf": "body 'head' can be accelerated without any force",
    "example-robot-data/romeo_description/urdf/romeo.urdf": "body 'LFinger23Link' can be accelerated without any force",
    "example-robot-data/romeo_description/urdf/romeo_laas_small.urdf": "a principal moment of inertia is negative",
    "dm_control/lqr.xml": "the model cannot move",
}
"""Files that are refused, with a part of the message: bodies without a joint, a scene without a body, a mass at a point
that turns about all axes and hands without mass (Pinocchio's mass matrix is singular there), and inertia whose energy
is negative."""


def found_files():
    """List the model files of the packages that are installed, by name."""
    found = {}
    for base in map(Path, sys.path):
        robots = base / "cmeel.prefix/share/example-robot-data/robots"
        found |= {f"example-robot-data/{p.relative_to(robots)}": p for p in sorted(robots.rglob("*.urdf"))}
    for package, folder in (("dm_control", "suite"), ("gymnasium", "envs/mujoco/assets")):
        spec = importlib.util.find_spec(package)
        if spec is not None and spec.submodule_search_locations:
            root = Path(spec.submodule_search_locations[0]) / folder
            files = [
                p for p in sorted(root.glob("*.xml")) if "<mujoco" in p.read_text(encoding="utf-8", errors="ignore")
            ]
            found |= {f"{package}/{p.name}": p for p in files}
    return found


FILES = found_files()


@pytest.mark.slow
@pytest.mark.skipif(not FILES, reason="the extra corpus is not installed")
def test_there_are_sixty_files():
    assert len(FILES) >= 60


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_model_moves_as_in_other_programs(name):
    from .peers import motion_of_mujoco, motion_of_pinocchio, ours

    path = FILES[name]
    urdf = path.suffix == ".urdf"
    if urdf:
        pytest.importorskip("pinocchio", reason="the extra corpus is not installed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # some files have physically impossible inertia, which Pinocchio takes as stated
        read = (lambda path: uqmbd.from_urdf(path, inertia="as stated")) if urdf else uqmbd.from_mjcf
        if name in REFUSED:
            with pytest.raises(uqmbd.StudyError, match=REFUSED[name]):
                ours(read(path), TIMES)
            return
        bodies, found = ours(read(path), TIMES)
        expected = (motion_of_pinocchio if urdf else motion_of_mujoco)(path, TIMES, bodies)
    known = np.isfinite(expected).all(axis=(0, 2))
    assert known.any()
    found, expected = found[:, known], expected[:, known]
    moved, error = np.abs(expected - expected[0]).max(), np.abs(found - expected).max()
    print(f"\n| {name} | {len(bodies)} | {moved:.3g} | {error:.1e} |")
    assert error < 1e-8 + 1e-6 * moved
