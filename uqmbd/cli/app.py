"""The commands and their options; their implementations are imported on demand, so that `--help` is fast."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from uqmbd.cli.commands import Commands
from uqmbd.cli.completion import labels, studies
from uqmbd.cli.terminal import explained, shown_progress
from uqmbd.clusters import Workers, with_worker_options
from uqmbd.errors import StudyError
from uqmbd.files import check_script
from uqmbd.garbage_collection import loading
from uqmbd.new import PLUGIN_KINDS, new_plugin, new_study
from uqmbd.version import __version__

__all__ = ["app", "main"]

CONTEXT = {"help_option_names": ["-h", "--help"]}

# plain help instead of rich panels, because the markup of rich would double the time until the help appears
app = typer.Typer(
    name="uqmbd",
    cls=Commands,
    help="Propagate the uncertainty of lengths, masses, stiffnesses and loads through a multibody mechanism.",
    epilog="Exit status: 0 success, 1 failed computation, 2 unusable input, 3 unmet requirement or accuracy.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings=CONTEXT,
)
new = typer.Typer(
    name="new",
    help="Write a new study or a new plugin from a template.",
    rich_markup_mode=None,
    no_args_is_help=True,
    context_settings=CONTEXT,
)
app.add_typer(new)

Kind = StrEnum("Kind", {name: name for name in PLUGIN_KINDS})  # type: ignore[misc]  # from the table of kinds
KINDS_HELP = "\n".join(["\b", "Kinds:", *(f"  {name:12} {kind.what}" for name, kind in PLUGIN_KINDS.items())])

Script = Annotated[
    Path,
    typer.Argument(
        metavar="STUDY.py", help="Study script: a Python file that defines `study`.", autocompletion=studies
    ),
]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit by `SystemExit` with the status 0, 1, 2, 3, or 130 after Ctrl-C."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    # removed here, because the option may be at any position, before and after the command
    debug = "--debug" in words
    with explained(debug=debug):
        app(args=[word for word in words if word != "--debug"], prog_name="uqmbd")


def _show_version(requested: bool) -> None:
    if requested:
        import uqmbd

        typer.echo(f"uqmbd {uqmbd.__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the Python traceback of an error.")] = False,
) -> None:
    """Declare the options before the command; `main` has already read `--debug`."""


@app.command()
@with_worker_options
def run(
    script: Script,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="LABEL", help="Run only this propagator (may be repeated).", autocompletion=labels
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="LABEL.option=value", help="Set an option of a propagator (may be repeated)."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the results.")] = Path("results"),
    budget: Annotated[
        str | None,
        typer.Option("--budget", metavar="B", help="Budget: a time (30s, 10min, 2h) or a number of realisations."),
    ] = None,
    accuracy: Annotated[
        str | None,
        typer.Option(
            "--accuracy", metavar="A", help="Accuracy: choose samples or orders for errors of at most A, such as 1%."
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an unfinished run in DIR.")] = False,
    require: Annotated[
        str | None,
        typer.Option(
            "--require",
            metavar="P",
            help="Exit with status 3 unless each probability of violation is at most P, such as 1% (95 % confidence).",
        ),
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write the report.")] = True,
    show: Annotated[bool, typer.Option("--open", help="Open the report in the browser.")] = False,
    figures: Annotated[bool, typer.Option("--figures", help="Also write each figure to DIR/figures (SVG).")] = False,
    *,
    workers: Workers,
) -> None:
    """Run a study; write DIR/results.nc and DIR/report.html."""
    begin = time.monotonic()
    for name, selected in (("--open", show), ("--figures", figures)):
        if selected and not report:
            raise StudyError(f"{name} needs the report, which --no-report omits; omit one of these options.")
    # printed at once, because the next imports take some time
    print(f"uqmbd {__version__}: {script}", file=sys.stderr, flush=True)
    check_script(script)
    with shown_progress() as progress:
        progress.stage(f"loading {script.name}")
        with loading():
            from uqmbd.cli.run import run_study

        run_study(
            script,
            only=only or (),
            settings=set_ or (),
            out=out,
            workers=workers,
            resume=resume,
            require=require,
            budget=budget,
            accuracy=accuracy,
            report=report,
            figures=figures,
            show=show,
            begin=begin,
            progress=progress,
        )


@app.command()
def check(
    script: Script,
    figure: Annotated[
        Path | None,
        typer.Option("--figure", metavar="FILE", help="Draw the mechanism to FILE (.png, .svg or .pdf)."),
    ] = None,
) -> None:
    """Check a study without running it.

    List bodies, equations, redundant equations, mobility, inputs and propagators, and predict the cost of each method.
    """
    check_script(script)
    with loading():
        from uqmbd.cli.check import show_check

    show_check(script, figure)


@app.command()
def animate(
    script: Script,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="A .gif file, or .mp4 if ffmpeg is installed (default: STUDY.gif)."),
    ] = None,
    samples: Annotated[
        int,
        typer.Option(
            "--samples", metavar="N", min=0, help="Number of realisations, in addition to the motion at the means."
        ),
    ] = 20,
    method: Annotated[
        str | None,
        typer.Option(
            "--method", metavar="LABEL", help="Show the realisations of this propagator.", autocompletion=labels
        ),
    ] = None,
    fps: Annotated[float, typer.Option("--fps", metavar="N", help="Frames per second.")] = 20.0,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", metavar="S", help="Duration in s (default: that of the motion, between 3 and 8 s)."),
    ] = None,
) -> None:
    """Animate the mechanism.

    The animation shows the motion at the means of the inputs, with a cloud of realisations.
    """
    check_script(script)
    with loading():
        from uqmbd.cli.animate import animate_study

    animate_study(script, out=out, samples=samples, method=method, fps=fps, seconds=seconds)


@app.command(
    context_settings={**CONTEXT, "allow_extra_args": True, "ignore_unknown_options": True},
    epilog="The exporter defines further options, such as --fmi 3 for .fmu; the message on a wrong option lists them.",
)
def export(
    context: typer.Context,
    script: Script,
    to: Annotated[
        Path, typer.Option("--to", metavar="FILE", help="File to write; its ending selects the installed exporter.")
    ],
    what: Annotated[
        str | None,
        typer.Option("--what", metavar="surrogate|mechanism", help="Object to export (default: surrogate)."),
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            "--method", metavar="LABEL", help="Method with the surrogate, if there are several.", autocompletion=labels
        ),
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option("--from", metavar="DIR", help="Folder of an earlier run (default: the method runs now)."),
    ] = None,
) -> None:
    """Export the surrogate of a method, or the mechanism, to a file of another program."""
    check_script(script)
    with shown_progress() as progress:
        progress.stage(f"loading {script.name}")
        with loading():
            from uqmbd.cli.export import export_study

        export_study(script, to=to, what=what, method=method, results=results, words=context.args, progress=progress)


@app.command()
def view(
    script: Script,
    timeout: Annotated[float, typer.Option("--timeout", metavar="S", help="Time limit of the study file, s.")] = 10.0,
    port: Annotated[
        int, typer.Option("--port", metavar="N", min=0, max=65535, help="Port of the page (default: a free port).")
    ] = 0,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
) -> None:
    """View the mechanism while you build it.

    A page on this machine draws the mechanism, and draws it again when the file is saved. It shows unclosed joints and
    other findings, has a slider for each random input, and plays the motion. Ctrl-C ends it.
    """
    check_script(script)
    with loading():
        from uqmbd.viewer import view_study

    view_study(script, seconds=timeout, port=port, opened=show)


@app.command()
def plugins(
    as_json: Annotated[bool, typer.Option("--json", help="Write JSON instead of a table.")] = False,
) -> None:
    """List the installed plugins and their contents."""
    from uqmbd.cli.plugins import show_plugins

    show_plugins(as_json=as_json)


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, with results.nc.")],
    show: Annotated[bool, typer.Option("--open", help="Open the report in the browser.")] = False,
    figures: Annotated[bool, typer.Option("--figures", help="Also write each figure to DIR/figures (SVG).")] = False,
) -> None:
    """Write DIR/report.html again from DIR/results.nc."""
    with loading():
        from uqmbd.cli.report import rewrite_report

    rewrite_report(folder, figures=figures, show=show)


@app.command()
def compare(
    results: Annotated[
        list[Path],
        typer.Argument(metavar="A.nc B.nc ...", help="Result files, or folders of runs.", show_default=False),
    ],
    reference: Annotated[
        str | None,
        typer.Option("--reference", metavar="LABEL", help="Reference method of the comparison, and of errors by cost."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Also write DIR/comparison.nc and DIR/report.html.")
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option("--table", metavar="FILE", help="Also write errors and costs: FILE.csv, or FILE.tex of LaTeX."),
    ] = None,
) -> None:
    """Compare the results of several runs.

    List differences of statistics, verdicts, and differences of inputs, options and versions. With a reference, list
    the error and the cost of each method.
    """
    with loading():
        from uqmbd.cli.compare import show_comparison

    show_comparison(results, reference=reference, out=out, table=table)


Folder = Annotated[Path, typer.Option("--folder", metavar="DIR", help="Target folder.", show_default="here")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]


@new.command("study")
def new_study_script(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the study and of its script NAME.py.")],
    folder: Folder = Path(),
    typings: Annotated[
        bool,
        typer.Option("--typings", help="Also write typings/chaospy, type stubs for pyright."),
    ] = False,
    force: Force = False,
) -> None:
    """Write NAME.py, an executable study with a comment on each part."""
    written = new_study(name, folder, typings=typings, force=force)
    for path in written:
        print(f"wrote    {path}")
    print(f"\nNext:    uqmbd check {written[0]}\n         uqmbd run {written[0]}")


@new.command("plugin", epilog=KINDS_HELP)
def new_plugin_package(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the package and of its folder, such as wire-rope.")
    ],
    kind: Annotated[Kind, typer.Option("--kind", metavar="KIND", help="Kind of the plugin, from the list below.")],
    folder: Folder = Path(),
    force: Force = False,
) -> None:
    """Write a package NAME with a working plugin, its tests, and a CI workflow."""
    written = new_plugin(name, kind.value, folder, force=force)
    for path in written:
        print(f"wrote    {path}")
    about = PLUGIN_KINDS[kind.value]
    print(f"\nNext:    cd {folder / name}")
    print('         python -m pip install --editable ".[test]"')
    print("         python -m pytest")
    print(f"Then replace the example with your own code. docs/{about.page} of uqmbd describes the interface.")
