"""Compute tasks in this process or by workers; return results in order, and store each as soon as it is finished.

The main process spends a fraction of a millisecond on each task, for any number of workers and of finished tasks.
"""

from __future__ import annotations

import contextlib
import queue
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future
from dataclasses import dataclass, field, fields, is_dataclass
from functools import partial
from itertools import islice
from logging import LogRecord
from typing import Any, Generic, TypeVar

import numpy as np

from uqmbd.errors import IntegrationError, StudyError
from uqmbd.propagation.execution.cost import Laps
from uqmbd.propagation.execution.transport import (
    Reply,
    Route,
    WorkerRegistry,
    death,
    forward,
    records_before,
    route_to,
    versions,
)

__all__ = ["run_in_order"]

Piece = TypeVar("Piece")
Result = TypeVar("Result")

HELD = 1 << 27
"""Size of the results that wait for an earlier result, bytes; above this size, no further task is sent."""

WAITING = 16
"""Maximum number of results that wait for an earlier result, relative to the maximum number of submitted tasks."""

DEATHS = 2
"""A task counts as lost when this number of workers have died while they ran the task."""

LATE = 4.0
"""A task is late after `patience` plus this multiple of the typical task time.

An unoccupied worker then also computes the task.
"""

UNKNOWN = 10.0
"""A task is late after this multiple of `patience` if no worker has replied, so that the typical time is unknown."""

MISSES = 3
"""Maximum number of replies of workers that lack the packed objects of a task.

After this number, the task is not sent again before another task that carries the objects ends or is late.
"""

PAUSE = 0.002
"""Time between attempts to send a task while no worker accepts tasks, and minimum time between checks, s."""

TICK = 0.25
"""Maximum time between checks for late tasks, s."""


def run_in_order(
    pieces: Sequence[Piece],
    executor: Executor | None,
    known: Callable[[Piece], Result | None],
    work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
    keep: Callable[[Piece, Result, float], Result],
    lost: Callable[[Piece, str], Result] | None = None,
    patience: float = 1.0,
) -> Generator[Result, None, None]:
    """Yield the results of tasks in order; without an executor this process computes them.

    If a worker dies, another worker repeats its task once. If a task takes much longer than others (by at least
    `patience`, s), an unoccupied worker computes it, too. The first reply counts; both replies have the same bits.
    `known` returns a stored result, or None. `work` returns the function and its arguments (some may be `Packed`).
    `keep` converts a result and its time in s into the yielded value. If the second worker of a task dies, too, `lost`
    returns the result or raises an error (the default). Raise IntegrationError if no worker has the same versions of
    Python, uqmbd and libraries as this process, or if a task is lost.
    """
    if executor is None:
        return _compute_here(pieces, known, work, keep)
    return _Dispatcher(pieces, route_to(executor), known, work, keep, lost or _raise, patience).results()


def _compute_here(
    pieces: Sequence[Piece],
    known: Callable[[Piece], Result | None],
    work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
    keep: Callable[[Piece, Result, float], Result],
) -> Generator[Result, None, None]:
    laps = Laps()
    for piece in pieces:
        found = known(piece)
        if found is None:
            function, arguments = work(piece)
            found = keep(piece, function(*arguments), laps())
        yield found


def _raise(piece: object, reason: str) -> Any:
    raise IntegrationError(f"A task was lost: {reason}.")


@dataclass
class _Submission:
    """A submitted task."""

    futures: list[Future[Reply]] = field(default_factory=list)  # several if the task is late
    whole: bool = False  # whether packed arguments are sent entirely
    sent: float = 0.0  # time of the last submission, s
    begun: float | None = None  # first reply to a task sent later, s: a worker has begun this task before that time
    deaths: int = 0  # number of workers that died while they ran the task
    misses: int = 0  # number of replies of workers that lacked a packed object
    alone: bool = False  # whether no other task may run at the same time


