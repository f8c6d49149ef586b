"""Who computes, as it was asked for."""

from __future__ import annotations

import typing
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uqmbd.clusters.dask_cluster import STARTED_HERE, dask_executor
from uqmbd.clusters.mpi import mpi_executor
from uqmbd.errors import StudyError

__all__ = ["Workers"]


@dataclass(frozen=True)
class Workers:
    """Who computes, as the options ``--workers``, ``--dask`` and ``--mpi`` of a command say.

    A parameter of this type, of a command, is replaced by these three options: see `uqmbd.extend.Command`.

    Attributes
    ----------
    count : int, optional
        Number of workers: of threads or processes here, or of processes of a Dask cluster that is started for this.
        None: one here; of a cluster as many as its configuration says.
    dask : str
        Address of a Dask scheduler (``tcp://host:8786``), the scheduler file that it writes, or who starts a cluster:
        ``"local"`` (processes of this machine), or a queue by ``dask-jobqueue``: ``"slurm"``, ``"pbs"``, ``"sge"``,
        ``"lsf"``, ``"oar"``, ``"moab"``, ``"htcondor"``, as Dask's configuration describes it (docs/how-to/cluster.md).
    mpi : bool
        Whether the processes that ``mpiexec`` has started compute.
    executor : concurrent.futures.Executor, optional
        Who computes, where it is there already; it is left open.

    Raises
    ------
    uqmbd.StudyError
        If more than one of them is asked for, or a number of workers of those who have a number already.

    Examples
    --------
    >>> with Workers(count=2).at_work() as workers:
    ...     print(workers)
    2
    >>> Workers(count=2, mpi=True)
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: --mpi with --workers 2: ...
    """

    count: int | None = None
    dask: str = ""
    mpi: bool = False
    executor: Executor | None = None

    def __post_init__(self) -> None:
        for name, declared in typing.get_type_hints(type(self)).items():
            _require_kind("Workers", name, getattr(self, name), declared)
        if self.mpi and self.dask:
            raise StudyError(f"--mpi with --dask {self.dask}: give one of them, not both.")
        if self.executor is not None and (self.mpi or self.dask or self.count is not None):
            raise StudyError("Workers has an executor, and others besides; give one of them.")
        if self.mpi and self.count is not None:
            raise StudyError(
                f"--mpi with --workers {self.count}: mpiexec says how many there are, as in "
                f"mpiexec -n {self.count + 1} uqmbd ... --mpi (one of them gives the others work)."
            )
        if self.dask and self.count is not None and self.dask not in STARTED_HERE:
            raise StudyError(
                f"give either --workers or --dask, not both: the cluster at {self.dask} has its workers. Their number "
                f"is asked for where uqmbd starts them: --dask {', '.join(sorted(STARTED_HERE))}."
            )

    @property
    def awaited(self) -> str:
        """Who is waited for before the work begins, as a stage of it; empty: nobody."""
        if self.mpi:
            return "waiting for the processes of MPI"
        if self.dask in STARTED_HERE:
            return f"starting the Dask cluster {self.dask}"
        return f"connecting with the Dask scheduler {self.dask}" if self.dask else ""

    @contextmanager
    def at_work(self, *files: str | Path) -> Iterator[int | Executor]:
        """Yield what `Study.run`, `uqmbd.extend.pool` and others take as workers; what is started for it ends with it.

        Parameters
        ----------
        *files : str or Path
            Scripts whose functions may be a part of the work; a Dask cluster that does not share this folder gets
            copies of them.

        Yields
        ------
        int or concurrent.futures.Executor
            A number of workers, or who does the work.

        Raises
        ------
        uqmbd.StudyError
            If the library is missing, nobody answers, or a cluster cannot be started.
        SystemExit
            In the processes of MPI but the first, which serve it until its context ends, and end then.
        """
        for file in files:
            _require_kind("Workers.at_work", "files", file, str | Path)
        if self.dask:
            with dask_executor(self.dask, self.count, [Path(file).resolve() for file in files]) as executor:
                yield executor
        elif self.mpi:
            with mpi_executor(map(Path, files)) as executor:
                yield executor
        else:
            yield self.executor or self.count or 1


def _require_kind(where: str, name: str, value: Any, declared: Any) -> None:
    """Refuse a value that does not fit an annotation."""
    # imported here, since commands name `Workers` in their parameters, and `uqmbd --help` would wait for NumPy
    if type(value) in typing.get_args(declared) or type(value) is declared:
        return
    from uqmbd.arguments import fits, refusal

    if not fits(value, declared):
        raise StudyError(f"{where}: {refusal(name, value, declared)}")
