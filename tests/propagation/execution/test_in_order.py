"""Pieces of work at workers that are slow, die, lack what they need, or are of another version: simulated, thousands of cases."""

from __future__ import annotations

import heapq
import random
import threading
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.errors import IntegrationError
from uqmbd.propagation.execution import Packed, run_in_order
from uqmbd.propagation.execution.transport import Reply, WorkerRegistry, versions
from uqmbd.propagation.execution.transport.identity import this_worker

MODEL = Packed.of({"factor": 0.1})
ME = this_worker()


class Simulated(Executor):
    """Workers that take simulated time, in a thread of their own: in the order of a virtual clock, as fast as it goes.

    Parameters
    ----------
    workers : int
        How many.
    seed : int
        Of delays and deaths.
    killers : set of int
        Pieces that kill whoever does them.
    deaths : float
        Probability that a worker dies for no reason.
    collateral : int
        Other pieces that are told dead with the one that the worker did.
    strangers : int
        Workers of another version.
    stuck : int
        Workers that never answer, from the first answer of another one on: before it nobody can tell who is slow.
    uneven : float
        Largest delay over the smallest.
    """

    def __init__(self, workers, seed, killers=(), deaths=0.0, collateral=0, strangers=0, stuck=0, uneven=100.0):
        self.random, self.killers, self.deaths, self.collateral = random.Random(seed), set(killers), deaths, collateral
        self.uneven, self.names, self.sent = uneven, count(1), 0
        self.waiting: list[tuple] = []
        self.free = []
        for k in range(workers + strangers + stuck):
            kind = "good" if k < workers else "stranger" if k < workers + strangers else "stuck"
            self.free.append((next(self.names), kind, set()))
        self.later = [one for one in self.free if one[1] == "stuck"]
        self.free = [one for one in self.free if one[1] != "stuck"]
        self.busy: list[tuple] = []
        self.now, self.order = 0.0, count()
        self.died: list[int] = []
        self.told: list[int] = []
        self.most = 0
        self.stuck_at = []
        self.changed, self.ended = threading.Condition(), False
        self.thread = threading.Thread(target=self._work, daemon=True)
        self.thread.start()

    def submit(self, function, /, *arguments):
        future = Future()
        self.sent += any(isinstance(x, Packed) and x.data is not None for x in arguments)
        with self.changed:
            self.waiting.append((future, function, arguments))
            self.most = max(self.most, len(self.waiting) + len(self.busy))
            self.changed.notify()
        return future

    def shutdown(self, wait=True, *, cancel_futures=False):
        with self.changed:
            self.ended = True
            self.changed.notify()
        self.thread.join()

    def _work(self):
        while True:
            with self.changed:
                self.changed.wait_for(lambda: self.waiting or self.busy or self.ended)
                if self.ended:
                    return
                while self.waiting and self.free:
                    worker = self.free.pop(self.random.randrange(len(self.free)))
                    call = self.waiting.pop(0)
                    if not call[0].set_running_or_notify_cancel():
                        self.free.append(worker)
                    elif worker[1] == "stuck":
                        self.stuck_at.append(call)
                    else:
                        delay = self.uneven ** self.random.random() if worker[1] == "good" else 0.0
                        heapq.heappush(self.busy, (self.now + delay, next(self.order), worker, call))
                if not self.busy:
                    if self.waiting and not self.free:
                        self.changed.wait(0.001)  # everybody is stuck, or somebody will give up
                    continue
                self.now, _, worker, (future, function, arguments) = heapq.heappop(self.busy)
                dead, told = self._outcome(worker, function, arguments)
                self.free.append((next(self.names), worker[1], set()) if dead else worker)
                also = []
                if dead:
                    self.died.append(arguments[-1])
                    self.random.shuffle(self.busy)
                    also = [self.busy.pop() for _ in range(min(self.collateral, len(self.busy)))]
                    self.free += [one[2] for one in also]
                    self.told += [arguments[-1], *(one[3][2][-1] for one in also)]
                    heapq.heapify(self.busy)
            if dead:
                future.set_exception(BrokenExecutor("it has died"))
                for *_, (other, _, _) in also:
                    other.set_exception(BrokenExecutor("somebody has died"))
            else:
                future.set_result(told)
                if told.kind == "done":
                    self.free, self.later = self.free + self.later, []

    def _outcome(self, worker, function, arguments):
        name, kind, has = worker
        wanted, work, packed, piece = arguments
        who = replace(ME, host="simulated", process=name)
        if kind == "stranger":
            return False, Reply(replace(who, versions=(("uqmbd", "0.0"),)), "refused")
        if packed.data is not None:
            has.add(packed.digest)
        if packed.digest not in has:
            return False, Reply(who, "missing")
        if piece in self.killers or self.random.random() < self.deaths:
            return True, None
        return False, replace(function(*arguments), worker=who)


def work_on(packed, piece):
    return np.sin(packed.value()["factor"] * piece)


