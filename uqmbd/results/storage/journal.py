"""Provide an append-only file of records; damage affects only the damaged record."""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.files import no_link

__all__ = ["Journal", "Record"]

Record = tuple[dict[str, Any], dict[str, NDArray[Any]]]
"""JSON data and arrays of a record."""

_MARK = b"\x00uqmbd\xff\n"
_HEAD = struct.Struct("<II")
_ABOUT = "_about"
_AT_ONCE = 1 << 20


class Journal:
    """File of records, each with its length and checksum.

    `path`: path of the file, which need not exist.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     journal = Journal(Path(folder) / "a.journal")
    ...     place = journal.append({"number": 7}, {"x": np.arange(3)})
    ...     about, arrays = journal.read(place)
    >>> about, arrays["x"].tolist()
    ({'number': 7}, [0, 1, 2])
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def append(self, about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> int:
        """Write a record and return its offset (bytes).

        Raise OSError if the record cannot be written.
        """
        content = io.BytesIO()
        np.savez(content, **{_ABOUT: np.array(json.dumps(about))}, **arrays)  # type: ignore[arg-type]  # names as options
        payload = content.getvalue()
        with open(self.path, "ab", buffering=0, opener=no_link) as file:
            place = file.seek(0, os.SEEK_END)
            rest = memoryview(_MARK + _HEAD.pack(len(payload), zlib.crc32(payload)) + payload)
            while rest:
                rest = rest[file.write(rest) :]  # a write may be partial, such as on a full disk
        return place

    def read(self, place: int) -> Record | None:
        """Return the record at an offset `place` (bytes), or None if the record is damaged."""
        with self.path.open("rb") as file:
            found = _payload(file, place)
        return None if found is None else _record(found)

    def places(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the offset (bytes) and the JSON data of each complete record."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            place = 0
            while (payload := _payload(file, place)) is not None or (place := _next(file, place + 1)) >= 0:
                if payload is None:
                    continue
                if (record := _record(payload)) is not None:
                    yield place, record[0]
                place += len(_MARK) + _HEAD.size + len(payload)


def _payload(file: Any, place: int) -> bytes | None:
    file.seek(place)
    head = file.read(len(_MARK) + _HEAD.size)
    if len(head) < len(_MARK) + _HEAD.size or not head.startswith(_MARK):
        return None
    length, checksum = _HEAD.unpack(head[len(_MARK) :])
    if length > os.fstat(file.fileno()).st_size - place:
        return None
    payload: bytes = file.read(length)
    return payload if len(payload) == length and zlib.crc32(payload) == checksum else None


def _next(file: Any, place: int) -> int:
    """Return the offset (bytes) of the first mark at or after `place`; -1 if there is none."""
    while True:
        file.seek(place)
        part = file.read(_AT_ONCE)
        if (found := part.find(_MARK)) >= 0:
            return place + int(found)
        if len(part) < _AT_ONCE:
            return -1
        place += _AT_ONCE - len(_MARK) + 1


def _record(payload: bytes) -> Record | None:
    try:
        with np.load(io.BytesIO(payload), allow_pickle=False) as stored:
            arrays = {key: stored[key] for key in stored.files}
        about = json.loads(str(arrays.pop(_ABOUT)))
        return (about, arrays) if isinstance(about, dict) else None
    except Exception:  # noqa: BLE001 - after any error the chunk is computed again
        return None
