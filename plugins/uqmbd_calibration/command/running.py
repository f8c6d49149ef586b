"""Implementation of `uqmbd calibrate`, and parsers of options of the form NAME=VALUE."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

import uqmbd
from uqmbd.report import installed_sections, write_report
from uqmbd.results import failed_methods, save
from uqmbd_calibration.calibrated import Calibrated
from uqmbd_calibration.calibrating import calibrate
from uqmbd_calibration.records import Record, check_known_names, outputs_in
from uqmbd_calibration.result import Calibration

__all__ = ["Options", "run"]


def texts_of(words: Sequence[str], option: str) -> dict[str, str]:
    """Return the texts of an option, by name; a name can contain equals signs, but a value cannot.

    Raise StudyError if a word has no equals sign or no name, or a name occurs twice.

    >>> texts_of(["force=N", "a=b=m"], "--units")
    {'force': 'N', 'a=b': 'm'}
    """
    found: dict[str, str] = {}
    for word in words:
        name, mark, value = word.rpartition("=")
        if not mark or not name.strip():
            raise uqmbd.StudyError(f"{option} {word}: expected NAME=VALUE.")
        if name in found:
            raise uqmbd.StudyError(f"{option} {word}: the name {name!r} is given twice; give each name once.")
        found[name] = value.strip()
    return found


def numbers_of(words: Sequence[str], option: str) -> dict[str, float]:
    """Return the numbers of an option, by name.

    Raise StudyError if a value is not a finite number, or if `texts_of` raises it.

    >>> numbers_of(["force=2", "angle=1e-3"], "--noise")
    {'force': 2.0, 'angle': 0.001}
    """
    found: dict[str, float] = {}
    for name, text in texts_of(words, option).items():
        try:
            found[name] = float(text)
        except ValueError:
            found[name] = math.nan
        if not math.isfinite(found[name]):
            raise uqmbd.StudyError(f"{option} {name}={text}: {text!r} is not a finite number.")
    return found


WRITTEN = ("calibration.nc", "results.nc", "report.html", "figures")
"""Files and folders that the command writes into its output folder."""


@dataclass(frozen=True)
class Options:
    """Options of the command, as typed."""

    noise: Sequence[str] = ()
    units: Sequence[str] = ()
    known: Sequence[str] = ()
    robust: bool = False
    realisations: int | None = None
    seed: int = 0
    only: Sequence[str] = ()
    workers: uqmbd.Workers = field(default_factory=uqmbd.Workers)


def run(script: Path, paths: Sequence[Path], out: Path, options: Options) -> None:
    """Calibrate a study, write the posterior, predictions and a report into a folder, and print a summary."""
    study = uqmbd.load_study(script)
    records = _records(paths, options)
    methods = chosen_methods(study, options.only)
    with uqmbd.extend.output_folder(out, WRITTEN), options.workers.start(script) as workers:
        found = calibrate(
            study,
            records,
            noise="student" if options.robust else "normal",
            realisations=options.realisations,
            seed=options.seed,
            workers=workers,
            progress=True,
        )
        # save the posterior before any later step can fail
        files = {"calibration": found.save(out / "calibration.nc")}
        print(found)
        failed = _predicted(study, methods, found, out, workers, files)
    for kind, path in files.items():
        print(f"{kind:<12} {path}")
    if failed:
        raise SystemExit(1)


def _predicted(
    study: uqmbd.Study,
    methods: Sequence[uqmbd.extend.Propagator],
    found: Calibration,
    out: Path,
    workers: int | Executor,
    files: dict[str, Path],
) -> bool:
    """Run methods with the prior and the posterior, and write results and report; return whether a method failed."""
    after = {f"{method.node_name}, calibrated": method for method in methods}
    both = [*methods, *(Calibrated(method, found, label=label) for label, method in after.items())]
    labels = [one.node_name for one in both]
    # select all methods by label: a run without a selection also computes curves of error against cost
    tree = study.with_propagators(both).run(workers, only=labels, progress=True)
    files["results"] = save(tree, out / "results.nc")
    files["report"] = write_report(tree, out / "report.html", sections=installed_sections(), folder=out / "figures")
    failed = failed_methods(tree)
    for label, reason in failed.items():
        print(f"Error: the method {label} failed: {reason}", file=sys.stderr, flush=True)
    return bool(failed)


def _records(paths: Sequence[Path], options: Options) -> list[Record]:
    """Read records; options on an output apply to all records that contain it."""
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


def chosen_methods(study: uqmbd.Study, only: Sequence[str]) -> list[uqmbd.extend.Propagator]:
    """Return the selected methods of a study, or collocation for a study without methods."""
    known = {method.node_name: method for method in study.propagators}
    for label in only:
        if label not in known:
            raise uqmbd.StudyError(
                f"--only {label}: the study has no method with this label; its methods are "
                f"{', '.join(known) or 'none'}."
            )
    if not known:
        return [uqmbd.extend.propagator("collocation")(order=3)]
    return [method for label, method in known.items() if not only or label in only]
