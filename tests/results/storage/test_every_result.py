"""Results are saved, loaded and opened as they are: to the bit, with their attributes."""

from __future__ import annotations

import warnings
from pathlib import Path

import chaospy
import h5py
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.results import load, save
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

TIMES = np.linspace(0, 1, 11)


def same(tree: xr.DataTree, found: xr.DataTree, *, order: bool = True) -> None:
    """Compare all that two trees hold, numbers by their bits."""
    paths = [[node.path for node in one.subtree] for one in (tree, found)]
    assert paths[0] == paths[1] if order else sorted(paths[0]) == sorted(paths[1])
    for node in tree.subtree:
        one, other = node.to_dataset(inherit=False), found[node.path].to_dataset(inherit=False)
        xr.testing.assert_identical(one, other)
        assert {key: type(value) for key, value in one.attrs.items()} == {
            key: type(value) for key, value in other.attrs.items()
        }
        for name, variable in one.variables.items():
            again = other.variables[name]
            assert again.dtype.kind == variable.dtype.kind
            if variable.dtype.kind != "U":
                assert again.dtype == variable.dtype and again.values.tobytes() == variable.values.tobytes(), name


def check(tree: xr.DataTree, folder: Path) -> None:
    path = save(tree, folder / "results.nc")
    found = load(path)
    assert found.encoding["digest"] == "verified"
    same(tree, found)
    with h5py.File(path) as file:
        plain: list[str] = []

        def note(name: str, one: h5py.Group | h5py.Dataset) -> None:
            if isinstance(one, h5py.Dataset) and one.size and one.shape and not one.fletcher32:
                if b"netCDF dimension but not" not in bytes(np.bytes_(one.attrs.get("NAME", b""))):
                    plain.append(name)

        file.visititems(note)
    assert plain == []
    pytest.importorskip("dask")
    with uqmbd.results.open(path) as opened:
        assert opened.encoding["digest"] == "verified"
        if not any("all_samples" in node.attrs for node in tree.subtree):
            same(tree, opened.load())
    tree.to_netcdf(folder / "xarray.nc", engine="h5netcdf")
    other = load(folder / "xarray.nc")
    assert other.encoding["digest"] == "not verified"
    assert [node.path for node in other.subtree] == [node.path for node in tree.subtree]


def stone() -> uqmbd.Mechanism:
    """A stone with a summary, an event that some realisations do not reach, an angle and three requirements."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
    push = uqmbd.RandomVariable("push", chaospy.Uniform(0, 0.2), units="m")
    body = mechanism.body("stone", mass=1, position=push, velocity=speed)
    way = body.position[0]
    mechanism.output("way", way, units="m")
    mechanism.output("turn", 7 * way, units="rad", angle=True)
    mechanism.output("most", uqmbd.maximum(way), units="m")
    mechanism.output("passed", uqmbd.first_time(way >= 1.1), units="s")
    mechanism.require("short", way <= 1.3)
    mechanism.require("slow", uqmbd.maximum(way) <= 1.2)
    return mechanism


def results_of(study: uqmbd.Study, folder: Path) -> xr.DataTree:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what some methods cannot do, and how coarse they are
        return study.run(folder=folder)


@pytest.mark.slow
def test_results_of_two_methods_with_a_requirement(tmp_path: Path) -> None:
    methods = [MonteCarlo(samples=20, seed=1), Collocation(order=2)]
    tree = results_of(uqmbd.Study("stone", stone(), TIMES, methods), tmp_path)
    check(tree, tmp_path)
    for form in (2, 3):
        # of consolidated metadata in format 3 zarr warns
        tree.to_zarr(tmp_path / f"{form}.zarr", zarr_format=form, consolidated=False)
        same(tree, load(tmp_path / f"{form}.zarr"), order=False)
