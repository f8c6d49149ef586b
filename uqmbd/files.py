"""Atomic writing of files and folders, and checks of files."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from uqmbd.errors import StudyError

__all__ = ["check_script", "flush", "no_link", "regular", "replacing", "scratch", "sweep"]

_PREFIX = ".uqmbd-"
_SUFFIX = ".part"
_OLD = "old"
_MARK = "uqmbd"
_MARK_TEXT = b"uqmbd writes here, and removes this folder.\n"
"""Contents of the file that distinguishes a temporary folder of uqmbd from a folder of the user."""


def no_link(path: str | os.PathLike[str], flags: int, mode: int = 0o666) -> int:
    """Open a file like `os.open`, but do not follow a symbolic link of this name; an opener for `open`.

    Use this opener to write in folders that others may share; otherwise a link could redirect the writing to another
    file.  A pipe does not block.
    """
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), mode)


@contextlib.contextmanager
def regular(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file for reading; reading from a pipe or a device could block forever.

    Raise StudyError if the path is not a regular file. Raise OSError if it cannot be opened.
    """

    def at_once(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    with open(path, "rb", opener=at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise StudyError(f"{str(path)!r} is a pipe, a device or a socket; expected a regular file.")
        yield file


@contextlib.contextmanager
def replacing(path: Path, *, lasting: bool = True) -> Iterator[Path]:
    """Yield a temporary path for a file or folder, and rename it to `path` if the context ends without an error.

    Readers find either the old or the complete new contents.  Incomplete contents are removed.

    The folder of `path` must exist. If `lasting`, the contents survive a power loss: they are written to the disk
    before the renaming. The temporary path does not exist yet, and only the owner can read its folder.

    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / "a.txt") as part:
    ...         _ = part.write_text("whole")
    ...     print([(f.name, f.read_text()) for f in Path(folder).iterdir()])
    [('a.txt', 'whole')]
    """
    with scratch(path.parent) as place:
        part = place / "new"
        yield part
        if lasting:
            flush(part)
        if path.is_dir() and not path.is_symlink():
            if not part.is_dir() and os.listdir(path):
                raise IsADirectoryError(errno.EISDIR, "there is a folder of this name", str(path))
            (place / _OLD).mkdir()
            os.replace(path, place / _OLD / path.name)
        os.replace(part, path)
    if lasting:
        with contextlib.suppress(OSError):  # some systems cannot open folders
            _flush(path.parent)


@contextlib.contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """Yield a new subfolder, on the file system of `folder`, for the temporary path ``new``; remove it at the end."""
    place = Path(tempfile.mkdtemp(dir=folder, prefix=_PREFIX, suffix=_SUFFIX))
    try:
        (place / _MARK).write_bytes(_MARK_TEXT)
        yield place
    finally:
        _discard(place)


def sweep(folder: Path) -> None:
    """Remove incomplete files of killed processes from a folder; no process may write to the folder meanwhile.

    The function restores contents that a killed process moved away but did not replace.  It does not remove folders of
    the user with a similar name.
    """
    for part in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
        if _is_scratch(part):
            _discard(part)


def _is_scratch(place: Path) -> bool:
    try:
        if place.is_symlink() or not {_MARK} <= set(os.listdir(place)) <= {_MARK, "new", _OLD}:
            return False
        with open(place / _MARK, "rb", opener=no_link) as file:
            mark = file.read(len(_MARK_TEXT) + 1)
        # a killed process may leave an incomplete mark
        return mark == _MARK_TEXT or (os.listdir(place) == [_MARK] and _MARK_TEXT.startswith(mark))
    except OSError:
        return False


def _discard(scratch: Path) -> None:
    """Remove a temporary folder, and restore older contents that have not been replaced."""
    for old in (scratch / _OLD).glob("*"):
        place = scratch.parent / old.name
        if not place.exists():
            os.replace(old, place)
    # remove the mark last, so that `sweep` recognises the folder if this process is killed here
    for part in (scratch / "new", scratch / _OLD):
        if part.is_dir() and not part.is_symlink():
            shutil.rmtree(part, ignore_errors=True)
    with contextlib.suppress(OSError):
        for name in ("new", _MARK):
            (scratch / name).unlink(missing_ok=True)
        scratch.rmdir()


def flush(path: Path) -> None:
    """Write a file, or all files of a folder, to the disk, so that they survive a power loss."""
    for file in [path, *path.rglob("*")]:
        if file.is_file():
            _flush(file)


def _flush(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def check_script(path: str | os.PathLike[str]) -> Path:
    """Return the path of a study script, without importing large libraries.

    Raise StudyError if the file does not exist, or is not a Python file.
    """
    file = Path(path)
    try:
        folder, exists = file.is_dir(), file.exists()
    except (OSError, ValueError) as error:  # the name is too long, or contains a null character
        raise StudyError(f"{str(path)[:100]!r} cannot be the name of a study script: {error}.") from None
    if folder:
        raise StudyError(f"{path} is a folder; expected a study script (a .py file).{_alternatives(file)}")
    if not exists:
        raise StudyError(f"The file {path} does not exist (current folder: {Path.cwd()}).{_alternatives(file.parent)}")
    if file.suffix != ".py":
        raise StudyError(f"{path} is not a Python file; a study script is a .py file with a module-level `study`.")
    return file


def _alternatives(folder: Path) -> str:
    """Return a sentence with the Python files of a folder, as alternatives to a misspelt name."""
    if not folder.is_dir():
        return ""
    names = sorted(found.name for found in folder.glob("*.py"))
    if not names:
        return ""
    listed = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
    return f" Python files in {folder}: {listed}."
