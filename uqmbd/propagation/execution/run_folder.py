"""The folder of a run: one run at a time, and results of an earlier one are set aside."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import sys
import threading
import warnings
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from uqmbd.errors import StudyError
from uqmbd.files import sweep

__all__ = ["PREVIOUS", "claimed", "set_aside"]

PREVIOUS = "previous"
"""Folder of the results that were there before, within that of a run."""

_LOCK = ".uqmbd-lock"
_BYTE = 1 << 20
"""Where a lock of Windows lies: beyond the text, which others then can read."""

_RESULTS = ("results.nc", "report.html", "motion.nc", "pose_surrogate.nc", "figures", "*-samples.zarr", "*-samples.nc")

_held: set[tuple[Path, int]] = set()
"""Folders that threads of this process have claimed."""


@contextlib.contextmanager
def claimed(folder: Path | None) -> Iterator[None]:
    """Hold a folder for one run, while the context lasts and the process lives; a thread may hold it several times.

    The operating system ends the claim with the process, however that ends.

    Parameters
    ----------
    folder : Path, optional
        Made if it does not exist; None: nothing is held.

    Raises
    ------
    StudyError
        If another run holds it: its process, and the way out.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place, claimed(Path(place)), claimed(Path(place)):
    ...     print("ours")
    ours
    """
    if folder is None:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    claim = (folder.resolve(), threading.get_ident())
    if claim in _held:
        yield
        return
    lock = folder / _LOCK
    handle = _locked(folder, lock)
    _held.add(claim)
    try:
        sweep(folder)
        yield
    finally:
        _held.discard(claim)
        with contextlib.suppress(OSError):  # Windows does not remove what is open
            lock.unlink()
        os.close(handle)


def _locked(folder: Path, lock: Path) -> int:
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if not _lock(handle):
                raise _taken(folder, _read(handle))
            # whoever held it may have removed the file after it was opened here
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), lock.stat()):
                    _write(handle)
                    return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _lock(handle: int) -> bool:
    """Lock an open file, or say that another process has."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(handle, _BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        warnings.warn(
            f"this file system has no locks ({error.strerror}), so nothing keeps a second run out of the folder.",
            stacklevel=2,
        )
    return True


def _write(handle: int) -> None:
    text = f"process {os.getpid()} on {socket.gethostname()}, since {datetime.now():%Y-%m-%d %H:%M:%S}"
    os.ftruncate(handle, 0)
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, text.encode())


def _read(handle: int) -> str:
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 1000).decode(errors="replace") or "another process"


def _taken(folder: Path, owner: str) -> StudyError:
    return StudyError(
        f"{folder}: another run writes into this folder ({owner}). Wait until it has ended, or end it, or give this "
        "run a folder of its own (--out DIR; in Python: folder=)."
    )


def set_aside(folder: Path) -> Path | None:
    """Move the results of an earlier run to ``previous``, in the place of those that are there.

    Returns
    -------
    Path or None
        Where they are now; None: there are none.
    """
    if not (folder / "results.nc").exists():
        return None
    previous = folder / PREVIOUS
    collected = folder / f".{PREVIOUS}"
    shutil.rmtree(collected, ignore_errors=True)
    collected.mkdir()
    # the result itself last: who is killed before begins again with all of it
    for pattern in reversed(_RESULTS):
        for found in folder.glob(pattern):
            found.rename(collected / found.name)
    if previous.exists():
        shutil.rmtree(previous)
    collected.rename(previous)
    return previous
