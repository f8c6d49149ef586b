"""Code for processors and systems that are not this one: what it calls, and that lesser instructions give the same."""

from __future__ import annotations

import os
import pickle
import struct
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import chaospy
import llvmlite.binding as llvm
import numpy as np
import pytest
import symengine as se
import sympy

import uqmbd
from uqmbd.compiled import Target, kernel, kernels, native, object_code
from uqmbd.mechanism.expressions.computable import FUNCTIONS
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

TARGETS = {
    "x86_64 Linux": Target("x86_64-unknown-linux-gnu", "x86-64", ""),
    "aarch64 Linux": Target("aarch64-unknown-linux-gnu", "generic", ""),
    "x86_64 macOS": Target("x86_64-apple-darwin", "x86-64", ""),
    "arm64 macOS": Target("arm64-apple-darwin", "apple-m1", ""),
    # llvmlite asks for ELF there, which MCJIT wants
    "x86_64 Windows": Target("x86_64-pc-windows-msvc-elf", "x86-64", ""),
}
ROOT = Path(__file__).parents[2]


def undefined(code: bytes) -> set[str]:
    """Read the names that object code wants from outside: of ELF and of Mach-O files of 64 bits."""
    if code[:4] == b"\x7fELF":
        (table,) = struct.unpack_from("<Q", code, 0x28)
        size, count = struct.unpack_from("<HH", code, 0x3A)
        sections = [struct.unpack_from("<IIQQQQIIQQ", code, table + k * size) for k in range(count)]
        symbols = next(s for s in sections if s[1] == 2)
        first, length, names = symbols[4], symbols[5], sections[symbols[6]][4]
        entries = [struct.unpack_from("<IBBHQQ", code, first + k) for k in range(0, length, 24)]
        offsets = [names + name for name, _, _, section, *_ in entries if section == 0 and name]
        return {code[x : code.index(b"\0", x)].decode() for x in offsets}
    assert code[:4] == b"\xcf\xfa\xed\xfe", "Mach-O"
    commands, place, found = struct.unpack_from("<I", code, 16)[0], 32, set()
    for _ in range(commands):
        command, size = struct.unpack_from("<II", code, place)
        if command == 2:
            first, count, names, _ = struct.unpack_from("<IIII", code, place + 8)
            for k in range(count):
                name, kind = struct.unpack_from("<IB", code, first + 16 * k)
                if kind & 0x0E == 0:  # a name on its own
                    x = names + name
                    found.add(code[x : code.index(b"\0", x)].decode().removeprefix("_"))
        place += size
    return found


@pytest.fixture(scope="module", autouse=True)
def _all_targets():
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()


def text(function: type[sympy.Basic], count: int) -> str:
    """A kernel of one function of two arguments at most, as LLVM IR for a processor without any extension."""
    from uqmbd.compiled.emission import expressions_text

    symbols = sympy.symbols("x y", real=True)[:count]
    return expressions_text("one", se.symbols("x y"), [], [se.sympify(function(*symbols))], 2, {})


@pytest.mark.parametrize("target", TARGETS)
def test_kernels_call_what_is_registered(target: str) -> None:
    """Every function, and one so long that it spills to a large stack frame."""
    kinds = [f for f in FUNCTIONS if f not in (sympy.Heaviside, sympy.Piecewise)]
    two = (sympy.atan2, sympy.Max, sympy.Min, sympy.Pow)
    found = [undefined(object_code(text(f, 2 if f in two else 1), TARGETS[target])) for f in (*kinds, sympy.Pow)]
    assert {"sin", "tgamma", "atan2", "pow"} <= set().union(*found) <= set(native.LIBRARY)


def crowded() -> str:
    """A function that holds more values than any processor has registers: more than a page of them."""
    from uqmbd.compiled.writer import FunctionWriter

    w = FunctionWriter()
    values = [w.load(k) for k in range(80)]
    for k in range(80):
        w.store(k, w.call("sin", w.multiply(values[k], values[79 - k])))
    total = values[0]
    for value in values:
        total = w.add(w.multiply(total, value), value)
    w.store(80, total)
    return w.text("crowded", 8)


@pytest.mark.parametrize("target", TARGETS)
def test_large_frames_are_probed_on_windows_only(target: str) -> None:
    found = undefined(object_code(crowded(), TARGETS[target]))
    assert found == {"sin"} | ({"__chkstk"} if "Windows" in target else set())
    assert "__chkstk" in native.LIBRARY


