"""The options ``--workers``, ``--dask`` and ``--mpi`` of all commands that compute."""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from uqmbd.clusters.mpi import mpi_executor
from uqmbd.clusters.workers import Workers
from uqmbd.errors import StudyError

__all__ = ["with_worker_options"]

Count = Annotated[
    int | None, typer.Option("--workers", metavar="N", min=1, help="Number of threads or processes (default: 1).")
]
Dask = Annotated[
    str | None,
    typer.Option(
        "--dask",
        metavar="WHERE",
        help="Compute on a Dask cluster: address or file of its scheduler, or local, slurm, pbs, sge, lsf ...",
    ),
]
Mpi = Annotated[bool, typer.Option("--mpi", help="Compute with the processes that mpiexec started.")]

OPTIONS: dict[str, tuple[Any, Any]] = {"count": (Count, None), "dask": (Dask, None), "mpi": (Mpi, False)}
"""Annotations and defaults, by the names of the fields of `Workers`."""


def with_worker_options(run: Callable[..., None]) -> Callable[..., None]:
    """Replace the `Workers` parameter of a command's function by options; return other functions unchanged.

    With MPI, only the first process calls the function.

    >>> def run(script: str, *, workers: Workers) -> None:
    ...     print(script, workers.count)
    >>> with_options = with_worker_options(run)
    >>> list(inspect.signature(with_options).parameters)
    ['script', 'count', 'dask', 'mpi']
    >>> with_options(script="study.py", count=3, dask=None, mpi=False)
    study.py 3
    """
    hints = typing.get_type_hints(run, include_extras=True)
    taken = [name for name, hint in hints.items() if hint is Workers]
    if not taken:
        return run
    [name] = taken

    @functools.wraps(run)
    def with_options(*, count: int | None, dask: str | None, mpi: bool, **others: Any) -> None:
        if dask is not None and not dask.strip():
            # for example an unset variable of the shell: do not use one worker of this machine instead
            raise StudyError(
                "--dask is empty; expected an address, a scheduler file, or local, slurm, pbs, sge, lsf ..."
            )
        workers = Workers(count, dask or "", mpi)
        if not mpi:
            run(**others, **{name: workers})
            return
        files = [given for given in others.values() if isinstance(given, Path) and given.is_file()]
        with mpi_executor(files) as executor:
            run(**others, **{name: Workers(executor=executor)})

    parameters = [
        parameter.replace(annotation=hints.get(parameter.name, parameter.annotation))
        for parameter in inspect.signature(run).parameters.values()
        if parameter.name != name
    ]
    parameters += [
        inspect.Parameter(option, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for option, (annotation, default) in OPTIONS.items()
    ]
    described: Any = with_options
    described.__signature__ = inspect.Signature(parameters)
    described.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return with_options
