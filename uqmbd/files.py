"""Files that are there as a whole or not at all."""

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
"""What tells a folder for what is half written from one of the user's of such a name."""


def no_link(path: str | os.PathLike[str], flags: int, mode: int = 0o666) -> int:
    """Open a file as `os.open` does, but never what a symbolic link of this name leads to; an opener for `open`.

    Everything that is opened for writing in a folder that others may share is opened so: else a link there decides
    what is overwritten.  A pipe does not block.
    """
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), mode)


@contextlib.contextmanager
def regular(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file to read; a pipe or a device could keep the reader waiting for ever.

    Raise StudyError if it is something else. Raise OSError if it cannot be opened.
    """

    def at_once(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))

    with open(path, "rb", opener=at_once) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise StudyError(f"{str(path)!r} is a pipe, a device or a socket; expected a regular file.")
        yield file


@contextlib.contextmanager
def replacing(path: Path, *, lasting: bool = True) -> Iterator[Path]:
    """Yield a place beside `path` to write a file or a folder to, which takes the name if the context ends well.

    A reader meets what was there before or what is there afterwards.  What is half written is removed.

    `path`: in a folder that exists; `lasting`: whether it must survive a loss of power: it is on the disk before it
    takes the name. Yield nothing is there yet; in a folder that its owner alone can read.

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
        with contextlib.suppress(OSError):  # folders cannot be opened everywhere
            _flush(path.parent)


@contextlib.contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """Yield a new folder in another one, hence on the same file system, in which ``new`` may be made; it is removed."""
    place = Path(tempfile.mkdtemp(dir=folder, prefix=_PREFIX, suffix=_SUFFIX))
    try:
        (place / _MARK).write_bytes(_MARK_TEXT)
        yield place
    finally:
        _discard(place)


def sweep(folder: Path) -> None:
    """Remove what processes that were killed left half written in a folder; nobody must be writing there.

    What one had just moved away, to put something in its place, is put back.  What only has such a name is left.
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
        # a process may be killed while it writes the mark
        return mark == _MARK_TEXT or (os.listdir(place) == [_MARK] and _MARK_TEXT.startswith(mark))
    except OSError:
        return False


def _discard(scratch: Path) -> None:
    """Remove a place beside others, but for what was there before and has not been replaced."""
    for old in (scratch / _OLD).glob("*"):
        place = scratch.parent / old.name
        if not place.exists():
            os.replace(old, place)
    # the mark last: what is left by who is killed here is still known
    for part in (scratch / "new", scratch / _OLD):
        if part.is_dir() and not part.is_symlink():
            shutil.rmtree(part, ignore_errors=True)
    with contextlib.suppress(OSError):
        for name in ("new", _MARK):
            (scratch / name).unlink(missing_ok=True)
        scratch.rmdir()


def flush(path: Path) -> None:
    """Have a file, or all files of a folder, on the disk, where they survive a loss of power."""
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
    """Return the path of a study script if there is such a file, else raise; nothing heavy is imported for it.

    Raise StudyError if there is no such file, or it is no Python file.
    """
    file = Path(path)
    try:
        folder, exists = file.is_dir(), file.exists()
    except (OSError, ValueError) as error:  # a name that is too long, or has a null character
        raise StudyError(f"{str(path)[:100]!r} cannot be the name of a study script: {error}.") from None
    if folder:
        raise StudyError(f"{path} is a folder; a study script (a .py file) is expected.{_alternatives(file)}")
    if not exists:
        raise StudyError(f"There is no file {path} (looked in {Path.cwd()}).{_alternatives(file.parent)}")
    if file.suffix != ".py":
        raise StudyError(f"{path} is not a Python file; a study script is a .py file with a module-level `study`.")
    return file


def _alternatives(folder: Path) -> str:
    """Name the Python files of a folder, for someone who mistyped one of them."""
    if not folder.is_dir():
        return ""
    names = sorted(found.name for found in folder.glob("*.py"))
    if not names:
        return ""
    listed = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
    return f" Python files in {folder}: {listed}."
