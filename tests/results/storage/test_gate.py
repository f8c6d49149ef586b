"""What is read is a regular file that holds what it declares: no waiting, no memory filled, one message."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr

import uqmbd
from tests.results.old_zarr import stored_as_zarr
from uqmbd.errors import StudyError
from uqmbd.results import SampleStore, load, save
from uqmbd_calibration import Record

SIZE = 1_000_000_000  # numbers of 8 bytes


@pytest.fixture(autouse=True)
def ends_soon() -> Iterator[None]:
    """A reader that waits for ever is interrupted."""

    def late(*given: object) -> None:
        raise AssertionError("it was still reading after 20 s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(20)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def tree() -> xr.DataTree:
    data = xr.Dataset({"mean": ("time", np.arange(4.0))}, {"time": np.arange(4.0)}, {"options": {"a": 1}, "label": "m"})
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs={"study": "s", "names": ["a", "b"]}), "m/statistics": data})


def readers() -> list[Callable[[Path], object]]:
    return [load, uqmbd.results.open]


@pytest.mark.parametrize("name", ["a.nc", "a.zarr"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_only_regular_files_are_read(tmp_path: Path, name: str, kind: str) -> None:
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    for read in (*readers(), Record.read):
        with pytest.raises(StudyError):
            read(path)


@pytest.mark.parametrize("place", [".zattrs", ".zmetadata", "m/statistics/mean/0", "m/statistics/time/.zarray"])
def test_pipes_in_a_zarr_folder_are_refused(tmp_path: Path, place: str) -> None:
    folder = stored_as_zarr(tree(), tmp_path / "a.zarr")
    (folder / place).unlink()
    os.mkfifo(folder / place)
    for read in readers():
        with pytest.raises(StudyError, match="a pipe"):
            read(folder)


def _dataset(file: h5py.File) -> None:
    file.create_dataset("m/x", (SIZE,), "f8", chunks=(1000,))


def _one_chunk(file: h5py.File) -> None:
    file.create_dataset("m/x", (SIZE // 3,), "f8", chunks=(SIZE // 3,), compression="gzip")


def _contiguous(file: h5py.File) -> None:
    file.create_dataset("x", (SIZE // 1000, 1000), "f8")


def _zeros(file: h5py.File) -> None:
    """Zeros that are compressed twice, of which a chunk of 8 MB is some hundred bytes."""
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_chunk((1_000_000,))
    layout.set_deflate(1)
    layout.set_deflate(1)
    space = h5py.h5s.create_simple((40_000_000,))
    made = h5py.Dataset(h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_DOUBLE, space, layout))
    for k in range(40):
        made[k * 1_000_000 : (k + 1) * 1_000_000] = 0


def _texts(file: h5py.File) -> None:
    """Many texts, one of which is long: of fixed width in memory all are."""
    made = file.create_dataset("x", (10_000,), h5py.string_dtype())
    made[5000] = "long" * 10_000


def _many_texts(file: h5py.File) -> None:
    file.create_dataset("x", (SIZE,), h5py.string_dtype(), chunks=(1000,))


def _fixed_texts(file: h5py.File) -> None:
    file.create_dataset("x", (100_000,), "S4000", chunks=(10,))


@pytest.mark.parametrize(
    "make",
    [
        _dataset,
        _one_chunk,
        _contiguous,
        pytest.param(_zeros, marks=pytest.mark.thorough),
        _texts,
        _many_texts,
        _fixed_texts,
    ],
)
def test_what_declares_more_than_it_holds_is_refused_before_it_is_read(
    tmp_path: Path, make: Callable[[h5py.File], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("values are read")

    with h5py.File(tmp_path / "a.nc", "w") as file:
        make(file)
    assert (tmp_path / "a.nc").stat().st_size < 500_000
    monkeypatch.setattr(h5py.Dataset, "__getitem__", never)
    for read in (*readers(), Record.read):
        with pytest.raises(StudyError, match="declare|holds"):
            read(tmp_path / "a.nc")


@pytest.mark.parametrize("form", [2, 3])
@pytest.mark.parametrize("changes", [{"shape": [SIZE]}, {"chunks": [SIZE]}, {"chunks": [0]}, {"shape": [-1]}])
def test_zarr_that_declares_more_than_it_holds_is_refused(tmp_path: Path, form: Any, changes: dict[str, Any]) -> None:
    folder = stored_as_zarr(tree(), tmp_path / "a.zarr", form)
    (folder / ".zmetadata").unlink(missing_ok=True)
    name = "zarr.json" if form == 3 else ".zarray"
    about = json.loads((folder / "m/statistics/mean" / name).read_text())
    if form == 3 and "chunks" in changes:
        changes = {"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": changes["chunks"]}}}
    (folder / "m/statistics/mean" / name).write_text(json.dumps(about | changes))
    for read in readers():
        with pytest.raises(StudyError, match="declare|has the shape"):
            read(folder)


def test_coordinates_of_samples_that_declare_more_than_they_hold_are_refused(tmp_path: Path) -> None:
    axes = uqmbd.extend.labels(["x"], ["k"], [0.0, 1.0])
    samples = uqmbd.extend.sample_dataset(np.ones((5, 1, 2)), np.zeros((5, 1)), axes)
    store = SampleStore.write(tmp_path / "a-samples.zarr", samples)
    about = json.loads((store.folder / "time/.zarray").read_text())
    (store.folder / "time/.zarray").write_text(json.dumps(about | {"shape": [SIZE]}))
    with pytest.raises(StudyError, match="declare"):
        SampleStore.open(store.folder)


def _vlen(file: h5py.File) -> None:
    made = file.create_dataset("x", (3,), h5py.vlen_dtype("f8"))
    made[0] = [1.0, 2.0]


def _compound(file: h5py.File) -> None:
    file["x"] = np.zeros(3, dtype=[("a", "f8"), ("b", "i4")])


def _opaque(file: h5py.File) -> None:
    file["x"] = np.zeros(3, dtype="V8")


def _references(file: h5py.File) -> None:
    file["g"] = 1.0
    file.create_dataset("x", (2,), h5py.ref_dtype)[0] = file["g"].ref


def _cycle(file: h5py.File) -> None:
    file.create_group("a")["b"] = file["/"]


def _soft(file: h5py.File) -> None:
    file["a"] = h5py.SoftLink("/a")


def _external(file: h5py.File) -> None:
    file["a"] = h5py.ExternalLink("other.nc", "/")


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource("other.nc", "x", (3,))
    file.create_virtual_dataset("x", layout)


def _elsewhere(file: h5py.File) -> None:
    file.create_dataset("x", (3,), "f8", external=[("/etc/passwd", 0, 24)])


@pytest.mark.parametrize(
    "make", [_vlen, _compound, _opaque, _references, _cycle, _soft, _external, _virtual, _elsewhere]
)
def test_what_no_result_has_is_refused(tmp_path: Path, make: Callable[[h5py.File], None]) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        make(file)
    for read in (*readers(), Record.read):
        with pytest.raises(StudyError, match="which uqmbd does not support|the dataset has no variables"):
            read(tmp_path / "a.nc")


TEXTS = ["not json", 5, "7", '["study"]', "[" * 30_000, "x", 3, "null", '{"a": 1}', "9" * 5000, b"\xff\xfe", "[[1]]"]


@pytest.mark.parametrize(
    "place",
    ["/", *(pytest.param(place, marks=pytest.mark.thorough) for place in ("m/statistics", "m/statistics/mean"))],
)
@pytest.mark.parametrize(
    "name", ["uqmbd_json_attributes", "uqmbd_children", "schema_version", "_FillValue", "scale_factor"]
)
def test_damaged_attributes_are_one_message_or_none(tmp_path: Path, place: str, name: str) -> None:
    path = save(tree(), tmp_path / "a.nc")
    for value in TEXTS[::3] if place == "/" else TEXTS:
        with h5py.File(path, "r+") as file:
            file[place].attrs[name] = value
        for read in readers():
            try:
                with read(path) as found:  # type: ignore[attr-defined]  # the readers of the table return trees or open files
                    assert "mean" in found["m/statistics"]
            except StudyError as error:
                assert len(str(error)) < 1000
            except UnicodeWarning:
                pass  # xarray warns of bytes that are no text


def test_units_that_resemble_dates_are_units(tmp_path: Path) -> None:
    given = tree()
    given["m/statistics/mean"].attrs["units"] = "days since 2000-01-01"
    for path in (save(given, tmp_path / "a.nc"), stored_as_zarr(given, tmp_path / "a.zarr")):
        found = load(path)
        assert found.identical(given) and found["m/statistics/mean"].dtype == float
        with uqmbd.results.open(path) as opened:
            assert opened.load().identical(given)


def test_dates_are_not_stored(tmp_path: Path) -> None:
    for kind in ("datetime64[ns]", "timedelta64[ns]"):
        dates = xr.DataTree(xr.Dataset({"x": ("time", np.zeros(2).astype(kind))}))
        with pytest.raises(StudyError, match="'x' contains dates or durations"):
            save(dates, tmp_path / "a.nc")


def test_results_are_read_where_they_fit_into_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save(tree(), tmp_path / "a.nc")
    monkeypatch.setattr(os, "sysconf", lambda name: 1)
    with pytest.raises(StudyError, match="this computer has .*results.open"):
        load(path)
    with uqmbd.results.open(path) as opened:
        assert float(opened["m/statistics/mean"].sum()) == 6
