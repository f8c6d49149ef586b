"""Measure the time of 500 slider-cranks by part, relative to the limit: kernel operations at the peak of the processor.

The limit of a part is the time of the operations of its kernels, without any other cost:

- Operations are the additions, subtractions, multiplications, divisions, square roots and library functions in the
  LLVM IR of the kernels, each of eight realisations at once.  Changes of sign, comparisons, choices, loads and stores
  are not counted.
- A separate run counts the calls of each kernel: every call passes through a counter.  Lanes without a realisation
  count as well, as part of the limit.  The gathering of arguments and the sums of the integrator are not part of it.
- The peak is measured with independent chains of multiplications and additions (fused or alternating, the faster of
  both; a fused one counts twice), of divisions, of square roots, and of calls of the library functions in eight lanes.

Run with ``OMP_NUM_THREADS=1 python studies/benchmarks/limit.py [--repeat N] [--samples N]``.
"""

from __future__ import annotations

import argparse
import ctypes
import hashlib
import os
import re
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

os.environ.setdefault("OMP_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import numpy as np
import slider_crank
from measure import console, table_of

import uqmbd
from uqmbd.compiled import Kernel, addresses_of, kernel, object_code
from uqmbd.compiled.explicit import IntegrationState
from uqmbd.dynamics import Ensemble, build, integrate
from uqmbd_montecarlo import MonteCarlo

RTOL = 1e-6
CHUNK = 64
"""Number of realisations for which the parts run in turn, as in a study."""
ROUNDS = 20_000
"""Number of turns of the loops that measure the peak."""
CHAINS = 6
"""Number of independent chains: more exceed the registers of processors with sixteen of four numbers each."""
SIMPLE = {"fadd": "sums", "fsub": "sums", "fmul": "products", "fdiv": "divisions"}

ROW = "<8 x double>"

Operations = Counter[str]


def operations_of(text: str) -> Operations:
    """Count the operations on rows in a kernel's IR."""
    body = text[text.index("define void @") :]
    found: Operations = Counter()
    for line in body.splitlines():
        match = re.match(r"\s*%\S+ = (?:call \S+ x double> @(llvm|lanes)\.(\w+)|(\w+))", line)
        if match is None:
            continue
        family, function, operation = match.groups()
        if operation in SIMPLE:
            found[SIMPLE[operation]] += 1
        elif function == "sqrt":
            found["roots"] += 1
        elif family == "lanes":
            found[function] += 1
    return found


# -- the peak ---------------------------------------------------------------------------------------------------------


def loop(steps: Callable[[int, str], list[str]], declarations: str = "") -> float:
    """Return the seconds of one turn of a loop over independent chains.

    Parameters
    ----------
    steps : callable
        Lines of IR for chain number k, which compute ``%n{k}`` from the named value.
    declarations : str
        Declarations of the functions that the lines call.
    """
    phis = [f"%c{k} = phi {ROW} [ splat (double 0.5), %entry ], [ %n{k}, %turn ]" for k in range(CHAINS)]
    lines = [line for k in range(CHAINS) for line in steps(k, f"%c{k}")]
    stores = [
        line
        for k in range(CHAINS)
        for line in (f"%p{k} = getelementptr {ROW}, ptr %y, i64 {k}", f"store {ROW} %n{k}, ptr %p{k}, align 64")
    ]
    text = "\n".join(
        [
            declarations,
            "define void @NAME(ptr %x, ptr %y) nounwind {\nentry:",
            "%single = load double, ptr %x",
            f"%first = insertelement {ROW} poison, double %single, i32 0",
            f"%a = shufflevector {ROW} %first, {ROW} poison, <8 x i32> zeroinitializer",
            "br label %turn\nturn:\n%i = phi i64 [ 0, %entry ], [ %j, %turn ]",
            *phis,
            *lines,
            f"%j = add i64 %i, 1\n%more = icmp ult i64 %j, {ROUNDS}\nbr i1 %more, label %turn, label %end\nend:",
            *stores,
            "ret void\n}\n",
        ]
    )
    name = f"peak{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    place = addresses_of([name], object_code(text.replace("@NAME(", f"@{name}(")))[0]
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(place)
    room = np.ones(8 * (CHAINS + 2) + 8)
    begin = room.ctypes.data + (-room.ctypes.data) % 64
    spent = []
    for _ in range(15):
        start = time.process_time()
        call(begin, begin + 64)
        spent.append(time.process_time() - start)
    return min(spent) / ROUNDS


def peak(functions: set[str]) -> dict[str, float]:
    """Return the least seconds of each kind of operation, for eight realisations."""

    def one(operation: str) -> Callable[[int, str], list[str]]:
        return lambda k, c: [f"%n{k} = {operation} {ROW} {c}, %a"]

    alternating = loop(lambda k, c: [f"%n{k} = {('fadd', 'fmul')[k % 2]} {ROW} {c}, %a"]) / CHAINS
    fma = f"declare {ROW} @llvm.fma.v8f64({ROW}, {ROW}, {ROW})"
    fused = loop(lambda k, c: [f"%n{k} = call {ROW} @llvm.fma.v8f64({ROW} {c}, {ROW} %a, {ROW} %a)"], fma)
    simple = min(alternating, fused / (2 * CHAINS))
    root = f"declare {ROW} @llvm.sqrt.v8f64({ROW})"
    found = {
        "sums": simple,
        "products": simple,
        "divisions": loop(one("fdiv")) / CHAINS,
        "roots": loop(lambda k, c: [f"%n{k} = call {ROW} @llvm.sqrt.v8f64({ROW} {c})"], root) / CHAINS,
    }
    for function in sorted(functions):
        count = 2 if function in ("atan2", "pow") else 1
        declared = f"declare double @{function}({', '.join(['double'] * count)}) nounwind"

        def lanes(k: int, c: str, function: str = function, count: int = count) -> list[str]:
            lines, result = [], "poison"
            for lane in range(8):
                lines.append(f"%e{k}.{lane} = extractelement {ROW} {c}, i32 {lane}")
                given = ", ".join([f"double %e{k}.{lane}"] * count)
                lines.append(f"%f{k}.{lane} = call double @{function}({given}) nounwind")
                lines.append(f"%r{k}.{lane} = insertelement {ROW} {result}, double %f{k}.{lane}, i32 {lane}")
                result = f"%r{k}.{lane}"
            # the next argument depends on this result, which hardly changes it
            lines.append(f"%t{k} = fmul {ROW} {result}, splat (double 1.0e-20)")
            return [*lines, f"%n{k} = fadd {ROW} %t{k}, splat (double 0.5)"]

        found[function] = loop(lanes, declared) / CHAINS
    return found


# -- calls ------------------------------------------------------------------------------------------------------------


class Phases:
    """Current part of an integration: steps, output states, or the rest."""

    def __init__(self) -> None:
        self.now = "around"
        self.seconds: dict[str, float] = defaultdict(float)

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Record the parts of an integration separately."""
        kept = {name: getattr(IntegrationState, name) for name in ("advance", "project")}
        for name, method in kept.items():
            setattr(IntegrationState, name, self._timed(name, method))
        try:
            yield
        finally:
            for name, method in kept.items():
                setattr(IntegrationState, name, method)

    def _timed(self, name: str, method: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any, **options: Any) -> Any:
            outer, self.now = self.now, name
            begin = time.process_time()
            try:
                return method(*arguments, **options)
            finally:
                self.seconds[name] += time.process_time() - begin
                self.now = outer

        return timed


@contextmanager
def recorded(texts: dict[str, Operations]) -> Iterator[None]:
    """Record the operations of kernels during compilation."""
    compiled = object_code

    def noting(source: str, *rest: Any, **options: Any) -> bytes:
        name = re.search(r"define void @(\w+)\(", source)
        if name is not None:
            texts[name.group(1)] = operations_of(source)
        return compiled(source, *rest, **options)

    with patch.object(kernel, "object_code", noting):
        yield


@contextmanager
def counted(phases: Phases, calls: dict[str, Counter[str]]) -> Iterator[None]:
    """Count the calls of kernels whose address is not yet requested, by phase."""
    kept = vars(Kernel)["address"].func
    function = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    made: dict[str, Any] = {}

    def address(one: Kernel) -> int:
        if not one.code:
            return 0
        if one.name not in made:
            inner = function(kept(one))

            def count(x: int, y: int, name: str = one.name, inner: Any = inner) -> None:
                calls.setdefault(phases.now, Counter())[name] += 1
                inner(x, y)

            made[one.name] = function(count)
        return ctypes.cast(made[one.name], ctypes.c_void_p).value or 0

    with patch.object(Kernel, "address", property(address)):
        yield


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=9, help="rounds (default 9)")
    parser.add_argument("--samples", type=int, default=500, help="slider-cranks (default 500)")
    options = parser.parse_args()
    samples, times, mechanism = options.samples, slider_crank.study.times, slider_crank.mechanism
    values = mechanism.inputs.from_uniform(np.random.default_rng(1).uniform(size=(samples, len(mechanism.inputs))))
    texts: dict[str, Operations] = {}
    calls: dict[str, Counter[str]] = {}
    phases = Phases()

    def run(model: Any) -> dict[str, float]:
        """Return the processor seconds of the parts."""
        phases.seconds.clear()
        spent = dict.fromkeys(("assembly", "around", "outputs"), 0.0)
        for first in range(0, samples, CHUNK):
            clock = [time.process_time()]
            phases.now = "assembly"
            ensemble = Ensemble(model, values[first : first + CHUNK])
            ensemble.start  # noqa: B018 - assembled now
            clock.append(time.process_time())
            phases.now = "around"
            found = integrate(ensemble, times, RTOL)
            clock.append(time.process_time())
            phases.now = "outputs"
            ensemble.outputs(times, found.states)
            clock.append(time.process_time())
            for name, seconds in zip(spent, np.diff(clock).tolist(), strict=True):
                spent[name] += seconds
        spent["around"] -= sum(phases.seconds.values())
        return spent | dict(phases.seconds)

    with tempfile.TemporaryDirectory() as folder:
        os.environ["UQMBD_CACHE"] = folder
        with recorded(texts), phases.watched(), counted(phases, calls):
            phases.now = "building"
            model = build(mechanism)
            model_of_calls = run(model)
        del model_of_calls
        fresh = uqmbd.Study("limit", mechanism, times, [MonteCarlo(samples=samples, seed=1)], rtol=RTOL)
        model = fresh.model
        with phases.watched():
            rounds = [run(model) for _ in range(options.repeat + 1)][1:]
        whole = []
        for _ in range(options.repeat + 1):
            begin = time.process_time()
            fresh.propagate(fresh.propagators[0])
            whole.append(time.process_time() - begin)
    unit = peak({name for text in texts.values() for name in text} - {"sums", "products", "divisions", "roots"})
    table = table_of("Peak: ns of an operation on eight realisations", "operation", "ns")
    for name, seconds in unit.items():
        table.add_row(name, f"{1e9 * seconds:.3g}")
    console.print(table)
    kinds = list(unit)
    titles = {
        "assembly": "assembly",
        "advance": "steps",
        "project": "output states",
        "around": "the rest of the integration",
        "outputs": "outputs and reactions",
    }
    columns = ("", "us a sample (range)", "limit, us", "share of it", "calls of kernels", *kinds)
    table = table_of(f"{samples} slider-cranks, tolerance {RTOL:g}; operations of a sample, on eight lanes", *columns)
    together = np.zeros(options.repeat)
    limits: Counter[str] = Counter()
    for phase, title in titles.items():
        spent = np.array([1e6 * r.get(phase, 0.0) / samples for r in rounds])
        together += spent
        total: Operations = Counter()
        for name, number in calls.get(phase, Counter()).items():
            for kind, count in texts.get(name, Counter()).items():
                total[kind] += number * count
        limits[phase] = 1e6 * sum(total[kind] * unit[kind] for kind in kinds) / samples
        row = [f"{np.median(spent):.1f} ({spent.min():.1f} to {spent.max():.1f})", f"{limits[phase]:.2f}"]
        row.append(f"{limits[phase] / np.median(spent):.2f}" if limits[phase] else "")
        row.append(f"{sum(calls.get(phase, Counter()).values()) / samples:.0f}")
        table.add_row(title, *row, *(f"{total[kind] / samples:.0f}" for kind in kinds))
    both = np.array([1e6 * (r.get("advance", 0.0) + r.get("project", 0.0)) / samples for r in rounds])
    limit = limits["advance"] + limits["project"]
    about = f"{np.median(both):.1f} ({both.min():.1f} to {both.max():.1f})"
    table.add_row("steps and output states", about, f"{limit:.2f}", f"{limit / np.median(both):.2f}")
    spent = np.array([1e6 * seconds / samples for seconds in whole[1:]])
    rest = spent - np.median(together)
    table.add_row("further parts of a whole study: draws, statistics", f"{np.median(rest):.1f}")
    table.add_row("a whole study", f"{np.median(spent):.1f} ({spent.min():.1f} to {spent.max():.1f})")
    console.print(table)
    console.print(f"Steps and output states take {np.median(both) / limit:.1f} times their limit")


if __name__ == "__main__":
    main()
