"""Somebody else's Zarr folder executes nothing: what `save` does not write is refused before it is opened."""

from __future__ import annotations

import json
import os
import pickle
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results import load, save

numcodecs = pytest.importorskip("numcodecs")
pytest.importorskip("zarr")

from numcodecs import registry  # noqa: E402 - after the check that the package is there

WRITTEN = ("blosc", "zstd", "crc32")
OTHERS = sorted((set(registry.codec_registry) | set(registry.entries)) - set(WRITTEN))


class Trap:
    """Leaves a trace where it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[object, tuple[str, ...]]:
        return os.mkdir, (str(self.trace),)


class Spy(numcodecs.abc.Codec):
    """Notes that it was made or asked."""

    codec_id = "uqmbd-spy"
    made: list[str] = []

    def __init__(self) -> None:
        self.made.append("made")

    def encode(self, buf: Any) -> Any:
        return buf

    def decode(self, buf: Any, out: Any = None) -> Any:
        self.made.append("asked")
        return buf


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A result as it was saved."""
    data = xr.Dataset(
        {
            "mean": (("output", "time"), np.ones((2, 6000))),
            "count": ("output", [1, 2]),
            "late": ("output", [True, False]),
        },
        coords={"output": ["a", "b"], "time": np.arange(6000.0)},
    )
    return save(
        xr.DataTree.from_dict({"/": xr.Dataset(attrs={"study": "s"}), "m/statistics": data}), tmp_path / "r.zarr"
    )


def change(
    folder: Path, array: str, changes: dict[str, Any], files: tuple[str, ...] = (".zarray", ".zmetadata")
) -> None:
    """Change the metadata of an array, in its own file, in the consolidated one, or in both."""
    own = folder / array / ".zarray"
    if ".zarray" in files:
        own.write_text(json.dumps(json.loads(own.read_text()) | changes))
    joint = folder / ".zmetadata"
    if ".zmetadata" in files:
        about = json.loads(joint.read_text())
        about["metadata"][f"{array}/.zarray"] |= changes
        joint.write_text(json.dumps(about))


def test_what_was_saved_is_read(folder: Path) -> None:
    assert load(folder)["m/statistics"]["mean"].shape == (2, 6000)


@pytest.mark.parametrize(
    "changes", [{"compressor": {"id": "pickle"}}, {"compressor": None, "filters": [{"id": "pickle"}]}]
)
@pytest.mark.parametrize("kind", ["|O", "<i8"])
def test_pickles_are_not_unpickled(
    folder: Path, changes: dict[str, Any], kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where numcodecs would do so, as older ones always did."""
    import numcodecs.pickles

    monkeypatch.setattr(numcodecs.pickles, "ALLOW_UNSAFE_PICKLE_DECODE", True, raising=False)
    change(folder, "m/statistics/count", {**changes, "dtype": kind})
    (folder / "m/statistics/count/0").write_bytes(pickle.dumps(Trap(tmp_path / "trace")))
    with pytest.raises(StudyError, match=r"'m/statistics/count' uses the codec 'pickle', which .*save does not write"):
        load(folder)
    assert not (tmp_path / "trace").exists()


@pytest.mark.parametrize("files", [(".zarray",), (".zmetadata",), (".zarray", ".zmetadata")], ids="+".join)
@pytest.mark.parametrize("key", ["compressor", "filters"])
def test_no_codec_of_others_is_even_made(
    folder: Path, key: str, files: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(registry.codec_registry, Spy.codec_id, Spy)
    monkeypatch.setattr(Spy, "made", [])
    codec = {"id": Spy.codec_id}
    change(folder, "m/statistics/mean", {key: codec if key == "compressor" else [codec]}, files)
    with pytest.raises(StudyError, match=Spy.codec_id):
        load(folder)
    assert not Spy.made


def test_every_codec_that_is_not_written_is_refused(folder: Path) -> None:
    assert "pickle" in OTHERS
    for codec in OTHERS:
        for changes in (
            {"compressor": {"id": codec}, "filters": None},
            {"compressor": None, "filters": [{"id": codec}]},
        ):
            change(folder, "m/statistics/output", changes)
            with pytest.raises(StudyError, match=f"'{codec}'"):
                load(folder)


def test_types_that_are_not_written_are_refused(folder: Path) -> None:
    for kind in ("|O", "|V8", "|S4", [["a", "<f8"]], "O", "object", None, 3):
        change(folder, "m/statistics/count", {"dtype": kind})
        with pytest.raises(StudyError, match="has the type"):
            load(folder)


def test_format_3_is_refused(folder: Path) -> None:
    for where in (".", "m", "m/statistics/mean"):
        file = folder / where / "zarr.json"
        file.write_text('{"zarr_format": 3, "node_type": "group", "attributes": {}}')
        with pytest.raises(StudyError, match="format 3"):
            load(folder)
        file.unlink()
    load(folder)


def test_links_are_refused(folder: Path, tmp_path: Path) -> None:
    """What lies elsewhere was not looked at."""
    array = folder / "m" / "statistics" / "count"
    shutil.move(array, tmp_path / "elsewhere")
    array.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(StudyError, match="is a link"):
        load(folder)


@pytest.mark.parametrize("name", ["m/statistics/count/.zarray", ".zmetadata"])
def test_damaged_metadata_are_one_message(folder: Path, name: str) -> None:
    for text in ("", "[]", "{}", "null", '{"compressor": 3, "filters": 1, "dtype": 1}', "\xff"):
        (folder / name).write_text(text, encoding="latin-1")
        with pytest.raises(StudyError, match=r"damaged or no result|is not read"):
            load(folder)