@pytest.mark.thorough
@pytest.mark.parametrize("target", TARGETS)
def test_the_driver_calls_what_is_registered(target: str) -> None:
    source = files("uqmbd.compiled").joinpath("source")
    parts = [path.read_bytes() for path in source.iterdir() if path.name.endswith(".bc")]
    assert len(parts) > 1
    defined, needed = set(), set()
    for bitcode in parts:
        code = object_code(bitcode, TARGETS[target])
        needed |= undefined(code)
        defined |= {one.name for one in llvm.parse_bitcode(bitcode).functions if not one.is_declaration}
    found = needed - defined
    own = {"Windows": {"__chkstk"}, "macOS": {"bzero"}}.get(target.split()[1], set())
    assert found <= {"memcpy", "memset", "memmove"} | own
    assert found <= set(native.LIBRARY)


@pytest.mark.parametrize(("cpu", "width"), [("x86-64", 2), ("x86-64-v2", 2), ("x86-64-v3", 4)])
@pytest.mark.skipif(not native.host().triple.startswith("x86_64"), reason="these are x86 processors")
def test_lesser_processors_compute_the_same(cpu: str, width: int, monkeypatch) -> None:
    """Without AVX-512, AVX2 and fused operations: a long kernel and a short one, to rounding."""
    x = se.symbols("x0:20")
    short = [x[0] * x[1] + se.sin(x[2]) / x[3], se.Max(x[4], x[5]) + se.floor(9 * x[6])]
    long = [sum((x[i] * x[(i + k) % 20] - x[k]) ** 2 / x[(3 * i + k) % 20] for i in range(20)) for k in range(20)]
    rows = np.random.default_rng(0).uniform(0.5, 1.5, (11, 20))
    expected = [kernels.compile_kernel(x, e)(rows) for e in (short, long)]
    target = Target(native.host().triple, cpu, "")
    assert target.width == width
    monkeypatch.setattr(kernels, "host", lambda: target)
    monkeypatch.setattr(kernel, "host", lambda: target)
    monkeypatch.setattr(kernel, "object_code", lambda source: object_code(source, target))
    for e, values in zip((short, long), expected, strict=True):
        np.testing.assert_allclose(kernels.compile_kernel(x, e)(rows), values, rtol=1e-13)


PENDULUM = """
import sys
import llvmlite.binding as llvm
from llvmlite.binding.targets import FeatureMap
if sys.argv[1:]:
    llvm.get_host_cpu_name = lambda: sys.argv[1]
    llvm.get_host_cpu_features = lambda: FeatureMap()
import numpy as np
import sympy
import uqmbd
from uqmbd_joints import Revolute
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0.5, 0))
pivot = mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
mechanism.output("x", rod.position[0], units="m")
force = sympy.Abs(pivot.reaction_force[0])
mechanism.output("largest", uqmbd.maximum(force))
mechanism.output("impulse", uqmbd.integral(force))
mechanism.output("lowest", uqmbd.first_time(rod.position[0] <= 0))
mechanism.require("load", rod.position[1] >= -0.4)
from uqmbd.compiled import host
found = uqmbd.simulate(mechanism, np.linspace(0, 2, 9), rtol=1e-10)
names = "largest", "impulse", "lowest", "requirement_margin"
print(host().width, *found["x"].values, *np.concatenate([found[x].values.ravel() for x in names]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not native.host().triple.startswith("x86_64"), reason="these are x86 processors")
def test_motion_on_lesser_processors_is_the_same() -> None:
    """The whole way: one cache that knows the processors apart, the driver, kernels, and what sums a motion up."""
    found = []
    for arguments in ([], ["x86-64"], ["x86-64-v3"]):
        command = [sys.executable, "-c", PENDULUM, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
        found.append([float(x) for x in done.stdout.split()])
    assert [one[0] for one in found] == [native.host().width, 2, 4]
    assert len(found[0]) == 22
    for one in found[1:]:
        np.testing.assert_allclose(one[1:], found[0][1:], atol=1e-9)


REFUSED = """
import ctypes
import sys
if "pretend" in sys.argv:
    import llvmlite.binding as llvm
    def refuse():
        raise OSError("cannot allocate executable memory")
    llvm.check_jit_execution = refuse
elif ctypes.CDLL(None).prctl(65, 1, 0, 0, 0):  # PR_SET_MDWE: Linux refuses it to this process from now on
    sys.exit(77)
