"""Measure the cost before the first realisation moves: imports, models without and with the cache, and the first study.

Each number is the median over rounds, each in a new process, with the range.  This version, an earlier one if its work
tree is given, and CasADi alternate.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/building.py [--earlier FOLDER] [--repeat N]``.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE)]

import numpy as np
from measure import console, table_of

MODELS = {
    "slider-crank": ("import slider_crank; made = slider_crank.mechanism", "slider_crank"),
    "four spatial bodies (five-bar)": ("import mechanisms; made = mechanisms.five_bar(random=True)", "five_bar"),
    "spatial chain of 40": ("import mechanisms; made = mechanisms.spatial_links(40)", None),
    "40 four-bars": ("import mechanisms; made = mechanisms.four_bars(40)", None),
}
"""Statements that create a mechanism, and its name among those of CasADi."""

SETUP = f"import sys, time; sys.path[:0] = {[str(HERE), str(HERE.parent)]!r}; import numpy as np; "
BEGIN, CLOCK = "begin = time.process_time(); ", "print(time.process_time() - begin)"

LONGEST = 30
"""Processor seconds after which a child process is stopped."""

BUILD = (
    "import uqmbd.dynamics, symengine, scipy.linalg, llvmlite.binding; {make}; "
    + BEGIN
    + "uqmbd.dynamics.build(made); "
    + CLOCK
)

FIRST = (
    "import uqmbd.dynamics as d, symengine, scipy.linalg, llvmlite.binding; {make}; model = d.build(made); "
    "e = d.Ensemble(model, np.tile(made.inputs.means, (8, 1))); e.start; "
    + BEGIN
    + "d.integrate(e, np.linspace(0, 0.01, 3), 1e-6); "
    + CLOCK
)
"""Script of the first integration in a process, which loads the kernels and the driver."""

DRIVER = (
    "import uqmbd.compiled.driver as c, llvmlite.binding; load = getattr(c, 'load_driver', None) or c.driver; "
    + BEGIN
    + "load(); "
    + CLOCK
)
"""Script that compiles the driver once for a processor, or loads it; models are built with a compiled driver.

In earlier versions the function is `driver`."""

PEER = "import peers; " + BEGIN + "peers.CasadiPeer(peers.PEERS[{name!r}][0](), np.linspace(0, 1, 401), 1e-6); " + CLOCK

MODULES = (
    "import atexit, sys; atexit.register(lambda: open({list!r}, 'w').write(chr(10).join(sys.modules))); "
    "sys.argv = ['uqmbd', 'run', {study!r}, '--out', {out!r}]; from uqmbd.cli import main; main()"
)
"""Script that lists the imports of a run."""

DRIVEN = "the driver, once for a processor"

IMPORTS = (
    "import sys, time, importlib, warnings; warnings.simplefilter('ignore'); names = open({list!r}).read().split(); "
    + BEGIN
    + "[importlib.import_module(n) for n in names if n.partition('.')[0] not in ('__main__', '__mp_main__')]; "
    + CLOCK
)

STUDY = "import sys; sys.argv = ['uqmbd', 'run', {study!r}, '--out', {out!r}]; from uqmbd.cli import main; main()"


def limited() -> None:
    """Limit the processor time of this process."""
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))


def child(script: str, root: Path, cache: str) -> tuple[float, str]:
    """Run a script in a new process, and return its total processor seconds and its output.

    The time is infinite if it exceeds the limit, and NaN if the script fails; the error is printed.
    """
    path = os.pathsep.join([str(root), str(root / "plugins")])
    environment = dict(os.environ, PYTHONPATH=path, UQMBD_CACHE=cache, MPLBACKEND="Agg")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-W", "ignore", "-c", script]
    # the working folder is first in the path
    done = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, preexec_fn=limited)
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return float("inf"), ""
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        print(done.stderr.strip().splitlines()[-1:], file=sys.stderr)
        return float("nan"), ""
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return spent, done.stdout


def clocked(script: str, root: Path, cache: str) -> float:
    """Return the processor seconds that a script measures and prints."""
    spent, printed = child(SETUP + script, root, cache)
    return float(printed.split()[-1]) if printed else spent


def cell(seconds: list[float]) -> str:
    """Format median and range."""
    found = np.array(seconds)
    if np.isinf(found).any():
        return f"over {LONGEST}"
    return f"{np.median(found):.2f} ({found.min():.2f} to {found.max():.2f})"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--earlier", type=Path, help="work tree of an earlier version")
    parser.add_argument("--repeat", type=int, default=3, help="rounds (default 3)")
    options = parser.parse_args()
    versions = {"now": HERE.parent.parent}
    if options.earlier is not None:
        versions = {"earlier": options.earlier.resolve(), **versions}
    parts = ("without cache", "with cache", "first integration, cached")
    with_casadi = importlib.util.find_spec("casadi") is not None
    found: dict[tuple[str, str, str], list[float]] = {}

    def note(model: str, version: str, part: str, *, seconds: float) -> None:
        found.setdefault((model, version, part), []).append(seconds)

    for _ in range(options.repeat):
        for name, (make, peer) in MODELS.items():
            for version, root in versions.items():
                with tempfile.TemporaryDirectory() as cache:
                    if (root / "uqmbd" / "compiled").is_dir():
                        for part in parts[:2]:
                            note(DRIVEN, version, part, seconds=clocked(DRIVER, root, cache))
                    stopped = any(np.isinf(x).any() for k, x in found.items() if k[:2] == (name, version))
                    for part, script in () if stopped else zip(parts, (BUILD, BUILD, FIRST), strict=True):
                        seconds = clocked(script.format(make=make), root, cache)
                        note(name, version, part, seconds=seconds)
                        if not np.isfinite(seconds):
                            break
            if peer is not None and with_casadi:
                root = versions["now"]
                note(name, "CasADi", parts[0], seconds=clocked(PEER.format(name=peer), root, tempfile.gettempdir()))
        for version, root in versions.items():
            with tempfile.TemporaryDirectory() as folder:
                study, cache = str(root / "studies" / "slider_crank.py"), str(Path(folder, "cache"))
                names = {"study": study, "out": str(Path(folder, "out")), "list": str(Path(folder, "modules"))}
                seconds = child(STUDY.format(**names), root, cache)[0]
                note("uqmbd run studies/slider_crank.py", version, parts[0], seconds=seconds)
                seconds = child(MODULES.format(**names), root, cache)[0]
                note("uqmbd run studies/slider_crank.py", version, parts[1], seconds=seconds)
                note("its imports", version, parts[1], seconds=clocked(IMPORTS.format(**names), root, cache))
    table = table_of(f"Processor s, medians of {options.repeat} rounds (range)", "", "version", *parts)
    for name, version in dict.fromkeys(key[:2] for key in found):
        cells = [found.get((name, version, part)) for part in parts]
        table.add_row(name, version, *("" if x is None else cell(x) for x in cells))
    console.print(table)


if __name__ == "__main__":
    main()
