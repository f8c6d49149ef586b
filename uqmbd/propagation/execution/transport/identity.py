"""Identity of workers: versions that all processes must share, and properties that may change the last bits."""

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
"""Libraries that compute numbers or compile code: a different version may give different bits."""

EXTENSIONS = (
    *("avx", "avx2", "fma", "avx512f", "avx512dq", "avx512bw", "avx512vl", "avx512vnni"),
    *("neon", "sve", "sve2"),
)
"""Names, in LLVM, of the vector extensions that determine which code the libraries run."""

Versions = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Worker:
    """Identity of a worker."""

    host: str  # name of the machine
    process: int  # process number in the operating system; `thread` is the thread number
    thread: int
    versions: Versions  # names and versions of all software that must be the same in all processes
    machine: str  # type of the machine, which affects the last bits
    address: str = ""  # address on a Dask cluster; otherwise empty

    @property
    def key(self) -> tuple[str, int, int]:
        """Return a key that is unique to each worker."""
        return self.host, self.process, self.thread

    def differs(self, expected: Versions) -> str:
        """Describe the versions that differ from the expected versions; return an empty text if all agree."""
        required = dict(expected)
        return ", ".join(
            f"{name} {found} instead of {required.get(name, 'none')}"
            for name, found in self.versions
            if required.get(name) != found
        )


@cache
def versions() -> Versions:
    """Return all versions that affect pickles or bits; they must be the same in all processes."""
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
    """Return a digest of the modules of uqmbd: a user may have edited a copy of the same version."""
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
    """Return the identity of this worker."""
    return Worker(*_process(os.getpid()), threading.get_ident(), versions(), machine_type(), _address())


def _address() -> str:
    dask: Any = sys.modules.get("distributed")
    if dask is None:
        return ""
    try:
        return str(dask.get_worker().address)
    except ValueError:  # this process is not a Dask worker
        return ""


@cache
def _process(process: int) -> tuple[str, int]:
    return socket.gethostname(), process
