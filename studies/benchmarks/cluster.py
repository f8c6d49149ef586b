"""Measure Monte Carlo on a local Dask cluster with one, two and more workers: wall time, processor time, overhead.

The scheduler and the workers are separate processes.  Speed-up is the wall time with one worker over that with several,
after a first run that compiles.  On a busy machine the processor time of the workers and of the coordinator is more
informative than the wall time.  Without overhead it is the same for any number of workers.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/cluster.py [--samples N] [--workers N] [--repeat N]``.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import distributed
import slider_crank
from measure import console, table_of

import uqmbd
from uqmbd_montecarlo import MonteCarlo


def spent(client: distributed.Client) -> dict[str, tuple[float, int]]:
    """Return the processor seconds and the number of finished tasks of each worker so far."""

    def tell(dask_worker: distributed.Worker) -> tuple[float, int]:
        return time.process_time(), dask_worker.state.executed_count

    found: Any = client.run(tell)  # a coroutine only for asynchronous clients
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--workers", type=int, default=2, help="largest number; starts at 1 and doubles (default 2)")
    parser.add_argument("--repeat", type=int, default=3)
    given = parser.parse_args()
    times = slider_crank.study.times
    methods = [MonteCarlo(samples=given.samples, seed=1)]
    study = uqmbd.Study("slider_crank", slider_crank.study.mechanism, times, methods, integrator="ida")
    rows: list[tuple[int, float, float, list[float], list[int]]] = []
    first = 0.0
    counts = [1]
    while counts[-1] * 2 <= given.workers:
        counts.append(counts[-1] * 2)
    for count in counts:
        cluster = distributed.LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=":0")
        with cluster, distributed.Client(cluster) as client:
            client.wait_for_workers(count)
            executor = client.get_executor(pure=False)
            study.with_propagators([MonteCarlo(samples=64 * count * 4, seed=2)]).run(executor)
            for _ in range(given.repeat):
                before, here, begin = spent(client), time.process_time(), time.monotonic()
                study.run(executor)
                wall, here = time.monotonic() - begin, time.process_time() - here
                after = spent(client)
                seconds = [after[name][0] - before[name][0] for name in after]
                tasks = [after[name][1] - before[name][1] for name in after]
                rows.append((count, wall, here, seconds, tasks))
    title = f"{given.samples} slider-cranks by IDA, median of {given.repeat}"
    columns = ["wall, s", "speed-up", "processor of all workers, s", "of the coordinator, s"]
    table = table_of(title, "workers", *columns, "tasks of each", "processor of each, s")
    for count in counts:
        mine = [row for row in rows if row[0] == count]
        wall, here = statistics.median(row[1] for row in mine), statistics.median(row[2] for row in mine)
        first = first or wall
        work = statistics.median(sum(row[3]) for row in mine)
        shares = ", ".join(map(str, mine[-1][4])), ", ".join(f"{seconds:.1f}" for seconds in mine[-1][3])
        table.add_row(str(count), f"{wall:.1f}", f"{first / wall:.2f}", f"{work:.1f}", f"{here:.2f}", *shares)
    console.print(table)


if __name__ == "__main__":
    main()
