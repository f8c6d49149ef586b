"""LLVM: the processor that code is made for, object code from LLVM IR, and its place in memory.

What is loaded stays loaded: one engine per process holds it, under names that are digests of what they compute.
"""

from __future__ import annotations

import contextlib
import ctypes
import ctypes.util
import hashlib
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from uqmbd.compiled.writer import LANES
from uqmbd.errors import UqmbdError

__all__ = ["Target", "addresses_of", "host", "lacking", "object_code"]

LEVEL = 1
"""Optimisation of code generation: 2 and 3 make code of the same speed from straight lines, 0 half as fast a code."""

LEVEL_OF_LOOPS = 2
"""The same for bitcode, which a compiler has optimised before: LLVM's passes take twice the time, and bring nothing."""

LIBRARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh",
    "exp", "log", "erf", "erfc", "tgamma", "lgamma", "atan2", "pow",
    "floor", "ceil", "fma", "fmax", "fmin", "memcpy", "memset", "memmove", "bzero", "__chkstk",
)  # fmt: skip
"""Symbols that compiled code may call.

Kernels call the functions, the driver copies and fills, and processors without the instructions need the rest. macOS
has a symbol that fills with zeros, and Windows one that probes large stack frames."""

_LOCK = threading.RLock()


@dataclass(frozen=True)
class Target:
    """A processor for which code is generated."""

    triple: str  # architecture, system and format of object code
    cpu: str  # as LLVM names it
    features: str  # as LLVM names them

    @property
    def width(self) -> int:
        """Lanes that it computes at once."""
        features = set(self.features.split(","))
        if self.cpu.startswith("x86-64-v4") or "+avx512f" in features:
            return LANES
        return 4 if self.cpu.startswith("x86-64-v3") or "+avx" in features else 2

    @property
    def needs(self) -> str:
        """What a processor must be and have to run its code, in words."""
        enabled = sorted(x[1:] for x in self.features.split(",") if x.startswith("+"))
        return " ".join([self.triple.split("-")[0], *enabled])

    @property
    def digest(self) -> str:
        """Digest of all this, and of the version of LLVM."""
        import llvmlite.binding as llvm

        about = (self.triple, self.cpu, self.features, llvm.llvm_version_info, LEVEL, LEVEL_OF_LOOPS)
        return hashlib.sha256(repr(about).encode()).hexdigest()


@cache
def host() -> Target:
    """Return this machine's processor."""
    import llvmlite.binding as llvm

    features = ""
    with contextlib.suppress(RuntimeError):  # LLVM does not know the features of every processor
        features = llvm.get_host_cpu_features().flatten()
    return Target(llvm.get_process_triple(), llvm.get_host_cpu_name(), features)


@cache
def lacking(needs: str) -> str:
    """Return, in words, what this processor lacks of what code needs."""
    own = host().needs.split()
    return ", ".join(x for x in needs.split() if x not in own)


@cache
def _initialised() -> None:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


@cache
def _machine(target: Target, level: int) -> Any:
    import llvmlite.binding as llvm

    _initialised()
    kind = llvm.Target.from_triple(target.triple)
    return kind.create_target_machine(cpu=target.cpu, features=target.features, opt=level, jit=True)


def object_code(source: str | bytes, target: Target | None = None) -> bytes:
    """Compile LLVM IR (text, or bitcode) without further optimisation, for this processor by default.

    The IR contains no common subexpressions, or a compiler has already removed them.
    """
    import llvmlite.binding as llvm

    with _LOCK:
        if isinstance(source, str):
            machine, module = _machine(target or host(), LEVEL), llvm.parse_assembly(source)
        else:
            machine, module = _machine(target or host(), LEVEL_OF_LOOPS), llvm.parse_bitcode(source)
        module.triple = machine.triple  # on Windows MCJIT wants ELF, which llvmlite asks the machine for
        module.data_layout = str(machine.target_data)
        code: bytes = machine.emit_object(module)
        return code


@cache
def _engine() -> Any:
    """Return what holds the code of this process."""
    import llvmlite.binding as llvm

    try:
        llvm.check_jit_execution()
    except OSError:
        raise UqmbdError(
            "This system refuses memory that code may be written to and run from, and uqmbd compiles "
            "the equations of a mechanism while it runs. Expected a process that may do so: with systemd unset "
            "MemoryDenyWriteExecute, with SELinux allow execmem, on macOS sign the interpreter with the entitlement "
            "com.apple.security.cs.allow-jit; or run uqmbd in a container or on a machine that allows it."
        ) from None
    # an engine owns its machine
    machine = _machine.__wrapped__(host(), LEVEL)
    for name, place in _library().items():
        llvm.add_symbol(name, place)
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def _library() -> dict[str, int]:
    """Return the addresses of the functions of the C library that code may call."""
    # on Windows the probe of a large stack frame is in ntdll, and in the runtime only as a static library
    names = ["ucrtbase", "ntdll"] if sys.platform == "win32" else [None, ctypes.util.find_library("m")]
    found: dict[str, int] = {}
    for library in names:
        with contextlib.suppress(OSError):
            loaded = ctypes.CDLL(library)
            for name in LIBRARY:
                with contextlib.suppress(AttributeError):
                    found.setdefault(name, ctypes.cast(getattr(loaded, name), ctypes.c_void_p).value or 0)
    return found


_loaded: dict[str, int] = {}


def addresses_of(names: Sequence[str], code: bytes) -> list[int]:
    """Return the addresses of functions in object code for this processor, and load the code on first use.

    Different code must have different function names.
    """
    if names[0] not in _loaded:
        import llvmlite.binding as llvm

        with _LOCK:
            if names[0] not in _loaded:
                engine = _engine()
                engine.add_object_file(llvm.ObjectFileRef.from_data(code))
                engine.finalize_object()
                for name in reversed(names):  # the first one shows that all are there
                    _loaded[name] = engine.get_function_address(name)
    return [_loaded[name] for name in names]
