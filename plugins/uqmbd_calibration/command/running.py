"""What `uqmbd calibrate` does."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import uqmbd
from uqmbd_calibration.calibrating import calibrate
from uqmbd_calibration.command.assignments import numbers_of, texts_of
from uqmbd_calibration.records import Record, check_known_names, outputs_in

__all__ = ["Options", "run"]


@dataclass(frozen=True)
class Options:
    """What is asked for, as it was typed."""

    noise: Sequence[str] = ()
    units: Sequence[str] = ()
    known: Sequence[str] = ()
    robust: bool = False
    realisations: int = 200
    seed: int = 0
    workers: int = 1


def run(script: Path, paths: Sequence[Path], out: Path, options: Options) -> None:
    """Calibrate a study, write the posterior into a folder, and sum up what came out."""
    records = _records(paths, options)
    study = uqmbd.load_study(script)
    _make_folder(out)
    found = calibrate(
        study,
        records,
        noise="student" if options.robust else "normal",
        realisations=options.realisations,
        seed=options.seed,
        workers=options.workers,
        progress=True,
    )
    path = found.save(out / "calibration.nc")
    print(found)
    print(f"calibration  {path}")


def _records(paths: Sequence[Path], options: Options) -> list[Record]:
    """Read records; what options say of an output holds for all records that have it."""
    noise = numbers_of(options.noise, "--noise")
    units = texts_of(options.units, "--units")
    known = numbers_of(options.known, "--known")
    outputs = [outputs_in(path) for path in paths]
    everything = dict.fromkeys(name for names in outputs for name in names)
    check_known_names(noise, everything, "--noise")
    check_known_names(units, everything, "--units")
    return [
        Record.read(
            path,
            units={name: units[name] for name in names if name in units},
            noise={name: noise[name] for name in names if name in noise},
            known=known or None,
        )
        for path, names in zip(paths, outputs, strict=True)
    ]


def _make_folder(folder: Path) -> None:
    """Make the folder before the work, not after it, and see whether it can be written."""
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / "results.nc").exists() and not (folder / "calibration.nc").exists():
        raise uqmbd.StudyError(f"--out {folder}: there are results of something else; give another folder.")
    with tempfile.TemporaryFile(dir=folder):
        pass
