"""Measure many samples of the pendulum of the README: processor time, memory and disk of runs with a folder, by size.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/many_samples.py [--samples 50000] [--workers 2]``.  Each run is a
separate process.  The script sums the memory of its processes every fifth of a second.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
TICK = 0.2
"""Seconds between two measurements of memory and disk."""


def run(samples: int, workers: int, folder: Path) -> None:
    """Run a study, store its results, and print its cost."""
    sys.path.insert(0, str(HERE.parent))
    import resource

    import pendulum

    import uqmbd
    from uqmbd_montecarlo import MonteCarlo

    study = pendulum.study.with_propagators([MonteCarlo(samples=samples, seed=1)])
    _ = study.model  # compiled once for every number of samples
    before, begin = spent(resource), time.perf_counter()
    tree = study.run(workers, folder=folder)
    uqmbd.results.save(tree, folder / "results.nc")
    numbers = len(pendulum.study.times) * len(study.mechanism.outputs)
    raw = 8 * samples * numbers
    print(json.dumps({"cpu": spent(resource) - before, "wall": time.perf_counter() - begin, "raw": raw}))


def spent(resource: object) -> float:
    """Return the processor time of this process and its ended children, s."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]  # type: ignore[attr-defined]
    return float(sum(usage.ru_utime + usage.ru_stime for usage in usages))


def measured(samples: int, workers: int, place: Path) -> dict[str, float]:
    """Return bytes of memory (all processes, and the largest) and of disk (at the peak, and after) of a run."""
    import psutil

    with tempfile.TemporaryDirectory(dir=place) as name:
        folder = Path(name)
        command = [sys.executable, __file__, "--run", str(samples), "--workers", str(workers), "--folder", name]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        watched, together, largest, disk = psutil.Process(process.pid), 0, 0, 0
        while process.poll() is None:
            memory = [_memory(one) for one in (watched, *watched.children(recursive=True))]
            together, largest = max(together, sum(memory)), max(largest, *memory)
            disk = max(disk, used(folder))
            time.sleep(TICK)
        measurement = json.loads(process.communicate()[0].splitlines()[-1])
        return {**measurement, "together": together, "largest": largest, "disk": disk, "after": used(folder)}


def _memory(process: object) -> int:
    """Return the resident memory of a process, with its part of shared memory."""
    import psutil

    try:
        return int(process.memory_full_info().pss)  # type: ignore[attr-defined]
    except (psutil.NoSuchProcess, psutil.AccessDenied, AttributeError):
        return 0


def used(folder: Path) -> int:
    """Return the bytes of a folder on the disk; files may appear and disappear."""
    found = 0
    for where, _, files in os.walk(folder):
        for name in files:
            try:
                found += os.stat(os.path.join(where, name)).st_blocks * 512
            except OSError:
                continue
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, nargs="+", default=[50_000, 100_000])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--place", type=Path, default=Path(tempfile.gettempdir()), help="folder on the disk to measure")
    parser.add_argument("--run", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run is not None:
        run(options.run, options.workers, options.folder)
        return
    print(
        "samples, workers: processor s, wall s; MB of all processes, the largest; disk over samples at the peak, after"
    )
    for samples in options.samples:
        found = measured(samples, options.workers, options.place)
        print(
            f"{samples}, {options.workers}: {found['cpu']:.1f}, {found['wall']:.1f}; {found['together'] / 1e6:.0f}, "
            f"{found['largest'] / 1e6:.0f}; {found['disk'] / found['raw']:.2f}, {found['after'] / found['raw']:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
