"""`uqmbd run`: load a study, run it, store the results, write the report, and say in a few lines what came out."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uqmbd.cli.progress import seconds, shown_progress
from uqmbd.cli.report import keep_motion, write
from uqmbd.cli.settings import apply_settings, check_labels
from uqmbd.cli.tables import show_summary
from uqmbd.errors import StudyError, UqmbdError
from uqmbd.propagation.script import load_study

__all__ = ["run_study"]

UNFINISHED = "unfinished"
"""Folder of finished chunks within that of the results."""


def run_study(
    script: Path,
    *,
    only: Sequence[str] = (),
    settings: Sequence[str] = (),
    out: Path = Path("results"),
    workers: int = 1,
    dask: str | None = None,
    resume: bool = False,
) -> None:
    """Run a study script and write ``results.nc`` and ``report.html`` into a folder.

    Parameters
    ----------
    script : Path
        The study script.
    only : sequence of str
        Labels of the propagators to run; all if there is none.
    settings : sequence of str
        Changed options, ``LABEL.option=value``.
    out : Path
        Folder for the results; made if it does not exist.
    workers : int
        Number of processes.
    dask : str, optional
        Address of a Dask scheduler that does the work instead.
    resume : bool
        Continue an unfinished run in the folder.
    """
    # before the work, not after it: whatever is wrong with the report should cost no hours
    import uqmbd.report.html  # noqa: F401

    begin = time.monotonic()
    study = load_study(script)
    check_labels(only, study.propagators)
    if settings:
        study = study.with_propagators(apply_settings(settings, study.propagators))
    if not study.propagators:
        raise StudyError(f"{script}: the study has no propagators; give it some, as in propagators=[MonteCarlo(...)].")
    # Before the work, not after it: a folder that cannot be written should cost no hours.
    _make_folder(out)
    with _executor(workers, dask, script) as executor, shown_progress() as progress:
        try:
            tree = study.run(executor, only=list(only) or None, progress=progress, folder=out, resume=resume)
        except KeyboardInterrupt:
            print(_how_to_go_on(script, out), file=sys.stderr, flush=True)
            raise
        except UqmbdError:
            chosen = list(only) or [p.node_name for p in study.propagators]
            if len(chosen) > 1 and any((out / UNFINISHED).glob("*")):
                print(
                    f"What the other methods have computed is kept in {out}: to leave out the one that cannot go on, "
                    f"name the others, as in uqmbd run {script} --out {out} --only {chosen[0]} --resume",
                    file=sys.stderr,
                    flush=True,
                )
            raise
    from uqmbd.report.animation import with_motion
    from uqmbd.results import save

    print("writing the report ...", file=sys.stderr, flush=True)
    tree, missing = with_motion(tree, study)
    if missing:
        print(f"Note: the report shows no animation of the mechanism: {missing}", file=sys.stderr, flush=True)
    # poses have a file of their own: a result holds its methods and their comparison
    results = save(tree.drop_nodes("motion", errors="ignore"), out / "results.nc")
    keep_motion(tree, out)
    report = write(tree, out / "report.html")
    show_summary(tree, files={"results": results, "report": report}, title=f"{study.name}: ")
    print(f"Done in {seconds(time.monotonic() - begin)}.")


def _how_to_go_on(script: Path, out: Path) -> str:
    return (
        f"What is computed so far is kept in {out}. To go on (with other options as before): "
        f"uqmbd run {script} --out {out} --resume"
    )


def _make_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise StudyError(f"--out {folder} is a file; a folder is expected, which is made if it does not exist.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".uqmbd-probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise StudyError(f"--out {folder}: this folder cannot be written ({error.strerror}).") from error


@contextmanager
def _executor(workers: int, address: str | None, script: Path) -> Iterator[int | Executor]:
    """Yield what `Study.run` takes as workers: a number of processes, or the pool of a Dask cluster."""
    if address is None:
        yield workers
        return
    try:
        import distributed
    except ImportError as error:
        raise StudyError('--dask needs Dask, which is not installed: pip install "uqmbd[distributed]"') from error
    try:
        connect: Any = distributed.Client
        client: Any = connect(address, timeout=10)
    except (OSError, ValueError) as error:
        raise StudyError(
            f"--dask {address}: no Dask scheduler answers there ({type(error).__name__}). Expected an address such as "
            "tcp://host:8786, as `dask scheduler` prints it."
        ) from error
    with client:
        # The workers know uqmbd, but not the script, whose functions may be part of the work.
        client.upload_file(str(script.resolve()))
        yield client.get_executor()
