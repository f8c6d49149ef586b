"""Workers of commands and scripts: of this machine, of a Dask cluster, or the processes of MPI.

Nothing heavy is imported: commands name `Workers` in their parameters, and `uqmbd --help` waits for that.
"""

from __future__ import annotations

from uqmbd.clusters.options import with_worker_options
from uqmbd.clusters.workers import Workers

__all__ = ["Workers", "with_worker_options"]
