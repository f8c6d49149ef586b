"""The folder of a run: one run at a time, and results of an earlier one are set aside."""

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
"""Where a lock of Windows lies: beyond the text, which others then can read."""

_RESULT = "results.nc"
_BESIDE = ("report.html", "motion.nc", "pose_surrogate.nc")

_WRITTEN = re.compile(r"[^/\\.][^/\\]*\.nc|report\.html|" + FIGURES)
"""What a command may write into a folder."""

_OWNER = re.compile(rb"process \d+ on [^\0\n]*, since \d{4}-\d\d-\d\d \d\d:\d\d:\d\d")
"""What is in a lock."""

_held: set[tuple[Path, int]] = set()
"""Folders that threads of this process have claimed."""


@contextlib.contextmanager
def claimed(folder: Path | None) -> Iterator[None]:
    """Lock a folder for one run, while the context lasts and the process lives; a thread may lock it several times.

    The folder is made if it does not exist; None: nothing is locked. The operating system ends the lock with the
    process. Raise StudyError if another run holds it: its process, and the remedy.
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
        made = _made(folder, lock)
        try:
            handle = no_link(lock, os.O_RDWR) if made is None else made
        except FileNotFoundError:  # whoever held it has removed it
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
            # whoever held it may have removed the file after it was opened here
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), lock.lstat()):
                    _write(handle)
                    return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _made(folder: Path, lock: Path) -> int | None:
    """Make a lock that says whose it is, and is held, from the moment at which it has its name; None: there is one."""
    if os.path.lexists(lock):
        return None
    with scratch(folder) as place:
        part = place / "new"
        try:
            handle = no_link(part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
        except FileNotFoundError:  # another run has the folder, and swept this
            return None
        try:
            _write(handle)
            _lock(handle)
            os.link(part, lock)
        except (FileExistsError, FileNotFoundError):  # likewise
            os.close(handle)
            return None
        except OSError as error:
            os.close(handle)
            if error.errno not in (errno.EPERM, errno.ENOTSUP, errno.ENOSYS, errno.EOPNOTSUPP):
                raise
        else:
            return handle
    # a file system without links
    try:
        handle = no_link(lock, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
    except FileExistsError:
        return None
    _lock(handle)
    _write(handle)
    return handle


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
    text = f"process {os.getpid()} on {socket.gethostname()}, since {datetime.now():%Y-%m-%d %H:%M:%S}".encode()
    # in this order: whoever is killed in between leaves what is known as a lock
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
        f"{lock} is in the way: uqmbd keeps other runs out of the folder by a file of this name, and did not write "
        "what is there. It is left as it is, and nothing was computed. Remove it, or give another folder (--out DIR; "
        "in Python: folder=)."
    )


def _taken(folder: Path, owner: str) -> StudyError:
    return StudyError(
        f"{folder}: another run writes into this folder ({owner}). Wait until it has ended, or end it, or give this "
        "run a folder of its own (--out DIR; in Python: folder=)."
    )


def set_aside(folder: Path, needed: Collection[str] = ("results.nc",), stores: Collection[str] = ()) -> Path | None:
    """Move the results of an earlier run away and return their folder, or None; files of others stay where they are.

    Results in the manifest go to ``previous``, replacing those there. Others that uqmbd can have written go to a new
    folder ``previous-N``. `needed` are the names that the run will write, `stores` those of stores of samples that it
    may write or continue. Raise StudyError, before anything is moved, if one of these names, or that of the chunks of a
    run, belongs to something else.
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
        # results of another command that are written again
        earlier = [name for name in in_manifest(folder) if name in needed or name.partition("/")[0] in needed]
        names = list(dict.fromkeys([*names, *(name for name in earlier if is_ours(folder, name))]))
    try:
        start_manifest(folder)
        return move_aside(folder, names) if names else None
    except OSError as error:
        where = error.filename or folder
        raise StudyError(
            f"{where} cannot be written: {error.strerror or error}. Nothing was computed; what was in {folder} is "
            "there, or in a folder previous-N there."
        ) from error


@contextlib.contextmanager
@typechecked
def output_folder(folder: str | os.PathLike[str], names: Collection[str]) -> Iterator[Path]:
    """Hold the folder that a command writes into, without loss of anything that the user has there.

    Results of uqmbd of these names are moved to ``previous`` or ``previous-N`` within the folder, with a note on the
    standard error.  What is written under these names is noted in the manifest of the folder, so that a later command
    may replace it.  No other run writes into the folder meanwhile.

    Parameters
    ----------
    folder : path-like
        Made if it does not exist.
    names : collection of str
        What the command writes there: files of results, which end in ``.nc``, ``report.html``, and ``figures``.

    Yields
    ------
    pathlib.Path
        The folder.

    Raises
    ------
    uqmbd.StudyError
        If the folder cannot be written, another run writes into it, or one of the names is taken by something that
        uqmbd did not write.  Then nothing was moved.

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
            print(f"Note: the results that were in {place} are in {previous} now.", file=sys.stderr, flush=True)
        try:
            yield place
        finally:
            # a command that ended early may have found others' files there
            there = [name for name in names if name != FIGURES and is_recognised(place / name)]
            with contextlib.suppress(OSError):  # a disk that is full; the error that was first matters
                record(place, there, stated=True)


def writable(folder: str | os.PathLike[str]) -> Path:
    """Return a folder in which files can be made, before anything is computed for it."""
    try:
        place = Path(folder)
    except TypeError:
        raise StudyError(f"output_folder: the folder is {folder!r}; expected a path.") from None
    # pathlib raises where a folder on the way may not be searched; os.path takes it for nothing that is there
    if os.path.exists(place) and not os.path.isdir(place):
        raise StudyError(f"--out {place} is a file; a folder is expected, which is made if it does not exist.")
    try:
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=place):
            pass
    except (OSError, ValueError) as error:  # ValueError: a null character
        raise StudyError(
            f"--out {place}: this folder cannot be written ({getattr(error, 'strerror', None) or error})."
        ) from error
    return place
