import hashlib
import os
import subprocess
import sys
from importlib.resources import files

import numpy as np

from uqmbd.compiled.driver import aligned, load_driver

SOURCE = files("uqmbd.compiled").joinpath("source")


def test_driver_belongs_to_its_sources():
    """`.ci/driver` notes digests of the sources, and of the bitcode that was made from them."""
    made = hashlib.sha256()
    for path in sorted((p for p in SOURCE.iterdir() if p.name.endswith((".h", ".c", ".json"))), key=lambda p: p.name):
        made.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    first, *lines = SOURCE.joinpath("driver.sha256").read_text().splitlines()
    assert first == made.hexdigest()
    noted = {name: digest for digest, name in map(str.split, lines)}
    bitcode = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in SOURCE.iterdir() if p.name.endswith(".bc")}
    assert noted == bitcode


def test_parts_are_made_when_they_are_needed(tmp_path):
    """A pendulum needs no part; a contact, a stiff integrator and a maximum each need one."""
    script = tmp_path / "parts.py"
    script.write_text(PARTS)
    environment = {**os.environ, "UQMBD_CACHE": str(tmp_path)}
    found = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["driver", "summaries", "decisions", "implicit"]


PARTS = """
import uqmbd
from uqmbd.compiled import driver
from uqmbd_contact import PlaneImpact

made = driver._object_code
def listed(part):
    print(part, flush=True)
    return made(part)
driver._object_code = listed

def fall(*, maximum=False, ground=False, integrator="dop853"):
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
    stone = mechanism.body("stone", mass=1, position=1, velocity=0.5)
    if ground:
        mechanism.add(PlaneImpact("floor", mechanism.ground, stone, 0, 0, normal_i=1, restitution=0.5))
    mechanism.output("height", uqmbd.maximum(stone.position[0]) if maximum else stone.position[0], units="m")
    uqmbd.simulate(mechanism, [0, 0.5], integrator=integrator, check=False)

fall()
fall(maximum=True)
fall(ground=True)
fall(integrator="radau")
"""


def test_structures_are_mirrored():
    load_driver()  # compares their sizes


def test_work_arrays_are_aligned():
    for rows in range(1, 20):
        work = aligned(rows)
        assert work.shape == (rows, 8)
        assert work.ctypes.data % 64 == 0
        assert not np.any(work)
