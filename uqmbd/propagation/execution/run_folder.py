"""Folder of a run: lock the folder for one run at a time, and move results of an earlier run to another folder."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import socket
import stat
import sys
import tempfile
import threading
import warnings
from collections.abc import Collection, Iterator
from datetime import datetime
from pathlib import Path

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.files import no_link, scratch, sweep
from uqmbd.results.storage import (
    FIGURES,
    check_names,
    check_unfinished,
    in_manifest,
    is_ours,
    is_recognised,
    move_aside,
    record,
    start_manifest,
    stores_of,
)

__all__ = ["claimed", "output_folder", "set_aside", "writable"]

_LOCK = ".uqmbd-lock"
_BYTE = 1 << 20
"""Offset of the locked byte on Windows: other processes can then read the text before it."""

_RESULT = "results.nc"
_BESIDE = ("report.html", "motion.nc", "pose_surrogate.nc")

_WRITTEN = re.compile(r"[^/\\.][^/\\]*\.nc|report\.html|" + FIGURES)
"""Names of the files and folders that a command may write."""

_OWNER = re.compile(rb"process \d+ on [^\0\n]*, since \d{4}-\d\d-\d\d \d\d:\d\d:\d\d")
"""Content of a lock file."""

_held: set[tuple[Path, int]] = set()
"""Folders that threads of this process have locked."""


@contextlib.contextmanager
def claimed(folder: Path | None) -> Iterator[None]:
    """Lock a folder for one run within the context; a thread may lock it several times.

    The folder is created if it does not exist. If `folder` is None, nothing is locked. The operating system releases
    the lock when the process ends. Raise StudyError if another run has locked the folder; the message states the
    process and the remedy.
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
        with contextlib.suppress(OSError):  # Windows does not remove open files
            lock.unlink()
        os.close(handle)


def _locked(folder: Path, lock: Path) -> int:
    while True:
        made = _made(folder, lock)
        try:
            handle = no_link(lock, os.O_RDWR) if made is None else made
        except FileNotFoundError:  # the other run has removed its lock
            continue
        except OSError as error:  # a link, or a folder
            raise _not_a_lock(lock) from error
        try:
            if made is not None:
                return handle
            if not stat.S_ISREG(os.fstat(handle).st_mode) or not _OWNER.match(_content(handle)):
                raise _not_a_lock(lock)
            if not _lock(handle):
                raise _taken(folder, _read(handle))
            # the other run may have removed the file after this process opened it
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), lock.lstat()):
                    _write(handle)
                    return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _made(folder: Path, lock: Path) -> int | None:
    """Make a lock file that names this process and is locked from the start; return None if a lock file exists."""
    if os.path.lexists(lock):
        return None
    with scratch(folder) as place:
        part = place / "new"
        try:
            handle = no_link(part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
        except FileNotFoundError:  # another run has locked the folder, and removed this file
            return None
        try:
            _write(handle)
            _lock(handle)
            os.link(part, lock)
        except (FileExistsError, FileNotFoundError):  # another run has created the file in the meantime
            os.close(handle)
            return None
        except OSError as error:
            os.close(handle)
            if error.errno not in (errno.EPERM, errno.ENOTSUP, errno.ENOSYS, errno.EOPNOTSUPP):
                raise
        else:
            return handle
    # the file system does not support links
    try:
        handle = no_link(lock, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError:
        return None
    _lock(handle)
    _write(handle)
    return handle


def _lock(handle: int) -> bool:
    """Lock an open file; return whether no other process has locked it."""
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
            f"The file system of the run folder does not support locks ({error.strerror}). Do not start a second run "
            "with the same folder.",
            stacklevel=2,
        )
    return True


def _write(handle: int) -> None:
    text = f"process {os.getpid()} on {socket.gethostname()}, since {datetime.now():%Y-%m-%d %H:%M:%S}".encode()
    # the order matters: a process that is killed in between leaves a file that is recognised as a lock
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, text)
    os.ftruncate(handle, len(text))


def _content(handle: int) -> bytes:
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 1000)


def _read(handle: int) -> str:
    return _content(handle).decode(errors="replace")


def _not_a_lock(lock: Path) -> StudyError:
    return StudyError(
        f"{lock} exists, but uqmbd did not write it. uqmbd needs this file name to lock the folder. Nothing was "
        "changed or computed. Remove the file, or use another folder (--out DIR; in Python: folder=)."
    )


def _taken(folder: Path, owner: str) -> StudyError:
    return StudyError(
        f"{folder}: another run writes into this folder ({owner}). Wait until it ends, stop it, or use another "
        "folder for this run (--out DIR; in Python: folder=)."
    )


