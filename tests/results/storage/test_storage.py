"""Round trips through netCDF, results that are in Zarr, and what happens when one goes wrong."""

from __future__ import annotations

import functools
import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
import pytest
import xarray as xr

from tests.results.old_zarr import stored, stored_as_zarr
from uqmbd import results
from uqmbd.errors import StudyError
from uqmbd.results.storage import hdf5

MakeNode = Callable[..., xr.DataTree]

ENDINGS = [".nc", ".zarr"]


def _same_types(a: xr.DataTree, b: xr.DataTree) -> None:
    for one, other in zip(a.subtree, b.subtree, strict=True):
        assert one.path == other.path
        left, right = one.to_dataset(inherit=False), other.to_dataset(inherit=False)
        assert {k: v.dtype for k, v in left.variables.items()} == {k: v.dtype for k, v in right.variables.items()}
        assert set(left.coords) == set(right.coords)
        assert {k: type(v) for k, v in left.attrs.items()} == {k: type(v) for k, v in right.attrs.items()}


@pytest.mark.thorough
@pytest.mark.parametrize("ending", ENDINGS)
def test_round_trip_is_exact(study: xr.DataTree, tmp_path: Path, ending: str) -> None:
    """Numbers, NaN, text, units, attributes and their types come back; what was read can be saved again."""
    once = results.load(stored(study, tmp_path / f"a{ending}"))
    assert once.identical(study)
    _same_types(once, study)
    results.validate(once)
    twice = results.load(stored(once, tmp_path / f"a{ending}"))
    assert twice.identical(study)
    assert [p.name for p in tmp_path.iterdir()] == [f"a{ending}"]


@pytest.mark.thorough
def test_round_trip_through_format_3_is_exact(study: xr.DataTree, tmp_path: Path) -> None:
    """Numbers to the bit, text in the width that it takes."""
    path = stored_as_zarr(study, tmp_path / "a.zarr", zarr_format=3)
    assert (path / "zarr.json").is_file()
    once = results.load(path)
    assert once.identical(study)
    for one, other in zip(once.subtree, study.subtree, strict=True):
        assert one.path == other.path
        assert {k: type(v) for k, v in one.attrs.items()} == {k: type(v) for k, v in other.attrs.items()}
        for name, variable in other.variables.items():
            found = one.variables[name]
            assert found.dtype.kind == variable.dtype.kind
            if variable.dtype.kind != "U":
                assert found.dtype == variable.dtype and found.values.tobytes() == variable.values.tobytes()
    results.validate(once)
    if importlib.util.find_spec("dask"):
        with results.open(path) as opened:
            assert opened.load().identical(study)
    assert results.load(results.save(once, tmp_path / "a.nc")).identical(study)


@pytest.mark.parametrize("zarr_format", [2, 3])
def test_what_xarray_writes_is_read(tmp_path: Path, zarr_format: Literal[2, 3]) -> None:
    """Without our encoding: attributes of lists are arrays where they are of numbers."""
    pytest.importorskip("zarr")
    data = xr.Dataset(
        {"mean": (("output", "time"), [[0.1, np.nan], [np.inf, -0.0]], {"units": "m", "scale": np.array([1.5, 2.0])})},
        coords={"output": ["x", "Ü"], "time": [0.0, 1.0]},
        attrs={"names": ["a", "b"], "many": [[1], [2, 3]], "flag": True, "number": 7, "one": np.array([2.5])},
    )
    data["output"].encoding = {"dtype": "O"}
    tree = xr.DataTree.from_dict({"/": xr.Dataset(attrs={"study": "s"}), "m/statistics": data, "a": xr.Dataset()})
    tree.to_zarr(tmp_path / "a.zarr", zarr_format=zarr_format, consolidated=False)
    found = results.load(tmp_path / "a.zarr")
    assert found.identical(tree)
    assert found["m/statistics/mean"].values.tobytes() == data["mean"].values.tobytes()
    attrs, expected = found["m/statistics"].attrs, data.attrs
    assert {k: type(v) for k, v in attrs.items()} == {k: type(v) for k, v in expected.items()}
    assert list(found.children) == ["a", "m"]  # xarray stores no order


def test_zarr_is_written_by_xarray(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"a.zarr.*; expected a path that ends in .nc .netCDF.*tree.to_zarr\("):
        results.save(xr.DataTree(), tmp_path / "a.zarr")
    assert not list(tmp_path.iterdir())


def _objects(path: Path) -> list[object]:
    """What an HDF5 file holds: objects with their types, shapes, chunks, dimension scales and attributes, in order."""
    found: list[object] = []

    def note(name: str, one: h5py.Group | h5py.Dataset) -> None:
        attrs = {k: str(v) for k, v in one.attrs.items() if k not in ("REFERENCE_LIST", "DIMENSION_LIST")}
        found.append((name, type(one), attrs))
        if isinstance(one, h5py.Dataset):
            scales = [list(dimension.keys()) for dimension in one.dims]
            found.append((one.dtype, one.shape, one.maxshape, one.chunks, one.compression, scales))

    with h5py.File(path) as file:
        file.visititems(note)
        found.append({k: str(v) for k, v in file.attrs.items()})
    return found


