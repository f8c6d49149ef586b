"""The finished chunks of a run, kept until the results that were made of them are whole on the disk.

While it runs they are in the folder ``unfinished`` of its own.  When it has ended they are in ``unsaved``, until its
results are saved there; where that fails, the run is unfinished again.
"""

from __future__ import annotations

import contextlib
import hashlib
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

__all__ = ["FOLDER", "clear", "computed", "how_to_go_on", "is_kept", "reopen", "saved", "unsaved"]

FOLDER = "unfinished"

_ENDED = "unsaved"
_MARK = "results"


def clear(folder: Path) -> None:
    """Forget the chunks of a run that starts over."""
    for name in (FOLDER, _ENDED):
        with contextlib.suppress(FileNotFoundError):
            shutil.rmtree(folder / name)


def computed(folder: Path, attrs: Mapping[Any, Any]) -> None:
    """Note that a run has ended, with results that have these attributes of the root.

    One of which some methods failed is unfinished: those may go on with what they have.
    """
    place = folder / FOLDER
    if not place.is_dir() or "failed" in attrs:
        return
    # where that cannot be noted, as on a full disk, the run is unfinished, and the results are not lost
    with contextlib.suppress(OSError):
        (place / _MARK).write_text(_identity(attrs))
        shutil.rmtree(folder / _ENDED, ignore_errors=True)
        place.rename(folder / _ENDED)


def saved(folder: Path, attrs: Mapping[Any, Any]) -> None:
    """Forget the chunks of these results, which are in the folder now; those of others are left."""
    if _is_of(folder, attrs):
        shutil.rmtree(folder / _ENDED, ignore_errors=True)


def unsaved(folder: Path, attrs: Mapping[Any, Any]) -> None:
    """Note that these results could not be saved in the folder."""
    if _is_of(folder, attrs):
        reopen(folder)


def reopen(folder: Path) -> None:
    """Let a run that had ended without being saved be unfinished again."""
    if (folder / _ENDED).is_dir() and not (folder / FOLDER).exists():
        (folder / _ENDED).rename(folder / FOLDER)
        (folder / FOLDER / _MARK).unlink(missing_ok=True)


def is_kept(folder: Path) -> bool:
    """Tell whether an earlier run has left something to go on with."""
    return any(any((folder / name).glob("*/*")) for name in (FOLDER, _ENDED))


def how_to_go_on(folder: Path) -> str:
    """Return a sentence on the work of a run that is unfinished, or nothing if there is none."""
    place = folder / FOLDER
    if not place.is_dir():
        return ""
    return (
        f" What is computed so far is kept in {place}: make room, and go on with --resume (in Python: "
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
