"""Manage the folder with finished chunks of a run, which are stored until its results are complete on the disk.

During a run the chunks are in ``unfinished``, within the folder of the run. After the run they are in ``unsaved`` until
the results are saved in the folder of the run. If the results cannot be saved, the run is unfinished again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uqmbd.errors import StudyError
from uqmbd.files import no_link, replacing, sweep
from uqmbd.results.storage.manifest import start_manifest

__all__ = [
    "FOLDER",
    "WITHIN",
    "begin",
    "check_unfinished",
    "computed",
    "resume_hint",
    "is_unfinished",
    "make",
    "reopen",
    "saved",
    "unsaved",
]

FOLDER = "unfinished"

_ENDED = "unsaved"
_MARK = "results"
_OWNER = ".uqmbd"
_ASKED = "asked.json"
_OWNER_TEXT = "uqmbd made this folder, and removes it when the results are saved.\n"

_METHOD, _KEY = "[0-9a-f]{16}", "[0-9a-f]{32}"
_CHUNKS = rf"{_METHOD}/{_KEY}(\.task)?\.npz"
_STORE = rf"{_METHOD}/({_KEY}|old)\.zarr"
_SCRATCH = rf"({_METHOD}/)?\.uqmbd-[a-z0-9_]{{8}}\.part(/(uqmbd|new|old)(/.+)?)?"
_FOLDERS = re.compile(rf"{_METHOD}|{_STORE}(/[^/]+)?|{_METHOD}/{_KEY}\.rest|{_CHUNKS}|{_SCRATCH}")
_CHUNK = r"\d+(\.\d+)*|\.[0-9a-f]{16}\.part"
_FILES = re.compile(
    rf"\{_OWNER}|asked\.json|budget\.json|{_MARK}|{_CHUNKS}|{_METHOD}/{_KEY}\.(journal|token)|"
    rf"{_STORE}(/[^/]+)?/({_CHUNK}|\.z[a-z]+)|{_METHOD}/{_KEY}\.rest/({_CHUNK})|{_SCRATCH}"
)
"""Names of files that uqmbd writes into these folders; uqmbd does not remove other files."""

WITHIN = "convergence"
"""Folder, within the folder of the chunks of a run, for the chunks of its convergence runs (error over cost)."""


def begin(folder: Path, *, resume: bool) -> None:
    """Create the folder of the chunks of a run; remove the chunks of an earlier run, or reuse them (`resume`).

    Raise StudyError, with the path and a remedy, if a file of another program has the name of the folder or is in it.
    """
    check_unfinished(folder)
    place = folder / FOLDER
    try:
        start_manifest(folder)
        if resume:
            reopen(folder)
        else:
            for name in (FOLDER, _ENDED):
                _remove(folder / name)
        make(folder)
        if not (place / _OWNER).exists():
            with replacing(place / _OWNER, lasting=False) as part:
                part.write_text(_OWNER_TEXT)
    except OSError as error:
        where = error.filename or place
        raise StudyError(
            f"{where} cannot be written: {error.strerror or error}. Use another folder (--out DIR; in Python: folder=)."
        ) from error


def make(folder: Path) -> None:
    """Create the folder of the chunks of a run, with its mark of ownership, if it does not exist."""
    place = folder / FOLDER
    if not place.exists():
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(place, lasting=False) as part:
            part.mkdir()
            (part / _OWNER).write_text(_OWNER_TEXT)


def check_unfinished(folder: Path) -> None:
    """Raise a `StudyError` if a folder for the chunks of a run contains, or is, a file that uqmbd did not write."""
    for name in (FOLDER, _ENDED):
        _check(folder / name)


def _check(place: Path) -> None:
    if not os.path.lexists(place):
        return
    found = [place] if place.is_symlink() or not place.is_dir() else _foreign(place)
    if not found and not (place / _OWNER).is_file() and not _is_of_earlier_version(place):
        found = [place]
    if found:
        raise StudyError(
            f"{found[0]} exists, but uqmbd did not write this file or folder. uqmbd stores unfinished results in "
            f"{place}. Nothing was changed or computed. Move or rename the file or folder, or use another folder "
            "(--out DIR; in Python: folder=)."
        )


def _is_of_earlier_version(place: Path) -> bool:
    """Return whether the file ``asked.json`` shows that an earlier version, without ownership marks, made a folder."""
    try:
        with open(place / _ASKED, "rb", opener=no_link) as file:
            found = json.load(file)
        return re.fullmatch(_KEY, found["study"]) is not None and isinstance(found["methods"], dict)
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return False


def _foreign(place: Path) -> list[Path]:
    """Return the contents of a folder of chunks that uqmbd did not write."""
    found = []
    _sweep_all(place)
    for at, folders, files in os.walk(place):
        here = Path(at)
        found += [here / n for n in folders if not _is_own(here / n, place, _FOLDERS) or (here / n).is_symlink()]
        found += [here / n for n in files if not _is_own(here / n, place, _FILES) or not _is_plain(here / n)]
    return found


def _is_plain(path: Path) -> bool:
    return stat.S_ISREG(path.lstat().st_mode)


def _is_own(path: Path, place: Path, names: re.Pattern[str]) -> bool:
    name = path.relative_to(place).as_posix()
    inner = f"{WITHIN}/{FOLDER}"
    if name in (WITHIN, inner):
        return names is _FOLDERS
    return names.fullmatch(name.removeprefix(f"{inner}/")) is not None


def _remove(place: Path) -> None:
    """Remove the files of uqmbd in a folder of chunks, and the folder if it is then empty."""
    if place.is_symlink() or not place.is_dir():
        return
    _sweep_all(place)
    for at, folders, files in os.walk(place, topdown=False):
        here = Path(at)
        for name in files:
            if _is_own(here / name, place, _FILES) and name != _OWNER:
                (here / name).unlink(missing_ok=True)
        for name in folders:
            if _is_own(here / name, place, _FOLDERS):
                with contextlib.suppress(OSError):
                    (here / name).rmdir()
    if set(os.listdir(place)) <= {_OWNER}:
        (place / _OWNER).unlink(missing_ok=True)
        place.rmdir()


def _sweep_all(place: Path) -> None:
    """Remove incomplete files in a folder of chunks and in the folders of its methods."""
    inner = place / WITHIN / FOLDER
    for folder in (place, *place.glob("*"), inner, *inner.glob("*")):
        if folder.is_dir() and not folder.is_symlink():
            sweep(folder)


def computed(folder: Path, attrs: Mapping[Any, Any]) -> None:
    """Record that a run has ended with results that have the root attributes `attrs`.

    A run with failed methods remains unfinished, because these methods may continue with their stored chunks.
    """
    place = folder / FOLDER
    if not place.is_dir() or "failed" in attrs:
        return
    # if this fails, for example on a full disk, the run remains unfinished and no results are lost
    with contextlib.suppress(OSError):
        with replacing(place / _MARK, lasting=False) as part:
            part.write_text(_identity(attrs))
        _remove(folder / _ENDED)
        if not _foreign(place):
            place.rename(folder / _ENDED)


def saved(folder: Path, attrs: Mapping[Any, Any]) -> None:
    """Remove the chunks of results that are now saved in the folder; keep chunks of other results."""
    if _is_of(folder, attrs):
        with contextlib.suppress(OSError):
            _remove(folder / _ENDED)


def unsaved(folder: Path, attrs: Mapping[Any, Any]) -> None:
    """Mark the run of results as unfinished, because the results could not be saved in the folder."""
    if _is_of(folder, attrs):
        reopen(folder)


def reopen(folder: Path) -> None:
    """Mark an ended run with unsaved results as unfinished again."""
    if (folder / _ENDED).is_dir() and not (folder / FOLDER).exists():
        (folder / _ENDED).rename(folder / FOLDER)
        (folder / FOLDER / _MARK).unlink(missing_ok=True)


def is_unfinished(folder: Path) -> bool:
    """Return whether the folder contains chunks of an earlier run that can be resumed."""
    return any(any((folder / name).glob("*/*")) for name in (FOLDER, _ENDED))


def resume_hint(folder: Path) -> str:
    """Return a sentence on how to resume an unfinished run, or an empty text if no run is unfinished."""
    place = folder / FOLDER
    if not place.is_dir():
        return ""
    return (
        f" Computed results are stored in {place}. Free disk space, and continue with --resume (in Python: "
        "study.run(..., folder=..., resume=True))."
    )


def _is_of(folder: Path, attrs: Mapping[Any, Any]) -> bool:
    try:
        return (folder / _ENDED / _MARK).read_text() == _identity(attrs)
    except (OSError, ValueError):
        return False


def _identity(attrs: Mapping[Any, Any]) -> str:
    about = [str(attrs.get(name)) for name in ("study", "mechanism", "created", "uqmbd_version")]
    return hashlib.sha256(repr(about).encode()).hexdigest()
