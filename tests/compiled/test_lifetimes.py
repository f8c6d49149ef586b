"""What several threads make at once: each keeps what it points to, also where it is made anew by another."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

LOCKLESS = """
import functools, time

class Lockless:
    '''`functools.cached_property` without a lock, as from Python 3.12 on; whoever comes first stores last.'''

    def __init__(self, function):
        self.function, self.name, self.__doc__ = function, None, function.__doc__

    def __set_name__(self, owner, name):
        self.name = name

    def __get__(self, instance, owner=None):
        if instance is None:
            return self
        if self.name not in vars(instance):
            value = self.function(instance)
            time.sleep(0.02)
            vars(instance)[self.name] = value
        return vars(instance)[self.name]

functools.cached_property = Lockless
"""
RUN = """
import gc, threading
import numpy as np
import symengine
from uqmbd.compiled import Dynamics, ExplicitOptions, IntegrationState, Program, ProgramWriter, compile_kernel

THREADS, END = 4, 2.0
q, v, t, zero, p = symengine.symbols("q v t zero p")
kernel, writer = compile_kernel([q, v, t, zero, p], [-p * q]), ProgramWriter(5)
(force,) = writer.call(kernel, np.arange(5)[None]).ravel()
part, rate = writer.part(), np.array([1, force])
program = Program(part, 5, writer.size, np.array([force]))
dynamics = Dynamics(1, 1, 2, 1, part, rate, None, writer.size, 2)
method = ExplicitOptions(1e-9, 1e-3, 4.0, 6.1, 15, 3, 20_000, guarded=False)
random = np.random.default_rng(0)
p, z, times = random.uniform(1, 50, 40), random.normal(size=(40, 2)), np.linspace(0, END, 9)
w, barrier, found, bound = np.sqrt(p)[:, None], threading.Barrier(THREADS), {}, {}
arguments = random.normal(size=(40, 5))

def work(k):
    barrier.wait()
    run = IntegrationState(dynamics, method, z, p[:, None], times, [((END, np.inf, False),)], np.full(40, 1e-9))
    run._problem, run._pool
    out = np.empty((40, 1))
    call = program.bound(arguments, out=out)
    barrier.wait()
    gc.collect()
    run.advance()
    call()
    found[k], bound[k] = run.result[..., 0], out

threads = [threading.Thread(target=work, args=(k,)) for k in range(THREADS)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert len(found) == THREADS
for k in range(THREADS):
    exact = z[:, :1] * np.cos(w * times) + z[:, 1:] / w * np.sin(w * times)
    np.testing.assert_allclose(found[k], exact, rtol=0, atol=1e-7)
    np.testing.assert_allclose(bound[k][:, 0], -arguments[:, 4] * arguments[:, 0], rtol=1e-14)
print("right")
"""


@pytest.mark.thorough
def test_a_process_whose_threads_begin_together() -> None:
    """Memory that is given back is overwritten, so that who still points to it gets wrong numbers, or crashes."""
    environment = os.environ | {"PYTHONMALLOC": "debug", "MALLOC_PERTURB_": "165"}
    command = [sys.executable, "-c", LOCKLESS + RUN]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == "right\n", done.stderr
