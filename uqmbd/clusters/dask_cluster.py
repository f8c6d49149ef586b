"""Dask clusters: an existing cluster, a cluster of this machine, or a cluster of jobs of a queue."""

from __future__ import annotations

import json
import logging
import shutil
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uqmbd.errors import StudyError, StudyWarning
from uqmbd.packages import require_package

__all__ = ["STARTED_HERE", "dask_executor"]

QUEUES = {
    "htcondor": "HTCondorCluster",
    "lsf": "LSFCluster",
    "moab": "MoabCluster",
    "oar": "OARCluster",
    "pbs": "PBSCluster",
    "sge": "SGECluster",
    "slurm": "SLURMCluster",
}
"""Classes of ``dask-jobqueue``, by the names of their sections in Dask's configuration."""

STARTED_HERE = ("local", *QUEUES)
"""Clusters that uqmbd starts for a run and stops at its end."""

PATIENCE = 10
"""Time limit for the answer of a scheduler, s."""


@contextmanager
def dask_executor(given: str, count: int | None, files: Sequence[Path]) -> Iterator[Executor]:
    """Yield the executor of a Dask cluster.

    `given` is one of `STARTED_HERE`, an address, or a scheduler file. `count` is the number of worker processes of a
    cluster that is started. `files` are scripts that workers may need. Raise StudyError if Dask is missing, no
    scheduler answers, or a cluster cannot be started. Warn by StudyWarning if an existing cluster has no workers yet.
    """
    distributed = require_package("distributed", "--dask", "uqmbd[distributed]")
    with _scheduler(given, count) as scheduler, _client(distributed, given, scheduler) as client:
        if given not in STARTED_HERE and not client.nthreads():
            warnings.warn(
                f"--dask {given}: the cluster has no workers; the computation starts when the first worker has joined.",
                StudyWarning,
                stacklevel=2,
            )
        if files:
            from uqmbd.clusters.study_files import StudyFiles

            try:
                client.register_plugin(StudyFiles.of(files).plugin())
            except Exception as error:  # an error of a worker, whose type is not always transmitted
                raise StudyError(
                    f"--dask {given}: a worker cannot import a module or write a file that it needs ({error}). Start "
                    "the workers in an environment with this version of uqmbd and the plugins of the study."
                ) from error
        # not pure: a task that is submitted again after the loss of its worker is computed again
        yield client.get_executor(pure=False)


def _client(distributed: Any, where: str, scheduler: Any) -> Any:
    """Connect to a scheduler."""
    try:
        if isinstance(scheduler, Path):
            return distributed.Client(scheduler_file=str(scheduler), timeout=PATIENCE)
        return distributed.Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise StudyError(
            f"--dask {where}: no Dask scheduler answers at this address ({type(error).__name__}). Expected an address "
            "such as tcp://host:8786, as `dask scheduler` prints it, the file that `dask scheduler --scheduler-file` "
            f"writes, or one of {', '.join(sorted(STARTED_HERE))}."
        ) from error


@contextmanager
def _scheduler(where: str, count: int | None) -> Iterator[Any]:
    """Yield an address, a scheduler file, or a started cluster, to which a client connects."""
    if where == "local":
        import distributed

        # one thread per process: computations in Python block the other threads of a process
        alone = {"threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
        with distributed.LocalCluster(n_workers=count, **alone) as cluster:
            yield cluster
    elif where in QUEUES:
        with _queue(where) as cluster:
            _scale(where, cluster, count)
            yield cluster
    else:
        file = Path(where)
        if ":" not in where and not file.is_file():
            raise StudyError(
                f"--dask {where}: expected an address such as tcp://host:8786, an existing scheduler file (there is "
                f"no file of this name), or one of {', '.join(sorted(STARTED_HERE))}."
            )
        yield _scheduler_file(file) if file.is_file() else where


def _scheduler_file(file: Path) -> Path:
    """Return a scheduler file, if it contains an address."""
    try:
        if isinstance(json.loads(file.read_bytes())["address"], str):
            return file
    except (OSError, ValueError, LookupError, TypeError):
        pass
    raise StudyError(
        f"--dask {file}: this file contains no address of a scheduler. Expected the complete file that `dask "
        "scheduler --scheduler-file` writes."
    )


def _queue(where: str) -> Any:
    """Start a scheduler on this machine for workers in jobs of a queue; submit no job yet."""
    dask_jobqueue = require_package("dask_jobqueue", f"--dask {where}", "uqmbd[cluster]")
    cluster = getattr(dask_jobqueue, QUEUES[where])
    submit = cluster.job_cls.submit_command.split()[0]
    if shutil.which(submit) is None:
        raise StudyError(f"--dask {where}: the command {submit!r}, which submits jobs, is not available here.")
    try:
        return cluster()
    except ValueError as error:
        raise StudyError(
            f"--dask {where}: Dask's configuration does not describe the jobs: {error}\n"
            f"Expected a section jobqueue, {where}, with at least cores and memory, in a file such as jobqueue.yaml. "
            f"Dask reads it from these folders (DASK_CONFIG names another file or folder): {_folders()}"
        ) from error


def _folders() -> str:
    """Return the names of the folders in which Dask searches for its configuration."""
    import dask.config

    return ", ".join(map(str, dask.config.paths))


def _scale(where: str, cluster: Any, count: int | None) -> None:
    """Request `count` workers, or adapt their number to the load within the limits of the configuration."""
    if count is not None:
        # replace jobs that end before the computation, for example at their time limit
        _submit(where, cluster, count)
        cluster.adapt(minimum=count, maximum=count)
        return
    import dask.config

    least, most = (dask.config.get(f"distributed.adaptive.{limit}") for limit in ("minimum", "maximum"))
    if most == float("inf"):
        raise StudyError(
            f"--dask {where}: the number of workers is unknown. Give it by --workers N, or set limits for an adaptive "
            "cluster. The limits are distributed, adaptive, minimum and maximum in a file of Dask's configuration. "
            f"Dask reads it from these folders (DASK_CONFIG names another file or folder): {_folders()}"
        )
    _submit(where, cluster, max(least, 1))
    cluster.adapt(minimum=least, maximum=most)


def _submit(where: str, cluster: Any, count: int) -> None:
    """Submit the first jobs, and report a refusal by the queue, which Dask writes only to a log."""
    from distributed.core import Status

    log = logging.getLogger("tornado.application")
    before, log.disabled = log.disabled, True
    try:
        cluster.scale(count)
        while len(cluster.workers) < len(cluster.worker_spec):
            time.sleep(0.05)
    finally:
        log.disabled = before
    refused = [job for job in cluster.workers.values() if job.status == Status.created]
    for job in refused:
        try:
            cluster.sync(job.start)
        except RuntimeError as error:
            for one in refused:
                one.status = Status.failed
            raise StudyError(f"--dask {where}: the queue accepts no jobs: {_answer(error)}") from error


def _answer(error: RuntimeError) -> str:
    """Return the output of the command that submits jobs."""
    return str(error).partition("stderr:")[2].strip() or str(error)
