import hashlib
from importlib.resources import files

import numpy as np

from uqmbd.compiled.driver import aligned, load_driver


def test_driver_belongs_to_its_sources():
    """What `.ci/load_driver` notes: digests of the sources, and of the bitcode that was made from them."""
    source = files("uqmbd.compiled").joinpath("source")
    made = hashlib.sha256()
    for path in sorted((p for p in source.iterdir() if p.name.endswith((".h", ".c"))), key=lambda p: p.name):
        made.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    bitcode = hashlib.sha256(source.joinpath("driver.bc").read_bytes()).hexdigest()
    assert source.joinpath("driver.sha256").read_text().split() == [made.hexdigest(), bitcode]


def test_structures_are_mirrored():
    load_driver()  # compares their sizes


def test_work_arrays_are_aligned():
    for rows in range(1, 20):
        work = aligned(rows)
        assert work.shape == (rows, 8)
        assert work.ctypes.data % 64 == 0
        assert not np.any(work)
