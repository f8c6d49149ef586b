"""`uqmbd report`: write the report of stored results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FIGURES", "MOTION", "keep_motion", "rewrite_report", "write"]

FIGURES = "figures"
"""Folder of the report's figures as files, beside the report."""


MOTION = "motion.nc"
"""Poses of the mechanism, from which the report draws its motion."""


def rewrite_report(folder: Path) -> None:
    """Write ``report.html`` into a folder from the ``results.nc`` in it."""
    from uqmbd.results import load

    # Someone who names the file itself means its folder.
    source = folder if folder.is_file() else folder / "results.nc"
    if not source.exists():
        raise StudyError(f"There is no {source}; give the folder that `uqmbd run STUDY.py --out DIR` wrote.")
    tree = load(source)
    if (motion := source.parent / MOTION).exists():
        tree["motion"] = load(motion)
    print(f"report   {write(tree, source.parent / 'report.html')}")


def keep_motion(tree: xr.DataTree, folder: Path) -> None:
    """Write the poses from which the report draws the motion, if there are any, beside ``results.nc``."""
    from uqmbd.results import save

    path = folder / MOTION
    if "motion" in tree.children:
        import xarray as xr

        save(xr.DataTree(tree["motion"].to_dataset()), path)
    else:
        path.unlink(missing_ok=True)


def write(tree: xr.DataTree, path: Path) -> Path:
    """Write a report with the sections that plugins add, its figures as files beside it, and return its path."""
    from uqmbd.report import installed_sections, write_report

    return write_report(tree, path, sections=installed_sections(), folder=path.parent / FIGURES)
