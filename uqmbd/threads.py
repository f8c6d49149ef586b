"""Limit of the thread pools of linear algebra libraries (BLAS, OpenMP) to one thread.

:func:`threadpoolctl.threadpool_limits` reads the list of loaded libraries at each call, which takes 1 to 3 ms, longer
than the computation of some chunks of realisations. This module reads the list again only if libraries have been loaded
since the last reading. On systems other than Linux, a changed number of imported modules counts as a change of the
loaded libraries.

Some libraries have one number of threads for the whole process. This number is restored when the last thread leaves its
context. Other libraries have one number for each calling thread, which is restored when this thread leaves its context.
"""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

__all__ = ["one_thread"]


class _Thread(threading.local):
    """Settings that one thread must restore, and its number of nested contexts."""

    def __init__(self) -> None:
        """Initialise the settings of a thread."""
        self.depth = 0
        self.before: dict[str, int] = {}


class _ProcessLibraries:
    """Libraries with thread pools, and the settings that the last thread restores."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.thread = _Thread()
        self.libraries: tuple[Any, ...] = ()
        self.loads = -1
        self.inside = 0
        self.before: dict[str, int] = {}

    def enter(self) -> None:
        """Limit all libraries that are now loaded to one thread."""
        with self.lock:
            loads = _loads()()
            if loads != self.loads:
                from threadpoolctl import ThreadpoolController

                self.libraries, self.loads = tuple(ThreadpoolController().lib_controllers), loads
            self.inside += self.thread.depth == 0
            self.thread.depth += 1
            for library in self.libraries:
                # OpenMP has a separate number of threads for each calling thread, other libraries have one number
                openmp = getattr(library, "threading_layer", "") == "openmp"
                own = openmp or library.internal_api in ("openmp", "mkl")
                before = self.thread.before if own else self.before
                threads = library.get_num_threads()
                before.setdefault(library.filepath, threads)
                if threads != 1:
                    _set(library, 1)

    def leave(self) -> None:
        """Restore the settings of this thread; the last thread also restores the settings of the process."""
        with self.lock:
            self.thread.depth -= 1
            if self.thread.depth:
                return
            self.inside -= 1
            before = self.thread.before if self.inside else self.before | self.thread.before
            for library in self.libraries:
                threads = before.get(library.filepath, 1)
                if threads != 1:
                    _set(library, threads)
            self.thread.before.clear()
            if not self.inside:
                self.before.clear()


_PROCESS = _ProcessLibraries()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread, so that results are bitwise independent of the number of processors.

    Contexts can be nested, and several threads can use them at the same time.  A context limits only libraries that
    were loaded before it began.
    """
    _PROCESS.enter()
    try:
        yield
    finally:
        _PROCESS.leave()


def _set(library: Any, threads: int) -> None:
    """Set the number of threads from any thread; threadpoolctl 3.8 rejects threads other than the last that set it."""
    release = getattr(library, "clear_controlling_thread", None)
    if release is not None:
        release(force=True)
    library.set_num_threads(threads)
    if release is not None:
        release(force=True)


class _Object(ctypes.Structure):
    """Description ``dl_phdr_info`` of a library by the loader of Linux."""

    _fields_ = (
        ("address", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("headers", ctypes.c_void_p),
        ("count", ctypes.c_uint16),
        ("adds", ctypes.c_ulonglong),
        ("removals", ctypes.c_ulonglong),
    )


@cache
def _loads() -> Callable[[], int]:
    """Return a function that counts loads of libraries, or imported modules on systems other than Linux."""
    if not sys.platform.startswith("linux"):
        return lambda: len(sys.modules)
    found = [0]

    def first(about: Any, size: int, data: Any) -> int:
        found[0] = about.contents.adds
        return 1

    call = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(_Object), ctypes.c_size_t, ctypes.c_void_p)(first)
    walk = ctypes.CDLL(None).dl_iterate_phdr

    def loads() -> int:
        walk(call, None)
        return found[0]

    return loads
