"""Files that are there as a whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

__all__ = ["replacing", "sweep"]

_PREFIX = ".uqmbd-"
_SUFFIX = ".part"


@contextlib.contextmanager
def replacing(path: Path, *, lasting: bool = True) -> Iterator[Path]:
    """Yield an empty file beside `path` to write to; it takes the name when the context ends without an exception.

    A reader meets what was there before or what is there afterwards.  What is half written is removed.

    Parameters
    ----------
    path : Path
        In a folder that exists.
    lasting : bool
        Whether it must survive a loss of power: its content is on the disk before it takes the name.

    Yields
    ------
    Path
        Readable and writable by its owner alone while it is written.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / "a.txt") as part:
    ...         _ = part.write_text("whole")
    ...     print([(f.name, f.read_text()) for f in Path(folder).iterdir()])
    [('a.txt', 'whole')]
    """
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=_PREFIX, suffix=_SUFFIX)
    os.close(handle)
    part = Path(name)
    try:
        yield part
        if lasting:
            _flush(part)
        os.replace(part, path)
    except BaseException:
        with contextlib.suppress(OSError):
            part.unlink()
        raise
    if lasting:
        with contextlib.suppress(OSError):  # folders cannot be opened everywhere
            _flush(path.parent)


def sweep(folder: Path) -> None:
    """Remove what processes that were killed left half written in a folder; nobody must be writing there."""
    for part in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
        with contextlib.suppress(OSError):
            part.unlink()


def _flush(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
