"""Measurements in files of other programs: padded, with groups, links and attributes of their own."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.extend import read_root
from uqmbd.results import load, save
from uqmbd_calibration import Record


def measured(rng: random.Random) -> xr.Dataset:
    count = rng.randrange(1, 9)
    times = np.cumsum([rng.uniform(0.1, 1) for _ in range(count)])
    units = {"units": "m", "noise": 0.1}
    data = {"x": ("time", [rng.gauss(0, 1) for _ in range(count)], units), "f": ("repetition", [1.0, 2.0], units)}
    return xr.Dataset(data, {"time": ("time", times, {"units": "s"})}, {"name": "run 1", "machine": "rig 2"})


def _group_of_other_times(file: h5py.File) -> None:
    times = file.create_dataset("raw/time", data=np.arange(7.0))
    times.make_scale("time")
    file.create_dataset("raw/x", data=np.arange(7.0)).dims[0].attach_scale(times)


def _table(file: h5py.File) -> None:
    file.create_dataset("log/table", data=np.zeros(3, [("time", "f8"), ("event", "i4")]))


def _links(file: h5py.File) -> None:
    file["log/same"] = h5py.SoftLink("/x")
    file["log/elsewhere"] = h5py.ExternalLink("/etc/passwd", "/x")


def _ring(file: h5py.File) -> None:
    file["ring/again"] = file.create_group("ring")


def _huge(file: h5py.File) -> None:
    file.create_dataset("raw/empty", (10**12,), "f8", chunks=(1000,))


def _version(file: h5py.File) -> None:
    file.attrs["schema_version"] = "A4 sheet"


def _later(file: h5py.File) -> None:
    file.attrs["schema_version"] = 10**9


CHANGES: tuple[Callable[[h5py.File], None], ...] = (
    _group_of_other_times,
    _table,
    _links,
    _ring,
    _huge,
    _version,
    _later,
)


def _written(data: xr.Dataset, path: Path, rng: random.Random) -> None:
    """Write as another program might, with some of the changes, and what this or a third one pads it with."""
    head = 0
    if rng.random() < 0.2:
        data.to_netcdf(path, engine="scipy")
    else:
        data.to_netcdf(path, engine="h5netcdf")
        with h5py.File(path, "r+") as file:
            for change in rng.sample(CHANGES, rng.randrange(4)):
                change(file)
        head = rng.choice([0, 0, 512, 4096])
    tail = rng.choice([b"", bytes(1), bytes(4096), b"end of measurement\n", rng.randbytes(300)])
    path.write_bytes(b"HEAD".ljust(head, b" ")[:head] + path.read_bytes() + tail)


@pytest.mark.parametrize(
    "count", [pytest.param(20, marks=pytest.mark.thorough), pytest.param(300, marks=pytest.mark.slow)]
)
def test_measurements_of_other_programs_are_read(tmp_path: Path, count: int) -> None:
    rng, path = random.Random(count), tmp_path / "measured.nc"
    for _ in range(count):
        data = measured(rng)
        path.unlink(missing_ok=True)
        _written(data, path, rng)
        record = Record.read(path)
        assert (record.name, record.machine, record["x"].noise) == ("run 1", "rig 2", 0.1)
        assert np.array_equal(record["x"].times, data["time"]) and np.array_equal(record["x"].values, data["x"])
        found = read_root(path)
        assert found.encoding["digest"] == "not verified"
        xr.testing.assert_equal(found, data)


@pytest.mark.parametrize("change", CHANGES)
def test_what_else_a_file_holds_is_left_alone(tmp_path: Path, change: Callable[[h5py.File], None]) -> None:
    data, path = measured(random.Random(0)), tmp_path / "measured.nc"
    data.to_netcdf(path, engine="h5netcdf")
    with h5py.File(path, "r+") as file:
        change(file)
    path.write_bytes(path.read_bytes() + bytes(100))
    assert np.array_equal(Record.read(path)["x"].values, data["x"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda file: file.__setitem__("elsewhere", h5py.ExternalLink("/etc/passwd", "/x")), "is a link"),
        (lambda file: file.create_dataset("empty", (10**12,), "f8", chunks=(1000,)), "declare"),
    ],
)
def test_the_gate_is_that_of_results(tmp_path: Path, change: Callable[[h5py.File], None], words: str) -> None:
    path = tmp_path / "measured.nc"
    measured(random.Random(0)).to_netcdf(path, engine="h5netcdf")
    with h5py.File(path, "r+") as file:
        change(file)
    for read in (Record.read, read_root, load):
        with pytest.raises(uqmbd.StudyError, match=words):
            read(path)


def test_a_record_that_uqmbd_saved_is_verified(tmp_path: Path) -> None:
    data = measured(random.Random(0)).assign_attrs(known={"speed": 10.0})
    path = save(xr.DataTree(data), tmp_path / "measured.nc")
    assert read_root(path).identical(data) and read_root(path).encoding["digest"] == "verified"
    assert Record.read(path).known == {"speed": 10.0}
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(uqmbd.StudyError, match="does not match its digest"):
        Record.read(path)


@pytest.mark.parametrize(
    ("name", "words"),
    [("a.txt", "expected a path that ends in .nc or .nc4"), ("a.nc", "The netCDF file .* does not exist")],
)
def test_what_is_no_netcdf_file_is_refused(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(uqmbd.StudyError, match=words):
        read_root(tmp_path / name)


def test_attributes_of_the_root_stay(tmp_path: Path) -> None:
    attrs: Mapping[str, object] = {"title": "tap test", "schema_version": 3.5}
    measured(random.Random(1)).assign_attrs(attrs).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    assert read_root(tmp_path / "a.nc").attrs.items() >= attrs.items()