class _Dispatcher(Generic[Piece, Result]):
    """Dispatcher that sends tasks to workers, and yields their results in order."""

    def __init__(
        self,
        pieces: Sequence[Piece],
        route: Route,
        known: Callable[[Piece], Result | None],
        work: Callable[[Piece], tuple[Callable[..., Result], tuple[Any, ...]]],
        keep: Callable[[Piece, Result, float], Result],
        lost: Callable[[Piece, str], Result],
        patience: float,
    ) -> None:
        self.pieces, self.route, self.patience = pieces, route, patience
        self.known, self.work, self.keep, self.lost = known, work, keep, lost
        self.registry, self.laps = WorkerRegistry(versions()), Laps()
        self.next = self.held = 0
        self.tick = min(TICK, patience / 4 + PAUSE)
        self.looked = self.heard = time.monotonic()
        self.submissions: dict[int, _Submission] = {}
        """Submissions by the index of the task, in the order in which they were sent."""
        self.refused: deque[int] = deque()
        self.lacking: deque[tuple[int, _Submission]] = deque()
        """Indices and next submissions of tasks whose workers lacked a packed object."""
        self.possible_killers: deque[tuple[int, int]] = deque()
        """Indices of tasks that may have killed a worker, each with the number of deaths."""
        self.ready: dict[int, tuple[Result, int]] = {}
        """Results, and their size in bytes, by the index of the task."""
        self.records: dict[int, tuple[LogRecord, ...]] = {}
        """Log records of workers for results that wait, by the index of the task."""
        self.arrived: queue.SimpleQueue[tuple[int, Future[Reply]]] = queue.SimpleQueue()

    def results(self) -> Generator[Result, None, None]:
        """Yield the results in order."""
        try:
            for due in range(len(self.pieces)):
                while due not in self.ready:
                    self._send_more(due)
                    if due not in self.ready:
                        self._take()
                result, size = self.ready.pop(due)
                self.held -= size
                forward(self.records.pop(due, ()))
                yield result
        finally:
            self._end()

    def _send_more(self, due: int) -> None:
        """Send further tasks, with only a few in reserve for every worker, to limit the memory of results."""
        if self.possible_killers and not self.submissions:
            # if the task of a dead worker is unknown, possible tasks run alone, so that another death identifies the
            # task
            index, deaths = self.possible_killers.popleft()
            self._send(index, _Submission(whole=True, deaths=deaths, alone=True))
        elif not self.possible_killers and not any(submission.alone for submission in self._first()):
            self._send_lacking()
            self._send_refused()
            if not self.refused and not self.lacking:
                self._send_new(due)
        if self.route.apart and (now := time.monotonic()) - self.looked >= self.tick:
            self.looked = now
            self._send_late(now)

    def _first(self) -> Iterator[_Submission]:
        """Yield the first submission, if it exists; a task that runs alone is the only submission."""
        return islice(self.submissions.values(), 1)

    def _send_lacking(self) -> None:
        """Send again tasks whose workers lacked a packed object; after `MISSES`, wait for a task that carries it."""
        free = not self._carried()
        for _ in range(len(self.lacking)):
            index, submission = self.lacking.popleft()
            if free:  # no task carries the object now, so try once more: a worker that has the object may be free
                submission.misses = min(submission.misses, MISSES - 1)
            carried = self._carried()
            submission.whole = self.registry.needs_objects(carried)
            if submission.whole or submission.misses < MISSES:
                self._send(index, submission)
            else:
                self.lacking.append((index, submission))

    def _carried(self) -> int:
        """Return the number of recent tasks that include packed objects; older ones may be at a stopped worker."""
        oldest = time.monotonic() - self.patience
        return sum(submission.whole and submission.sent >= oldest for submission in self.submissions.values())

    def _send_refused(self) -> None:
        """Send again as many refused tasks as the accepting workers can compute."""
        while self.refused and len(self.submissions) < self.registry.window - 1:
            self._send(self.refused.popleft(), _Submission(whole=self.registry.needs_objects(0)))
        if self.refused and not self.submissions:
            self.registry.raise_if_all_refuse()
            time.sleep(PAUSE)
            self._send(self.refused.popleft(), _Submission(whole=self.registry.needs_objects(0)))

    def _send_new(self, due: int) -> None:
        """Send the next tasks, unless too many are in progress or too many results wait for an earlier one."""
        window = self.registry.window
        while self.next < len(self.pieces) and len(self.submissions) < window:
            if self.next > due and (self.held >= HELD or len(self.ready) >= WAITING * window):
                return
            index, self.next = self.next, self.next + 1
            if (found := self.known(self.pieces[index])) is not None:
                self._add_result(index, found, due)
            else:
                self._send(index, _Submission())

    def _send(self, index: int, submission: _Submission) -> None:
        """Send a task, for the first time or again."""
        function, arguments = self.work(self.pieces[index])
        future = self.route.send(function, arguments, whole=submission.whole, late=submission.futures)
        submission.futures.append(future)
        submission.sent = time.monotonic()
        self.submissions.setdefault(index, submission)
        future.add_done_callback(partial(self._hear, index))

    def _hear(self, index: int, future: Future[Reply]) -> None:
        self.arrived.put((index, future))

    def _send_late(self, now: float) -> None:
        """Send late tasks also to unoccupied workers; send a task once more each time its delay doubles."""
        # a run of one task has no earlier reply: its worker may have stopped before its first reply
        known = self.registry.count > 0
        late = self.patience + LATE * self.registry.typical if known else UNKNOWN * self.patience
        behind, working = [], 0
        for index, submission in self.submissions.items():
            # workers do not report the start of a task: the last reply is the latest possible start
            begun = max(submission.sent, self.heard) if submission.begun is None else submission.begun
            if now - begun >= late * 2 ** (len(submission.futures) - 1):
                behind.append((index, submission))
            else:
                working += len(submission.futures)
        for index, submission in behind[: max(max(self.registry.count, 1) - working, 0)]:
            submission.whole = True
            self._send(index, submission)

    def _take(self) -> None:
        """Wait for a reply, at most for one tick, and process it."""
        try:
            index, future = self.arrived.get(timeout=self.tick)
        except queue.Empty:
            return
        submission = self.submissions.get(index)
        if submission is None or future not in submission.futures:
            return  # a second reply to the same task
        submission.futures.remove(future)
        error = CancelledError() if future.cancelled() else future.exception()
        if error is not None:
            self._failed(index, submission, error)
            return
        reply = future.result()
        if reply.kind == "done":
            self.heard = time.monotonic()  # only "done" is progress: other replies must not hide a stopped worker
            if reply.records:
                self.records[index] = reply.records
            self._note_begun(index)
            self.registry.done(reply.worker, reply.seconds)
            self._leave(index)
            self._add_result(index, self.keep(self.pieces[index], reply.result, self.laps()))
            return
        forward(reply.records)
        if submission.futures:
            return  # another worker computes the task
        if reply.kind == "missing":
            self.registry.missing(reply.worker)
            del self.submissions[index]
            again = _Submission(deaths=submission.deaths, misses=submission.misses + 1, alone=submission.alone)
            self.lacking.append((index, again))
        else:
            self.registry.refuse(reply.worker)
            self.route.refused(reply.worker)
            del self.submissions[index]
            if submission.deaths:
                self.possible_killers.appendleft((index, submission.deaths))
                self.registry.raise_if_all_refuse()
            else:
                self.refused.append(index)

    def _failed(self, index: int, submission: _Submission, error: BaseException) -> None:
        reason = death(error)
        if not reason:
            forward(records_before(error))
            raise error
        self.route.renew()
        self.registry.record_death()
        submission.deaths += 1
        self._leave(index)
        if submission.deaths >= DEATHS:
            reason = f"its worker process ended unexpectedly in two attempts ({reason})"
            self._add_result(index, self.lost(self.pieces[index], reason))
        elif self.route.identifies_lost_task:
            self._send(index, _Submission(whole=True, deaths=submission.deaths))
        else:
            self.possible_killers.append((index, submission.deaths))

    def _note_begun(self, index: int) -> None:
        """Record that tasks sent before this task are running."""
        for other, submission in self.submissions.items():
            if other == index:
                return
            if submission.begun is None:
                submission.begun = self.heard

    def _leave(self, index: int) -> None:
        for future in self.submissions.pop(index).futures:
            future.cancel()

    def _add_result(self, index: int, result: Result, due: int | None = None) -> None:
        size = 0 if index == due else size_of(result)
        self.ready[index] = result, size
        self.held += size

    def _end(self) -> None:
        """Cancel tasks in progress, and store finished tasks."""
        for index, submission in self.submissions.items():
            for future in submission.futures:
                if future.cancel() or not future.done() or future.cancelled() or future.exception() is not None:
                    continue
                reply = future.result()
                if reply.kind == "done":
                    with contextlib.suppress(StudyError):  # raise the error that ended the run instead
                        self.keep(self.pieces[index], reply.result, self.laps())
                    self.records[index] = reply.records
                    break
        for _, records in sorted(self.records.items()):
            forward(records)


def size_of(value: object) -> int:
    """Return the approximate size of a result, bytes: the size of its arrays, plus an allowance for each object.

    >>> size_of({"a": np.zeros(1000)}) // 1000
    8
    """
    if isinstance(value, np.ndarray):
        return 100 + value.nbytes
    if isinstance(value, (str, bytes)):
        return 50 + len(value)
    if isinstance(value, Mapping):
        return 200 + sum(map(size_of, value.values()))
    if isinstance(value, (tuple, list)):
        return 50 + sum(map(size_of, value))
    if is_dataclass(value):
        return 100 + sum(size_of(getattr(value, one.name)) for one in fields(value))
    return 30
