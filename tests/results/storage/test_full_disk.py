"""A disk that is full, or a limit on files: which file, how to go on, and nothing half written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.errors import StudyError
from uqmbd.files import replacing, sweep
from uqmbd.results import load, save

pytest.importorskip("resource")

# A process of its own: HDF5 ends one that has a file open which it cannot write.
SCRIPT = """
import resource, sys
from pathlib import Path
import numpy as np, xarray as xr
from uqmbd.results import load, save

folder = Path(sys.argv[1])
noise = np.random.default_rng(0).normal(size=(20, 20_000))
tree = xr.DataTree.from_dict({"m/statistics": xr.Dataset({"mean": (("output", "time"), noise)}), "other": xr.Dataset()})
whole = load(save(xr.DataTree(xr.Dataset(attrs={"name": "old"})), folder / "r.nc"))
before = resource.getrlimit(resource.RLIMIT_FSIZE)
for limit in map(int, sys.argv[2:]):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        save(tree, folder / "r.nc")
        said = "nothing"
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert load(folder / "r.nc").identical(whole), "the file that was there"
    print(limit, said)
"""


@pytest.mark.thorough
def test_limit_on_files_is_reported_and_leaves_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "unfinished").mkdir()
    limits = [0, 3000, 100_000]
    command = [sys.executable, "-c", SCRIPT, str(tmp_path), *map(str, limits)]
    root = Path(uqmbd.__file__).parents[1]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    told = done.stdout.splitlines()
    assert len(told) == len(limits)
    for line in told:
        assert "StudyError: The result" in line
        assert "r.nc" in line and "File too large" in line and "unfinished" in line and "--resume" in line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.nc", "unfinished"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_full_disk_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every write fails as on a full disk."""
    real = Path.open

    def full(self: Path, mode: str = "r", *args: object, **kwargs: object) -> object:
        return real(Path("/dev/full") if "w" in mode else self, mode, *args, **kwargs)

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(StudyError, match="r.nc.*No space left on device"):
        save(xr.DataTree(xr.Dataset({"x": ("time", np.ones(3))})), tmp_path / "r.nc")
    assert os.listdir(tmp_path) == []


def test_numbers_that_are_written_so_are_those_that_were_given(tmp_path: Path) -> None:
    """Files are written by a handle of our own: large and small arrays, text, groups in groups."""
    generator = np.random.default_rng(1)
    sets = {
        f"a/b{k}/c": xr.Dataset(
            {"x": (("time", "row"), generator.normal(size=(n, 3))), "name": ("row", ["", "ü", "long" * n])},
            coords={"time": np.arange(float(n))},
            attrs={"long": "x" * 70_000},
        )
        for k, n in enumerate((1, 2, 70, 40_000))
    }
    tree = xr.DataTree.from_dict(sets)
    assert load(save(tree, tmp_path / "r.nc")).identical(tree)


def test_a_folder_that_cannot_be_replaced_is_left_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody reads in the old one, on a system that minds; or a process is killed between the two steps."""
    path = tmp_path / "a-samples.zarr"
    path.mkdir()
    (path / "old").write_text("old")
    real = os.replace

    def busy(source: Path, target: Path) -> None:
        if Path(source).name == "new":
            raise PermissionError(13, "somebody reads there")
        real(source, target)

    monkeypatch.setattr(os, "replace", busy)
    with pytest.raises(PermissionError, match="somebody reads there"), replacing(path) as part:
        part.mkdir()
    monkeypatch.undo()
    assert os.listdir(path) == ["old"] and os.listdir(tmp_path) == [path.name]
    moved = tmp_path / ".uqmbd-killed.part" / "old" / path.name
    moved.parent.mkdir(parents=True)
    (moved.parents[1] / "uqmbd").write_text("uqmbd writes here, and removes this folder.\n")
    path.rename(moved)
    sweep(tmp_path)
    assert os.listdir(path) == ["old"] and os.listdir(tmp_path) == [path.name]
