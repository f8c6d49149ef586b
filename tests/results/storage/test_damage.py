"""A file that was changed is refused, or marked as not verified: never other numbers, no error but ours, no output."""

from __future__ import annotations

import gc
import random
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.errors import StudyError
from uqmbd.results import load, save
from uqmbd.results.storage import record, start_manifest

MakeNode = Callable[..., xr.DataTree]


@pytest.fixture(autouse=True)
def nothing_is_printed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """h5netcdf prints a traceback ("Exception ignored") where an object that it could not make goes away."""
    said: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda about: said.append(about.exc_value))
    yield
    gc.collect()
    assert not said


def small() -> xr.DataTree:
    """All kinds of variables: small, large, text, scalars, empty ones, in groups of groups."""
    generator = np.random.default_rng(0)
    inner = xr.Dataset(
        {
            "mean": (("output", "time"), generator.normal(size=(2, 40)), {"units": "m", "unknown": {"a": ["b"]}}),
            "large": (("output", "long"), np.cumsum(generator.integers(0, 9, (2, 20_000)), axis=1) / 8),
            "status": ("time", np.arange(40) % 3),
            "message": ("time", np.array(["", "größer", "a long message " * 9, ""] * 10)),
            "single": ((), 2.5),
            "word": ((), "text"),
            "none": ("nobody", np.zeros(0)),
        },
        coords={"output": ["x", "ü"], "time": np.linspace(0, 1, 40)},
        attrs={"options": '{"samples": 40}', "wall_time": 1.5, "flag": True, "names": ["a", "b"]},
    )
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs={"study": "s"}), "a/statistics": inner, "b": inner[["mean"]]})


def _plain(tree: xr.DataTree) -> xr.DataTree:
    """Leave out the attributes that netCDF does not know."""
    sets = {node.path: node.to_dataset(inherit=False).drop_attrs() for node in tree.subtree}
    return xr.DataTree.from_dict({path: data.assign_attrs(study="s") for path, data in sets.items()})


