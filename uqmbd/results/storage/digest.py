"""Write and check the digest at the end of a netCDF file, which reveals a changed byte before HDF5 reads the file.

The checksums of HDF5 cover neither attributes nor texts of variable length. HDF5 ignores bytes after the end of its
data, so the digest does not affect other readers. A program that changes the file cuts the digest off.

Large variables are compressed. Each of their chunks ends with a checksum of HDF5 and has a separate digest.
`uqmbd.results.open` compares only the digest of the other bytes, which include the checksums, and reads no chunk.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from uqmbd.errors import StudyError
from uqmbd.files import no_link

__all__ = ["CHECKSUM", "MARK", "Span", "add_digest", "check_digest"]

Span = tuple[int, int]
"""Offset and length of a range of bytes in a file."""

CHECKSUM = 4
"""Number of bytes of the HDF5 checksum at the end of a chunk."""

MARK = "uqmbd_digest_follows"
"""Root attribute of a file with a digest; if the digest is missing, the attribute reveals the loss."""

_FORM = "uqmbd digest 1"
_END = b"\x89uqmbd digest\r\n\x1a\n"
_SHA = hashlib.sha256().digest_size
_FOOT = 8 + _SHA + len(_END)
"""Number of bytes of the footer, which contains length and digest of the statement, and the end mark."""
_LARGEST = 1 << 26
_AT_ONCE = 1 << 20
_HDF5 = b"\x89HDF\r\n\x1a\n"


def add_digest(path: Path, spans: Sequence[Span]) -> None:
    """Append the digest to a complete file.

    `path`: HDF5 file without a digest; `spans`: disjoint ranges of bytes with separate digests, which are not read when
    a file is only opened.
    Raise OSError if the file cannot be written.
    """
    with open(path, "r+b", opener=no_link) as file:
        size = file.seek(0, os.SEEK_END)
        parts = sorted(spans)
        rest, digests = _digests(file, size, parts, whole=True)
        about = {
            "form": _FORM,
            "size": size,
            "rest": rest,
            "spans": [[*span, digest] for span, digest in zip(parts, digests, strict=True)],
        }
        statement = json.dumps(about).encode()
        file.seek(size)
        file.write(statement + len(statement).to_bytes(8, "little") + hashlib.sha256(statement).digest() + _END)


def check_digest(file: BinaryIO, *, whole: bool) -> bool:
    """Compare the digest of a file with its content.

    `file`: file open for reading; `whole`: whether large chunks are compared, too. Return True if the file has a digest
    that matches its content, and False if another program wrote the file. Raise StudyError if the content differs, or
    if a file with uqmbd's mark has other bytes in place of the digest. Other files may have any bytes after their data.
    """
    end = file.seek(0, os.SEEK_END)
    file.seek(max(end - _FOOT, 0))
    foot = file.read(_FOOT)
    if len(foot) < _FOOT or not foot.endswith(_END):
        if (data := _end_of_data(file)) is not None and end > data and _has_mark(file):
            raise _damaged(file, f"{end - data} bytes after the end of its data are not a digest")
        return False
    length, digest = int.from_bytes(foot[:8], "little"), foot[8 : 8 + _SHA]
    size = end - _FOOT - length
    if size < 0 or length > _LARGEST:
        raise _damaged(file, "its digest has an impossible length")
    file.seek(size)
    statement = file.read(length)
    if hashlib.sha256(statement).digest() != digest:
        raise _damaged(file, "its digest is damaged")
    about = json.loads(statement)
    if about["form"] != _FORM:
        raise StudyError(
            f"A later version of uqmbd wrote the digest of {str(file.name)!r}; read the file with that version."
        )
    spans = [(int(begin), int(count)) for begin, count, _ in about["spans"]]
    rest, digests = _digests(file, size, spans, whole=whole)
    if size != about["size"] or rest != about["rest"] or (whole and digests != [one[2] for one in about["spans"]]):
        raise _damaged(file, "its content does not match its digest")
    return True


def _digests(file: BinaryIO, size: int, spans: Sequence[Span], *, whole: bool) -> tuple[str, list[str]]:
    """Return the digest of all bytes outside the ordered spans and, if `whole`, the digest of each span."""
    rest, found, place = hashlib.sha256(), [], 0
    for begin, count in spans:
        _update(rest, file, place, begin)
        place = begin + count
        if whole:
            own = hashlib.sha256()
            _update(own, file, begin, place)
            found.append(own.hexdigest())
    _update(rest, file, place, size)
    return rest.hexdigest(), found


def _update(digest: Any, file: BinaryIO, begin: int, end: int) -> None:
    file.seek(begin)
    for part in _parts(file, end - begin):
        digest.update(part)


def _parts(file: BinaryIO, count: int) -> Iterator[bytes]:
    while count > 0 and (part := file.read(min(count, _AT_ONCE))):
        yield part
        count -= len(part)


def _has_mark(file: BinaryIO) -> bool:
    """Return whether a file, which may be truncated, contains the mark of files with a digest."""
    marks = (MARK.encode(), _FORM.encode())
    file.seek(0)
    last = b""
    for part in iter(lambda: file.read(_AT_ONCE), b""):
        last = last[-len(MARK) :] + part
        if any(mark in last for mark in marks):
            return True
    return False


def _end_of_data(file: BinaryIO) -> int | None:
    """Return the end of the data of an HDF5 file (bytes) from its superblock; None for other or unusual files."""
    file.seek(0)
    head = file.read(64)
    if not head.startswith(_HDF5) or len(head) < 64:
        return None
    # "The HDF5 File Format Specification", superblock of versions 0 to 3 with addresses of 8 bytes
    place, width = {0: (40, head[13]), 1: (44, head[13]), 2: (28, head[9]), 3: (28, head[9])}.get(head[8], (0, 0))
    return int.from_bytes(head[place : place + 8], "little") if width == 8 else None


def _damaged(file: BinaryIO, found: str) -> StudyError:
    return StudyError(f"{str(file.name)!r} is damaged: {found}. Use another copy of the file, or run the study again.")