def test_file_that_looks_objects_up_once_is_that_of_h5netcdf(
    study: xr.DataTree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Written through plain h5py there is the same in it; coordinates take the places of the scales of dimensions."""
    results.save(study, tmp_path / "once.nc")
    plain = functools.partial(h5py.File, track_order=True, libver=("v110", "v110"))
    monkeypatch.setattr(hdf5, "remembering", lambda: plain)
    results.save(study, tmp_path / "always.nc")
    assert _objects(tmp_path / "once.nc") == _objects(tmp_path / "always.nc")
    assert len(_objects(tmp_path / "once.nc")) > 100


@pytest.mark.parametrize("ending", ENDINGS)
def test_round_trip_of_awkward_things(tmp_path: Path, ending: str) -> None:
    """Empty text, unicode, empty arrays, huge integers, lists, truth values, None and long attributes survive."""
    attrs = {
        "empty": "",
        "unicode": "Größe ° µ 力 \n second line",
        "seed": 2**127 + 1,
        "flag": True,
        "nothing": None,
        "nan": float("nan"),
        "number": 3,
        "real": 1.5,
        "one": [1],
        "many": [1.0, 2.0],
        "texts": ["a", "ü"],
        "nested": {"a": [1, {"b": ""}]},
        "long": "x" * 200_000,
        "array": np.array([1, 2, 3]),
    }
    data = xr.Dataset(
        {
            "text": ("sample", np.array(["", "ü 力", " space "])),
            "all_empty": ("sample", np.array(["", "", ""])),
            "none": ("nobody", np.zeros(0)),
            "truth": ("sample", np.array([True, False, True])),
            "big": (("sample", "time"), np.random.default_rng(0).normal(size=(3, 5000))),
            "single": ((), 2.5),
            "inf": ("sample", np.array([np.inf, -np.inf, np.nan])),
            "small": ("sample", np.array([1, 2, 3], dtype=np.int16), {"flag_values": np.array([0, 1, 2])}),
        },
        coords={
            "output_units": ("sample", np.array(["m", "", "s"])),
            "time": ("time", np.arange(5000.0), {"units": "s"}),
        },
        attrs=attrs,
    )
    tree = xr.DataTree.from_dict({"/": xr.Dataset(attrs={"study": "ü"}), "monte carlo $1/statistics": data})
    back = results.load(stored(tree, tmp_path / f"a{ending}"))
    found = back["monte carlo $1/statistics"].to_dataset()
    xr.testing.assert_equal(found, data)
    assert {k: v.dtype for k, v in found.variables.items()} == {k: v.dtype for k, v in data.variables.items()}
    assert np.isnan(found.attrs.pop("nan")) and np.isnan(attrs.pop("nan"))
    np.testing.assert_array_equal(found.attrs.pop("array"), attrs.pop("array"))
    assert found.attrs == attrs
    np.testing.assert_array_equal(found["small"].attrs["flag_values"], [0, 1, 2])


@pytest.mark.parametrize("ending", ENDINGS)
def test_units_in_words_stay_numbers(tmp_path: Path, ending: str) -> None:
    """A duration in seconds is no time stamp: it comes back as the number it was."""
    tree = xr.DataTree(xr.Dataset({"wall": ("method", [1.5, 2.5], {"units": "seconds"})}))
    assert results.load(stored(tree, tmp_path / f"a{ending}")).identical(tree)


def test_python_text_becomes_fixed_width(tmp_path: Path) -> None:
    """Text held as Python objects is stored; other objects are refused by name."""
    tree = xr.DataTree(xr.Dataset({"m": ("sample", np.array(["", "b"], dtype=object))}))
    assert results.load(results.save(tree, tmp_path / "a.nc")).equals(tree)
    with pytest.raises(StudyError, match="Variable 'm' contains Python objects"):
        results.save(xr.DataTree(xr.Dataset({"m": ("sample", np.array([{}], dtype=object))})), tmp_path / "b.nc")
    with pytest.raises(StudyError, match="Attribute 'a' of the dataset is a object"):
        results.save(xr.DataTree(xr.Dataset(attrs={"a": object()})), tmp_path / "b.nc")


@pytest.mark.thorough
def test_file_is_closed_after_loading(study: xr.DataTree, tmp_path: Path) -> None:
    """The data lives in memory: the file can go."""
    path = results.save(study, tmp_path / "deep" / "er" / "a.nc")
    tree = results.load(path)
    path.unlink()
    assert tree.identical(study)


@pytest.mark.thorough
def test_unusable_paths_are_named(tmp_path: Path, study: xr.DataTree, monkeypatch: pytest.MonkeyPatch) -> None:
    """Missing, damaged and unknown files, and a missing Zarr, are each one clear message."""
    with pytest.raises(StudyError, match="The result .* does not exist"):
        results.load(tmp_path / "none.nc")
    with pytest.raises(StudyError, match="ends in .nc"):
        results.save(study, tmp_path / "a.csv")
    with pytest.raises(StudyError, match="expected a path that ends in .nc"):
        results.load(tmp_path / "a.csv")
    (tmp_path / "bad.nc").write_bytes(b"not HDF5 at all")
    with pytest.raises(StudyError, match="damaged, or is not a result"):
        results.load(tmp_path / "bad.nc")
    (tmp_path / "bad.zarr").mkdir()
    with pytest.raises(StudyError, match="damaged, or is not a result"):
        results.load(tmp_path / "bad.zarr")
    whole = results.save(study, tmp_path / "a.nc").read_bytes()
    (tmp_path / "cut.nc").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(StudyError, match="damaged, or is not a result"):
        results.load(tmp_path / "cut.nc")
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyError, match="cannot be written"):
        results.save(study, tmp_path / "file" / "a.nc")
    monkeypatch.setitem(sys.modules, "dask.array", None)
    with pytest.raises(StudyError, match=r'pip install "uqmbd\[distributed\]"'):
        results.open(tmp_path / "a.nc")


@pytest.mark.thorough
def test_import_is_light() -> None:
    """Reading results loads neither Matplotlib nor Jinja."""
    code = (
        "import sys, uqmbd.results; sys.exit(bool({'matplotlib', 'jinja2', 'zarr', 'scipy.stats'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
