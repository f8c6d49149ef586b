"""Samples in a Zarr folder: what another reader finds in it, what is refused, and what is damaged."""

from __future__ import annotations

import json
import os
import pickle
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.errors import StudyError
from uqmbd.extend import labels, sample_dataset
from uqmbd.results import SampleStore
from uqmbd.results.storage import UnfinishedStore
from uqmbd.results.storage.journal import Journal


def samples_of(count: int, outputs: int = 2, times: int | None = 5, inputs: int = 1, seed: int = 0) -> xr.Dataset:
    """Make samples of which every seventh failed."""
    rng = np.random.default_rng(seed)
    axes = labels(
        [(f"x{k}", "m", 360.0 * k) for k in range(outputs)],
        [(f"k{k}", "N/m") for k in range(inputs)],
        None if times is None else np.linspace(0, 1, times),
    )
    status = np.where(np.arange(count) % 7 == 3, 2, 0)
    messages = [f"sample {k} failed: \N{GREEK SMALL LETTER LAMDA}" if s else "" for k, s in enumerate(status)]
    response = rng.normal(size=(count, *axes.shape))
    return sample_dataset(response, rng.normal(size=(count, inputs)), axes, status=status, messages=messages)


@pytest.mark.thorough
@settings(max_examples=15, deadline=None)
@given(
    count=st.integers(1, 60),
    outputs=st.integers(1, 3),
    times=st.sampled_from([None, 1, 4]),
    inputs=st.integers(1, 3),
    size=st.sampled_from([1, 3, 16, 64]),
)
def test_xarray_reads_what_was_written(
    tmp_path_factory: pytest.TempPathFactory, count: int, outputs: int, times: int | None, inputs: int, size: int
) -> None:
    samples = samples_of(count, outputs, times, inputs)
    store = SampleStore.write(tmp_path_factory.mktemp("s") / "a-samples.zarr", samples, size)
    found = xr.load_dataset(store.folder, engine="zarr")
    for name in ("response", "inputs", "status", "message"):
        assert found[name].dims == samples[name].dims
        np.testing.assert_array_equal(found[name], samples[name])
    for name in ("output", "output_units", "input", "input_units", "time"):
        assert (name in found.coords) == (name in samples.coords)
        if name in samples.coords:
            np.testing.assert_array_equal(found[name], samples[name])
    for _ in range(2):
        parts = list(store.chunks())
        assert [part.first for part in parts] == list(range(0, count, size)) and len(store) == count
        np.testing.assert_array_equal(np.concatenate([p.response for p in parts]), samples["response"])
        np.testing.assert_array_equal(np.concatenate([p.good for p in parts]), samples["status"] == 0)
    one = [part.response for part in store.chunks([f"x{outputs - 1}"])]
    np.testing.assert_array_equal(np.concatenate(one), samples["response"][:, [-1]])


@pytest.fixture
def store(tmp_path: Path) -> SampleStore:
    return SampleStore.write(tmp_path / "a-samples.zarr", samples_of(50), size=16)


def test_missing_chunk_is_refused(store: SampleStore) -> None:
    path = store.folder / "response" / "2.0.0"
    path.unlink()
    with pytest.raises(StudyError, match="chunks are missing"):
        SampleStore.open(store.folder)
    with pytest.raises(StudyError, match=r"2\.0\.0 is missing"):
        list(store.chunks())


@pytest.mark.parametrize("damage", [b"", b"short", None], ids=["empty", "short", "half"])
def test_damaged_chunk_is_named(store: SampleStore, damage: bytes | None) -> None:
    path = store.folder / "response" / "1.0.0"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2] if damage is None else damage)
    with pytest.raises(StudyError, match=r"1\.0\.0 is damaged"):
        list(store.chunks())


def flip(path: Path, bit: int) -> None:
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


