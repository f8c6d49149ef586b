"""Disk cache of derived and compiled code."""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import platform
import time
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from uqmbd.compiled.native import host
from uqmbd.compiled.store import Store
from uqmbd.logs import kernels
from uqmbd.version import __version__

__all__ = ["cache_folder", "cached", "source_digest"]


def cache_folder() -> Path:
    """Return the folder of cached kernels: within ``UQMBD_CACHE`` if set (may be shared), or in the user's cache."""
    if stated := os.environ.get("UQMBD_CACHE"):
        return Path(stated) / (f"uqmbd-{os.geteuid()}" if hasattr(os, "geteuid") else "uqmbd")
    import platformdirs

    return platformdirs.user_cache_path("uqmbd") / "kernels"


def source_digest(folders: Iterable[Path]) -> bytes:
    """Return a digest of all files in the given folders, by name, except compiled copies."""
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                content = path.read_bytes()
                digest.update(repr((path.relative_to(folder).as_posix(), len(content))).encode())
                digest.update(content)
    return digest.digest()


_SOURCES = source_digest(Path(__file__).parents[1] / name for name in ("compiled", "dynamics", "mechanism"))
"""Digest of the modules that write equations, computed at import, because this process does not load later edits."""


@cache
def _dependencies() -> bytes:
    """Describe the dependencies of kernels other than expressions: sources, versions, and the processor."""
    import llvmlite
    import symengine
    import sympy
    from symengine.lib import symengine_wrapper

    # one version of SymEngine may have several builds
    library = Path(symengine_wrapper.__file__).stat()
    packages = (__version__, symengine.__version__, sympy.__version__, np.__version__, llvmlite.__version__)
    about = (packages, platform.python_version(), library.st_size, library.st_mtime_ns, host().digest)
    return repr(about).encode() + _SOURCES


def cached(key: object, make: Callable[[], Any]) -> Any:  # noqa: ANN401 - whatever `make` returns
    """Return the result of `make` from the cache on disk, or call `make` and store its result.

    The key is plain data; its ``repr`` is hashed together with the other dependencies of kernels. The result must be
    picklable. A damaged entry, or an entry of another user, is replaced. Without a writable folder, each process calls
    `make`. If several processes need the same entry at once, such as starting workers, only one of them calls `make`.
    """
    name = hashlib.sha256(repr(key).encode() + _dependencies()).hexdigest()
    store = Store(cache_folder())
    for waited in (False, True):
        with store.alone(name) if waited else contextlib.nullcontext():
            stored = store.get(name)
            if stored is not None:
                with contextlib.suppress(Exception):  # the entry is complete, but the installed packages cannot read it
                    value = pickle.loads(stored)  # noqa: S301 - checked by the store
                    kernels.debug("%s: taken from the cache %s", name[:12], store.folder)
                    return value
            if waited:
                begin = time.perf_counter()
                value = make()
                seconds = time.perf_counter() - begin
                kernels.info("%s: compiled in %.3g s, stored in %s", name[:12], seconds, store.folder)
                store.put(name, pickle.dumps(value))
    return value
