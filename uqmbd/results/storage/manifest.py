"""Read and write the manifest of a run folder, which lists files of uqmbd by name and digest.

Files without an entry, or with another digest, belong to the user: uqmbd does not remove, move or overwrite them. An
earlier version of uqmbd wrote no manifest, so a result, report or store of samples without an entry may be its output.
uqmbd moves such files to a new folder ``previous-N``, which no run replaces.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
from collections.abc import Collection, Iterable
from pathlib import Path

from uqmbd.errors import StudyError
from uqmbd.files import no_link, replacing

__all__ = [
    "FIGURES",
    "PREVIOUS",
    "check_names",
    "foreign_in_store",
    "has_manifest",
    "in_manifest",
    "is_ours",
    "is_recognised",
    "move_unlisted",
    "move_aside",
    "record",
    "start_manifest",
    "stores_of",
]

MANIFEST = ".uqmbd-manifest.json"
PREVIOUS = "previous"
"""Folder, in the folder of a run, to which earlier results are moved."""
FIGURES = "figures"
"""Folder of the figure files of the report, next to the report."""

_FORM = "uqmbd manifest 1"
_LARGEST = 1 << 24
"""Maximum size of a manifest, bytes."""
_RESULT = re.compile(r"(results|motion|pose_surrogate|comparison)\.nc")
_NAME = re.compile(rf"{_RESULT.pattern}|report\.html|[^/\\]+-samples\.zarr|{FIGURES}/[^/\\]+")
_STATED = re.compile(rf"{_NAME.pattern}|[^/\\.][^/\\]*\.nc")
"""Names as in `_NAME`, and names of other netCDF files, which commands of plugins declare before they write them."""
_TITLE = b" uqmbd report</title>"
_IN_STORE = re.compile(r"\.z[a-z]+|\d+(\.\d+)*|\.[0-9a-f]{16}\.part")
"""Names of files in a store of samples."""
_AT_ONCE = 1 << 20


def in_manifest(folder: Path) -> dict[str, str]:
    """Return the names in the manifest of a folder, with their digests.

    The function ignores names that uqmbd does not write and names that lead out of the folder.
    """
    found = _read(folder / MANIFEST)
    return {} if found is None else found


def has_manifest(folder: Path) -> bool:
    """Return whether a folder has a manifest, as the folder of a run does."""
    return _read(folder / MANIFEST) is not None


def start_manifest(folder: Path) -> None:
    """Create an empty manifest if the folder has none.

    Raise StudyError if another file has the name of the manifest.
    """
    place = folder / MANIFEST
    if not os.path.lexists(place):
        _write(folder, {})
    elif _read(place) is None:
        raise _is_obstacle(place)


def record(folder: Path, names: Iterable[str], places: Collection[Path] = (), *, stated: bool = False) -> None:
    """Record files or folders in the manifest as written by uqmbd.

    `folder`: folder of the run; `names`: names to record; names that runs do not use are ignored unless they are in the
    manifest; `places`: temporary paths of files that are not yet renamed to `names`; `stated`: whether a command
    declared and checked the names beforehand, so that any netCDF file is recorded.
    """
    start_manifest(folder)
    found = in_manifest(folder)
    listed = list(names)
    for name, place in zip(listed, places or [folder / name for name in listed], strict=True):
        known = name in found or (_STATED if stated else _NAME).fullmatch(name)
        if known and (digest := _digest(place)) is not None:
            found[name] = digest
    _write(folder, found)


def is_ours(folder: Path, name: str) -> bool:
    """Return whether the file or folder `name` is in the manifest and unchanged since uqmbd wrote it."""
    noted = in_manifest(folder).get(name)
    if noted is None or ("/" in name and not _is_folder(folder / FIGURES)):
        return False
    return _digest(folder / name) == noted


def is_recognised(place: Path) -> bool:
    """Return whether the content of a file or folder is a result, a report or a store of samples of uqmbd."""
    try:
        if place.name.endswith(".zarr"):
            return _is_folder(place) and _is_store(place) and not foreign_in_store(place)
        if not stat.S_ISREG(place.lstat().st_mode):
            return False
        with open(place, "rb", opener=no_link) as file:
            begin = file.read(4096)
    except OSError:
        return False
    if place.name == "report.html":
        return begin.startswith(b"<!DOCTYPE html>") and _TITLE in begin
    return place.name.endswith(".nc") and _attributes(place) is not None


def stores_of(result: Path) -> list[str]:
    """Return the names of the stores of samples that a result refers to."""
    return _attributes(result) or []


def foreign_in_store(place: Path) -> list[Path]:
    """Return the files in a store of samples that do not belong to it."""
    found = []
    for at, folders, files in os.walk(place):
        deep = Path(at) != place
        found += [Path(at, name) for name in folders if deep or Path(at, name).is_symlink()]
        found += [Path(at, name) for name in files if not _IN_STORE.fullmatch(name) or not _is_file(Path(at, name))]
    return found


def check_names(folder: Path, names: Iterable[str]) -> list[str]:
    """Return the names in `names` of existing files that uqmbd may have written, but the manifest does not list.

    Raise StudyError, with the name and a remedy, if a file of another origin has one of the names.
    """
    manifest = folder / MANIFEST
    if os.path.lexists(manifest) and _read(manifest) is None:
        raise _is_obstacle(manifest)
    recognised = []
    for name in names:
        place = folder / name
        if not os.path.lexists(place) or is_ours(folder, name):
            continue
        if name == FIGURES:
            noted = [f"{FIGURES}/{one}" for one in os.listdir(place)] if _is_folder(place) else [""]
            if not all(is_ours(folder, one) for one in noted):
                raise _is_obstacle(place)
        elif is_recognised(place):
            recognised.append(name)
        else:
            raise _is_obstacle(place)
    return recognised


def move_unlisted(folder: Path, names: Collection[str]) -> Path | None:
    """Move unlisted files that uqmbd may have written to a new folder, and return the folder; None if there are none.

    Raise StudyError and move nothing if a file of another origin has one of the names.
    """
    recognised = check_names(folder, names)
    return move_aside(folder, recognised) if recognised else None


def move_aside(folder: Path, names: Collection[str]) -> Path:
    """Move results to a new folder, in reverse order of `names`, and return the folder.

    If the manifest lists all results, the folder is ``previous``. An existing ``previous`` is removed if it contains
    only listed, unchanged files. Otherwise, the folder is the next ``previous-N``. No run replaces unlisted files.
    """
    noted, owned = in_manifest(folder), [name for name in names if is_ours(folder, name)]
    target = _new_folder(folder)
    if len(owned) == len(names):
        _write(target, {name: noted[name] for name in owned})
    for name in reversed(list(names)):
        (target / name).parent.mkdir(exist_ok=True)
        os.rename(folder / name, target / name)
    if any(name.startswith(f"{FIGURES}/") for name in names):
        with contextlib.suppress(OSError):  # the folder still contains files of the user
            (folder / FIGURES).rmdir()
    if noted:
        _write(folder, {name: digest for name, digest in noted.items() if name not in names})
    return target if len(owned) < len(names) else _renamed(folder, target)


def _renamed(folder: Path, target: Path) -> Path:
    """Rename a new folder to the first name that is unused or belongs to a removable folder; remove the latter."""
    number = 0
    while (place := _numbered(folder, number)) != target:
        if os.path.lexists(place) and _is_whole(place):
            _remove(place)
        if not os.path.lexists(place):
            os.rename(target, place)
            return place
        number += 1
    return target


def _is_whole(place: Path) -> bool:
    """Return whether all contents of a folder are in its manifest and unchanged."""
    if not _is_folder(place) or _read(place / MANIFEST) is None:
        return False
    names = [name for name in os.listdir(place) if name != MANIFEST]
    if FIGURES in names:
        if not _is_folder(place / FIGURES):
            return False
        names.remove(FIGURES)
        names += [f"{FIGURES}/{name}" for name in os.listdir(place / FIGURES)]
    return all(is_ours(place, name) for name in names)


def _remove(place: Path) -> None:
    """Remove the unchanged files in the manifest of a folder, and the folder if it is then empty."""
    import shutil

    for name in in_manifest(place):
        found = place / name
        if is_ours(place, name):
            shutil.rmtree(found) if _is_folder(found) else found.unlink()
    with contextlib.suppress(OSError):
        (place / FIGURES).rmdir()
    if os.listdir(place) == [MANIFEST]:
        (place / MANIFEST).unlink()
        place.rmdir()


def _new_folder(folder: Path) -> Path:
    number = 1
    while True:
        place = _numbered(folder, number)
        try:
            place.mkdir()
        except FileExistsError:
            number += 1
            continue
        return place


def _numbered(folder: Path, number: int) -> Path:
    return folder / (f"{PREVIOUS}-{number}" if number else PREVIOUS)


def _is_obstacle(place: Path) -> StudyError:
    return StudyError(
        f"{place} exists, but uqmbd did not write this file, or another program has changed it. uqmbd needs this "
        "file name. Nothing was changed or computed. Move or rename the file, or use another folder (--out DIR; in "
        "Python: folder=)."
    )


def _read(place: Path) -> dict[str, str] | None:
    """Return the valid entries of a manifest, or None if the file is not a manifest."""
    try:
        with open(place, "rb", opener=no_link) as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode) or about.st_size > _LARGEST:
                return None
            found = json.loads(file.read())
        if found["form"] != _FORM or not isinstance(found["written"], dict):
            return None
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None
    return {
        name: digest
        for name, digest in found["written"].items()
        if _STATED.fullmatch(name) and name != f"{FIGURES}/.." and name != f"{FIGURES}/." and isinstance(digest, str)
    }


def _write(folder: Path, written: dict[str, str]) -> None:
    with replacing(folder / MANIFEST) as part, open(part, "x", opener=no_link, encoding="utf-8") as file:
        file.write(json.dumps({"form": _FORM, "written": written}, indent=1, sort_keys=True) + "\n")


def _digest(place: Path) -> str | None:
    """Return the digest of a file, or of the names, sizes and checksums of the files in a store of samples."""
    digest = hashlib.sha256()
    try:
        if _is_folder(place):
            if foreign_in_store(place):
                return None
            for file in sorted(one for one in place.rglob("*") if _is_file(one)):
                with open(file, "rb", opener=no_link) as content:
                    about = (file.relative_to(place).as_posix(), os.fstat(content.fileno()).st_size)
                    # read the checksum at the start of a chunk, and metadata files as a whole
                    digest.update(repr((about, content.read(4 if file.name[0] != "." else _AT_ONCE))).encode())
            return digest.hexdigest()
        if not _is_file(place):
            return None
        with open(place, "rb", opener=no_link) as content:
            while part := content.read(_AT_ONCE):
                digest.update(part)
    except OSError:
        return None
    return digest.hexdigest()


def _attributes(result: Path) -> list[str] | None:
    """Return the names of the sample stores of a result, or None if the file is not a result of uqmbd."""
    import h5py

    try:
        with h5py.File(result, "r") as file:
            if "schema_version" not in file.attrs:
                return None
            names = [one.attrs.get("all_samples") for one in file.values()]
    except (OSError, LookupError, TypeError, ValueError, RuntimeError):
        return None
    return [name for name in names if isinstance(name, str) and _NAME.fullmatch(name)]


def _is_store(place: Path) -> bool:
    try:
        with open(place / ".zattrs", "rb", opener=no_link) as file:
            found = json.loads(file.read(_LARGEST))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and "schema_version" in found and _is_file(place / "response" / ".zarray")


def _is_folder(place: Path) -> bool:
    return place.is_dir() and not place.is_symlink()


def _is_file(place: Path) -> bool:
    return stat.S_ISREG(place.lstat().st_mode)
