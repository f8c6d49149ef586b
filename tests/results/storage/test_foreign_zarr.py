"""Somebody else's Zarr folder executes nothing: what uqmbd did not write is refused before it is opened."""

from __future__ import annotations

import json
import os
import pickle
import shutil
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from tests.results.old_zarr import stored_as_zarr
from uqmbd.errors import StudyError
from uqmbd.results import load

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
    return stored_as_zarr(
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


@pytest.fixture
def new_folder(folder: Path, tmp_path: Path) -> Path:
    """The same in Zarr's format 3."""
    return stored_as_zarr(load(folder), tmp_path / "new.zarr", zarr_format=3)


def change_3(folder: Path, array: str, changes: dict[str, Any], *, within: bool) -> None:
    """Change the metadata of an array in its own file, or within what the file of the root holds of it."""
    own, root = folder / array / "zarr.json", folder / "zarr.json"
    changed = json.loads(own.read_text()) | changes
    if not within:
        own.write_text(json.dumps(changed))
        return
    inline = {"kind": "inline", "must_understand": False, "metadata": {array: changed}}
    root.write_text(json.dumps(json.loads(root.read_text()) | {"consolidated_metadata": inline}))


@pytest.mark.parametrize("within", [False, True])
def test_in_format_3_no_codec_of_others_is_even_made(
    new_folder: Path, within: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is registered there, which any package that is installed may do."""
    from zarr import registry as new
    from zarr.abc.codec import BytesBytesCodec

    class NewSpy(BytesBytesCodec):  # type: ignore[misc]  # zarr is not known to the checker
        is_fixed_size = True

        @classmethod
        def from_dict(cls, data: dict[str, Any]) -> NewSpy:
            Spy.made.append("made")
            return cls()

    new.register_codec("uqmbd-spy", NewSpy)
    monkeypatch.setattr(Spy, "made", [])
    own = json.loads((new_folder / "m/statistics/mean/zarr.json").read_text())["codecs"]
    for spy in ({"name": "uqmbd-spy", "configuration": {}}, "uqmbd-spy", {"name": "numcodecs.pickle"}):
        change_3(new_folder, "m/statistics/mean", {"codecs": [*own, spy]}, within=within)
        with pytest.raises(StudyError, match=r"'[./]*m/statistics/mean' uses the codec '(uqmbd-spy|numcodecs.pickle)'"):
            load(new_folder)
    assert not Spy.made


def test_in_format_3_every_codec_that_is_not_written_is_refused(new_folder: Path) -> None:
    """Those of the packages that are installed, and of the specification; a shard holds codecs of its own."""
    installed = {one.name.removeprefix("zarr.codecs.") for one in entry_points(group="zarr.codecs")}
    others = installed | {"sharding_indexed", "transpose", "vlen-bytes", "numcodecs.blosc", "numcodecs.json2", "pickle"}
    for name in sorted(others):
        change_3(new_folder, "m/statistics/mean", {"codecs": [{"name": name, "configuration": {}}]}, within=False)
        with pytest.raises(StudyError, match=f"'{name}'"):
            load(new_folder)


@pytest.mark.parametrize("within", [False, True])
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"data_type": "object"}, "has the type"),
        ({"data_type": {"name": "null_terminated_bytes", "configuration": {"length_bytes": 4}}}, "has the type"),
        ({"data_type": {"name": "struct", "configuration": {}}}, "has the type 'struct'"),
        ({"storage_transformers": [{"name": "mine"}]}, "storage transformers"),
        ({"chunk_grid": {"name": "mine"}}, "'mine' as its chunk_grid"),
        ({"chunk_key_encoding": {"name": "../mine"}}, "as its chunk_key_encoding"),
        ({"node_type": "program"}, "is a 'program'"),
    ],
)
def test_in_format_3_what_is_not_written_is_refused(
    new_folder: Path, changes: dict[str, Any], words: str, within: bool
) -> None:
    change_3(new_folder, "m/statistics/count", changes, within=within)
    with pytest.raises(StudyError, match=words):
        load(new_folder)


@pytest.mark.parametrize("name", ["m/statistics/count/zarr.json", "m/zarr.json", "zarr.json"])
def test_damaged_metadata_of_format_3_are_one_message(new_folder: Path, name: str) -> None:
    for text in ("", "[]", "{}", "null", '{"node_type": "array", "codecs": 3}', "\xff"):
        (new_folder / name).write_text(text, encoding="latin-1")
        with pytest.raises(StudyError, match=r"damaged, or is not a result|is rejected"):
            load(new_folder)


def test_objects_of_format_2_are_texts_or_refused(folder: Path) -> None:
    """xarray writes text of any width as objects, whose codec makes nothing else of what is in the file."""
    tree = load(folder)
    for node in tree.subtree:
        for variable in node.variables.values():
            if variable.dtype.kind == "U":
                variable.encoding = {"dtype": "O"}
    other = folder.parent / "other.zarr"
    tree.to_zarr(other, zarr_format=2)
    assert json.loads((other / "m/statistics/output/.zarray").read_text())["dtype"] == "|O"
    assert load(other).identical(load(folder))
    change(other, "m/statistics/output", {"filters": None})
    with pytest.raises(StudyError, match="has the type"):
        load(other)


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
        with pytest.raises(StudyError, match=r"damaged, or is not a result|is rejected"):
            load(folder)
