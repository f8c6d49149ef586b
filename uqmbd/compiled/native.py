"""LLVM: target processor, object code from LLVM IR, and addresses of loaded code.

Code remains loaded in one engine per process, and the name of a function is the digest of its text.
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
"""Optimisation level of straight-line code: levels 2 and 3 give the same speed, level 0 half the speed."""

LEVEL_OF_LOOPS = 2
"""Optimisation level of bitcode that a compiler has already optimised: passes of LLVM double the time without gain."""

LIBRARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh",
    "exp", "log", "erf", "erfc", "tgamma", "lgamma", "atan2", "pow",
    "floor", "ceil", "fma", "fmax", "fmin", "memcpy", "memset", "memmove", "bzero", "__chkstk",
)  # fmt: skip
"""Symbols that compiled code may call.

Kernels call mathematical functions. The driver calls functions that copy and fill memory. Processors without some
instructions need the other symbols. macOS has a function that fills with zeros, and Windows one that probes large stack
frames."""

_LOCK = threading.RLock()


@dataclass(frozen=True)
class Target:
    """Target processor of generated code."""

    triple: str  # architecture, system and format of object code
    cpu: str  # name of the processor in LLVM
    features: str  # names of the features in LLVM

    @property
    def width(self) -> int:
        """Return the number of SIMD lanes."""
        features = set(self.features.split(","))
        if self.cpu.startswith("x86-64-v4") or "+avx512f" in features:
            return LANES
        return 4 if self.cpu.startswith("x86-64-v3") or "+avx" in features else 2

    @property
    def needs(self) -> str:
        """Describe the required processor and its features."""
        enabled = sorted(x[1:] for x in self.features.split(",") if x.startswith("+"))
        return " ".join([self.triple.split("-")[0], *enabled])

    @property
    def digest(self) -> str:
        """Return a digest of the target and of the version of LLVM."""
        import llvmlite.binding as llvm

        about = (self.triple, self.cpu, self.features, llvm.llvm_version_info, LEVEL, LEVEL_OF_LOOPS)
        return hashlib.sha256(repr(about).encode()).hexdigest()


@cache
def host() -> Target:
    """Return the processor of this machine."""
    import llvmlite.binding as llvm

    features = ""
    with contextlib.suppress(RuntimeError):  # LLVM cannot list the features of every processor
        features = llvm.get_host_cpu_features().flatten()
    return Target(llvm.get_process_triple(), llvm.get_host_cpu_name(), features)


@cache
def lacking(needs: str) -> str:
    """Describe the required features that this processor lacks."""
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
        module.triple = machine.triple  # MCJIT on Windows requires ELF, which llvmlite requests from the machine
        module.data_layout = str(machine.target_data)
        code: bytes = machine.emit_object(module)
        return code


@cache
def _engine() -> Any:
    """Return the execution engine that contains the code of this process."""
    import llvmlite.binding as llvm

    try:
        llvm.check_jit_execution()
    except OSError:
        raise UqmbdError(
            "This system refuses memory that is both writable and executable. uqmbd needs it, because it compiles the "
            "equations of a mechanism at run time. With systemd, unset MemoryDenyWriteExecute. With SELinux, allow "
            "execmem. On macOS, sign the interpreter with the entitlement com.apple.security.cs.allow-jit. Or run "
            "uqmbd in a container or on a machine that allows such memory."
        ) from None
    # an engine owns its machine
    machine = _machine.__wrapped__(host(), LEVEL)
    for name, place in _library().items():
        llvm.add_symbol(name, place)
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def _library() -> dict[str, int]:
    """Return the addresses of the C library functions that code may call."""
    # on Windows, the probe of large stack frames is in ntdll; the runtime contains it only as a static library
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
    """Return the addresses of functions in object code for this processor; load the code at first use.

    Different code must have different function names.
    """
    if names[0] not in _loaded:
        import llvmlite.binding as llvm

        with _LOCK:
            if names[0] not in _loaded:
                engine = _engine()
                engine.add_object_file(llvm.ObjectFileRef.from_data(code))
                engine.finalize_object()
                for name in reversed(names):  # the first address is set last, and shows that all are set
                    _loaded[name] = engine.get_function_address(name)
    return [_loaded[name] for name in names]