@pytest.mark.parametrize("name", ["response/1.0.0", "inputs/0.0", "status/0", "message/0"])
def test_every_flipped_bit_is_noticed_by_every_reader(store: SampleStore, name: str) -> None:
    """Blosc takes many of them for other numbers; those of a checksum are found by its own definition."""
    path = store.folder / name
    variable = name.partition("/")[0]
    size = 8 * path.stat().st_size
    for bit in [0, 31, 32, *range(8 * 24, size, size // 20), size - 1]:
        flip(path, bit)
        with pytest.raises(StudyError, match=rf"{path.name} is damaged: .*run the study again"):
            store.read(variable, 16, 32)
        if bit % 5 == 0:
            with (
                xr.open_zarr(store.folder, chunks=None, consolidated=True) as found,
                pytest.raises(RuntimeError, match="checksum"),
            ):
                found[variable].load()
        flip(path, bit)
    assert len(store.read(variable, 16, 32)) == 16


def test_a_flipped_bit_of_the_axes_is_noticed(store: SampleStore) -> None:
    for name in ("time/0", "output/0", "input_units/0"):
        flip(store.folder / name, 200)
        with pytest.raises(StudyError, match=rf"{name} is damaged"):
            SampleStore.open(store.folder)
        flip(store.folder / name, 200)
    SampleStore.open(store.folder)


def test_length_that_a_chunk_states_is_not_trusted(store: SampleStore) -> None:
    path = store.folder / "response" / "1.0.0"
    content = bytearray(path.read_bytes())
    content[8:12] = (2**31 - 1).to_bytes(4, "little")
    content[:4] = zlib.crc32(content[4:]).to_bytes(4, "little")
    path.write_bytes(bytes(content))
    with pytest.raises(StudyError, match=r"1\.0\.0 is damaged: its length"):
        list(store.chunks())


def test_outputs_that_there_are_not_are_refused(store: SampleStore) -> None:
    with pytest.raises(StudyError, match="no output 'y'; its outputs are x0, x1"):
        store.chunks(["y"])


def test_foreign_codecs_and_links_are_refused_before_anything_runs(store: SampleStore, tmp_path: Path) -> None:
    class Bad:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(tmp_path / "ran"),)

    about = store.folder / "message" / ".zarray"
    whole = about.read_text()
    about.write_text(json.dumps(json.loads(whole) | {"dtype": "|O", "filters": [{"id": "pickle"}]}))
    (store.folder / "message" / "0").write_bytes(pickle.dumps(Bad()))
    with pytest.raises(StudyError, match="codec 'pickle'"):
        SampleStore.open(store.folder)
    about.write_text(whole)
    (store.folder / "response" / "0.0.0").unlink()
    (store.folder / "response" / "0.0.0").symlink_to("1.0.0")
    with pytest.raises(StudyError, match="is a link"):
        SampleStore.open(store.folder)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    "wrong", [{"chunks": [8, 2, 5]}, {"dtype": "<f4"}, {"order": "F"}, {"compressor": None}, {"filters": None}]
)
def test_other_layouts_are_refused(store: SampleStore, wrong: dict[str, object]) -> None:
    about = store.folder / "response" / ".zarray"
    about.write_text(json.dumps(json.loads(about.read_text()) | wrong))
    with pytest.raises(StudyError, match="another layout|cannot be read"):
        SampleStore.open(store.folder)


def test_what_is_no_store_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="is not a sample store; expected the folder"):
        SampleStore.open(tmp_path / "nothing.zarr")
    (tmp_path / "bad.zarr").mkdir()
    with pytest.raises(StudyError, match="is damaged, or is not a sample store"):
        SampleStore.open(tmp_path / "bad.zarr")


@pytest.mark.parametrize("about", [[1], {"x": 1}, {"number": "a"}, {"number": 99}])
def test_a_record_that_says_nothing_is_passed_over(tmp_path: Path, about: Any) -> None:
    """Whole by its checksum, and none of those that are written."""
    axes = labels(["x"], ["k"], [0.0])
    store = UnfinishedStore(tmp_path, tmp_path / "unfinished", None, "name", 10, 5, axes)
    store.keep(0, None, {"checksum": 1}, {})
    Journal(tmp_path / "unfinished" / "name.journal").append(about, {})
    again = UnfinishedStore(tmp_path, tmp_path / "unfinished", None, "name", 10, 5, axes)
    assert [again.record(number) is not None for number in range(2)] == [True, False]


@pytest.mark.parametrize("place", [".zmetadata", "response/.zarray", "output/0"])
def test_metadata_that_is_damaged_is_written_again_and_costs_no_chunk(tmp_path: Path, place: str) -> None:
    """As after a power failure: a store that goes on with it would be complete, and could not be opened."""

    def begun() -> UnfinishedStore:
        return UnfinishedStore(tmp_path, tmp_path / "unfinished", "all.zarr", "name", 4, 4, labels(["x"], ["k"], [0.0]))

    response = np.arange(4.0).reshape(4, 1, 1)
    store = begun()
    checksum, content = store.shelf(0).put(response)
    store.keep(0, content, {"checksum": checksum}, {})
    (tmp_path / "unfinished" / "name.zarr" / place).write_bytes(b"{")
    store = begun()
    found = store.shelf(0, checksum).load(4)
    assert found is not None and np.array_equal(found, response)
    store.fill(np.zeros((4, 1)), np.zeros(4, dtype=int), [""] * 4)
    store.finish()
    again = SampleStore.open(tmp_path / "all.zarr")
    assert [o.name for o in again.labels.outputs] == ["x"]
    assert np.array_equal(np.concatenate([part.response for part in again.chunks()]), response)
