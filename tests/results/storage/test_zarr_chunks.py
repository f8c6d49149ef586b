"""Chunks of Zarr arrays that become larger than their arrays say are refused before they are decoded."""

from __future__ import annotations

import gzip
import itertools
import json
import random
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import uqmbd
from tests.results.old_zarr import stored_as_zarr
from uqmbd.errors import StudyError
from uqmbd.results import load
from uqmbd.results.storage.zarr_chunks import FIRST, LAST, Encoded, decoded_bytes

numcodecs = pytest.importorskip("numcodecs")
zarr = pytest.importorskip("zarr")

HUGE = 1 << 29
"""Bytes that a bomb becomes, beyond what any file may declare."""


def tree() -> xr.DataTree:
    data = xr.Dataset({"mean": ("time", np.arange(40.0)), "word": ("time", ["a", "b"] * 20)}, {"time": np.arange(40.0)})
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs={"study": "s"}), "m/statistics": data})


def _zeros(encode: Callable[[bytes], bytes]) -> bytes:
    """Encode in parts that are decoded as one."""
    return encode(bytes(HUGE))


def _gzip_in_parts(count: int) -> bytes:
    """Members of 16 MB that follow each other; the last one states its own length only."""
    return gzip.compress(bytes(1 << 24)) * count


BOMBS: dict[str, Callable[[], bytes]] = {
    "zstd": lambda: bytes(numcodecs.Zstd(level=1).encode(bytes(HUGE))),
    "blosc": lambda: bytes(numcodecs.Blosc("zstd", clevel=1).encode(bytes(HUGE))),
    "gzip": lambda: gzip.compress(bytes(HUGE), 1),
    "members of gzip": lambda: _gzip_in_parts(HUGE >> 24),
    "frames of zstd": lambda: (
        bytes(numcodecs.Zstd(level=1).encode(bytes(320))) + bytes(numcodecs.Zstd().encode(bytes(HUGE)))
    ),
}


def _codec(name: str, form: int) -> Any:
    kind = name.rpartition(" ")[2]
    if form == 2:
        return {
            "id": kind,
            **({"cname": "zstd", "clevel": 1, "shuffle": 1, "blocksize": 0} if kind == "blosc" else {"level": 1}),
        }
    configuration = {"zstd": {"level": 0, "checksum": False}, "gzip": {"level": 1}}
    return {
        "name": kind,
        "configuration": configuration.get(
            kind, {"typesize": 8, "cname": "zstd", "clevel": 1, "shuffle": "noshuffle", "blocksize": 0}
        ),
    }


def plant(folder: Path, form: int, name: str, array: str) -> None:
    """Put a bomb in the place of a chunk, with the codec that decodes it."""
    place = folder / "m/statistics" / array
    about = json.loads((place / ("zarr.json" if form == 3 else ".zarray")).read_text())
    if form == 3:
        about["codecs"] = [*about["codecs"][:1], _codec(name, form)]
    else:
        about["compressor"] = _codec(name, form)
        (folder / ".zmetadata").unlink(missing_ok=True)
    (place / ("zarr.json" if form == 3 else ".zarray")).write_text(json.dumps(about))
    (place / ("c/0" if form == 3 else "0")).write_bytes(BOMBS[name]())


CASES = [
    (form, name, array)
    for form, name, array in itertools.product((2, 3), BOMBS, ("mean", "word"))
    # gzip reaches a ratio that any file may have; of format 2 it was never written
    if "gzip" not in name or (form == 3 and array == "mean")
]


@pytest.mark.thorough
@pytest.mark.parametrize(("form", "name", "array"), CASES)
def test_bombs_are_refused_before_they_are_decoded(tmp_path: Path, form: Any, name: str, array: str) -> None:
    folder = stored_as_zarr(tree(), tmp_path / "a.zarr", form)
    assert load(folder).identical(tree())
    plant(folder, form, name, array)
    assert sum(one.stat().st_size for one in folder.rglob("*") if one.is_file()) < HUGE // 100
    tracemalloc.start()
    for read in (load, uqmbd.results.open):
        with pytest.raises(StudyError, match="the chunk m/statistics/.* is damaged or malicious"):
            read(folder)
    assert tracemalloc.get_traced_memory()[1] < 1 << 26
    tracemalloc.stop()


def test_a_chunk_that_is_compressed_twice_is_refused(tmp_path: Path) -> None:
    folder = stored_as_zarr(tree(), tmp_path / "a.zarr", 3)
    place = folder / "m/statistics/mean"
    about = json.loads((place / "zarr.json").read_text())
    about["codecs"] = [about["codecs"][0], _codec("gzip", 3), _codec("gzip", 3)]
    (place / "zarr.json").write_text(json.dumps(about))
    (place / "c/0").write_bytes(gzip.compress(gzip.compress(bytes(320))))
    with pytest.raises(StudyError, match="compressed more than once"):
        load(folder)


def _encoded(rng: random.Random) -> tuple[bytes, Encoded, int]:
    """Encode numbers as numcodecs and Zarr do, with a checksum or none; return the file, how, and its bytes."""
    size = rng.choice([1, 8, 320, 70_000, 400_000])
    content = rng.choice([bytes(size), rng.randbytes(size), (rng.randbytes(7) * size)[:size]])
    name = rng.choice(["zstd", "blosc", "gzip", ""])
    made = content
    if name == "zstd":
        made = bytes(numcodecs.Zstd(level=rng.choice([-3, 1, 9]), checksum=rng.random() < 0.5).encode(content))
    elif name == "blosc":
        made = bytes(numcodecs.Blosc(rng.choice(["lz4", "zstd", "zlib"]), shuffle=rng.choice([0, 1])).encode(content))
    elif name == "gzip":
        parts = rng.choice([[content], [content[: size // 2], content[size // 2 :]]])
        made = b"".join(map(gzip.compress, parts))
    codecs = (name,) if name else ()
    kind = rng.choice(["", FIRST, LAST])
    checksum = zlib.crc32(made).to_bytes(4, "little")
    made = checksum + made if kind == FIRST else made + checksum if kind == LAST else made
    return made, Encoded(((kind,) if kind else ()) + codecs, size), size


@pytest.mark.parametrize("count", [60, pytest.param(1500, marks=pytest.mark.thorough)])
def test_sound_chunks_are_taken_and_longer_ones_refused(tmp_path: Path, count: int) -> None:
    rng, path = random.Random(count), tmp_path / "0"
    for _ in range(count):
        content, how, size = _encoded(rng)
        path.write_bytes(content)
        sums = 4 * sum(codec in (FIRST, LAST) for codec in how.codecs)
        plain = not set(how.codecs) - {FIRST, LAST}
        assert decoded_bytes(path, how, size) == size + (sums if plain else 0)
        if size > 8:
            with pytest.raises(ValueError, match="exceed|expected at most"):
                decoded_bytes(path, Encoded(how.codecs, size - 5 - sums), size - 5 - sums)


def test_other_files_within_an_array_are_left_alone(tmp_path: Path) -> None:
    folder = stored_as_zarr(tree(), tmp_path / "a.zarr")
    (folder / "m/statistics/mean/.DS_Store").write_bytes(bytes(100_000))
    (folder / "m/statistics/mean/readme.txt").write_bytes(bytes(100_000))
    assert load(folder).identical(tree())