def changed(content: bytes, rng: random.Random) -> bytes:
    """Flip a bit, cut some bytes out, cut the end off, let it be zeros, or swap two blocks."""
    data, size = bytearray(content), len(content)
    kind = rng.choice(["flip"] * 5 + ["hole", "cut", "cut", "zeros", "swap", "swap", "swap"])
    if kind == "flip":
        bit = rng.randrange(8 * size)
        data[bit // 8] ^= 1 << bit % 8
    elif kind == "hole":
        begin = rng.randrange(size)
        del data[begin : begin + rng.randrange(1, 4000)]
    elif kind == "cut":
        del data[rng.randrange(size) :]
    elif kind == "zeros":
        count = rng.randrange(1, 5000)
        data[-count:] = bytes(count)
    else:
        block = rng.choice([count for count in (8, 64, 512, 4096) if count <= size])
        one, other = (rng.randrange(size // block) * block for _ in range(2))
        data[one : one + block], data[other : other + block] = data[other : other + block], data[one : one + block]
    return bytes(data)


def read(path: Path, how: str) -> xr.DataTree:
    if how == "load":
        return load(path)
    with uqmbd.results.open(path) as opened:
        return opened.load()


def counts(path: Path, number: int, seed: int, how: str, expected: xr.DataTree) -> Counter[str]:
    """Read changed files: how many were refused, were the same, or were others."""
    good, rng, found = path.read_bytes(), random.Random(seed), Counter[str]()
    target = path.with_name("changed.nc")
    for _ in range(number):
        content = changed(good, rng)
        if content == good:
            continue
        target.unlink(missing_ok=True)  # HDF5 shares what it has open, by its inode
        target.write_bytes(content)
        try:
            tree = read(target, how)
        except StudyError:
            found["refused"] += 1
        else:
            found["same" if tree.identical(expected) else "other"] += 1
    return found


@pytest.mark.parametrize(
    ("how", "number"),
    [
        ("load", 60),
        ("open", 20),
        pytest.param("load", 800, marks=pytest.mark.thorough),
        pytest.param("open", 400, marks=pytest.mark.slow),
        pytest.param("load", 5000, marks=pytest.mark.slow),
    ],
)
def test_no_change_of_a_file_leads_to_other_numbers(tmp_path: Path, how: str, number: int) -> None:
    tree = small()
    found = counts(save(tree, tmp_path / "a.nc"), number, number, how, tree)
    assert found["other"] == 0 and found["refused"] > 0.95 * number


@pytest.mark.slow
@pytest.mark.parametrize("form", ["xarray", "without digest", "classic"])
def test_changes_of_files_of_other_programs_are_no_raw_errors(tmp_path: Path, form: str) -> None:
    """These have no digest: what is read may be other numbers, and is marked."""
    tree, path = small(), tmp_path / "a.nc"
    if form == "xarray":
        _plain(tree).to_netcdf(path, engine="h5netcdf")
    elif form == "classic":
        _plain(tree)["b"].to_dataset(inherit=False).to_netcdf(path, engine="scipy")
    else:
        save(tree, path)
        with h5py.File(path, "r+") as file:
            file.attrs["note"] = "mine"
    assert load(path).encoding["digest"] == "not verified"
    found = counts(path, 300, 1, "load", load(path))
    assert found["refused"] > 30


def test_a_file_that_another_program_changed_is_read_and_marked(tmp_path: Path) -> None:
    path = save(small(), tmp_path / "a.nc")
    assert load(path).encoding["digest"] == "verified"
    with h5py.File(path, "r+") as file:
        file["b/mean"][0, 0] = 7
    found = load(path)
    assert found.encoding["digest"] == "not verified" and found["b/mean"].values[0, 0] == 7
    assert load(save(found, path)).encoding["digest"] == "verified"


@pytest.mark.parametrize("rest", [b"\0", bytes(1000), b"uqmbd", b'{"form": "padded by another program"}'])
def test_what_another_program_puts_after_its_data_is_left_alone(tmp_path: Path, rest: bytes) -> None:
    path = tmp_path / "a.nc"
    _plain(small()).to_netcdf(path, engine="h5netcdf")
    expected = load(path)
    path.write_bytes(path.read_bytes() + rest)
    found = load(path)
    assert found.identical(expected) and found.encoding["digest"] == "not verified"


def test_what_is_left_of_a_digest_is_refused(tmp_path: Path) -> None:
    """Wherever a file is cut within its digest, whatever is there instead, and where zeros take its place."""
    path = save(small(), tmp_path / "a.nc")
    content = path.read_bytes()
    end = content.index(b'{"form": "uqmbd digest')
    rng = random.Random(0)
    for cut in [end + 1, end + 9, len(content) - 1, *(rng.randrange(end + 1, len(content)) for _ in range(20))]:
        for rest in (b"", bytes(len(content) - cut), bytes(5000), rng.randbytes(100)):
            path.unlink()
            path.write_bytes(content[:cut] + rest)
            with pytest.raises(StudyError, match="is damaged"):
                load(path)
    path.unlink()
    path.write_bytes(content[:end] + bytes(len(content) - end))
    with pytest.raises(StudyError, match="after the end of its data are not a digest"):
        load(path)
    path.unlink()
    path.write_bytes(content[:end])  # as a program leaves it that changes the file
    assert load(path).encoding["digest"] == "not verified"


def test_other_programs_read_what_is_saved(tmp_path: Path) -> None:
    """Text, too, and notice damage of what has HDF5's checksum."""
    tree = small()
    path = save(tree, tmp_path / "a.nc")
    with xr.open_datatree(path, engine="h5netcdf") as found:
        assert found["a/statistics/message"].values.tolist() == tree["a/statistics/message"].values.tolist()
        np.testing.assert_array_equal(found["a/statistics/large"], tree["a/statistics/large"])
    with h5py.File(path) as file:
        begin = file["a/statistics/mean"].id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[begin + 9] ^= 1
    path.write_bytes(content)
    with h5py.File(path) as file, pytest.raises(OSError, match="filter"):
        file["a/statistics/mean"][...]


def test_open_does_not_read_large_variables(tmp_path: Path) -> None:
    """Damage in one is noticed by `load`; by `open` when it is computed with, and all else before."""
    path = save(small(), tmp_path / "a.nc")
    with h5py.File(path) as file:
        chunk = file["a/statistics/large"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 4
    path.write_bytes(content)
    with pytest.raises(StudyError, match="does not match its digest"):
        load(path)
    with uqmbd.results.open(path) as opened:
        assert opened.encoding["digest"] == "verified"
        assert float(opened["b/mean"].sum()) == pytest.approx(float(small()["b/mean"].sum()))
        with pytest.raises(StudyError, match=r"a.nc': /a/statistics/large cannot be read"):
            opened["a/statistics/large"].mean().compute()


def test_the_manifest_of_a_run_knows_its_files(make_node: MakeNode, tmp_path: Path) -> None:
    """One of an earlier version, without a digest, is verified by it; one that was changed is refused, with a way out."""
    tree = make_node("mine", samples=20)
    start_manifest(tmp_path)
    path = save(tree, tmp_path / "results.nc")
    tree.to_netcdf(path, engine="h5netcdf")
    with pytest.raises(
        StudyError, match="differs from the file that the manifest of the folder describes.*rename the file"
    ):
        load(path)
    record(tmp_path, ["results.nc"])
    assert load(path).encoding["digest"] == "verified"
    with h5py.File(path, "r+") as file:
        file.attrs["note"] = "mine"
    with pytest.raises(StudyError, match="differs from the file that the manifest of the folder describes"):
        load(path)
    shutil.move(path, tmp_path / "mine.nc")
    assert load(tmp_path / "mine.nc").encoding["digest"] == "not verified"
    # a result of another run, whole by its own digest
    save(tree, tmp_path / "other.nc")
    shutil.move(tmp_path / "other.nc", path)
    assert load(path).encoding["digest"] == "verified"
