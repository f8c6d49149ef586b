"""Arguments and options of `uqmbd calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import uqmbd

__all__ = ["Calibrate"]


class Calibrate:
    """Calibrate the inputs of a study from records, and predict with the posterior."""

    name = "calibrate"
    help = (
        "Calibrate the inputs of a study with records of a machine.\n\nWrites the posterior to DIR/calibration.nc. "
        "Runs each method of the study with the inputs before and after calibration, and writes DIR/results.nc and "
        "DIR/report.html."
    )

    def run(
        self,
        script: Annotated[Path, typer.Argument(metavar="STUDY.py", help="Study script: a Python file with a `study`.")],
        records: Annotated[
            list[Path],
            typer.Argument(metavar="RECORD", help="Record files (.csv or .nc) with measured outputs and their times."),
        ],
        out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")] = Path(
            "calibration"
        ),
        noise: Annotated[
            list[str] | None,
            typer.Option(
                "--noise", metavar="OUTPUT=SD", help="Standard deviation of the noise of an output (may be repeated)."
            ),
        ] = None,
        units: Annotated[
            list[str] | None,
            typer.Option(
                "--units",
                metavar="OUTPUT=UNITS",
                help="Units of an output, if a record does not state them (may be repeated).",
            ),
        ] = None,
        known: Annotated[
            list[str] | None,
            typer.Option(
                "--known",
                metavar="INPUT=VALUE",
                help="Value of an input that is known in all records, such as a set speed (may be repeated).",
            ),
        ] = None,
        robust: Annotated[
            bool,
            typer.Option("--robust", help="Assume noise with Student's t distribution, for records with outliers."),
        ] = False,
        realisations: Annotated[
            int | None,
            typer.Option(
                "--realisations",
                metavar="N",
                min=1,
                help="Maximum number of realisations for each operating point and machine (default: 200, or 45 per "
                "random input).",
            ),
        ] = None,
        seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Seed of the draws.")] = 0,
        only: Annotated[
            list[str] | None,
            typer.Option(
                "--only", metavar="LABEL", help="Use only this method of the study for predictions (may be repeated)."
            ),
        ] = None,
        *,
        workers: uqmbd.Workers,
    ) -> None:
        """Calibrate, predict and report."""
        # check the path before slow imports
        if not script.is_file():
            raise uqmbd.StudyError(f"The study script {script} does not exist (current folder: {Path.cwd()}).")
        for path in records:
            if not path.is_file():
                raise uqmbd.StudyError(f"The record {path} does not exist.")
        from uqmbd_calibration.command.running import Options, run

        run(
            script,
            records,
            out,
            Options(
                noise=tuple(noise or ()),
                units=tuple(units or ()),
                known=tuple(known or ()),
                robust=robust,
                realisations=realisations,
                seed=seed,
                only=tuple(only or ()),
                workers=workers,
            ),
        )
