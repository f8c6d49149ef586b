"""An append-only file of records: damage affects only the record in which it occurs."""

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
"""Noted data, in JSON, and arrays."""

_MARK = b"\x00uqmbd\xff\n"
_HEAD = struct.Struct("<II")
_ABOUT = "_about"
_AT_ONCE = 1 << 20


class Journal:
    """Records in a file, each with its length and checksum.

    `path`: need not exist.

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
        """Write a record, and return where it begins.

        Raise OSError if it cannot be written.
        """
        content = io.BytesIO()
        np.savez(content, **{_ABOUT: np.array(json.dumps(about))}, **arrays)  # type: ignore[arg-type]  # names as options
        payload = content.getvalue()
        with open(self.path, "ab", buffering=0, opener=no_link) as file:
            place = file.seek(0, os.SEEK_END)
            rest = memoryview(_MARK + _HEAD.pack(len(payload), zlib.crc32(payload)) + payload)
            while rest:
                rest = rest[file.write(rest) :]  # what a full disk takes only in part
        return place

    def read(self, place: int) -> Record | None:
        """Return the record that begins at a place, or nothing where it is damaged."""
        with self.path.open("rb") as file:
            found = _payload(file, place)
        return None if found is None else _record(found)

    def places(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the place and the noted data of each complete record."""
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
    """Return where the next mark is, from a place on; -1: there is none."""
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
    except Exception:  # noqa: BLE001 - whatever is wrong with it, the work is done again
        return None
