"""Workers of commands and scripts: of this machine, of a Dask cluster, or the processes of MPI.

This package imports no large library, because the import of `Workers` by all commands would delay `uqmbd --help`.
"""

from __future__ import annotations

from uqmbd.clusters.options import with_worker_options
from uqmbd.clusters.workers import Workers

__all__ = ["Workers", "with_worker_options"]