class StoredResults:
    """Stores the results of pieces, and the reasons of lost ones."""

    def __init__(self, known=()):
        self.known, self.kept, self.lost = set(known), [], {}

    def run(self, executor, pieces, patience=0.01):
        def keep(piece, result, seconds):
            self.kept.append(piece)
            return result

        def lost(piece, reason):
            self.lost[piece] = reason
            return None

        def known(piece):
            return work_on(MODEL, piece) if piece in self.known else None

        return list(run_in_order(range(pieces), executor, known, lambda k: (work_on, (MODEL, k)), keep, lost, patience))


def expected(pieces, lost=()):
    return [None if k in lost else work_on(MODEL, k) for k in range(pieces)]


subsets = st.sets(st.integers(0, 59), max_size=4)


@pytest.mark.parametrize("examples", [60, pytest.param(3000, marks=pytest.mark.slow)])
def test_whoever_computes_and_whatever_happens_results_are_those_of_one_process(examples):
    """In order, to the bit, nothing lost but what kills twice, nothing kept twice."""

    @settings(max_examples=examples, deadline=None, database=None)
    @given(
        pieces=st.integers(0, 60),
        workers=st.integers(1, 100),
        seed=st.integers(0, 2**32),
        killers=subsets,
        known=subsets,
        collateral=st.integers(0, 3),
        strangers=st.integers(0, 3),
        stuck=st.sampled_from([0, 0, 0, 0, 1, 2]),
    )
    def check(pieces, workers, seed, killers, known, collateral, strangers, stuck):
        one = StoredResults(known)
        with Simulated(workers, seed, killers, 0.0, collateral, strangers, stuck) as executor:
            # a busy machine makes pieces late after 10 ms: only stuck workers need such a short patience
            found = one.run(executor, pieces, patience=0.01 if stuck else 3600.0)
        computed = {k for k in range(pieces)} - known
        lost = killers & computed
        assert found == expected(pieces, lost)
        assert set(one.lost) == lost
        assert sorted(one.kept) == sorted(computed - lost)
        assert lost <= set(executor.died)
        told = [executor.told.count(k) for k in lost]
        # next to stuck workers, further copies of a late piece may run: how many is a matter of the clock
        assert all(count >= 2 if stuck else count == 2 for count in told), "tried once elsewhere"

    check()


@settings(max_examples=60, deadline=None, database=None)
@given(workers=st.integers(1, 30), seed=st.integers(0, 2**32), deaths=st.floats(0, 0.3), collateral=st.integers(0, 2))
def test_workers_that_die_at_random_lose_only_what_they_did_twice(workers, seed, deaths, collateral):
    one = StoredResults()
    with Simulated(workers, seed, (), deaths, collateral) as executor:
        found = one.run(executor, 60)
    assert found == expected(60, one.lost)
    assert len(one.kept) + len(one.lost) == 60 and not set(one.kept) & set(one.lost)
    assert all(executor.died.count(k) >= 1 for k in one.lost), "nobody is lost who only was beside"
    if not collateral:
        assert all(executor.died.count(k) >= 2 for k in one.lost)


@pytest.mark.parametrize("workers", [1, 2, 8, 40])
def test_a_packed_object_does_not_travel_with_each_piece(workers):
    """Whoever has it may take what is meant for one who has not: some of 2000 go astray, how many is up to the machine."""
    with Simulated(workers, 1) as executor:
        assert StoredResults().run(executor, 2000) == expected(2000)
    assert workers <= executor.sent <= 1000


def test_as_many_pieces_are_under_way_as_there_are_workers():
    """More than a hundred workers have work, though nobody says how many there are."""
    with Simulated(150, 2) as executor:
        StoredResults().run(executor, 3000)
    # two for each are sent; a busy machine answers some of them before the next is sent
    assert 100 < executor.most <= 700


class FirstNeverFinishes(Executor):
    """Two workers: the one that receives the first `stuck` calls has stopped."""

    def __init__(self, stuck):
        self.calls, self.stuck = 0, stuck

    def submit(self, function, /, *arguments):
        self.calls += 1
        future = Future()
        if self.calls > self.stuck:
            future.set_result(function(*arguments))
        return future


class ObjectsStayWithTheStopped(FirstNeverFinishes):
    """Two workers: whatever carries a packed object goes to the one that has stopped, except late pieces."""

    def __init__(self):
        super().__init__(0)
        self.stopped = set()

    def submit(self, function, /, *arguments):
        self.calls += 1
        piece = arguments[-1]
        if any(isinstance(one, Packed) and one.data for one in arguments) and piece not in self.stopped:
            self.stopped.add(piece)
            return Future()
        future = Future()
        future.set_result(Reply(ME, "missing") if piece not in self.stopped else function(*arguments))
        return future


def test_a_model_that_went_to_a_stopped_worker_is_sent_again():
    executor = ObjectsStayWithTheStopped()
    assert StoredResults().run(executor, 5) == expected(5)
    assert executor.calls <= 5 * 6


