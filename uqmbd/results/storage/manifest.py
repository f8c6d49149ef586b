"""The manifest of a run folder: files that uqmbd wrote there, by name and digest.

What is not in it, or has another digest, belongs to the user: it is not removed, moved or overwritten. A result, report
or store of samples without an entry may be uqmbd's own: an earlier version wrote no manifest. It is moved to a new
folder ``previous-N``, which no run replaces.
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
"""Folder of the results that were there before, within that of a run."""
FIGURES = "figures"
"""Folder of the report's figures as files, next to the report."""

_FORM = "uqmbd manifest 1"
_LARGEST = 1 << 24
"""Bytes of a manifest at most."""
_RESULT = re.compile(r"(results|motion|pose_surrogate|comparison)\.nc")
_NAME = re.compile(rf"{_RESULT.pattern}|report\.html|[^/\\]+-samples\.zarr|{FIGURES}/[^/\\]+")
_STATED = re.compile(rf"{_NAME.pattern}|[^/\\.][^/\\]*\.nc")
"""Names with those of further results, which commands of plugins state before they write."""
_TITLE = b" uqmbd report</title>"
_IN_STORE = re.compile(r"\.z[a-z]+|\d+(\.\d+)*|\.[0-9a-f]{16}\.part")
"""Files of a store of samples."""
_AT_ONCE = 1 << 20


def in_manifest(folder: Path) -> dict[str, str]:
    """Return the names that the manifest of a folder has, with their digests.

    Names that uqmbd does not write are left out, as are those that lead out of the folder, whoever noted them there.
    """
    found = _read(folder / MANIFEST)
    return {} if found is None else found


def has_manifest(folder: Path) -> bool:
    """Return whether a folder has a manifest, as that of a run has."""
    return _read(folder / MANIFEST) is not None


def start_manifest(folder: Path) -> None:
    """Make an empty manifest if there is none.

    Raise StudyError if something else has its name.
    """
    place = folder / MANIFEST
    if not os.path.lexists(place):
        _write(folder, {})
    elif _read(place) is None:
        raise _is_obstacle(place)


def record(folder: Path, names: Iterable[str], places: Collection[Path] = (), *, stated: bool = False) -> None:
    """Note files or folders as written by uqmbd.

    `folder`: that of a run; `names`: others than those of a run are left out, unless they are noted already;
    `places`: where they still are, before they take their names; `stated`: whether a command stated the names
    beforehand, so that nothing else had them: any netCDF file is noted then.
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
    """Return whether the file or folder of a name is unchanged since uqmbd wrote it."""
    noted = in_manifest(folder).get(name)
    if noted is None or ("/" in name and not _is_folder(folder / FIGURES)):
        return False
    return _digest(folder / name) == noted


def is_recognised(place: Path) -> bool:
    """Return whether a file or folder is a result, a report or a store of samples of uqmbd, by its content."""
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
    """Return which of the needed names belong to unlisted files that uqmbd may have written.

    Raise StudyError if one is taken by something else: which, and the way out.
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
    """Move unlisted files that uqmbd may have written away from needed names; return their new folder.

    Raise StudyError if a name is taken by something else; then nothing is moved.
    """
    recognised = check_names(folder, names)
    return move_aside(folder, recognised) if recognised else None


def move_aside(folder: Path, names: Collection[str]) -> Path:
    """Move results to a new folder, the first last, and return it.

    It is ``previous`` if the manifest notes all of them, and an existing ``previous`` contains only what uqmbd wrote
    and noted: that is removed. Else it is the next ``previous-N``, and what is not noted stays there for good.
    """
    noted, owned = in_manifest(folder), [name for name in names if is_ours(folder, name)]
    target = _new_folder(folder)
    if len(owned) == len(names):
        _write(target, {name: noted[name] for name in owned})
    for name in reversed(list(names)):
        (target / name).parent.mkdir(exist_ok=True)
        os.rename(folder / name, target / name)
    if any(name.startswith(f"{FIGURES}/") for name in names):
        with contextlib.suppress(OSError):  # where the user's own are in it
            (folder / FIGURES).rmdir()
    if noted:
        _write(folder, {name: digest for name, digest in noted.items() if name not in names})
    return target if len(owned) < len(names) else _renamed(folder, target)


def _renamed(folder: Path, target: Path) -> Path:
    """Rename a new folder to the first unused name, or to that of a folder that uqmbd wrote entirely and removes."""
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
    """Return whether everything in a folder is noted in its manifest, and unchanged."""
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
    """Remove a folder that is whole, name by name."""
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
        f"{place} is in the way: uqmbd needs this name, but did not write what is there, or it was changed since. It "
        "is left as it is, and nothing was computed. Move or rename it, or give another folder (--out DIR; in Python: "
        "folder=)."
    )


def _read(place: Path) -> dict[str, str] | None:
    """Return the entries of a manifest that can be ones; None: it is none."""
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
    """Return the digest of a file; of a store of samples that of names, sizes and the checksums in its files."""
    digest = hashlib.sha256()
    try:
        if _is_folder(place):
            if foreign_in_store(place):
                return None
            for file in sorted(one for one in place.rglob("*") if _is_file(one)):
                with open(file, "rb", opener=no_link) as content:
                    about = (file.relative_to(place).as_posix(), os.fstat(content.fileno()).st_size)
                    # a chunk begins with its checksum; metadata is short
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
    """Return the stores that a result names; None: it is no result of uqmbd."""
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