def set_aside(folder: Path, needed: Collection[str] = ("results.nc",), stores: Collection[str] = ()) -> Path | None:
    """Move the results of an earlier run to another folder and return it, or None; other files stay in place.

    Results in the manifest move to ``previous``, and replace the content of ``previous``. Other files that uqmbd may
    have written move to a new folder ``previous-N``. `needed` contains the names that the run will write; `stores`
    contains the names of sample stores that the run may write or continue. The function also checks the name of the
    chunk folder. If uqmbd did not write an existing file with one of these names, raise StudyError before the first
    move.
    """
    check_unfinished(folder)
    check_names(folder, stores)
    names = check_names(folder, needed)
    if _RESULT in needed and os.path.lexists(folder / _RESULT):
        stores = stores_of(folder / _RESULT)
        ours = [name for name in in_manifest(folder) if is_ours(folder, name)]
        others = [name for name in (*_BESIDE, *stores) if is_recognised(folder / name)]
        names = list(dict.fromkeys([_RESULT, *names, *ours, *others]))
    else:
        # results of another command that this run writes again
        earlier = [name for name in in_manifest(folder) if name in needed or name.partition("/")[0] in needed]
        names = list(dict.fromkeys([*names, *(name for name in earlier if is_ours(folder, name))]))
    try:
        start_manifest(folder)
        return move_aside(folder, names) if names else None
    except OSError as error:
        where = error.filename or folder
        raise StudyError(
            f"{where} cannot be written: {error.strerror or error}. Nothing was computed. The previous content of "
            f"{folder} is unchanged, or is in its subfolder previous-N."
        ) from error


@contextlib.contextmanager
@typechecked
def output_folder(folder: str | os.PathLike[str], names: Collection[str]) -> Iterator[Path]:
    """Lock the output folder of a command, and preserve all files of the user in it.

    Existing results of uqmbd with these names are moved to ``previous`` or ``previous-N`` within the folder, with a
    note on the standard error. The manifest of the folder records the new files with these names, so that a later
    command may replace them. No other run can write into the folder within the context.

    Parameters
    ----------
    folder : path-like
        Folder to write into; it is created if missing.
    names : collection of str
        Names that the command writes: files of results (``.nc``), ``report.html``, and ``figures``.

    Yields
    ------
    pathlib.Path
        Path of the folder.

    Raises
    ------
    uqmbd.StudyError
        If the folder is not writable, another run writes into it, or a file with one of the names exists that uqmbd did
        not write. In these cases, no file is moved.

    Examples
    --------
    >>> import tempfile, uqmbd, xarray
    >>> from uqmbd.results import save
    >>> tree = xarray.DataTree(xarray.Dataset(attrs={"study": "crank"}))
    >>> with tempfile.TemporaryDirectory() as place:
    ...     with uqmbd.extend.output_folder(place, ["fit.nc"]) as folder:
    ...         path = save(tree, folder / "fit.nc")
    ...     print(path.name, path.exists())
    fit.nc True
    """
    several = isinstance(names, Collection) and not isinstance(names, (str, bytes))
    if not several or not all(isinstance(name, str) and _WRITTEN.fullmatch(name) for name in names):
        raise StudyError(
            f"output_folder: names is {names!r}; expected a list of files of results (.nc), 'report.html' and "
            "'figures'."
        )
    place = writable(folder)
    with claimed(place):
        previous = set_aside(place, names)
        if previous is not None:
            print(f"Note: the previous results in {place} were moved to {previous}.", file=sys.stderr, flush=True)
        try:
            yield place
        finally:
            # if the command ended early, the folder may contain files of other programs
            there = [name for name in names if name != FIGURES and is_recognised(place / name)]
            with contextlib.suppress(OSError):  # the disk may be full; the first error matters
                record(place, there, stated=True)


def writable(folder: str | os.PathLike[str]) -> Path:
    """Return a folder as a path after a check that files can be created in the folder."""
    try:
        place = Path(folder)
    except TypeError:
        raise StudyError(f"output_folder: the folder is {folder!r}; expected a path.") from None
    # without the permission to search a parent folder, pathlib raises an error, but os.path reports a missing path
    if os.path.exists(place) and not os.path.isdir(place):
        raise StudyError(f"--out {place} is a file; expected a folder, which uqmbd creates if it does not exist.")
    try:
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=place):
            pass
    except (OSError, ValueError) as error:  # ValueError: a null character
        raise StudyError(
            f"--out {place}: uqmbd cannot write to this folder ({getattr(error, 'strerror', None) or error}). Use "
            "another folder."
        ) from error
    return place
