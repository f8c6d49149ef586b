"""What a Zarr folder asks for, read before anything is opened: nothing that is loaded is executed.

A Zarr array names the codecs that decode it, and some of these run what they find, as `pickle` does.
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

_FILTERS = frozenset({"blosc"})
"""What the chunks of samples are compressed with before their checksum is taken."""

_METADATA = ("zarr.json", ".zarray", ".zmetadata")

_TYPE = re.compile(r"[<>|]([biufcmMU])(\d+)(\[\w+\])?")
"""Numbers, times, and text of fixed width."""


def check_codecs(folder: Path) -> None:
    """Refuse a Zarr folder with a codec, a filter or a type that `uqmbd.results.save` does not write.

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
            raise _refused(folder, f"{path.relative_to(folder)} is of Zarr's format 3")
        if name == ".zarray":
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
    for one in filters or []:
        if one["id"] not in _FILTERS:
            raise _refused(folder, f"{array!r} uses the codec {one['id']!r}")
    if not isinstance(kind, str) or not _TYPE.fullmatch(kind):
        raise _refused(folder, f"{array!r} has the type {kind!r}")


def _refused(folder: Path, found: str) -> StudyError:
    return StudyError(
        f"{str(folder)!r} is not read: {found}, which uqmbd.results.save does not write. Reading it could run code of "
        "whoever made it. Ask for the result as .nc, or for the .zarr as it was saved."
    )
