"""What loggers say in worker processes reaches those who listen to this one: all of it, once, in the order of work."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.propagation.execution.in_order import run_in_order
from uqmbd.propagation.execution.transport import log_records
from uqmbd.propagation.execution.workers import pool
from uqmbd.testing.propagators.moments import difference
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce

from ...mechanisms import oscillator

mine = logging.getLogger("uqmbd.mine")


class Unmovable:
    """What no pickle takes."""

    def __init__(self) -> None:
        self.lock = threading.Lock()

    def __str__(self) -> str:
        return "a thing"


def speak(piece: int) -> int:
    """Say something at all levels, with what does not travel."""
    mine.debug("debug %d", piece)
    mine.info("piece %d of %s", piece, Unmovable(), extra={"thing": Unmovable(), "number": piece})
    if piece == 3:
        try:
            raise ValueError("odd")
        except ValueError:
            mine.exception("three")
    return piece


def fail(piece: int) -> int:
    mine.info("begins %d", piece)
    raise RuntimeError(f"no {piece}")


@contextmanager
def others() -> Iterator[Executor]:
    """An executor of the standard library, whose workers say nothing of what they have."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        yield executor


@contextmanager
def threads() -> Iterator[Executor]:
    with ThreadPoolExecutor(2) as executor:
        yield executor


def work(executor: Executor | None, function: Callable[[int], int], count: int) -> list[int]:
    def keep(piece: int, result: int, seconds: float) -> int:
        return result

    return list(run_in_order(range(count), executor, lambda piece: None, lambda piece: (function, (piece,)), keep))


@pytest.mark.thorough
@pytest.mark.parametrize("made", [lambda: pool(2), others, threads], ids=["ours", "others", "threads"])
def test_all_that_is_reported_is_heard_once_in_the_order_of_the_pieces(
    made: Any, caplog: pytest.LogCaptureFixture
) -> None:
    with made() as executor, caplog.at_level("INFO", logger="uqmbd"):
        assert work(executor, speak, 12) == list(range(12))
    heard = [record for record in caplog.records if record.name == "uqmbd.mine"]
    lines = [(record.levelname, record.getMessage().partition("\n")[0]) for record in heard]
    expected = [("INFO", f"piece {k} of a thing") for k in range(12)]
    expected.insert(4, ("ERROR", "three"))
    assert sorted(lines) == sorted(expected)
    if made is not threads:  # threads of this process say it at once
        assert lines == expected
        assert "ValueError: odd" in heard[4].getMessage() and {record.process for record in heard} - {
            log_records.os.getpid()
        }
    assert [record.number for record in heard if hasattr(record, "number")] == [k for k in range(12)] or made is threads


@pytest.mark.thorough
def test_what_was_said_before_an_error_is_heard(caplog: pytest.LogCaptureFixture) -> None:
    with pool(2) as executor, caplog.at_level("INFO", logger="uqmbd"), pytest.raises(RuntimeError, match="no 0"):
        work(executor, fail, 1)
    assert [record.getMessage() for record in caplog.records if record.name == "uqmbd.mine"] == ["begins 0"]


def stranger() -> log_records.Listener:
    return log_records.Listener("elsewhere", 1, (("uqmbd", logging.INFO), ("uqmbd.mine", logging.DEBUG)))


def test_threads_of_a_worker_hear_their_own_and_leave_loggers_as_they_were(caplog: pytest.LogCaptureFixture) -> None:
    """As those of a Dask worker; its own handlers show nothing."""
    root = logging.getLogger("uqmbd")
    before = root.level, mine.level, root.propagate, list(root.handlers)
    barrier = threading.Barrier(4)

    def one(number: int) -> list[str]:
        with log_records.collect_records(stranger()) as found:
            barrier.wait()
            mine.debug("%d", number)
            logging.getLogger("uqmbd.methods").debug("not asked for")
            barrier.wait()
        return [record.getMessage() for record in found]

    with ThreadPoolExecutor(4) as executor:
        assert list(executor.map(one, range(4))) == [[str(k)] for k in range(4)]
    assert (root.level, mine.level, root.propagate, list(root.handlers)) == before
    assert not caplog.records


def test_a_level_that_changes_on_the_way_decides(caplog: pytest.LogCaptureFixture) -> None:
    with log_records.collect_records(stranger()) as found:
        mine.info("late")
    log_records.forward(found)
    assert not caplog.records
    with caplog.at_level("INFO", logger="uqmbd.mine"):
        log_records.forward(found)
    assert [record.getMessage() for record in caplog.records] == ["late"]


def test_where_nobody_listens_nothing_is_collected(monkeypatch: pytest.MonkeyPatch) -> None:
    """A handler that does nothing hears nothing; pytest's own are put aside."""
    monkeypatch.setattr(logging.getLogger(), "handlers", [logging.NullHandler()])
    assert log_records.listener() is None
    before = list(logging.getLogger("uqmbd").handlers)
    with log_records.collect_records(log_records.listener()) as found:
        assert logging.getLogger("uqmbd").handlers == before
        mine.warning("to nobody")
    assert found == []
    monkeypatch.setattr(mine, "handlers", [logging.StreamHandler()])
    assert log_records.listener() is not None


def push(time: float, measured: Any) -> Any:
    mine.info("at %.2f", time)
    return 0 * measured


def study() -> uqmbd.Study:
    """A mass whose controller says at what times it is asked."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N/m")
    mechanism = oscillator(stiffness)
    controller = uqmbd.Controller(measured=["x"], commanded=["f"], rate=5, function=push)
    mechanism.add(controller)
    body = mechanism.bodies["body"]
    mechanism.add(PointForce("push", body, (0, 0), (controller.command("f"), 0)))
    methods = [MonteCarlo(samples=200, seed=1)]
    return uqmbd.Study("oscillator", mechanism, np.linspace(0, 1, 6), methods)


@pytest.mark.slow
def test_a_run_says_the_same_whatever_the_number_of_workers(caplog: pytest.LogCaptureFixture) -> None:
    """And its results are those of a run that nobody listens to."""
    heard, trees = [], [study().run(workers=2)]
    for workers in (1, 2):
        caplog.clear()
        with caplog.at_level("INFO", logger="uqmbd.mine"):
            trees.append(study().run(workers=workers))
        heard.append([record.getMessage() for record in caplog.records if record.name == "uqmbd.mine"])
    assert heard[0] and heard[0] == heard[1]
    for tree in trees[1:]:
        assert not difference(tree["monte-carlo"], trees[0]["monte-carlo"])
