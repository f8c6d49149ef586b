"""What a worker that dies costs: at most the realisations that killed two of them; and who has computed what."""

from __future__ import annotations

import json
import math
import os
import signal
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.errors import IntegrationError
from uqmbd.propagation.execution import Packed, compute_chunk, pool, run_in_order
from uqmbd.propagation.execution.transport import Reply, machine_type
from uqmbd.results import STATUS_MEANINGS, load, save
from uqmbd.status import Status
from uqmbd_joints import Distance
from uqmbd_montecarlo import MonteCarlo

TIMES = np.linspace(0, 0.1, 3)


def swing(samples=256, **options):
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
    bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(0.2, 0))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=length))
    mechanism.output("x", bob.position[0], units="m")
    mechanism.output("longest", uqmbd.maximum(bob.position[0]), units="m")
    mechanism.require("short", bob.position[0] <= 1.0)
    return uqmbd.Study("swing", mechanism, TIMES, [MonteCarlo(samples=samples, seed=3, **options)])


class Elsewhere(Executor):
    """Computes here, as workers of a machine would; some pieces kill their worker."""

    def __init__(self, killers=(), machine=None):
        self.killers, self.machine, self.calls, self.deaths = killers, machine, 0, 0
        self.places = {}

    def submit(self, function, /, *arguments):
        future = Future()
        values = next(x for x in arguments if isinstance(x, np.ndarray))
        place = self.places.setdefault(values.tobytes(), len(self.places))
        if place in self.killers:
            self.deaths += 1
            future.set_exception(BrokenExecutor("killed"))
            return future
        said = function(*arguments)
        if self.machine:
            counters = {k: v for k, v in said.result.counters.items() if not k.startswith("on ")}
            counters[f"on {self.machine}"] = len(values)
            said = replace(said, result=replace(said.result, counters=counters))
        future.set_result(said)
        return future


def test_realisations_that_kill_their_workers_have_failed_with_a_status_of_their_own(tmp_path):
    """The others are to the bit what they are, over time, without a time and in requirements; inputs are kept."""
    whole = swing().run()["monte-carlo"]
    executor = Elsewhere(killers={1})
    with pytest.warns(UserWarning, match="64 of 256 realisations failed.*ended unexpectedly"):
        node = swing().run(executor, folder=tmp_path)["monte-carlo"]
    assert executor.deaths == 2, "tried once elsewhere, for all kinds of outputs together"
    assert STATUS_MEANINGS[int(Status.WORKER_DIED)] == "worker_died"
    for part in ("samples", "scalars/samples"):
        samples, reference = node[part].to_dataset(), whole[part].to_dataset()
        lost = samples["status"].values == Status.WORKER_DIED
        assert np.flatnonzero(lost).tolist() == list(range(64, 128))
        assert samples["inputs"].values.tobytes() == reference["inputs"].values.tobytes()
        assert np.isnan(samples["response"].values[lost]).all()
        assert samples["response"].values[~lost].tobytes() == reference["response"].values[~lost].tobytes()
        assert "ended unexpectedly" in str(samples["message"].values[64])
    assert int(node.attrs["failures"]) == 64


def test_a_resumed_run_tries_again_what_was_lost(tmp_path):
    study = swing()
    with pytest.warns(UserWarning, match="64 of 256"):
        study.run(Elsewhere(killers={1}), folder=tmp_path)
    again = Elsewhere()
    tree = study.run(again, folder=tmp_path, resume=True)
    repeated = tree["monte-carlo/statistics"]["integration_error"].attrs["realisations"]
    assert len(again.places) == 1 + math.ceil(repeated / 8), "tasks of eight are integrated again for the error"
    bits = [t["monte-carlo/samples"]["response"].values.tobytes() for t in (tree, study.run())]
    assert bits[0] == bits[1]


def test_too_many_deaths_are_an_error():
    with pytest.raises(IntegrationError, match=r"192 of 256 samples failed.*ended unexpectedly"):
        swing().run(Elsewhere(killers={0, 1, 2}))


