"""Store of bytes on disk that returns neither damaged data nor data of other users."""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from uqmbd.files import no_link, replacing

__all__ = ["Store"]

_MAGIC = b"uqmbd store 1\n"
_HEADER = len(_MAGIC) + 8 + hashlib.sha256().digest_size
_FOREIGN = stat.S_IWGRP | stat.S_IWOTH
_CHECKED = hasattr(os, "geteuid")
"""Whether files have owners and modes, as with POSIX."""


@dataclass(frozen=True)
class Store:
    """Bytes by key, in a private folder of the user.

    The folder is made with mode 0700 on the first write; the mode of an existing folder is never changed. A file
    contains a header (a mark, the length, and the SHA-256 digest of key and content) and the content. A file counts as
    missing if it fails the check, belongs to another user, or is writable for others. Content that cannot be written is
    not stored; a process warns once of each reason. A digest detects accidental damage; owner and mode protect against
    manipulation.
    """

    folder: Path

    def path(self, key: str) -> Path:
        """Return the file of a key; the key is the file name."""
        return self.folder / f"{key}.stored"

    def get(self, key: str) -> bytes | None:
        """Return the content of a key; None if it is missing, damaged, or belongs to another user."""
        try:
            if not self._private():
                return None
            with open(self.path(key), "rb", opener=no_link) as file:
                about = os.fstat(file.fileno())
                if not stat.S_ISREG(about.st_mode) or (_CHECKED and not _ours(about)):
                    return None
                data = file.read()
        except OSError:
            return None
        content = data[_HEADER:]
        return content if data[:_HEADER] == _header(key, content) else None

    def put(self, key: str, content: bytes) -> None:
        """Store the content of a key, if possible."""
        try:
            self.folder.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(FileExistsError):
                self.folder.mkdir(mode=0o700)
            if self._private():
                with (
                    replacing(self.path(key), lasting=False) as part,
                    open(part, "xb", opener=lambda path, flags: no_link(path, flags, 0o600)) as file,
                ):
                    file.write(_header(key, content) + content)
        except OSError as error:
            _report(
                f"{self.folder} cannot be written ({error.strerror or error}): compiled equations are not stored, so "
                "each process compiles them again. Set UQMBD_CACHE to a writable folder."
            )

    @contextlib.contextmanager
    def alone(self, key: str) -> Iterator[None]:
        """Wait until no other process makes the content of the key; then hold a lock for the key in the context.

        If the system does not support locks, or the folder is not writable, the context starts at once.
        """
        path, handle = self.folder / f"{key}.lock", -1
        with contextlib.suppress(OSError, ImportError):
            import fcntl

            if self.folder.is_dir() and self._private():
                handle = no_link(path, os.O_RDWR | os.O_CREAT, 0o600)
                fcntl.flock(handle, fcntl.LOCK_EX)
        try:
            yield
        finally:
            if handle >= 0:
                with contextlib.suppress(OSError):
                    path.unlink()
                os.close(handle)

    def _private(self) -> bool:
        """Return whether the folder belongs to the user, is not a link, and is not writable for others."""
        about = self.folder.lstat()
        if stat.S_ISDIR(about.st_mode) and (not _CHECKED or _ours(about)):
            return True
        _report(
            f"{self.folder} is not used: it is not a folder, belongs to another user, or is writable by others. uqmbd "
            "executes the files in this folder, so only you may have write access (mode 0700). Remove it, or set "
            "UQMBD_CACHE to another folder."
        )
        return False


@cache
def _report(problem: str) -> None:
    """Issue each warning at most once in a process."""
    warnings.warn(problem, stacklevel=2)


def _ours(about: os.stat_result) -> bool:
    return about.st_uid == os.geteuid() and not about.st_mode & _FOREIGN


def _header(key: str, content: bytes) -> bytes:
    digest = hashlib.sha256(key.encode() + b"\0")
    digest.update(content)
    return _MAGIC + len(content).to_bytes(8, "little") + digest.digest()
