"""Sizes within a budget whose samples are more than are kept, in a folder: the store is what they go on with."""

from __future__ import annotations

import json
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.propagation.budget import Amount, BudgetTerms
from uqmbd.propagation.budget.sized import Sized
from uqmbd.propagation.studies.outcome import run_methods
from uqmbd.results import SampleStore
from uqmbd_montecarlo import MonteCarlo


def fall(samples: int = 500) -> uqmbd.Study:
    """A mass with a random velocity."""
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    mass = mechanism.body("mass", mass=1, velocity=(speed, 0))
    mechanism.output("x", mass.position[0], units="m")
    return uqmbd.Study("fall", mechanism, [0.0, 1.0], [MonteCarlo(samples=samples, seed=1, keep=50)])


class Two(Executor):
    """Two threads, whose realisations are counted; a clock that goes on by what these cost.

    A piece counts when it is finished, and those before it: the clock is the same whichever thread is the quicker.
    """

    def __init__(self, each: Callable[[int], float] = lambda rows: 0.0) -> None:
        self.rows, self.now, self.each = 0, 0.0, each
        self.pool, self.lock = ThreadPoolExecutor(2), threading.Lock()
        self.sent, self.counted, self.finished = 0, 0, dict[int, int]()

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **keywords: Any) -> Future[Any]:
        future, number = self.pool.submit(function, *arguments, **keywords), self.sent
        self.sent += 1
        future.add_done_callback(lambda done: self.count(number, done))
        return future

    def count(self, number: int, future: Future[Any]) -> None:
        answer = None if future.cancelled() or future.exception() else future.result()
        # what was read from the store is not computed
        computed = answer is not None and answer.kind == "done" and answer.result.computed
        with self.lock:
            self.finished[number] = len(answer.result.status) if computed else 0
            while self.counted in self.finished:
                rows = self.finished[self.counted]
                self.counted, self.rows = self.counted + 1, self.rows + rows
                self.now += rows * self.each(self.rows)

    def clock(self) -> float:
        return self.now


def within(folder: Path, executor: Two, *, resume: bool = False, **terms: Any) -> tuple[Any, dict[str, Any]]:
    """Return the node, and what is told of its size."""
    study = fall()
    with executor.pool, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        asked = BudgetTerms(clock=executor.clock, **terms)
        outcome = run_methods(study, study.propagators, executor, folder=folder, terms=asked, resume=resume)
    (node,) = outcome.nodes
    return node, json.loads(outcome.attrs["budget"])["methods"]["monte-carlo"]


def same_as_plain(node: Any, folder: Path, size: int) -> None:
    """A run of the number that was chosen, in a folder of its own, gives the same bits."""
    other = folder.with_name("plain")
    plain = fall(size).run(folder=other)["monte-carlo"]
    for name in ("statistics", "samples"):
        assert node[name].to_dataset().identical(plain[name].to_dataset()), name
    found, expected = (SampleStore.open(place / "monte-carlo-samples.zarr") for place in (folder, other))
    assert len(found) == len(expected) == size
    for mine, its in zip(found.chunks(), expected.chunks(), strict=True):
        assert np.array_equal(mine.response, its.response)


@pytest.mark.thorough
def test_a_larger_size_goes_on_with_the_store_of_the_smaller_one(tmp_path: Path) -> None:
    """No realisation is computed twice: the budget holds 64 and 1436 more, not 64 and 1436 anew."""
    executor = Two()
    node, about = within(tmp_path / "run", executor, budget=Amount(realisations=1500))
    assert [stage["size"] for stage in about["stages"]] == [64, 1500]
    assert executor.rows == about["spent"] == about["size"] == 1500
    same_as_plain(node, tmp_path / "run", 1500)


@pytest.mark.thorough
def test_a_longer_run_is_gone_on_with_though_the_pilot_is_shorter(tmp_path: Path) -> None:
    """What an earlier run has stored of the same samples is not computed again, but for its last chunk, of 48."""
    folder, executor = tmp_path / "run", Two()
    fall(1200).run(folder=folder)
    with executor.pool:
        tree = fall().run(executor, budget=10_000, accuracy=0.0555, folder=folder, resume=True)
    size = json.loads(tree["monte-carlo"].attrs["options"])["samples"]
    assert 1248 <= size < 2048  # of chunks of 64, too
    assert executor.rows == size - 1200 // 64 * 64
    same_as_plain(tree["monte-carlo"], folder, size)


def test_a_size_that_ends_early_is_one_of_whole_chunks() -> None:
    """The last chunk, of 14, may be finished while others are not."""
    method, study = MonteCarlo(seed=1), fall()
    sizing = method.sizing(study, None)
    assert sizing is not None
    one = Sized(method, sizing, study, None)
    one.chunk = lambda count: 64
    assert [one.finished(782, done) for done in (782, 718, 704, 142, 64)] == [782, 704, 704, 128, None]


@pytest.mark.thorough
def test_a_time_that_is_over_leaves_a_whole_store_of_what_two_workers_have_finished(tmp_path: Path) -> None:
    """Realisations become a thousand times as dear when 640 are there: a few chunks are still on their way then."""
    executor = Two(lambda rows: 0.01 if rows <= 640 else 10.0)
    node, about = within(tmp_path / "run", executor, budget=Amount(seconds=15.0))
    # all that is counted is whole at 704, and half of the 14.36 s that the pilot leaves are asked for, at 0.01 s each
    assert 704 <= about["size"] <= executor.rows <= 64 + 718
    assert node.attrs["realisations"] == about["size"]
    same_as_plain(node, tmp_path / "run", about["size"])
