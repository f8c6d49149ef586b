"""Files that are there as a whole or not at all."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from uqmbd.errors import StudyError

__all__ = ["check_script", "flush", "no_link", "replacing", "sweep"]

_PREFIX = ".uqmbd-"
_SUFFIX = ".part"
_OLD = "old"


def no_link(path: str | os.PathLike[str], flags: int, mode: int = 0o666) -> int:
    """Open a file as `os.open` does, but never what a symbolic link of this name leads to; an opener for `open`.

    Everything that is opened for writing in a folder that others may share is opened so: else a link there decides
    what is overwritten.  A pipe does not block.
    """
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), mode)


@contextlib.contextmanager
def replacing(path: Path, *, lasting: bool = True) -> Iterator[Path]:
    """Yield a place beside `path` to write a file or a folder to, which takes the name if the context ends well.

    A reader meets what was there before or what is there afterwards.  What is half written is removed.

    Parameters
    ----------
    path : Path
        In a folder that exists.
    lasting : bool
        Whether it must survive a loss of power: it is on the disk before it takes the name.

    Yields
    ------
    Path
        Nothing is there yet; in a folder that its owner alone can read.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / "a.txt") as part:
    ...         _ = part.write_text("whole")
    ...     print([(f.name, f.read_text()) for f in Path(folder).iterdir()])
    [('a.txt', 'whole')]
    """
    # in the same folder, hence on the same file system: a name changes at once
    scratch = Path(tempfile.mkdtemp(dir=path.parent, prefix=_PREFIX, suffix=_SUFFIX))
    try:
        part = scratch / "new"
        yield part
        if lasting:
            flush(part)
        if path.is_dir():
            (scratch / _OLD).mkdir()
            os.replace(path, scratch / _OLD / path.name)
        os.replace(part, path)
    finally:
        _discard(scratch)
    if lasting:
        with contextlib.suppress(OSError):  # folders cannot be opened everywhere
            _flush(path.parent)


def sweep(folder: Path) -> None:
    """Remove what processes that were killed left half written in a folder; nobody must be writing there.

    What one had just moved away, to put something in its place, is put back.
    """
    for part in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
        _discard(part)


def _discard(scratch: Path) -> None:
    """Remove a place beside others, but for what was there before and has not been replaced."""
    for old in (scratch / _OLD).glob("*"):
        place = scratch.parent / old.name
        if not place.exists():
            os.replace(old, place)
    shutil.rmtree(scratch, ignore_errors=True)


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

    Raises
    ------
    uqmbd.StudyError
        If there is no such file, or it is no Python file.
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
