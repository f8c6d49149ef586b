"""Check the metadata of a Zarr folder before Zarr opens it, so that no content is executed.

A Zarr array names the codecs that decode it, and some codecs execute the content, as `pickle` does. In format 3, any
installed package may define codecs, data types and chunk grids. The metadata also declare the shapes of arrays, whose
chunks may be missing.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections import defaultdict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.results.storage.reading import check_declared, largest
from uqmbd.results.storage.zarr_chunks import CHUNK, FIRST, LAST, Encoded, decoded_bytes

__all__ = ["check_folder"]

_COMPRESSORS = frozenset({"blosc", "zstd", "crc32"})
"""Default compressors of versions of Zarr with which `save` wrote results, and the checksum codec."""

_TEXT = "vlen-utf8"
"""Codec with which xarray writes variable-length text."""

_FILTERS = frozenset({"blosc", _TEXT})
"""Compressor of chunks of samples, which is applied before their checksum, and codec of text."""

_CODECS = frozenset({"bytes", _TEXT, "zstd", "blosc", "gzip", "crc32c"})
"""Codecs of xarray and Zarr in format 3: chunk codecs of the specification."""

_OF_TEXT = 16
"""Minimum number of bytes of a variable-length text."""

_METADATA = ("zarr.json", ".zarray", ".zmetadata")

_TYPE = re.compile(r"[<>|]([biufcmMU])(\d+)(\[\w+\])?")
"""Data types of format 2: numbers, times, and fixed-width text."""

_TYPE_3 = re.compile(r"(?:bool|u?int|float|complex|string)(8|16|32|64|128)?")
"""Data types of format 3, whose specification has variable-length text."""

_KNOWN = {
    "chunk_grid": frozenset({"regular"}),
    "chunk_key_encoding": frozenset({"default", "v2"}),
}


def check_folder(folder: Path, unread: Collection[str] = ()) -> None:
    """Refuse a Zarr folder of format 2 or 3 with a codec, filter or data type that uqmbd never used for results.

    The function also rejects links, pipes and devices, arrays larger than their folder can contain, and chunks larger
    than declared.

    `folder`: root folder; `unread`: names of arrays that are not read as a whole. Raise StudyError that names the array
    and the codec. Raise OSError or ValueError if the metadata cannot be read.
    """
    size = 0
    declared: dict[str, int] = {}  # bytes by array, because consolidated metadata repeat the arrays
    chunks: list[str] = []
    encoded: dict[str, set[Encoded]] = defaultdict(set)
    for entry in _entries(folder):
        path, place = Path(entry.path), os.path.relpath(entry.path, folder)
        if entry.is_symlink() or not (entry.is_dir() or entry.is_file()):
            raise _refused(folder, f"{place} is a link, a pipe or a device")
        if place.split(os.sep)[0] in unread and entry.name[0] != ".":
            continue  # skip the chunks of these arrays, which may be many
        size += entry.stat().st_size
        name = entry.name.lower()  # some file systems open `.ZARRAY` for `.zarray`
        if name not in _METADATA:
            chunks += [place] if entry.is_file() else []
            continue
        node, about = str(path.parent.relative_to(folder)), json.loads(path.read_bytes())
        if name == "zarr.json":
            arrays = list(_arrays_3(folder, node, about))
        elif name == ".zarray":
            arrays = [(node, *_bytes_of(folder, node, about))]
        else:
            own = {str(key): content for key, content in about["metadata"].items()}
            found = {key.rpartition("/")[0]: own[key] for key in own if key.rpartition("/")[2] == ".zarray"}
            arrays = [(key, *_bytes_of(folder, key, content)) for key, content in found.items()]
        for key, count, how in arrays:
            if key not in unread:
                declared[os.path.normpath(key)] = max(count, declared.get(os.path.normpath(key), 0))
                encoded[os.path.normpath(key)].add(how)
    check_declared(sum(declared.values()), size, folder)
    texts = 0
    for place in chunks:
        for how in encoded.get(_array_of(place, encoded), ()):
            try:
                found_there = decoded_bytes(folder / place, how, largest(size) if how.size is None else how.size)
            except ValueError as error:
                raise StudyError(
                    f"{str(folder)!r} is rejected: the chunk {place} is damaged or malicious: {error}."
                ) from None
            texts += found_there if how.size is None else 0
    check_declared(texts, size, folder)


def _array_of(place: str, arrays: Collection[str]) -> str:
    """Return the array to which a file belongs according to its path, or an empty text."""
    parts = place.split(os.sep)
    for count in range(len(parts) - 1, -1, -1):
        array = os.path.join(*parts[:count]) if count else "."
        if array in arrays:
            return array if CHUNK.fullmatch("/".join(parts[count:])) else ""
    return ""


def _entries(folder: str | Path) -> Iterator[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        for entry in entries:
            yield entry
            if entry.is_dir(follow_symlinks=False):
                yield from _entries(entry.path)


def _bytes_of(folder: Path, array: str, about: Any) -> tuple[int, Encoded]:
    """Return the bytes and the encoding of an array of format 2; the bytes are at least the bytes of one chunk."""
    compressor, filters, kind = about["compressor"], about["filters"], about["dtype"]
    if compressor is not None and compressor["id"] not in _COMPRESSORS:
        raise _refused(folder, f"{array!r} uses the codec {compressor['id']!r}")
    names = [one["id"] for one in filters or []]
    for name in names:
        if name not in _FILTERS:
            raise _refused(folder, f"{array!r} uses the codec {name!r}")
    text = kind == "|O" and names[:1] == [_TEXT]  # this filter is decoded last and returns text objects
    plain = _TYPE.fullmatch(kind) if isinstance(kind, str) else None
    if plain and _TEXT in names:
        raise _refused(folder, f"{array!r} has the type {kind!r} and uses the codec {_TEXT!r}")
    if not text and not plain:
        raise _refused(folder, f"{array!r} has the type {kind!r}")
    each = np.dtype(kind).itemsize if plain else _OF_TEXT
    count = _size(folder, array, about["shape"], about["chunks"]) * each
    outer = (compressor["id"],) if compressor is not None else ()
    if outer == ("crc32",):
        outer = (LAST if compressor.get("location") == "end" else FIRST,)
    return count, Encoded((*outer, *reversed(names)), math.prod(about["chunks"]) * each if plain else None)


def _arrays_3(folder: Path, node: str, about: Any) -> Iterator[tuple[str, int, Encoded]]:
    """Check a group or an array of format 3 and its members; yield names, bytes and encodings of arrays."""
    if about["node_type"] == "array":
        yield node, *_bytes_of_3(folder, node, about)
    elif about["node_type"] != "group":
        raise _refused(folder, f"{node!r} is a {about['node_type']!r}")
    consolidated = about.get("consolidated_metadata") or {}
    for key, content in consolidated.get("metadata", {}).items():
        yield from _arrays_3(folder, f"{node}/{key}", content)


def _bytes_of_3(folder: Path, array: str, about: Any) -> tuple[int, Encoded]:
    for codec in about["codecs"]:
        if _name(codec) not in _CODECS:
            raise _refused(folder, f"{array!r} uses the codec {_name(codec)!r}")
    if about.get("storage_transformers"):
        raise _refused(folder, f"{array!r} has storage transformers")
    kind = about["data_type"]
    found = _TYPE_3.fullmatch(kind) if isinstance(kind, str) else None
    if not found:
        raise _refused(folder, f"{array!r} has the type {_name(kind)!r}")
    for key, known in _KNOWN.items():
        if _name(about[key]) not in known:
            raise _refused(folder, f"{array!r} has {_name(about[key])!r} as its {key}")
    chunk = about["chunk_grid"]["configuration"]["chunk_shape"]
    text, each = kind == "string", int(found[1]) // 8 if found[1] else _OF_TEXT
    codecs = tuple(LAST if _name(codec) == "crc32c" else _name(codec) for codec in reversed(about["codecs"]))
    return _size(folder, array, about["shape"], chunk) * each, Encoded(
        codecs, None if text else math.prod(chunk) * each
    )


def _size(folder: Path, array: str, shape: Any, chunk: Any) -> int:
    """Return the number of elements of an array, at least the number of elements of one chunk."""
    whole = all(isinstance(n, int) and n >= 0 for n in (*shape, *chunk)) and len(shape) == len(chunk)
    if not whole or 0 in chunk:
        raise _refused(folder, f"{array!r} has the shape {shape} in chunks of {chunk}")
    return max(int(math.prod(shape)), int(math.prod(chunk)))


def _name(about: Any) -> str:
    """Return the name of an extension of format 3, which is a text or a mapping with a configuration."""
    return about if isinstance(about, str) else str(about["name"])


def _refused(folder: Path, found: str) -> StudyError:
    return StudyError(
        f"{str(folder)!r} is rejected: {found}, which uqmbd.results.save does not write. Reading it could execute "
        "code from the file. Use the result as .nc, or the .zarr that uqmbd saved."
    )
