"""Memory of the decoded chunks of a Zarr array, from their files.

Zarr decodes a chunk to whatever length the chunk says, whatever its array declares: 100 kB may become 3 GB.  Blosc and
Zstandard state the length ("Blosc Header Format", RFC 8878).  gzip does so modulo 2^32, hence it is decoded here by
parts.
"""

from __future__ import annotations

import os
import re
import zlib
from pathlib import Path
from typing import BinaryIO, NamedTuple

__all__ = ["CHUNK", "FIRST", "LAST", "Encoded", "decoded_bytes"]

_COMPRESSORS = frozenset({"blosc", "zstd", "gzip"})

CHUNK = re.compile(r"(c[/.])?\d+([/.]\d+)*|c", re.IGNORECASE)
"""The name of a chunk within the folder of its array, in formats 2 and 3."""

FIRST, LAST = "checksum before", "checksum after"
"""Codecs that add a checksum."""

_SUM = 4
"""Bytes of a checksum."""

_ROOM = 1 << 16
"""Bytes by which a chunk that cannot be compressed may grow."""

_AT_ONCE = 1 << 20
_ZSTD = b"\x28\xb5\x2f\xfd"


class Encoded(NamedTuple):
    """Encoding of the chunks of an array."""

    codecs: tuple[str, ...]
    """Codecs from the file to the numbers."""
    size: int | None
    """Bytes of the numbers of a chunk; None: they are texts of any length."""


def decoded_bytes(path: Path, encoded: Encoded, most: int) -> int:
    """Return the bytes that a chunk takes when it is decoded.

    `path`: of its file; `encoded`: how it is encoded; `most`: bytes that may be there; more are not counted. Raise
    ValueError if there are more, or the chunk does not say how many.
    """
    within = [codec for codec in encoded.codecs if codec in _COMPRESSORS]
    if len(within) > 1:
        raise ValueError("it is compressed more than once")
    most += _SUM * sum(codec in (FIRST, LAST) for codec in encoded.codecs)
    with path.open("rb") as file:
        held = file.seek(0, os.SEEK_END)
        if encoded.size is not None and held > 2 * most + _ROOM:
            raise ValueError(f"its file has {held} bytes; expected at most {most} when it is decoded")
        found = held
        if within:
            outer = encoded.codecs[: encoded.codecs.index(within[0])]
            found = _READERS[within[0]](file, _SUM * outer.count(FIRST), _SUM * outer.count(LAST), most)
    if found > most:
        raise ValueError(f"it has more than {most} bytes when it is decoded")
    return found


def _blosc(file: BinaryIO, begin: int, after: int, most: int) -> int:
    file.seek(begin)
    head = file.read(16)
    if len(head) < 16:
        raise ValueError("it has no header of Blosc")
    return int.from_bytes(head[4:8], "little")


def _zstd(file: BinaryIO, begin: int, after: int, most: int) -> int:
    """Return the length that a frame states, which must be the only one."""
    file.seek(begin)
    head = file.read(18)
    if len(head) < 6 or head[:4] != _ZSTD:
        raise ValueError("it is no frame of Zstandard")
    single, checksum = head[4] >> 5 & 1, head[4] >> 2 & 1
    width = (single, 2, 4, 8)[head[4] >> 6]
    place = 5 + (1 - single) + (0, 1, 2, 4)[head[4] & 3]
    if not width:
        raise ValueError("it does not state its length")
    size = int.from_bytes(head[place : place + width], "little") + (256 if width == 2 else 0)
    place += begin + width
    last = False
    while not last:
        file.seek(place)
        block = file.read(3)
        if len(block) < 3:
            raise ValueError("it ends early")
        about = int.from_bytes(block, "little")
        last = bool(about & 1)
        place += 3 + (1 if about >> 1 & 3 == 1 else about >> 3)
    if place + 4 * checksum + after != file.seek(0, os.SEEK_END):
        raise ValueError("its frame is not all that it holds")
    return size


def _gzip(file: BinaryIO, begin: int, after: int, most: int) -> int:
    left = file.seek(0, os.SEEK_END) - begin - after
    file.seek(begin)
    found, reader, rest = 0, zlib.decompressobj(31), b""
    try:
        while found <= most and (rest or left > 0):
            if not rest:
                rest = file.read(min(left, _AT_ONCE))
                left -= len(rest)
            found += len(reader.decompress(rest, _AT_ONCE))
            rest = reader.unconsumed_tail
            if reader.eof:  # another member may follow, or zeros
                rest, reader = reader.unused_data.lstrip(b"\0"), zlib.decompressobj(31)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    return found


_READERS = {"blosc": _blosc, "zstd": _zstd, "gzip": _gzip}
