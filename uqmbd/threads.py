"""Linear algebra on one thread.

:func:`threadpoolctl.threadpool_limits` reads the list of the libraries of the process each time, which takes 1 to 3 ms:
more than some chunks of realisations take. This module reads that list only after a library has been loaded. A limit
stays until the last of its threads has ended.
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
    """What one thread has to give back, and how many limits it is within."""

    def __init__(self) -> None:
        """Begin in a thread."""
        self.depth = 0
        self.before: dict[str, int] = {}


class _ProcessLibraries:
    """Libraries with threads of their own, and what the last thread has to give back."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.thread = _Thread()
        self.libraries: tuple[Any, ...] = ()
        self.loads = -1
        self.inside = 0
        self.before: dict[str, int] = {}

    def enter(self) -> None:
        """Limit all libraries that are loaded now."""
        with self.lock:
            loads = _loads()()
            if loads != self.loads:
                from threadpoolctl import ThreadpoolController

                self.libraries, self.loads = tuple(ThreadpoolController().lib_controllers), loads
            self.inside += self.thread.depth == 0
            self.thread.depth += 1
            for library in self.libraries:
                before = self.thread.before if _per_thread(library) else self.before
                threads = library.get_num_threads()
                before.setdefault(library.filepath, threads)
                if threads != 1:
                    _set(library, 1)

    def leave(self) -> None:
        """Give back what is this thread's, and what is everybody's if it is the last one."""
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
    """Keep linear algebra to one thread, so that its bits do not depend on the number of processors.

    It may stand inside another, and in several threads at once; libraries that were loaded since the last time are
    limited, too.
    """
    _PROCESS.enter()
    try:
        yield
    finally:
        _PROCESS.leave()


def _per_thread(library: Any) -> bool:
    """Return whether a library has a number of threads for each thread that calls it, as OpenMP has, or one for all."""
    return library.internal_api in ("openmp", "mkl") or getattr(library, "threading_layer", "") == "openmp"


def _set(library: Any, threads: int) -> None:
    """Set a number of threads, whichever thread has set the last one (threadpoolctl 3.8 lets only that one do it)."""
    release = getattr(library, "clear_controlling_thread", None)
    if release is not None:
        release(force=True)
    library.set_num_threads(threads)
    if release is not None:
        release(force=True)


class _Object(ctypes.Structure):
    """A library as the loader of Linux describes it: ``dl_phdr_info``."""

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
    """Return a function that gives another number whenever a library has been loaded: of loads, or else of modules."""
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
