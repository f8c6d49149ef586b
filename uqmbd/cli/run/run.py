"""`uqmbd run`: load and run a study, store the results, write the report, and print a summary."""

from __future__ import annotations

import hashlib
import re
import shlex
import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqmbd.cli.report import FIGURES, MOTION, POSES, open_report, write, write_motion
from uqmbd.cli.run.budget import check_sizes, choices, missed, too_small_for
from uqmbd.cli.run.settings import apply_settings, check_labels
from uqmbd.cli.tables import show_summary
from uqmbd.cli.terminal import FAILED, UNMET, Staged, shown_derivation, shown_progress
from uqmbd.clusters import Workers
from uqmbd.errors import MethodFailedWarning, Severity, StudyError, UqmbdError
from uqmbd.garbage_collection import loading
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.plugins import InputTreatment, example_of
from uqmbd.propagation import (
    allowed_of,
    claimed,
    findings,
    load_study,
    set_aside,
    store_name,
    warning_of,
    writable,
)
from uqmbd.results.storage import is_unfinished
from uqmbd.wording import format_duration, format_probability

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.propagation import Study

__all__ = ["run_study"]


def run_study(
    script: Path,
    *,
    only: Sequence[str] = (),
    settings: Sequence[str] = (),
    out: Path = Path("results"),
    workers: Workers | None = None,
    resume: bool = False,
    require: float | str | None = None,
    budget: str | None = None,
    accuracy: str | None = None,
    report: bool = True,
    figures: bool = False,
    show: bool = False,
    begin: float | None = None,
    progress: Staged | None = None,
) -> None:
    """Run a study script and write ``results.nc`` and ``report.html`` into a folder.

    `script` is the study script. `only` are labels of the propagators to run; empty: all. `settings` are changed
    options, ``LABEL.option=value``. `out` is the folder of the results, created if missing. `workers` are the processes
    that compute; None: this process. `resume` continues an unfinished run in the folder. `require` is the allowed
    probability of violation of each requirement, such as 0.01 or ``"1%"``. `Study.run` documents `budget` and
    `accuracy`. The exit status is 3 if all methods succeeded, but `uqmbd.results.unmet` lists a requirement or a method
    does not reach the accuracy.

    `report`: whether to write the report. `figures`: whether to write the figures of the report also as files. `show`:
    whether to open the report in the browser. `begin` is the start of the command from `time.monotonic`. `progress` is
    a display that already shows progress, and its first stage.
    """
    begin = time.monotonic() if begin is None else begin
    chosen, allowed = choices(budget, accuracy), allowed_of(require, "--require")
    with nullcontext(progress) if progress is not None else shown_progress() as shown:
        delivered = _run_and_write(
            script, only, settings, out, workers, shown, resume=resume, require=allowed, report=report,
            figures=figures, chosen=chosen,
        )  # fmt: skip
        shown.close()
    # print the summary after the display of progress has ended
    complete, tree, target = delivered()
    if show and target is not None:
        open_report(target)
    print(f"Done in {format_duration(time.monotonic() - begin, rough=True)}.")
    if not complete:
        raise SystemExit(FAILED)
    from uqmbd.results import propagator_nodes, unmet

    sentences = [] if allowed is None else unmet(propagator_nodes(tree), allowed)
    if allowed is not None and not sentences:
        most = format_probability(allowed)
        print(f"All requirements are met: every method that states a probability states at most {most}.")
    sentences += missed(tree)
    for sentence in sentences:
        print(f"{sentence[:1].upper()}{sentence[1:]}.", file=sys.stderr, flush=True)
    if sentences:
        raise SystemExit(UNMET)


def _run_and_write(
    script: Path,
    only: Sequence[str],
    settings: Sequence[str],
    out: Path,
    workers: Workers | None,
    progress: Staged,
    *,
    resume: bool,
    require: float | None,
    report: bool,
    figures: bool,
    chosen: dict[str, Any],
) -> Callable[[], tuple[bool, xr.DataTree, Path | None]]:
    """Run a study and write its results; return the function that prints the summary."""
    with loading():
        if report:
            # before the run: an error in the report must not appear after hours of computation
            import uqmbd.report  # noqa: F401 - an import that fails is to fail here

        with shown_derivation(progress):
            study = load_study(script)
    check_labels(only, study.propagators)
    if settings:
        check_sizes(settings, study, chosen, only)
        study = study.with_propagators(apply_settings(settings, study.propagators))
    if require is not None and not study.mechanism.requirements:
        raise StudyError(
            f"--require {require:g}: mechanism {study.mechanism.name!r} has no requirements. Add one, "
            "such as mechanism.require('clearance', slider.position[0] <= 0.47), or omit --require."
        )
    if not study.propagators:
        example = example_of(InputTreatment.SAMPLE)
        raise StudyError(f"{script}: the study has no propagators; add them, e.g. propagators=[{example}].")
    # check the folder before the computation, because an error after hours would be expensive
    with claimed(writable(out)):
        if workers is not None and (awaited := workers.awaited):
            progress.stage(awaited)
        with (workers or Workers()).start(script) as executor:
            if resume and not is_unfinished(out):
                print(
                    f"Note: --resume: {out} contains no unfinished run; a new run starts.", file=sys.stderr, flush=True
                )
            previous = set_aside(out, _needed(report=report, figures=figures), _stores(study, only))
            if previous:
                print(f"Note: the earlier results in {out} were moved to {previous}.", file=sys.stderr, flush=True)
            tree = _computed(study, executor, only, out, script, progress, resume=resume, **chosen)
        about = _origin(script, require)
        return _delivered(tree, study, out, script, progress, about=about, report=report, figures=figures)