def test_other_types_of_machines_are_recorded_and_reported(tmp_path):
    """Also by a run that goes on with what they have computed."""
    with pytest.warns(uqmbd.StudyWarning, match="last bits may differ"):
        tree = swing().run(Elsewhere(machine="riscv64 glibc-2.40"), folder=tmp_path)
    assert json.loads(tree["monte-carlo"].attrs["machines"]) == {"riscv64 glibc-2.40": 256}
    assert "riscv" not in tree["monte-carlo"].attrs["solver_counters"]
    with pytest.warns(uqmbd.StudyWarning, match="last bits may differ"):
        read = swing().run(folder=tmp_path, resume=True)
    assert json.loads(read["monte-carlo"].attrs["machines"]) == {"riscv64 glibc-2.40": 256}
    save(tree, tmp_path / "results.nc")
    assert "riscv64" in load(tmp_path / "results.nc")["monte-carlo"].attrs["machines"]
    assert "machines" not in swing().run()["monte-carlo"].attrs
    assert machine_type() not in str(swing().run()["monte-carlo"].attrs)


class Bytes(Executor):
    """Processes that start afresh; counts the bytes of packed objects that are sent to them."""

    def __init__(self, count):
        self.pool, self.sent = ProcessPoolExecutor(count, mp_context=get_context("spawn")), 0

    def submit(self, function, /, *arguments):
        self.sent += sum(len(x.data) for x in arguments if isinstance(x, Packed) and x.data is not None)
        return self.pool.submit(function, *arguments)


def size_of(packed, piece, pause=0.0):
    time.sleep(pause)
    return os.getpid(), len(packed.value()), piece


def through(executor, pieces, packed, function=size_of, **more):
    def nothing(piece):
        return None

    return list(
        run_in_order(range(pieces), executor, nothing, lambda k: (function, (packed, k)), lambda p, r, s: r, **more)
    )


@pytest.mark.thorough
def test_a_packed_object_travels_once_to_each_process():
    """A megabyte, two processes of a pool, 350 pieces: it is sent a few times, not with each piece.

    A process that has the object may take a task that was meant for one that lacks it: how often depends on the load of
    the machine. `test_one_object_at_a_time_is_sent_to_a_process_that_lacks_it` counts exactly.
    """
    packed = Packed.of(bytes(1_000_000))
    executor = Bytes(2)
    found = through(executor, 300, packed)
    processes = len({pid for pid, *_ in found})
    assert [one[1:] for one in found] == [(1_000_000, k) for k in range(300)]
    assert processes * 1_000_000 <= executor.sent <= 60 * 1_000_100
    before = executor.sent
    through(executor, 50, packed)
    assert executor.sent - before <= 10 * 1_000_100, "the next study sends it only to processes that lack it"
    executor.pool.shutdown()


def kills(packed, piece):
    if piece in packed.value():
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.002)
    return os.getpid(), piece


@pytest.mark.slow
def test_processes_of_our_own_lose_nothing_but_what_kills():
    """Two killers among 200 pieces: those beside them are not told dead, and each kills two processes."""
    killers, lost = {3, 77}, {}
    with pool(2) as workers:
        found = through(
            workers.processes, 200, Packed.of(killers), kills, lost=lambda piece, reason: lost.setdefault(piece)
        )
        # a stopped process is no reason to wait: another one does its piece, and it ends
        assert [one and one[1] for one in found] == [None if k in killers else k for k in range(200)]
        assert set(lost) == killers
        os.kill(found[-1][0], signal.SIGSTOP)
        again = through(workers.processes, 40, Packed.of(set()), kills, patience=0.3)
        assert [k for _, k in again] == list(range(40))


def test_answers_say_who_has_computed():
    problem = swing().problem(MonteCarlo(samples=8))
    said = []

    class Here(Elsewhere):
        def submit(self, function, /, *arguments):
            future = super().submit(function, *arguments)
            said.append(future.result())
            return future

    problem.using(executor=Here()).realise(np.full((64, 1), 1.0))
    (answer,) = said
    assert isinstance(answer, Reply)
    assert answer.worker.process == os.getpid() and answer.worker.machine == machine_type()
    names = [name for name, _ in answer.worker.versions]
    assert names[:3] == ["uqmbd", "Python", "numpy"]
    assert answer.seconds > 0
    assert compute_chunk(Packed.of(problem.model), np.ones((1, 1)), TIMES, 1e-6).counters[f"on {machine_type()}"] == 1
