"""What is paid before the first realisation moves: imports, models from nothing and from the cache, the first study.

Each number is the median over rounds, each in a fresh process, with the range; the versions (this one, and an earlier
one if its work tree is named) and CasADi take turns.

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
"""How a mechanism is made, and its name among CasADi's."""

SETUP = f"import sys, time; sys.path[:0] = {[str(HERE), str(HERE.parent)]!r}; import numpy as np; "
BEGIN, CLOCK = "begin = time.process_time(); ", "print(time.process_time() - begin)"

LONGEST = 30
"""Processor seconds after which a child is stopped."""

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
"""The first integration in a process, which loads the kernels and the driver."""

DRIVER = "import uqmbd.compiled.driver as c, llvmlite.binding; " + BEGIN + "c.driver(); " + CLOCK
"""The driver is compiled once for a processor, and then loaded; models are made where it is there."""

PEER = "import peers; " + BEGIN + "peers.CasadiPeer(peers.PEERS[{name!r}][0](), np.linspace(0, 1, 401), 1e-6); " + CLOCK

MODULES = (
    "import atexit, sys; atexit.register(lambda: open({list!r}, 'w').write(chr(10).join(sys.modules))); "
    "sys.argv = ['uqmbd', 'run', {study!r}, '--out', {out!r}]; from uqmbd.cli import main; main()"
)
"""Writes down what a run imports."""

DRIVEN = "the driver, once for a processor"

IMPORTS = (
    "import sys, time, importlib, warnings; warnings.simplefilter('ignore'); names = open({list!r}).read().split(); "
    + BEGIN
    + "[importlib.import_module(n) for n in names if n.partition('.')[0] not in ('__main__', '__mp_main__')]; "
    + CLOCK
)

STUDY = "import sys; sys.argv = ['uqmbd', 'run', {study!r}, '--out', {out!r}]; from uqmbd.cli import main; main()"


def limited() -> None:
    """Stop this process where it goes on for too long."""
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))


def child(script: str, root: Path, cache: str) -> tuple[float, str]:
    """Run a script in a fresh process: its processor seconds in total, and what it prints.

    The time is infinite where it took too long, and NaN where it failed, which is printed.
    """
    path = os.pathsep.join([str(root), str(root / "plugins")])
    environment = dict(os.environ, PYTHONPATH=path, UQMBD_CACHE=cache, MPLBACKEND="Agg")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-W", "ignore", "-c", script]
    # the folder where it runs comes first in the path
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
    """Processor seconds that a script has measured itself."""
    spent, printed = child(SETUP + script, root, cache)
    return float(printed.split()[-1]) if printed else spent


def cell(seconds: list[float]) -> str:
    """Median and range."""
    found = np.array(seconds)
    if np.isinf(found).any():
        return f"over {LONGEST}"
    return f"{np.median(found):.2f} ({found.min():.2f} to {found.max():.2f})"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--earlier", type=Path, help="the work tree of an earlier version")
    parser.add_argument("--repeat", type=int, default=3, help="rounds (default 3)")
    options = parser.parse_args()
    versions = {"now": HERE.parent.parent}
    if options.earlier is not None:
        versions = {"earlier": options.earlier.resolve(), **versions}
    parts = ("from nothing", "from the cache", "first integration, cached")
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
