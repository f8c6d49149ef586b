"""Who computes: what has to be the same everywhere, and what may change the last bits."""

from __future__ import annotations

import hashlib
import os
import platform
import socket
import sys
import threading
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from uqmbd.compiled import host
from uqmbd.version import __version__

__all__ = ["Worker", "machine_type", "this_worker", "versions"]

LIBRARIES = ("numpy", "scipy", "llvmlite", "scikit-sundae")
"""Which compute numbers, or compile what does: another version of one gives other bits."""

EXTENSIONS = (
    *("avx", "avx2", "fma", "avx512f", "avx512dq", "avx512bw", "avx512vl", "avx512vnni"),
    *("neon", "sve", "sve2"),
)
"""Vector extensions by which libraries choose what they run, as LLVM names them."""

Versions = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Worker:
    """Identity of a worker."""

    host: str  # name of the machine
    process: int  # number, as `thread`, that the system assigned
    thread: int
    versions: Versions  # names and versions of all software that must be the same everywhere
    machine: str  # type of the machine, on which last bits depend
    address: str = ""  # on a Dask cluster; else empty

    @property
    def key(self) -> tuple[str, int, int]:
        """Key that is unique to each worker."""
        return self.host, self.process, self.thread

    def differs(self, expected: Versions) -> str:
        """Say in words which versions are not those that are expected; empty if all are."""
        wanted = dict(expected)
        return ", ".join(
            f"{name} {found} instead of {wanted.get(name, 'none')}"
            for name, found in self.versions
            if wanted.get(name) != found
        )


@cache
def versions() -> Versions:
    """Return the versions of all that has to be the same everywhere: pickles, or bits, depend on it."""
    found = [
        ("uqmbd", f"{__version__} (sources {_sources()})"),
        ("Python", platform.python_version().rpartition(".")[0]),
    ]
    for name in LIBRARIES:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            found.append((name, "unknown"))
    return tuple(found)


def _sources() -> str:
    """Return a digest of the program's modules: copies of one version may have been edited."""
    folder, digest = Path(__file__).parents[3], hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:8]


@cache
def machine_type() -> str:
    """Return the type of this machine: architecture, vector extensions, and the mathematical library."""
    enabled = {name[1:] for name in host().features.split(",") if name.startswith("+")}
    extensions = [name for name in EXTENSIONS if name in enabled]
    library = "-".join(part for part in platform.libc_ver() if part) or platform.system().lower()
    return " ".join([platform.machine(), *extensions, library])


def this_worker() -> Worker:
    """Return who is here."""
    return Worker(*_process(os.getpid()), threading.get_ident(), versions(), machine_type(), _address())


def _address() -> str:
    dask: Any = sys.modules.get("distributed")
    if dask is None:
        return ""
    try:
        return str(dask.get_worker().address)
    except ValueError:  # this is none of its workers
        return ""


@cache
def _process(process: int) -> tuple[str, int]:
    return socket.gethostname(), process