def _list_findings(study: Study, only: Sequence[str]) -> list[str]:
    """Print the findings on a study, as `uqmbd check` does; return their texts."""
    study = study.with_propagators(p for p in study.propagators if not only or p.node_name in only)
    found = findings(study)
    for finding in found:
        if finding.severity is Severity.WARNING:
            # independent of the warning filters of the script
            warnings.showwarning(UserWarning(warning_of(study, finding)), UserWarning, "", 0)
        else:
            print(str(finding), file=sys.stderr, flush=True)
    return [finding.text for finding in found]


def _computed(
    study: Study,
    executor: int | Executor,
    only: Sequence[str],
    out: Path,
    script: Path,
    progress: Staged,
    *,
    resume: bool,
    **chosen: Any,
) -> xr.DataTree:
    """Run a study; if it ends early, print how to resume it."""
    from uqmbd.results import save

    try:
        with warnings.catch_warnings():
            # failed methods are reported at the end
            warnings.simplefilter("ignore", MethodFailedWarning)
            for text in _list_findings(study, only):
                # each method repeats this warning
                warnings.filterwarnings("ignore", f".*: {re.escape(text)}")
            # curves of error against cost may take long, so earlier results are stored before them
            grows = getattr(study, "convergence", None) is not None and not only
            before: dict[str, Any] = {"finished": lambda tree: save(tree, out / "results.nc")} if grows else {}
            return study.run(
                executor, only=list(only) or None, progress=progress, folder=out, resume=resume, **before, **chosen
            )
    except KeyboardInterrupt:
        print(_resume_hint(script, out), file=sys.stderr, flush=True)
        raise
    except UqmbdError as error:
        # an invalid input has to be changed, so the run cannot be resumed
        if (error.failed or not isinstance(error, StudyError)) and is_unfinished(out):
            print(_resume_hint(script, out), file=sys.stderr, flush=True)
        raise


def _delivered(
    tree: xr.DataTree,
    study: Study,
    out: Path,
    script: Path,
    progress: Staged,
    *,
    about: Mapping[str, Any],
    report: bool,
    figures: bool,
) -> Callable[[], tuple[bool, xr.DataTree, Path | None]]:
    """Write results and report; return the function that prints the summary and reports completeness."""
    from uqmbd.results import failed_methods, save

    tree.attrs.update(about)
    # first of all, because later steps may fail: the result contains the methods and their comparison
    progress.stage("writing the results")
    files = {"results": save(tree, out / "results.nc")}
    files |= {
        f"samples of {p.node_name}": s for p in study.propagators if (s := out / store_name(p.node_name)).exists()
    }
    problem = ""
    if report:
        progress.stage("writing the report")
        problem = _report(tree, study, out, files, figures=figures)

    def summed_up() -> tuple[bool, xr.DataTree, Path | None]:
        show_summary(tree, files=files, title=f"{study.name}: ")
        failed = failed_methods(tree)
        for label, reason in failed.items():
            print(f"Error: {label} has no results: {reason}", file=sys.stderr, flush=True)
        if failed.keys() - too_small_for(tree) and is_unfinished(out):
            print(_resume_hint(script, out), file=sys.stderr, flush=True)
        if problem:
            print(
                f"Error: {problem}\nThe results are complete. To write their report: uqmbd report {out}",
                file=sys.stderr,
                flush=True,
            )
        if not report:
            print(f"report   not written; to write it: uqmbd report {out}")
        return not (failed or problem), tree, files.get("report")

    return summed_up


def _report(tree: xr.DataTree, study: Study, out: Path, files: dict[str, Path], *, figures: bool) -> str:
    """Write poses and report of saved results; return the reason of a failure, or an empty text."""
    from uqmbd.report import with_motion, with_poses

    with Isolated(*ERRORS_AND_EXITS) as work:
        tree, missing = with_motion(tree, study)
        if missing:
            print(f"Note: the report shows no animation of the mechanism: {missing}", file=sys.stderr, flush=True)
        else:
            tree, _ = with_poses(tree, study)
        # poses have a separate file
        files |= write_motion(tree, out)
    if work.failed:
        print(f"Note: the report shows no animation of the mechanism: {work.reason}", file=sys.stderr, flush=True)
    with Isolated(*ERRORS_AND_EXITS) as work:
        files["report"] = write(tree, out / "report.html", figures=figures)
        files |= {"figures": out / FIGURES} if figures else {}
    return f"the report cannot be written: {work.reason}" if work.failed else ""


def _origin(script: Path, require: float | None) -> dict[str, Any]:
    """Return attributes of results: the script and its digest, the command, and the allowed probability."""
    try:
        digest = {"script_sha256": hashlib.sha256(script.read_bytes()).hexdigest()}
    except OSError:  # the file of the script no longer exists
        digest = {}
    command = {"command": shlex.join(["uqmbd", *sys.argv[1:]])} if "run" in sys.argv[1:2] else {}
    allowed = {} if require is None else {"allowed_probability": require}
    return {"script": script.name, **digest, **command, **allowed}


def _resume_hint(script: Path, out: Path) -> str:
    return (
        f"The completed part is stored in {out}. To continue (with the same other options): "
        f"uqmbd run {script} --out {out} --resume"
    )


def _needed(*, report: bool, figures: bool) -> tuple[str, ...]:
    """Return the names that a run writes into its folder."""
    return ("results.nc", *(("report.html", MOTION, POSES) if report else ()), *((FIGURES,) if figures else ()))


def _stores(study: Study, only: Sequence[str]) -> list[str]:
    """Return the names of the sample stores that methods may write."""
    return [store_name(one.node_name) for one in study.propagators if not only or one.node_name in only]
