"""Compile the sources of an FMU: by a C compiler of the machine, or by the compiler of the package ziglang."""

from __future__ import annotations

import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import uqmbd

__all__ = ["Compiler", "Platform", "check_compilers", "compile_library", "find_compiler", "host", "WINDOWS", "zig"]

FLAGS = ("-std=gnu11", "-O2", "-fvisibility=hidden", "-ffp-contract=off", "-Wall", "-Wextra", "-shared")
"""Flags of all compilers; without contraction of products and sums, results do not depend on the processor."""

NAMES = ("cc", "gcc", "clang")
"""Names of compilers that are searched; the environment variable ``CC`` comes first."""


@dataclass(frozen=True)
class Platform:
    """Platform of a binary: its folders in an FMU, the ending of its libraries, and its name for zig."""

    fmi2: str
    fmi3: str
    suffix: str
    target: str

    def folder(self, fmi: int) -> str:
        """Return the folder of the binary in an FMU."""
        return f"binaries/{self.fmi2 if fmi == 2 else self.fmi3}"


WINDOWS = Platform("win64", "x86_64-windows", ".dll", "x86_64-windows-gnu")
"""64-bit Windows, for which only zig compiles on other platforms."""

PLATFORMS = {
    ("Linux", "x86_64"): Platform("linux64", "x86_64-linux", ".so", "x86_64-linux-gnu.2.17"),
    ("Linux", "aarch64"): Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
    ("Darwin", "x86_64"): Platform("darwin64", "x86_64-darwin", ".dylib", "x86_64-macos"),
    ("Darwin", "arm64"): Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
    ("Windows", "AMD64"): WINDOWS,
}


@dataclass(frozen=True)
class Compiler:
    """C compiler with its name and the first words of its command."""

    name: str
    command: tuple[str, ...]

    @property
    def zig(self) -> bool:
        """Whether the compiler has the targets of zig."""
        return self.name == "zig"


def host() -> Platform | None:
    """Return the platform of this computer; None if FMUs have no binaries for it."""
    return PLATFORMS.get((platform.system(), platform.machine()))


def zig() -> Compiler | None:
    """Return the compiler of the package ziglang, or None if the package is not installed."""
    if importlib.util.find_spec("ziglang") is None:
        return None
    return Compiler("zig", (sys.executable, "-m", "ziglang", "cc"))


def find_compiler(name: str | None = None) -> Compiler | None:
    """Return the compiler with a name (a program, or ``zig``), or the first compiler that exists; None without any.

    Raise StudyError if the compiler of this name does not exist.
    """
    if name is not None:
        found = zig() if name == "zig" else _program(name)
        if found is None:
            hint = (
                "give the name or path of a C compiler, 'zig' (package ziglang), or 'none' for an FMU without binaries"
            )
            hint = "install the package ziglang" if name == "zig" else hint
            raise uqmbd.StudyError(f"The C compiler {name!r} was not found; {hint}.")
        return found
    given = os.environ.get("CC", "").strip()
    return next((c for n in (given, *NAMES) if n and (c := _program(n))), None) or zig()


def check_compilers(name: str | None, windows: bool) -> None:
    """Raise StudyError if the named compiler, or the compiler for Windows, does not exist."""
    if name not in (None, "none"):
        find_compiler(name)
    if windows and host() is not WINDOWS and zig() is None:
        raise uqmbd.StudyError("A binary for Windows needs the package ziglang: pip install ziglang.")


def _program(name: str) -> Compiler | None:
    path = shutil.which(name)
    return Compiler(Path(name).name, (path,)) if path else None


def compile_library(compiler: Compiler, folder: Path, sources: Sequence[str], to: Path, on: Platform) -> str:
    """Compile sources in a folder to a shared library; return the warnings of the compiler.

    Raise UqmbdError with the messages of the compiler if it fails.
    """
    words = [*compiler.command, *FLAGS]
    if compiler.zig:
        words += ["-target", on.target]
    if on is not WINDOWS:
        words.append("-fPIC")
    if on.suffix != ".dylib":
        words.append("-s")  # without tables of symbols, which are larger than the code
    words += [*sources, "-o", str(to.resolve())]
    if on is not WINDOWS:
        words.append("-lm")
    to.parent.mkdir(parents=True, exist_ok=True)
    run = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        shown = "\n".join(run.stderr.strip().splitlines()[:20])
        raise uqmbd.UqmbdError(f"The C compiler {compiler.name} cannot compile the sources of the FMU:\n{shown}")
    return run.stderr.strip()
