"""Results say which schema they keep to: older ones are read, later ones are refused in a sentence."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from tests.results.old_zarr import stored as save
from uqmbd import results
from uqmbd.errors import StudyError

ENDINGS = [".nc", ".zarr"]


def stored(path: Path) -> int | None:
    """The version that a file states, read without uqmbd."""
    if path.suffix == ".nc":
        with h5py.File(path) as file:
            return int(np.ravel(file.attrs["schema_version"])[0]) if "schema_version" in file.attrs else None
    return json.loads((path / ".zattrs").read_text()).get("schema_version")


def state(path: Path, version: object) -> None:
    """Let a file state another version, or none."""
    if path.suffix == ".nc":
        with h5py.File(path, "a") as file:
            del file.attrs["schema_version"]
            if version is not None:
                file.attrs["schema_version"] = version
        return
    for name in (".zattrs", ".zmetadata"):
        about = json.loads((path / name).read_text())
        attrs = about if name == ".zattrs" else about["metadata"][".zattrs"]
        del attrs["schema_version"]
        if version is not None:
            attrs["schema_version"] = version
        (path / name).write_text(json.dumps(about))


@pytest.mark.thorough
@pytest.mark.parametrize("ending", ENDINGS)
def test_every_result_states_its_version(study: xr.DataTree, tmp_path: Path, ending: str) -> None:
    assert study.attrs["schema_version"] >= 1
    assert stored(save(study, tmp_path / f"a{ending}")) == study.attrs["schema_version"]
    plain = xr.DataTree(xr.Dataset({"x": ("sample", [1.0, 2.0])}))
    path = save(plain, tmp_path / f"b{ending}")
    assert stored(path) == study.attrs["schema_version"]
    assert results.load(path).identical(plain)


@pytest.mark.thorough
@pytest.mark.parametrize(("ending", "version"), [(".nc", None), (".zarr", 0)])
def test_results_of_earlier_versions_are_read(
    study: xr.DataTree, tmp_path: Path, ending: str, version: int | None
) -> None:
    path = save(study, tmp_path / f"a{ending}")
    state(path, version)
    old = results.load(path)
    results.validate(old)
    assert old["comparison"].identical(study["comparison"])
    assert results.load(results.save(old, tmp_path / "again.nc")).identical(old)


@pytest.mark.thorough
@pytest.mark.parametrize("ending", ENDINGS)
def test_results_of_later_versions_are_refused_and_say_what_reads_them(
    study: xr.DataTree, tmp_path: Path, ending: str
) -> None:
    path = save(study, tmp_path / f"a{ending}")
    version = int(study.attrs["schema_version"]) + 1
    state(path, version)
    with pytest.raises(StudyError, match=rf"a{ending}' has the schema version {version}; .*up to {version - 1}"):
        results.load(path)


@pytest.mark.parametrize("version", [-1, 1.5, "two", True])
def test_what_is_no_version_is_refused(study: xr.DataTree, version: object) -> None:
    odd = study.copy()
    odd.attrs = {**study.attrs, "schema_version": version}
    with pytest.raises(StudyError, match="expected a whole number"):
        results.validate(odd)
