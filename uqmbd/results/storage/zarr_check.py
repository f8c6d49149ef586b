"""What a Zarr folder asks for, read before anything is opened: nothing that is loaded is executed.

A Zarr array names the codecs that decode it, and some of these run what they find, as `pickle` does.  In format 3 these
names may belong to any package that is installed, and so may those of types of data and of grids of chunks.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from uqmbd.errors import StudyError

__all__ = ["check_codecs"]

_COMPRESSORS = frozenset({"blosc", "zstd", "crc32"})
"""What Zarr compresses with by default, hence what `save` writes: it depends on the version of Zarr; and checksums."""

_TEXT = "vlen-utf8"
"""Text of any width, as xarray writes it."""

_FILTERS = frozenset({"blosc", _TEXT})
"""What the chunks of samples are compressed with before their checksum is taken; and text."""

_CODECS = frozenset({"bytes", _TEXT, "zstd", "blosc", "gzip", "crc32c"})
"""What xarray and Zarr write in format 3, and `save`: the codecs of its specification that are for chunks."""

_METADATA = ("zarr.json", ".zarray", ".zmetadata")

_TYPE = re.compile(r"[<>|]([biufcmMU])(\d+)(\[\w+\])?")
"""Numbers, times, and text of fixed width."""

_TYPE_3 = re.compile(r"bool|u?int(8|16|32|64)|float(16|32|64)|complex(64|128)|string")
"""The same in format 3, whose specification has text of any width."""

_KNOWN = {
    "chunk_grid": frozenset({"regular"}),
    "chunk_key_encoding": frozenset({"default", "v2"}),
}


def check_codecs(folder: Path) -> None:
    """Refuse a Zarr folder, of format 2 or 3, with a codec, a filter or a type that results are not written with.

    Raises
    ------
    StudyError
        That names the array and the codec.
    OSError, ValueError
        Where the metadata cannot be read.
    """
    for entry in _entries(folder):
        name = entry.name.lower()  # some file systems open `.ZARRAY` for `.zarray`
        if not (entry.is_symlink() or name in _METADATA):
            continue  # a chunk, of which there may be many
        path = Path(entry.path)
        if entry.is_symlink():
            raise _refused(folder, f"{path.relative_to(folder)} is a link")
        if name == "zarr.json":
            _check_format_3(folder, str(path.parent.relative_to(folder)), json.loads(path.read_bytes()))
        elif name == ".zarray":
            _check_array(folder, str(path.parent.relative_to(folder)), json.loads(path.read_bytes()))
        elif name == ".zmetadata":
            for key, content in json.loads(path.read_bytes())["metadata"].items():
                if str(key).rpartition("/")[2] == ".zarray":
                    _check_array(folder, str(key).rpartition("/")[0], content)


def _entries(folder: str | Path) -> Iterator[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        for entry in entries:
            yield entry
            if entry.is_dir(follow_symlinks=False):
                yield from _entries(entry.path)


def _check_array(folder: Path, array: str, about: Any) -> None:
    compressor, filters, kind = about["compressor"], about["filters"], about["dtype"]
    if compressor is not None and compressor["id"] not in _COMPRESSORS:
        raise _refused(folder, f"{array!r} uses the codec {compressor['id']!r}")
    names = [one["id"] for one in filters or []]
    for name in names:
        if name not in _FILTERS:
            raise _refused(folder, f"{array!r} uses the codec {name!r}")
    text = kind == "|O" and names[:1] == [_TEXT]  # the last to decode: its objects are texts
    if not text and not (isinstance(kind, str) and _TYPE.fullmatch(kind)):
        raise _refused(folder, f"{array!r} has the type {kind!r}")


def _check_format_3(folder: Path, node: str, about: Any) -> None:
    """Look at a group or an array of format 3, and at what it holds of those below it."""
    if about["node_type"] == "array":
        _check_array_3(folder, node, about)
    elif about["node_type"] != "group":
        raise _refused(folder, f"{node!r} is a {about['node_type']!r}")
    consolidated = about.get("consolidated_metadata") or {}
    for key, content in consolidated.get("metadata", {}).items():
        _check_format_3(folder, f"{node}/{key}", content)


def _check_array_3(folder: Path, array: str, about: Any) -> None:
    for codec in about["codecs"]:
        if _name(codec) not in _CODECS:
            raise _refused(folder, f"{array!r} uses the codec {_name(codec)!r}")
    if about.get("storage_transformers"):
        raise _refused(folder, f"{array!r} has storage transformers")
    kind = about["data_type"]
    if not isinstance(kind, str) or not _TYPE_3.fullmatch(kind):
        raise _refused(folder, f"{array!r} has the type {_name(kind)!r}")
    for key, known in _KNOWN.items():
        if _name(about[key]) not in known:
            raise _refused(folder, f"{array!r} has {_name(about[key])!r} as its {key}")


def _name(about: Any) -> str:
    """Return the name of an extension of format 3: its name alone, or with a configuration."""
    return about if isinstance(about, str) else str(about["name"])


def _refused(folder: Path, found: str) -> StudyError:
    return StudyError(
        f"{str(folder)!r} is not read: {found}, which uqmbd.results.save does not write. Reading it could run code of "
        "whoever made it. Ask for the result as .nc, or for the .zarr as it was saved."
    )