import symengine as se
from uqmbd.compiled import compile_kernel
compile_kernel([se.Symbol("x")], [se.Symbol("x") ** 2])
"""


@pytest.mark.parametrize("how", ["pretend", "by the kernel"])
def test_refused_executable_memory_is_reported(how: str) -> None:
    if how == "by the kernel" and sys.platform != "linux":
        pytest.skip("this is how Linux refuses it")
    done = subprocess.run([sys.executable, "-c", REFUSED, how], capture_output=True, text=True, check=False, cwd=ROOT)
    if done.returncode == 77:
        pytest.skip("Linux refuses it from version 6.3 on")
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("uqmbd.errors.UqmbdError: This system refuses memory") and "MemoryDenyWriteExecute" in last


def test_code_of_another_processor_is_compiled_again() -> None:
    """Code that was made elsewhere is made anew, before an instruction is met that is not there."""
    cube = kernels.compile_kernel([se.Symbol("x")], [se.Symbol("x") ** 3])
    assert replace(cube, needs=cube.needs.rpartition(" ")[0])(np.full((1, 1), 2.0)) == 8
    wrong = replace(cube, code=b"no code", needs=f"{cube.needs} avx1024", name="elsewhere")
    assert wrong(np.full((1, 1), 2.0)) == 8


SENT = """
import pickle
import sys
import llvmlite.binding as llvm
from llvmlite.binding.targets import FeatureMap
if sys.argv[2:]:
    llvm.get_host_cpu_name = lambda: sys.argv[2]
    llvm.get_host_cpu_features = lambda: FeatureMap()
import numpy as np
from uqmbd import compiled
from uqmbd.compiled import kernel
made = []
real = kernel.compiled
kernel.compiled = lambda source: made.append(1) or real(source)
from uqmbd.propagation.execution import Packed, compute_chunk
with open(sys.argv[1], "rb") as file:
    packed = Packed.of(pickle.load(file))
chunk = compute_chunk(packed, np.array([[0.9], [1.1]]), np.linspace(0, 1, 5), 1e-10)
print(len(made), *chunk.response.ravel(), *chunk.scalars.values.ravel())
"""


@pytest.mark.slow
@pytest.mark.skipif(not native.host().triple.startswith("x86_64"), reason="these are x86 processors")
def test_models_travel_to_lesser_processors(tmp_path) -> None:
    """A model that is pickled here is computed there, to rounding; what is compiled again is compiled once."""
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Uniform(0.8, 1.2), units="m")
    rod = mechanism.body("rod", mass=1, inertia=length**2 / 12, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.output("x", rod.position[0], units="m")
    mechanism.output("lowest", uqmbd.minimum(rod.position[1]), units="m")
    study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 1, 5), [MonteCarlo(samples=4)])
    (tmp_path / "model").write_bytes(pickle.dumps(study.problem(study.propagators[0]).model))
    found = []
    for cpu in ([], ["x86-64"], ["x86-64"], ["x86-64-v3"]):
        command = [sys.executable, "-c", SENT, str(tmp_path / "model"), *cpu]
        about = {**os.environ, "UQMBD_CACHE": str(tmp_path / "cache")}
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, env=about)
        found.append([float(x) for x in done.stdout.split()])
    again = [int(one[0]) for one in found]
    assert again[0] == again[2] == 0 < again[1] == again[3]
    for one in found[1:]:
        np.testing.assert_allclose(one[1:], found[0][1:], atol=1e-9)


def test_processes_that_want_the_same_at_once_make_it_once(tmp_path) -> None:
    """Four workers of one machine that start at the same time."""
    code = """
import sys, time
from pathlib import Path
from uqmbd.compiled.store import Store
folder = Path(sys.argv[1])
store = Store(folder / "cache")
store.put("other", b"")
print("ready", flush=True)
sys.stdin.readline()
with store.alone("key"):
    if store.get("key") is None:
        with open(folder / "made", "a") as file:
            file.write("made\\n")
        time.sleep(0.3)
        store.put("key", b"content")
"""
    command = [sys.executable, "-c", code, str(tmp_path)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    workers = [subprocess.Popen(command, text=True, cwd=ROOT, **pipes) for _ in range(4)]
    for worker in workers:
        assert worker.stdout.readline() == "ready\n"
    for worker in workers:
        worker.communicate("go\n")
    assert (tmp_path / "made").read_text().split() == ["made"]
    assert not list((tmp_path / "cache").glob("*.lock"))
