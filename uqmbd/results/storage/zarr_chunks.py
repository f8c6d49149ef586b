"""Compute the memory of the decoded chunks of a Zarr array from the chunk files.

Zarr decodes a chunk to the length in the chunk, not to the chunk length of its array: 100 kB may become 3 GB. Blosc and
Zstandard store the decoded length ("Blosc Header Format", RFC 8878). gzip stores it modulo 2^32; this module therefore
decodes gzip in parts.
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
"""Pattern of the name of a chunk file in the folder of its array, for formats 2 and 3."""

FIRST, LAST = "checksum before", "checksum after"
"""Names of codecs that add a checksum before or after the other bytes."""

_SUM = 4
"""Number of bytes of a checksum."""

_ROOM = 1 << 16
"""Number of bytes by which the compression of an incompressible chunk may increase its size."""

_AT_ONCE = 1 << 20
_ZSTD = b"\x28\xb5\x2f\xfd"


class Encoded(NamedTuple):
    """Encoding of the chunks of an array."""

    codecs: tuple[str, ...]
    """Codecs in the order of decoding."""
    size: int | None
    """Bytes of the numbers of a chunk; None for variable-length texts."""


def decoded_bytes(path: Path, encoded: Encoded, most: int) -> int:
    """Return the number of bytes of a decoded chunk.

    `path`: chunk file; `encoded`: encoding; `most`: maximum number of decoded bytes, at which counting stops. Raise
    ValueError if the chunk has more bytes or does not store its decoded length.
    """
    within = [codec for codec in encoded.codecs if codec in _COMPRESSORS]
    if len(within) > 1:
        raise ValueError("its data are compressed more than once")
    most += _SUM * sum(codec in (FIRST, LAST) for codec in encoded.codecs)
    with path.open("rb") as file:
        found = file.seek(0, os.SEEK_END)
        if encoded.size is not None and found > 2 * most + _ROOM:
            raise ValueError(f"its file has {found} bytes; expected at most {most} bytes after decompression")
        if within:
            outer = encoded.codecs[: encoded.codecs.index(within[0])]
            found = _READERS[within[0]](file, _SUM * outer.count(FIRST), _SUM * outer.count(LAST), most)
    if found > most:
        raise ValueError(f"its data exceed {most} bytes after decompression")
    return found


def _blosc(file: BinaryIO, begin: int, after: int, most: int) -> int:
    file.seek(begin)
    head = file.read(16)
    if len(head) < 16:
        raise ValueError("the header of the Blosc compression is missing")
    return int.from_bytes(head[4:8], "little")


def _zstd(file: BinaryIO, begin: int, after: int, most: int) -> int:
    """Return the decoded length (bytes) in the header of a Zstandard frame; a second frame is refused."""
    file.seek(begin)
    head = file.read(18)
    if len(head) < 6 or head[:4] != _ZSTD:
        raise ValueError("its data are not a Zstandard frame")
    single, checksum = head[4] >> 5 & 1, head[4] >> 2 & 1
    width = (single, 2, 4, 8)[head[4] >> 6]
    place = 5 + (1 - single) + (0, 1, 2, 4)[head[4] & 3]
    if not width:
        raise ValueError("the Zstandard frame does not state its length")
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
        raise ValueError("its file contains data after the Zstandard frame")
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
            if reader.eof:  # a further gzip member or zeros may follow
                rest, reader = reader.unused_data.lstrip(b"\0"), zlib.decompressobj(31)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    return found


_READERS = {"blosc": _blosc, "zstd": _zstd, "gzip": _gzip}
