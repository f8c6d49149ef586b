"""`uqmbd report`: write the report of stored results."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError
from uqmbd.results.storage import FIGURES, is_ours, is_recognised, move_unlisted, not_verified, start_manifest

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FIGURES", "MOTION", "POSES", "write_motion", "open_report", "rewrite_report", "write"]

MOTION = "motion.nc"
"""Name of the file of poses, from which the report draws the motion of the mechanism."""


POSES = "pose_surrogate.nc"
"""Name of the file of pose surrogates, with which the mechanism follows chosen inputs.

The surrogates have a separate file, because a part of a tree loses coordinates that it shares with its parents.
"""


def rewrite_report(folder: Path, *, figures: bool = False, show: bool = False) -> None:
    """Write ``report.html`` into a folder from the ``results.nc`` in it.

    `folder` is the folder of a run. `figures` states whether to write the figures also as files, and `show` whether to
    open the report in the browser.
    """
    from uqmbd.results import load

    # the path of the file denotes its folder
    source = folder if folder.is_file() else folder / "results.nc"
    if not source.exists():
        raise StudyError(f"{source} does not exist; expected the folder that `uqmbd run STUDY.py --out DIR` wrote.")
    tree = load(source)
    if not_verified(tree):
        print(f"Note: {source} is not verified: this file has no digest.", file=sys.stderr, flush=True)
    for name, file in (("motion", MOTION), ("pose_surrogate", POSES)):
        place = source.parent / file
        if is_recognised(place):
            tree[name] = load(place)
        elif os.path.lexists(place):
            print(f"Note: {place} is ignored: it was not written by uqmbd, or is damaged.", file=sys.stderr, flush=True)
    path = write(tree, source.parent / "report.html", figures=figures)
    print(f"report   {path}")
    if show:
        open_report(path)


def write_motion(tree: xr.DataTree, folder: Path) -> dict[str, Path]:
    """Write the poses from which the report draws the motion, and their surrogates, if there are any; return paths."""
    from uqmbd.results import save

    written = {}
    for kind, name, file in (("motion", "motion", MOTION), ("poses", "pose_surrogate", POSES)):
        path = folder / file
        if name in tree.children:
            written[kind] = save(tree.children[name].copy(), path)
        elif is_ours(folder, file):
            path.unlink()
    return written


def write(tree: xr.DataTree, path: Path, *, figures: bool = False) -> Path:
    """Write a report with the sections of plugins, and return its path; `figures`: also as separate files."""
    from uqmbd.report import installed_sections, write_report

    run, folder = path.parent, path.parent / FIGURES
    run.mkdir(parents=True, exist_ok=True)
    if not figures and folder.exists():
        print(
            f"Note: the figures in {folder} belong to an earlier report; --figures updates them.",
            file=sys.stderr,
            flush=True,
        )
    try:
        # replace existing files of uqmbd only
        previous = move_unlisted(run, [path.name, *([FIGURES] if figures else [])])
        if previous is not None:
            print(f"Note: the earlier report in {run} was moved to {previous}.", file=sys.stderr, flush=True)
        start_manifest(run)
        target = write_report(tree, path, sections=installed_sections(), folder=folder if figures else None)
    except OSError as error:
        where = error.filename or run
        raise StudyError(f"{where} cannot be written: {error.strerror or error}.") from error
    return target


def open_report(path: Path) -> None:
    """Open a report in the browser, or report that there is none."""
    import webbrowser

    address = path.resolve().as_uri()
    try:
        opened = webbrowser.open(address)
    except webbrowser.Error:
        opened = False
    if not opened:
        print(f"Note: no browser was found; open {address}", file=sys.stderr, flush=True)
