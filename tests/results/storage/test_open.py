"""Results that are opened, not read: all samples as arrays of Dask, and what is refused before anything runs."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from tests.results.old_zarr import stored_as_zarr
from uqmbd.errors import StudyError, StudyWarning
from uqmbd.extend import labels, sample_dataset
from uqmbd.results import SampleStore, load, save
from uqmbd_joints import Distance
from uqmbd_montecarlo import MonteCarlo

pytest.importorskip("dask")

SAMPLES, KEEP = 300, 100


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a study with outputs over time and without, and more samples than are kept."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
    bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(0.2, 0))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=length))
    mechanism.output("x", bob.position[0], units="m")
    mechanism.output("most", uqmbd.maximum(bob.position[0]), units="m")
    study = uqmbd.Study("swing", mechanism, np.linspace(0, 0.1, 3), [MonteCarlo(samples=SAMPLES, seed=3, keep=KEEP)])
    folder = tmp_path_factory.mktemp("out")
    save(study.run(folder=folder), folder / "results.nc")
    return folder


@pytest.fixture
def folder(run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(run, tmp_path / "out"))


@pytest.mark.parametrize("ending", [".nc", ".zarr"])
def test_opened_results_are_those_that_are_loaded_with_all_samples(folder: Path, ending: str) -> None:
    loaded = load(folder / "results.nc")
    path = folder / f"results{ending}"
    if ending == ".zarr":
        stored_as_zarr(loaded, path)
    with uqmbd.results.open(path) as opened:
        assert [node.path for node in opened.subtree] == [node.path for node in loaded.subtree]
        for node in opened.subtree:
            found, expected = node.to_dataset(inherit=False), loaded[node.path].to_dataset(inherit=False)
            if node.name == "samples":
                assert found.sizes["sample"] == SAMPLES and found["response"].dims == expected["response"].dims
                assert found["response"].chunks is not None
                found = found.isel(sample=slice(KEEP))
            xr.testing.assert_identical(found.compute(), expected)
        for name in ("monte-carlo", "monte-carlo/scalars"):
            mean = opened[f"{name}/samples"]["response"].mean("sample").values
            np.testing.assert_allclose(mean, loaded[f"{name}/statistics"]["mean"], rtol=1e-12)


def test_samples_that_are_elsewhere_are_reported(folder: Path) -> None:
    shutil.rmtree(folder / "monte-carlo-samples.zarr")
    with (
        pytest.warns(StudyWarning, match="is not in the folder of the result"),
        uqmbd.results.open(folder / "results.nc") as opened,
    ):
        assert opened["monte-carlo/samples"].sizes["sample"] == KEEP


@pytest.mark.parametrize("variable", ["response", "inputs"])
def test_a_chunk_that_is_missing_is_reported_though_their_number_is_right(folder: Path, variable: str) -> None:
    """Zarr reads what is missing as NaN, which means leave out."""
    chunk = sorted((folder / "monte-carlo-samples.zarr" / variable).glob("[0-9]*"))[-1]
    chunk.rename(chunk.with_name(f"9{chunk.name}"))
    with pytest.raises(StudyError, match="missing"):
        uqmbd.results.open(folder / "results.nc")


def test_a_first_chunk_that_is_damaged_is_reported(folder: Path) -> None:
    (folder / "monte-carlo-samples.zarr" / "response" / "0.0.0").write_bytes(bytes(1000))
    with pytest.raises(StudyError, match="damaged"):
        uqmbd.results.open(folder / "results.nc")


def test_samples_of_another_run_are_not_taken_for_those_of_the_result(folder: Path) -> None:
    """Same name, layout, outputs; other inputs, or other responses of the same inputs."""
    samples = xr.load_dataset(folder / "monte-carlo-samples.zarr", engine="zarr")
    for name in ("inputs", "response"):
        other = samples.assign({name: samples[name] * (1 + 1e-12)})
        SampleStore.write(folder / "monte-carlo-samples.zarr", other)
        with pytest.warns(StudyWarning, match="another run"), uqmbd.results.open(folder / "results.nc") as opened:
            assert opened["monte-carlo/samples"].sizes["sample"] == KEEP


def test_samples_of_a_longer_run_of_the_same_seed_are_not_taken_for_those_of_the_result(folder: Path) -> None:
    """They begin alike, to the bit."""
    samples = xr.load_dataset(folder / "monte-carlo-samples.zarr", engine="zarr")
    SampleStore.write(folder / "monte-carlo-samples.zarr", xr.concat([samples, samples], "sample"))
    with pytest.warns(StudyWarning, match="another run"), uqmbd.results.open(folder / "results.nc") as opened:
        assert opened["monte-carlo/samples"].sizes["sample"] == KEEP


def test_a_chunk_that_is_cut_off_or_taken_away_is_named_when_it_is_read(folder: Path) -> None:
    chunk = folder / "monte-carlo-samples.zarr" / "response" / "0.0.0"
    content = chunk.read_bytes()
    with uqmbd.results.open(folder / "results.nc") as opened:
        response = opened["monte-carlo/samples"]["response"]
        chunk.write_bytes(content[: len(content) // 2])
        with pytest.raises(StudyError, match=r"response.0\.0\.0 is damaged"):
            response.mean().compute()
        chunk.unlink()
        with pytest.raises(StudyError, match=r"response.0\.0\.0 is missing"):
            response.mean().compute()


def test_samples_alone_are_no_result(folder: Path) -> None:
    for read in (uqmbd.results.open, load):
        with pytest.raises(StudyError, match="contains samples of a method"):
            read(folder / "monte-carlo-samples.zarr")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
def test_who_may_read_the_results_may_read_the_samples(folder: Path) -> None:
    """A store and its files are as open to others as the result beside it."""
    open_to = (folder / "results.nc").stat().st_mode & 0o777
    assert {p.stat().st_mode & 0o777 for p in (folder / "monte-carlo-samples.zarr").rglob("*") if p.is_file()} == {
        open_to
    }


@pytest.mark.parametrize(("count", "times"), [(17_000, 400), (9_000, 700)])
def test_chunks_of_inputs_and_of_responses_need_not_begin_at_the_same_samples(
    tmp_path: Path, count: int, times: int
) -> None:
    """More samples than are read at once; warnings are errors here."""
    values = np.arange(float(count))
    axes = labels([("x", "m")], ["length"], np.linspace(0, 1, times))
    store = SampleStore.create(tmp_path / "all.zarr", count, 512, axes)
    for k in range(0, count, 512):
        store.put("response", k, np.broadcast_to(values[k : k + 512, None, None], (len(values[k : k + 512]), 1, times)))
    store.put("inputs", 0, values[:, None])
    kept = sample_dataset(np.broadcast_to(values[:9, None, None], (9, 1, times)), values[:9, None], axes)
    tree = xr.DataTree.from_dict({"one/samples": kept})
    tree["one"].attrs["all_samples"] = "all.zarr"
    save(tree, tmp_path / "results.nc")
    with uqmbd.results.open(tmp_path / "results.nc") as opened:
        data = opened["one/samples"].to_dataset()
        assert len(data.chunks["sample"]) > 1
        difference = data["inputs"].isel(input=0, drop=True) - data["response"].isel(output=0, time=-1, drop=True)
        assert difference.sizes["sample"] == count and float(abs(difference).max()) == 0.0


def test_samples_of_earlier_versions_open(folder: Path) -> None:
    """They are in a netCDF file."""
    tree = load(folder / "results.nc")
    path = folder / "monte-carlo-samples.zarr"
    samples = xr.load_dataset(path, engine="zarr").drop_attrs(deep=False)
    samples.to_netcdf(folder / "monte-carlo-samples.nc", engine="h5netcdf")
    shutil.rmtree(path)
    tree["monte-carlo"].attrs["all_samples"] = "monte-carlo-samples.nc"
    save(tree, folder / "results.nc")
    with uqmbd.results.open(folder / "results.nc") as opened:
        found = opened["monte-carlo/samples"].to_dataset()
        assert found["response"].chunks is not None
        np.testing.assert_array_equal(found["response"], samples["response"])


@pytest.mark.parametrize("name", ["../out/monte-carlo-samples.zarr", "/tmp", "..", ""])
def test_samples_are_not_looked_for_elsewhere(folder: Path, name: str) -> None:
    tree = load(folder / "results.nc")
    tree["monte-carlo"].attrs["all_samples"] = name
    save(tree, folder / "results.nc")
    with pytest.raises(StudyError, match="expected the name of a store next to the result"):
        uqmbd.results.open(folder / "results.nc")


def test_foreign_codecs_links_and_holes_are_refused(folder: Path) -> None:
    store = folder / "monte-carlo-samples.zarr"
    about = store / "response" / ".zarray"
    whole = about.read_text()
    about.write_text(json.dumps(json.loads(whole) | {"filters": [{"id": "pickle"}]}))
    with pytest.raises(StudyError, match="codec 'pickle'"):
        uqmbd.results.open(folder / "results.nc")
    about.write_text(whole)
    (store / "response" / "0.0.0").rename(store / "elsewhere")
    with pytest.raises(StudyError, match="chunks are missing"):
        uqmbd.results.open(folder / "results.nc")
    (store / "response" / "0.0.0").symlink_to(store / "elsewhere")
    with pytest.raises(StudyError, match="is a link"):
        uqmbd.results.open(folder / "results.nc")


MANY = """
import resource, sys, uqmbd.results, xarray, dask.array, zarr
from uqmbd.results.storage.sample_store import SampleStore
small = uqmbd.results.open(sys.argv[1])
before, chunks = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, []
read = SampleStore.read
SampleStore.read = lambda *given: chunks.append(1) or read(*given)
tree = uqmbd.results.open(sys.argv[2])
opened = len(chunks)
response = tree["monte-carlo/samples"]["response"]
mean = float(response.mean())
print(response.sizes["sample"], response.nbytes, opened, mean, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="kilobytes of memory are those of Linux")
def test_ten_million_realisations_open_unread_and_stream(folder: Path, tmp_path: Path) -> None:
    """A store of 1.6 GB whose chunks are names of one file: `open` reads none, the mean less than 400 MB."""
    count, size = 10_000_000, 512
    many = Path(shutil.copytree(folder, tmp_path / "many"))
    shutil.rmtree(many / "monte-carlo-samples.zarr")
    axes = labels([("x", "m")], ["length"], np.linspace(0, 0.1, 20))
    store = SampleStore.create(many / "monte-carlo-samples.zarr", count, size, axes)
    store.put("response", 0, np.full((size, 1, 20), 0.25))
    store.put("inputs", 0, np.ones((store.block, 1)))
    tree = load(folder / "results.nc")
    tree["monte-carlo/samples"] = xr.DataTree(sample_dataset(np.full((KEEP, 1, 20), 0.25), np.ones((KEEP, 1)), axes))
    tree["monte-carlo"].attrs["all_samples_count"] = count
    save(tree, many / "results.nc")
    for name, step in (("response", size), ("inputs", store.block)):
        for k in range(1, -(-count // step)):
            os.link(store.place(name, 0), store.place(name, k))
    command = [sys.executable, "-c", MANY, str(folder / "results.nc"), str(many / "results.nc")]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    assert int(said[0]) == count and int(said[1]) == 8 * 20 * count
    assert int(said[2]) == 0, "chunks that are read to open it"
    assert float(said[3]) == 0.25
    assert int(said[4]) < 400_000, "kilobytes more than before"


def test_what_is_opened_is_saved_with_its_numbers(tmp_path: Path) -> None:
    save(xr.DataTree(xr.Dataset({"x": ("n", np.arange(5.0))})), tmp_path / "a.nc")
    with uqmbd.results.open(tmp_path / "a.nc") as opened:
        save(opened, tmp_path / "b.nc")
    assert load(tmp_path / "b.nc")["x"].values.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