class OtherTakesObjects(Executor):
    """Two workers: one lacks the packed object and replies at once, the other takes most tasks that include it."""

    def __init__(self, seed):
        self.drawn, self.whole, self.taken, self.lacks = random.Random(seed), 0, 0, True

    def submit(self, function, /, *arguments):
        future = Future()
        if whole := any(isinstance(one, Packed) and one.data for one in arguments):
            self.whole += 1
        other = self.drawn.random() < (0.9 if whole else 0.05)
        self.taken += whole and other
        self.lacks = self.lacks and not (whole and not other)
        worker = ME if other else replace(ME, process=ME.process + 1)
        missing = self.lacks and not other
        future.set_result(Reply(worker, "missing") if missing else replace(function(*arguments), worker=worker))
        return future


@pytest.mark.parametrize("seed", range(20))
def test_one_object_at_a_time_is_sent_to_a_process_that_lacks_it(seed):
    executor = OtherTakesObjects(seed)
    assert StoredResults().run(executor, 300, patience=60.0) == expected(300)
    assert executor.whole == executor.taken + (not executor.lacks)


@pytest.mark.parametrize("stuck", [1, 2])
@pytest.mark.parametrize("pieces", [1, 2])
def test_pieces_are_repeated_elsewhere_before_any_worker_has_replied(pieces, stuck):
    executor = FirstNeverFinishes(stuck)
    assert StoredResults().run(executor, pieces) == expected(pieces)
    assert executor.calls <= pieces + stuck + 1


def test_nobody_accepts():
    with Simulated(0, 3, strangers=3) as executor, pytest.raises(IntegrationError) as caught:
        StoredResults().run(executor, 100)
    for name in (1, 2, 3):
        assert f"simulated (process {name})" in str(caught.value)
    assert "uqmbd 0.0 instead of" in str(caught.value)


@pytest.mark.thorough
def test_a_million_realisations_on_a_hundred_workers_cost_the_coordinator_little():
    """Nothing that the coordinator holds grows with what is finished: its memory is that of what is under way."""
    pieces = 1_000_000 // 64
    consumed, waiting = 0, 0
    with Simulated(100, 4, {500, 9000}, uneven=20.0) as executor:
        results = run_in_order(
            range(pieces),
            executor,
            lambda piece: None,
            lambda piece: (work_on, (MODEL, piece)),
            lambda piece, result, seconds: result,
            lambda piece, reason: None,
        )
        for k, result in enumerate(results):
            assert result == (None if k in (500, 9000) else work_on(MODEL, k))
            consumed += 1
            if k % 100 == 0:
                state = results.gi_frame.f_locals["self"]
                sizes = [len(x) for x in vars(state).values() if hasattr(x, "__len__") and not isinstance(x, range)]
                sizes += [len(x) for x in vars(state.registry).values() if hasattr(x, "__len__")]
                waiting = max(waiting, *sizes)
    assert consumed == pieces
    assert waiting <= 16 * 400


class Half(Executor):
    """Two threads of which one stops at the first piece until the other has done all that it can."""

    def __init__(self, until):
        self.threads, self.until, self.first = ThreadPoolExecutor(2), until, True
        self.done = []

    def submit(self, function, /, *arguments):
        first, self.first = self.first, False
        return self.threads.submit(self._slowly if first else self._call, function, *arguments)

    def _slowly(self, function, *arguments):
        assert self.until.wait(30)
        return function(*arguments)

    def _call(self, function, *arguments):
        found = function(*arguments)
        self.done.append(arguments[-1])
        if arguments[-1] == 0:
            self.until.set()
        return found


@pytest.mark.thorough
def test_a_slow_worker_does_not_stall():
    """The first piece is done by somebody else, after all others: nobody waits for the slow one while there is work."""
    executor = Half(threading.Event())
    assert StoredResults().run(executor, 300, patience=0.2) == expected(300)
    assert executor.done[-1] == 0 and sorted(executor.done) == list(range(300))
    executor.threads.shutdown()


def test_results_that_wait_are_bounded_in_bytes():
    """While the first piece is under way no more than 128 MB of others are made, and those under way."""
    gate = threading.Event()

    class Gated(ThreadPoolExecutor):
        made = 0

    def large(piece):
        if piece == 0:
            gate.wait(30)
        else:
            executor.made += 1
            if executor.made >= 220:
                gate.set()
        return np.empty(1 << 17)  # a megabyte, of which no page is touched

    executor = Gated(2)
    threading.Timer(1.0, gate.set).start()
    results = run_in_order(
        range(600), executor, lambda piece: None, lambda piece: (large, (piece,)), lambda piece, result, seconds: result
    )
    next(results)
    assert 64 <= executor.made < 220
    assert sum(1 for _ in results) == 599
    executor.shutdown()


def test_workers_that_leave_are_forgotten():
    """An adaptive cluster has had a thousand workers, of which three are left."""
    registry = WorkerRegistry(versions())
    for k in range(1000):
        registry.done(replace(ME, process=k), 0.1)
    assert registry.count > 100
    for k in range(100_000):
        registry.done(replace(ME, process=k % 3), 0.1)
    assert registry.count == 3
