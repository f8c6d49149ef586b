"""Selection of workers by the options of commands."""

from __future__ import annotations

import typing
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uqmbd.clusters.dask_cluster import STARTED_HERE, dask_executor
from uqmbd.clusters.mpi import mpi_executor
from uqmbd.errors import StudyError
from uqmbd.names import checked

__all__ = ["Workers"]


@checked
@dataclass(frozen=True)
class Workers:
    """Workers selected by the options ``--workers``, ``--dask`` and ``--mpi`` of a command.

    These three options replace a command's parameter of this type: see `uqmbd.extend.Command`.

    Attributes
    ----------
    count : int, optional
        Number of threads or processes of this machine, or of processes of a Dask cluster that uqmbd starts. None means
        one worker on this machine, and for a cluster the number in its configuration.
    dask : str
        Address of a Dask scheduler (``tcp://host:8786``), or a scheduler file that it writes. ``"local"`` starts
        processes of this machine. ``"slurm"``, ``"pbs"``, ``"sge"``, ``"lsf"``, ``"oar"``, ``"moab"`` and
        ``"htcondor"`` start jobs of a queue as Dask's configuration describes them (docs/how-to/cluster.md).
    mpi : bool
        Whether to use the processes started by ``mpiexec``.
    executor : concurrent.futures.Executor, optional
        An existing executor; it stays open.

    Raises
    ------
    uqmbd.StudyError
        If more than one of `dask`, `mpi` and `executor` is given, or `count` is given for a fixed number of workers.

    Examples
    --------
    >>> with Workers(count=2).start() as workers:
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
            raise StudyError("Workers: executor is given together with count, mpi or dask; give only one of them.")
        if self.mpi and self.count is not None:
            raise StudyError(
                f"--mpi with --workers {self.count}: with MPI, mpiexec sets the number of processes, as in "
                f"mpiexec -n {self.count + 1} uqmbd ... --mpi (one of them distributes the tasks)."
            )
        if self.dask and self.count is not None and self.dask not in STARTED_HERE:
            raise StudyError(
                f"give either --workers or --dask, not both: the cluster at {self.dask} already has workers. "
                f"--workers applies to clusters that uqmbd starts: --dask {', '.join(sorted(STARTED_HERE))}."
            )

    @property
    def awaited(self) -> str:
        """Stage of the progress display while the workers start; empty if they start without delay."""
        if self.mpi:
            return "waiting for the processes of MPI"
        if self.dask in STARTED_HERE:
            return f"starting the Dask cluster {self.dask}"
        return f"connecting to the Dask scheduler {self.dask}" if self.dask else ""

    @contextmanager
    def start(self, *files: str | Path) -> Iterator[int | Executor]:
        """Start the workers, yield them as `Study.run` and `uqmbd.extend.pool` accept them, and stop them at the end.

        Parameters
        ----------
        *files : str or Path
            Scripts whose functions the workers may call. A Dask cluster that does not share this folder receives
            copies of them.

        Yields
        ------
        int or concurrent.futures.Executor
            Number of workers, or executor.

        Raises
        ------
        uqmbd.StudyError
            If the library is missing, no scheduler answers, or a cluster cannot be started.
        SystemExit
            In all processes of MPI except the first. These processes compute tasks until the context ends, and then
            exit.
        """
        for file in files:
            _require_kind("Workers.start", "files", file, str | Path)
        if self.dask:
            with dask_executor(self.dask, self.count, [Path(file).resolve() for file in files]) as executor:
                yield executor
        elif self.mpi:
            with mpi_executor(map(Path, files)) as executor:
                yield executor
        else:
            yield self.executor or self.count or 1

    def at_work(self, *files: str | Path) -> AbstractContextManager[int | Executor]:
        """Return `start(*files)`; the old name is removed in version 0.2.

        Parameters
        ----------
        *files : str or Path
            Scripts whose functions the workers may call.

        Returns
        -------
        context manager of int or concurrent.futures.Executor
            Context of the workers.

        Warns
        -----
        DeprecationWarning
            At every call.

        Examples
        --------
        >>> import pytest
        >>> with pytest.warns(DeprecationWarning, match="Workers.start"), Workers(count=2).at_work() as workers:
        ...     print(workers)
        2
        """
        text = "Workers.at_work was renamed to Workers.start; version 0.2 removes the old name."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return self.start(*files)


def _require_kind(where: str, name: str, value: Any, declared: Any) -> None:
    """Refuse a value that does not fit an annotation."""
    # imported here: all commands import `Workers`, and the import of NumPy would delay `uqmbd --help`
    if type(value) in typing.get_args(declared) or type(value) is declared:
        return
    from uqmbd.arguments import fits, refusal

    if not fits(value, declared):
        raise StudyError(f"{where}: {refusal(name, value, declared)}")
