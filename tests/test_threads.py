"""Linear algebra on one thread: nested, in several threads at once, for libraries that come later, at no cost."""

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy  # noqa: F401 - its library is one of those that are limited
import pytest
import scipy.linalg  # noqa: F401 - the same
import threadpoolctl

from uqmbd.threads import one_thread

pytestmark = pytest.mark.skipif(
    not threadpoolctl.threadpool_info(), reason="no library has threads that can be limited"
)


def numbers() -> set[int]:
    return {about["num_threads"] for about in threadpoolctl.threadpool_info()}


def shared() -> set[int]:
    """Numbers of the libraries that have one for all threads; those of OpenMP have one for each that calls them."""
    return {
        about["num_threads"]
        for about in threadpoolctl.threadpool_info()
        if about["internal_api"] not in ("openmp", "mkl") and about.get("threading_layer") != "openmp"
    }


def test_limits_nest_and_end() -> None:
    """Within limits there is one thread; after the outermost, also by an error, what was there before."""
    with threadpoolctl.threadpool_limits(2):
        assert numbers() == {2}
        try:
            with one_thread():
                with one_thread():
                    assert numbers() == {1}
                assert numbers() == {1}
                raise ArithmeticError
        except ArithmeticError:
            assert numbers() == {2}
        with one_thread():
            assert numbers() == {1}


def test_limits_of_threads_that_overlap() -> None:
    """The first thread to end takes no limit from the others: the last one gives back, whichever began."""
    with threadpoolctl.threadpool_limits(2):
        begun, ended = threading.Event(), threading.Event()

        def first() -> None:
            with one_thread():
                begun.set()
                ended.wait(10)

        with ThreadPoolExecutor(1) as executor:
            work = executor.submit(first)
            assert begun.wait(10)
            with one_thread():
                ended.set()
                work.result()
                assert shared() == {1}
            assert shared() == {2}
            begun.clear(), ended.clear()
            with one_thread():
                work = executor.submit(first)
                assert begun.wait(10)
            assert shared() == {1}
            ended.set()
            work.result()
            assert shared() == {2}


SCRIPT = """
import ctypes, pathlib, shutil, sys, threadpoolctl
from uqmbd.threads import one_thread

def numbers():
    return sorted(about["num_threads"] for about in threadpoolctl.threadpool_info() if about["user_api"] == "blas")

import numpy
with one_thread():
    (first,) = numbers()
import scipy.linalg
with threadpoolctl.threadpool_limits(2), one_thread():
    two = numbers()
whole = [about["filepath"] for about in threadpoolctl.threadpool_info() if about["user_api"] == "blas"][0]
copy = shutil.copy(whole, pathlib.Path(sys.argv[1]) / ("libopenblas-late" + "".join(pathlib.Path(whole).suffixes[-1:])))
modules = len(sys.modules)
ctypes.CDLL(copy)  # no module comes with it
assert len(sys.modules) == modules
with threadpoolctl.threadpool_limits(2), one_thread():
    three = numbers()
print(first, two, three)
"""


def test_libraries_that_come_later(tmp_path) -> None:
    """A library that is loaded after the first limit, by an import or without one, is limited by the next."""
    run = subprocess.run([sys.executable, "-c", SCRIPT, tmp_path], capture_output=True, text=True, check=True)
    assert run.stdout == "1 [1, 1] [1, 1, 1]\n"


def test_limits_look_at_the_libraries_once(monkeypatch) -> None:
    """A look at all libraries of the process takes longer than ten limits, so that it is made for new ones only."""
    with one_thread():
        pass
    looks = []
    controller = threadpoolctl.ThreadpoolController
    monkeypatch.setattr(threadpoolctl, "ThreadpoolController", lambda: looks.append(1) or controller())
    for _ in range(200):
        with one_thread():
            pass
    assert not looks
