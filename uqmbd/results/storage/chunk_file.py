"""Read and write chunk files of Zarr arrays, whose first four bytes are the checksum of the other bytes.

A chunk is encoded by codecs of Zarr format 2, with Blosc as its filter and CRC32 as its compressor. The checksum
therefore covers the bytes in the file, and every Zarr reader with both codecs compares it. The module does not call
Zarr: through the event loop and threads of Zarr, a chunk of 0.8 MB takes three times as long.
"""

from __future__ import annotations

import os
import secrets
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.packages import require_package
from uqmbd.typing import Array

__all__ = ["check_file", "checksum_of", "codecs", "decoded", "encoded", "read_checked", "same_codecs", "write_file"]

LARGEST = 1 << 30
"""Maximum number of bytes of a chunk that is compressed; the limit of Blosc is twice this number."""

_SUM = 4
"""Number of bytes of a checksum."""


def codecs(kind: str, chunk: tuple[int, ...]) -> dict[str, Any]:
    """Return the codecs of an array as options of Zarr and xarray."""
    return {"filters": [_blosc()] if _small(kind, chunk) else [], "compressors": _numcodecs().CRC32()}


def same_codecs(about: Mapping[str, Any], kind: str, chunk: tuple[int, ...]) -> bool:
    """Return whether the metadata `about` of an array name the codecs that `codecs` returns."""
    filters = [one["id"] for one in about["filters"] or []]
    return (about["compressor"] or {}).get("id") == "crc32" and filters == (["blosc"] if _small(kind, chunk) else [])


def encoded(values: NDArray[Any], kind: str, chunk: tuple[int, ...]) -> bytes:
    """Return the bytes of a chunk file; missing last samples are filled with zeros."""
    full = np.ascontiguousarray(values, dtype=kind)
    if len(full) < chunk[0]:
        full = np.concatenate([full, np.zeros((chunk[0] - len(full), *full.shape[1:]), dtype=kind)])
    if kind[1] == "U":  # the codec encodes numbers only
        full = full.view("<u4")
    content: bytes = _blosc().encode(full) if full.nbytes <= LARGEST else full.tobytes()
    return b"".join([zlib.crc32(content).to_bytes(_SUM, "little"), content])


def checksum_of(content: bytes) -> int:
    """Return the checksum that is stored in the content of a chunk file."""
    return int.from_bytes(content[:_SUM], "little")


def read_checked(path: Path, chunk: tuple[int, ...], checksum: int, count: int) -> Array | None:
    """Return the first `count` responses of a chunk file; None if its checksum differs or it cannot be read."""
    try:
        content = path.read_bytes()
        return _decode(path, content, "<f8", chunk)[:count] if checksum_of(content) == checksum else None
    except (OSError, StudyError):
        return None


def decoded(path: Path, kind: str, chunk: tuple[int, ...]) -> NDArray[Any]:
    """Return the values of a chunk; chunks of zeros or empty texts may have no file, unless they are floating-point.

    Raise StudyError if the file is missing or damaged.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        if kind == "<f8":
            raise StudyError(f"{path} is missing: the samples are incomplete. {_ADVICE}") from None
        return np.zeros(chunk, dtype=kind)
    return _decode(path, content, kind, chunk)


def check_file(path: Path) -> None:
    """Compare the checksum of a file with its content.

    Raise StudyError if the checksum differs.
    """
    _body(path, path.read_bytes())


_ADVICE = (
    "Restore an undamaged copy of the file, or run the study again in a separate folder. With --resume, an "
    "unfinished run recomputes the chunk."
)


def _body(path: Path, content: bytes) -> memoryview:
    """Compare the checksum of a file with its content; return the content without the checksum."""
    body = memoryview(content)[_SUM:]
    if len(content) < _SUM or zlib.crc32(body) != checksum_of(content):
        raise StudyError(f"{path} is damaged: its content does not match its checksum. {_ADVICE}")
    return body


def _decode(path: Path, content: bytes, kind: str, chunk: tuple[int, ...]) -> NDArray[Any]:
    blosc = _numcodecs().blosc
    size, body = int(np.prod(chunk)) * np.dtype(kind).itemsize, _body(path, content)
    try:
        if not _small(kind, chunk):
            return np.frombuffer(body, dtype=kind).reshape(chunk)
        # check the stated length, because this much memory is allocated
        if len(body) < 16 or int.from_bytes(body[4:8], "little") != size:
            raise ValueError("its length is wrong")
        return np.frombuffer(blosc.decompress(body), dtype=kind).reshape(chunk)
    except (ValueError, RuntimeError) as error:
        raise StudyError(f"{path} is damaged: {error}. {_ADVICE}") from error


def _blosc() -> Any:
    blosc = _numcodecs().Blosc
    return blosc("lz4", clevel=5, shuffle=blosc.SHUFFLE)


def _numcodecs() -> ModuleType:
    """Import the codecs of Zarr."""
    return require_package("numcodecs", "the store of many samples", "uqmbd[samples]")


def _small(kind: str, chunk: tuple[int, ...]) -> bool:
    return int(np.prod(chunk)) * np.dtype(kind).itemsize <= LARGEST


def write_file(path: Path, content: bytes) -> None:
    """Write a file atomically; several processes may write the same file."""
    # uqmbd.files.replacing is slower (1.1 ms instead of 0.4 ms for 0.8 MB), because it makes a folder; files of
    # tempfile are readable only for their owner
    part = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        with part.open("xb") as file:
            file.write(content)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
